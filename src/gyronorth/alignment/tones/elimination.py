"""No tone, each tone and each two tones taken out of the products of columns, for several recordings as flat arrays.

The models of a recording (m = 1 + f + f (f - 1) / 2 for f frequencies) lie one after the other, and so do recordings
(M models of b recordings, with T = sum of f, plus b, tones: behind those of all recordings stands, for each, the one
that a model without it has, which is zero).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from gyronorth.arrays import Array, Index
from gyronorth.frozen import frozen


@lru_cache(maxsize=64)
def tones_of(count: int) -> tuple[Index, Index]:
    """Numbers of the first and of the second tone of each model of `count` frequencies (m,); -1 for none."""
    i, j = np.triu_indices(count, 1)
    return np.concatenate([[-1], np.arange(count), i]), np.concatenate([np.full(1 + count, -1), j])


@frozen
class Models:
    """Where the models of several recordings find their tones in flat arrays."""

    ends: list[int]  # (b + 1) the models of recording n are [ends[n], ends[n + 1])
    owner: Index  # (M,) recording of a model
    owner_of_tone: Index  # (T,)
    first: Index  # (M,) tones
    second: Index
    own: Index  # (3, sum of f) entries of the flat Gram matrix: cosine by cosine, by sine, sine by sine
    mixed: Index  # (4, M) of the first and the second tone: cosine by cosine, by sine, sine by cosine, by sine

    @classmethod
    def of(cls, counts: Sequence[int]) -> Models:
        """Of recordings with so many frequencies each."""
        total, recordings = sum(counts), np.arange(len(counts))
        zero = sum((2 * f) ** 2 for f in counts)  # the last entry of the flat Gram matrix
        ends, start, corner = [0], 0, 0
        first, second, own, mixed = (list[Index]() for _ in range(4))
        for n, f in enumerate(counts):
            i, j = tones_of(f)
            ends.append(ends[-1] + len(i))
            first.append(np.where(i < 0, total + n, start + i))
            second.append(np.where(j < 0, total + n, start + j))
            place, diagonal = 2 * f * i + j, (2 * f + 1) * np.arange(f)
            shifts = np.array([0, f, 2 * f * f, 2 * f * f + f])[:, None]
            own.append(corner + diagonal + shifts[[0, 1, 3]])
            mixed.append(np.where(j < 0, zero, corner + place + shifts))
            start, corner = start + f, corner + (2 * f) ** 2
        owner_of_tone = np.concatenate([np.repeat(recordings, counts), recordings])
        one, other = np.concatenate(first), np.concatenate(second)
        return cls(ends, owner_of_tone[one], owner_of_tone, one, other, np.hstack(own), np.hstack(mixed))

    def log_prior(self, kinds: Array, of_tones: Sequence[Array]) -> Array:
        """Log prior (s, M), from that of slow change and number of tones (s, b, 3), and of a tone at each frequency."""
        prior = np.concatenate([*of_tones, np.zeros(len(self.ends) - 1)])
        none = len(self.owner_of_tone) - (len(self.ends) - 1)
        number = (self.first < none).astype(np.int64) + (self.second < none)
        total = prior.take(self.first) + prior.take(self.second) + np.where(number == 2, np.log(2), 0.0)
        return kinds.reshape(len(kinds), -1).take(3 * self.owner + number, axis=1) + total


@frozen
class Tones:
    """Cosine and sine of each tone made orthonormal, and those of the second tone of a model to the first.

    A tone's by the Cholesky factor L of its 2 x 2 block of the Gram matrix G and the prior; what the first of two tones
    leaves of the second is 1 - m^T m with m = L_i^-1 G_ij L_j^-T.
    """

    models: Models
    factor: tuple[Array, Array, Array]  # (..., T) entries 00, 10, 11 of L
    mixed: tuple[Array, Array, Array, Array]  # (..., M) entries 00, 01, 10, 11 of m
    share: Array  # (..., M) of the second column of the second tone in its first
    sizes: tuple[Array, Array]  # (..., M) one over what is left of these two
    log_det: Array  # (..., M) log determinant of all columns of a model

    @classmethod
    def of(cls, models: Models, gram: Array) -> Tones:
        """Of the flat Gram matrices (..., g), in which the cosines stand before the sines."""
        cosines, crossed, sines = (gram.take(models.own[row, :], axis=-1) for row in range(3))
        shape, tones = (*gram.shape[:-1], len(models.owner_of_tone)), cosines.shape[-1]
        l0, l10, l1 = np.ones(shape), np.zeros(shape), np.ones(shape)
        l0[..., :tones] = np.sqrt(cosines + 1)
        l10[..., :tones] = crossed / l0[..., :tones]
        l1[..., :tones] = np.sqrt(sines + 1 - l10[..., :tones] ** 2)
        i0, i10, i1, j0, j10, j1 = (
            each.take(which, axis=-1) for which in (models.first, models.second) for each in (l0, l10, l1)
        )
        m00, m01, m10, m11 = (gram.take(models.mixed[row, :], axis=-1) for row in range(4))
        m00, m01 = m00 / i0, m01 / i0
        m10, m11 = (m10 - i10 * m00) / i1, (m11 - i10 * m01) / i1
        m00, m10 = m00 / j0, m10 / j0
        m01, m11 = (m01 - m00 * j10) / j1, (m11 - m10 * j10) / j1
        s00, s01, s11 = 1 - m00 * m00 - m10 * m10, m00 * m01 + m10 * m11, 1 - m01 * m01 - m11 * m11
        det = s00 * s11 - s01 * s01
        sizes = np.sqrt(s11 / det), 1 / np.sqrt(s11)
        log_det = 2 * np.log(i0 * i1 * j0 * j1) + np.log(det)
        return cls(models, (l0, l10, l1), (m00, m01, m10, m11), s01 / s11, sizes, log_det)

    def at(self, number: int) -> Tones:
        """Those of one of several matrices."""
        factor, mixed, sizes = (tuple(each[number] for each in some) for some in (self.factor, self.mixed, self.sizes))
        return Tones(self.models, factor, mixed, self.share[number], sizes, self.log_det[number])  # type: ignore[arg-type]

    def explained(self, products: Array) -> Explained:
        """What the tones explain of columns whose products with cosines and with sines (..., 2, sum of f) are given."""
        cosines, sines = products[..., 0, :], products[..., 1, :]
        (l0, l10, l1), (m00, m01, m10, m11) = self.factor, self.mixed
        first, second = self.models.first, self.models.second
        q0 = np.zeros((*cosines.shape[:-1], l0.shape[-1]))
        q1 = q0.copy()
        tones = slice(0, cosines.shape[-1])
        q0[..., tones] = cosines / l0[..., tones]
        q1[..., tones] = (sines - l10[..., tones] * q0[..., tones]) / l1[..., tones]
        q0_i, q1_i, k0, k1 = (q.take(which, axis=-1) for which in (first, second) for q in (q0, q1))
        k0 -= m00 * q0_i
        k0 -= m10 * q1_i
        k1 -= m01 * q0_i
        k1 -= m11 * q1_i
        k0 += self.share * k1
        k0 *= self.sizes[0]
        k1 *= self.sizes[1]
        return Explained(self.models, (q0, q1), (k0, k1))


@frozen
class Explained:
    """Products of columns with the orthonormal ones of the tones."""

    models: Models
    first: tuple[Array, Array]  # (..., T) of a tone alone
    second: tuple[Array, Array]  # (..., M) of the second of two

    def __getitem__(self, index: int | slice | tuple[int | slice, ...]) -> Explained:
        """Those of some columns."""
        return Explained(
            self.models,
            (self.first[0][index], self.first[1][index]),
            (self.second[0][index], self.second[1][index]),
        )

    def left_of(self, product: Array, other: Explained) -> Array:
        """What is left (..., M) of the product (..., b) of the columns with others."""
        alone = product.take(self.models.owner_of_tone, axis=-1)
        alone = alone - self.first[0] * other.first[0] - self.first[1] * other.first[1]
        left = alone.take(self.models.first, axis=-1)
        left -= self.second[0] * other.second[0]
        left -= self.second[1] * other.second[1]
        return left
