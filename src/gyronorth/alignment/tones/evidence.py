"""Closed-form evidence of every model of a few tones: the law of `bayes` on a chosen set of frequencies.

The law is that of `gyronorth.alignment.tones.search`: a constant, at most two tones, at most one settling
exponential, samples left out in bumps. Here the frequencies come from outside, few enough for
all time constants and all pairs to be worked in one array operation. Three things are added.
Settling, tones and bumps are not independent: they come in kinds of recording, `KINDS`. A unit
whose bias does not settle may tilt slowly, at the rate of an angle that settles. And in place of
both the bias may walk from switch-on, as a sensor's rate random walk does, by more than the
profile says: that is what is left when nothing else explains a slow change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from gyronorth.alignment.tones.search import FREQUENCIES, SETTLING_RATE, SPACING, TIME_CONSTANT_BINS, TONE_RATE
from gyronorth.alignment.tones.unexplained import STILL, BoundedMotion
from gyronorth.angles import DEG_PER_HOUR
from gyronorth.arrays import Array, Index, Mask
from gyronorth.sensor import TriadErrors
from gyronorth.sensor.law import NoiseLaw

#: Kinds of recording: prior probability, probability of a bump in it, whether its bias settles, and
#: probabilities of no, one and two tones.
KINDS = (
    (0.36, 0.6, True, (0.09, 0.42, 0.49)),  # the reference mix
    (0.47, 0.0, False, (1.0, 0.0, 0.0)),  # quiet
    (0.05, 0.0, True, (1.0, 0.0, 0.0)),  # warm-up alone
    (0.04, 0.0, False, (0.0, 0.3, 0.7)),  # sway alone
    (0.08, 1.0, False, (0.8, 0.1, 0.1)),  # bumps
)
#: Beyond this duration, s, a bias may also settle with time constants of up to so many durations, in bins that grow
#: by this factor, of equal weight. What is so slow shows as a slope, so that it costs a quiet recording nothing.
LONGEST, SLOWEST, WIDER = 300.0, 2.0, 4 / 3
#: Slow tilt where no bias settles: probability, angle, rad, and bins of its time constant, s, which is uniform over
#: them. Its two horizontal axes are taken as three of as much energy.
TILT, TILT_ANGLE, TILT_BINS = 0.15, np.radians(0.01) * np.sqrt(2 / 3), (30.0, 60.0, 110.0, 190.0, 300.0)
#: Walking bias: probability, rate at the end of the recording (one standard deviation), rad/s, and how many of its
#: Karhunen-Loeve modes are taken: its slow part, 97 % of its variance.
WALK, WALK_RATE, WALK_MODES = 0.02, 3 * DEG_PER_HOUR, 6

#: Samples by which the noise law is worked out.
BLOCK = 300
TILTS = len(TILT_BINS) - 1


def grid_frequencies(samples: int, rate_hz: float) -> Array:
    """Frequencies, Hz, on which tones are proposed, shape (f,): those of `bayes`, 1 / (8 durations) apart."""
    return np.arange(FREQUENCIES[0], min(FREQUENCIES[1], 0.4 * rate_hz), SPACING * rate_hz / samples)


def time_constant_bins(duration: float) -> Array:
    """Bins of a settling bias's time constant, s: those of `bayes`, and further ones where it does not reach."""
    edges = list(TIME_CONSTANT_BINS)
    while duration > LONGEST and edges[-1] < SLOWEST * duration:
        edges.append(edges[-1] * WIDER)
    return np.array(edges)


def _share(edges: Array) -> Array:
    """Prior of each bin of time constants: uniform over those of `bayes`, beyond them as one over the time constant."""
    last = TIME_CONSTANT_BINS[-1]
    weight = np.where(edges[1:] <= last, np.diff(edges), last * np.log(edges[1:] / edges[:-1]))
    return weight / weight.sum()


def network_axes(samples: int, rate_hz: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """What the network takes beside the rates: sample numbers from the middle, and cycles a sample of the grid."""
    index = np.arange(samples) - (samples - 1) / 2
    return index.astype(np.float32), (grid_frequencies(samples, rate_hz) / rate_hz).astype(np.float32)


@dataclass(frozen=True)
class ToneLaw:
    """What depends on the length of a recording and on the sensor only; columns whitened."""

    whiten: Array  # (n, n) or, for white noise alone, (n,)
    time: Array  # (n,) s
    frequency: Array  # (f,) Hz
    log_prior: Array  # (f,) of one tone in the cell around each frequency
    constant: Array  # (n,)
    settling: Array  # (n, k + modes) exponentials, then modes of a walk, in units of their prior deviation
    share: Array  # (k,) prior of each exponential: of the first if the bias settles, of the last `TILTS` if it tilts
    log_kinds: tuple[Array, Array]  # of a recording without bumps, and with them: `log_kinds`

    def whitened(self, columns: Array) -> Array:
        """Columns (n, m) in units of the noise, and without its correlation."""
        return self.whiten[:, None] * columns if self.whiten.ndim == 1 else self.whiten @ columns

    def coloured(self, columns: Array) -> Array:
        """The inverse of `whitened`."""
        if self.whiten.ndim == 1:
            return columns / self.whiten[:, None]
        return np.asarray(np.linalg.solve(self.whiten, columns), dtype=float)

    def tones(self, frequency: Array) -> Array:
        """Cosines, then sines, (n, 2 f), whitened, in units of their prior deviation."""
        phase = 2 * np.pi * self.time[:, None] * frequency
        return self.whitened(np.concatenate([np.cos(phase), np.sin(phase)], axis=1) * (TONE_RATE / np.sqrt(2)))


@lru_cache(maxsize=16)
def _whitener(blocks: int, rate_hz: float, errors: TriadErrors, motion: BoundedMotion) -> Array:
    """What whitens the first `blocks` times 300 samples: a matrix, or its diagonal for white noise alone.

    Of fewer samples it is the first rows and columns: what comes later does not change their covariance, so that a
    recording that grows by a sample costs no new factorisation.
    """
    edges = np.arange(BLOCK * blocks + 1)
    covariance = NoiseLaw(errors).mean_covariance(edges[:-1], edges[1:], rate_hz=rate_hz)
    if motion.angle > 0:
        covariance = covariance + motion.covariance(BLOCK * blocks, rate_hz)
    if np.count_nonzero(covariance) == BLOCK * blocks:
        return np.asarray(1 / np.sqrt(np.diag(covariance)), dtype=float)
    return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)), dtype=float)


@lru_cache(maxsize=16)
def law(samples: int, rate_hz: float, errors: TriadErrors, motion: BoundedMotion = STILL) -> ToneLaw:
    """The law for recordings of one length of one sensor, whose platform may move."""
    whiten = _whitener(-(-samples // BLOCK), rate_hz, errors, motion)
    whiten = whiten[:samples] if whiten.ndim == 1 else whiten[:samples, :samples]
    time = (np.arange(samples) + 0.5) / rate_hz
    frequency = grid_frequencies(samples, rate_hz)
    bins = time_constant_bins(samples / rate_hz)
    decay = np.exp(-time[:, None] / ((bins[1:] + bins[:-1]) / 2)) * SETTLING_RATE
    edges = np.array(TILT_BINS)
    slow_constant = np.sqrt(edges[1:] * edges[:-1])
    tilt = np.exp(-time[:, None] / slow_constant) * TILT_ANGLE / slow_constant
    # A random walk of unit variance at the end: sqrt(2) sin(pi (m - 1/2) t / T) / (pi (m - 1/2)), m = 1, 2, ...
    # (Karhunen-Loeve; Ghanem and Spanos, "Stochastic Finite Elements", 1991, sec. 2.3.3).
    wave = np.pi * (np.arange(WALK_MODES) + 0.5)
    walk = np.sqrt(2) * np.sin(wave * time[:, None] * rate_hz / samples) / wave * WALK_RATE
    slow = np.concatenate([np.ones((samples, 1)), decay, tilt, walk], axis=1)
    slow = whiten[:, None] * slow if whiten.ndim == 1 else whiten @ slow
    share = np.concatenate([_share(bins), np.diff(edges) / (edges[-1] - edges[0])])
    return ToneLaw(
        whiten=whiten,  # type: ignore[arg-type]
        time=time,  # type: ignore[arg-type]
        frequency=frequency,
        log_prior=np.log(1 / frequency / np.sum(1 / frequency)),
        constant=slow[:, 0],
        settling=slow[:, 1:],
        share=share,
        log_kinds=(log_kinds(share, bumped=False), log_kinds(share, bumped=True)),
    )


def log_kinds(share: Array, *, bumped: bool) -> Array:
    """Log prior (1 + k + 1, 3) of no slow change, each exponential and a walk, by the number of tones."""
    table = np.full((2, 3), 1e-9)
    for probability, bump, settles, tones in KINDS:
        table[int(settles)] += probability * (bump if bumped else 1 - bump) * np.array(tones)
    table /= table.sum()
    walk = WALK * table.sum(axis=0)
    tilts = TILT * share[-TILTS:, None] * table[:1]
    table = np.concatenate([(1 - TILT) * table[:1], share[:-TILTS, None] * table[1:], tilts]) * (1 - WALK)
    return np.log(np.concatenate([table, walk[None]]))


@dataclass(frozen=True)
class Evidence:
    """Every model: slow change s by no tone, each tone and each two tones (m = 1 + f + f (f - 1) / 2).

    Slow change is none, one of k exponentials, or a walk: s = 1 + k + 1.
    """

    log_weight: Array  # (s, m) prior, determinant and residual, without the constant's own
    information: Array  # (s, m) of the constant, (rad/s)^-2
    rate: Array  # (3, s, m) estimate of the constant, rad/s
    first: NDArray[np.int64]  # (m,) number of the first tone, -1 for none
    second: NDArray[np.int64]  # (m,) of the second

    @cached_property
    def posterior(self) -> Array:
        """Probability (s, m) of each model when nothing is known of the constant."""
        log_weight = self.log_weight - 1.5 * np.log(self.information)
        weight = np.exp(log_weight - log_weight.max())
        return weight / weight.sum()

    def shares(self, count: int) -> Array:
        """Expected number of tones at each of `count` frequencies."""
        weight = self.posterior.sum(axis=0)
        total = np.zeros(count + 1)
        for which in (self.first, self.second):
            total += np.bincount(which + 1, weight, minlength=count + 1)
        return total[1:]


@dataclass(frozen=True)
class Columns:
    """One recording's whitened columns, masked samples projected out."""

    frequency: Array  # (f,) Hz
    known: Array  # (n, 4 + k + modes) constant, three axes, what changes slowly
    tone: Array  # (n, 2 f)
    bumped: bool  # whether samples are masked


def columns(law: ToneLaw, whitened: Array, masked: Mask, frequency: Array) -> Columns:
    """Columns of one recording, whose whitened rates (n, 3) are given; a masked sample is one more unknown."""
    known = np.concatenate([law.constant[:, None], whitened, law.settling], axis=1)
    tone, bumped = law.tones(frequency), bool(masked.any())
    if bumped and law.whiten.ndim == 1:
        known, tone = known * ~masked[:, None], tone * ~masked[:, None]
    elif bumped:
        basis = np.linalg.qr(law.whiten[:, masked])[0]
        known, tone = known - basis @ (basis.T @ known), tone - basis @ (basis.T @ tone)
    return Columns(frequency, known, tone, bumped)


def evidence(law: ToneLaw, seen: Columns, log_prior: Array, *, scale: float = 1.0) -> Evidence:
    """All models over the frequencies of `seen`, each with its log prior; noise `scale` times the law's."""
    return evidences(law, [seen], [log_prior], [scale])[0]


def evidences(
    law: ToneLaw, seen: Sequence[Columns], log_prior: Sequence[Array], scale: Sequence[float]
) -> list[Evidence]:
    """The same of several recordings with as many frequencies each, worked as one array (b recordings).

    Unknowns are eliminated one after the other, slow change, tone, tone, by Schur complements.
    """
    f, k = len(log_prior[0]), len(law.share)
    pairs = list(zip(seen, scale, strict=True))
    inner = np.stack([one.known.T @ one.known / size**2 for one, size in pairs])
    gram = np.stack([one.tone.T @ one.tone / size**2 for one, size in pairs])
    cross = np.stack([one.tone.T @ one.known / size**2 for one, size in pairs])
    # Slow change is the last axis: no change, k exponentials, a walk. Its columns are made orthonormal.
    exponential, walk = slice(4, 4 + k), slice(4 + k, None)
    pivot = np.diagonal(inner, axis1=1, axis2=2)[:, exponential] + 1
    root = np.sqrt(pivot)[:, None]
    into, through = inner[:, :4, exponential] / root, cross[:, :, exponential] / root
    lower = np.linalg.cholesky(inner[:, walk, walk] + np.eye(WALK_MODES))
    inverse = np.linalg.inv(lower)
    # One by one: the matrix library sums in another order where they are stacked.
    into_walk = [one[:4, walk] @ each.T for one, each in zip(inner, inverse, strict=True)]
    through_walk = [one[:, walk] @ each.T for one, each in zip(cross, inverse, strict=True)]
    log_walk = 2 * np.sum(np.log(np.diagonal(lower, axis1=1, axis2=2)), axis=1)
    log_pivot = np.concatenate([np.zeros((len(seen), 1)), np.log(pivot), log_walk[:, None]], axis=1)
    walked = np.stack([whole - each @ each.T for whole, each in zip(gram, through_walk, strict=True)])

    def of_tones(rows: Index, columns: Index) -> Array:
        """Entries (b, m, s) of the matrix of the tones, whose slow change is eliminated."""
        whole = np.empty((len(seen), len(rows), k + 2))
        whole[..., 0], whole[..., -1] = gram[:, rows, columns], walked[:, rows, columns]
        np.multiply(through[:, rows], through[:, columns], out=whole[..., 1:-1])
        np.subtract(whole[..., :1], whole[..., 1:-1], out=whole[..., 1:-1])
        return whole

    still, crossed = inner[:, :4, :4, None], cross[:, :, :4].transpose(2, 0, 1)[..., None]
    walking = np.stack([one[:4, :4] - each @ each.T for one, each in zip(inner, into_walk, strict=True)])[..., None]
    constant = np.concatenate([still, still - into[:, :, None] * into[:, None], walking], axis=3)
    rest = _entries(constant[:, 0].transpose(1, 0, 2), np.trace(constant[:, 1:, 1:], axis1=1, axis2=2))  # (5, b, s)
    drawn = np.stack([
        one[:, :4].T - a @ b.T for one, a, b in zip(cross, into_walk, through_walk, strict=True)
    ]).transpose(1, 0, 2)  # fmt: skip
    settled = crossed - into.transpose(1, 0, 2)[:, :, None] * through
    p = np.concatenate([crossed, settled, drawn[..., None]], axis=3)  # (4, b, 2 f, s)
    # Cosine and sine of a frequency, orthonormalised by the Cholesky factor of their 2 x 2 block.
    own = np.arange(f)
    a, b, d = of_tones(own, own) + 1, of_tones(own, own + f), of_tones(own + f, own + f) + 1
    l0 = np.sqrt(a)
    l10 = b / l0
    l1 = np.sqrt(d - l10 * l10)
    q0 = p[:, :, :f] / l0
    q1 = (p[:, :, f:] - l10 * q0) / l1
    log_det_one = 2 * np.log(l0 * l1)
    single = rest[:, :, None] - _squares(q0) - _squares(q1)  # (5, b, f, s)
    # Off-diagonal blocks in the same orthonormal coordinates: m = L_i^-1 G_ij L_j^-T.
    i, j = _pairs(f)
    i0, i10, i1, j0, j10, j1 = (each.take(which, axis=1) for which in (i, j) for each in (l0, l10, l1))
    m00, m01 = of_tones(i, j) / i0, of_tones(i, f + j) / i0
    m10, m11 = (of_tones(f + i, j) - i10 * m00) / i1, (of_tones(f + i, f + j) - i10 * m01) / i1
    m00, m10 = m00 / j0, m10 / j0
    m01, m11 = (m01 - m00 * j10) / j1, (m11 - m10 * j10) / j1
    s00, s01, s11 = 1 - m00 * m00 - m10 * m10, -m00 * m01 - m10 * m11, 1 - m01 * m01 - m11 * m11
    det = s00 * s11 - s01 * s01
    q0_i, q1_i, k0, k1 = q0.take(i, axis=2), q1.take(i, axis=2), q0.take(j, axis=2), q1.take(j, axis=2)
    k0 -= m00 * q0_i + m10 * q1_i
    k1 -= m01 * q0_i + m11 * q1_i
    k0 -= s01 / s11 * k1
    k0 *= np.sqrt(s11 / det)
    k1 *= 1 / np.sqrt(s11)
    double = single.take(i, axis=2)
    double -= _squares(k0)
    double -= _squares(k1)

    total = np.concatenate([rest[:, :, None], single, double], axis=2)
    both = log_det_one.take(i, axis=1) + log_det_one.take(j, axis=1) + np.log(det)
    log_det = np.concatenate([np.zeros((len(seen), 1, k + 2)), log_det_one, both], axis=1)
    kinds, prior = np.stack([law.log_kinds[one.bumped].T for one in seen]), np.stack(log_prior)[..., None]
    of_two = np.log(2) + prior[:, i] + prior[:, j]
    log_weight = np.concatenate([kinds[:, :1], kinds[:, 1:2] + prior, kinds[:, 2:] + of_two], axis=1)
    information, product, square = total[0], total[1:4], total[4]
    rate = product / information
    left = square - np.einsum("c...,c...->...", product, rate)
    log_weight -= 1.5 * (log_pivot[:, None] + log_det) + 0.5 * left
    first = np.concatenate([[-1], own, i])
    second = np.concatenate([np.full(1 + f, -1), j])
    return [
        Evidence(log_weight[n].T, information[n].T, np.swapaxes(rate[:, n], 1, 2), first, second)
        for n in range(len(seen))
    ]


@lru_cache(maxsize=64)
def _pairs(count: int) -> tuple[Index, Index]:
    """Numbers of the first and of the second of every two of `count`."""
    first, second = np.triu_indices(count, 1)
    return first, second


def _entries(first: Array, squares: Array) -> Array:
    """What is needed of a symmetric 4 x 4 matrix (5, ...): its first row, and the sum of the others' own entries."""
    return np.concatenate([first, squares[None]])


def _squares(x: Array) -> Array:
    """The same of the product of `x` (4, ...) with itself."""
    return _entries(x[0] * x, np.einsum("c...,c...->...", x[1:], x[1:]))
