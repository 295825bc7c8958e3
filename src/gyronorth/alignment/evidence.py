"""Closed-form evidence of every model of a few tones: the law of `bayes` on a chosen set of frequencies.

The law is that of `gyronorth.alignment.bayes`: a constant, at most two tones, at most one settling
exponential, samples left out in bumps. Here the frequencies come from outside, few enough for
all time constants and all pairs to be worked in one array operation.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gyronorth.alignment.bayes import (
    FREQUENCIES,
    SETTLING,
    SETTLING_RATE,
    SPACING,
    TIME_CONSTANT_BINS,
    TONE_RATE,
    TONES,
)
from gyronorth.alignment.turned_law import mean_covariance
from gyronorth.sensor import TriadErrors

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: The entries of the symmetric 4 x 4 matrix of the constant and the three axes that are needed:
#: the information, three products with it, three squares.
_FIRST, _SECOND = np.array([0, 0, 0, 0, 1, 2, 3]), np.array([0, 1, 2, 3, 1, 2, 3])


def grid_frequencies(samples: int, rate_hz: float) -> Array:
    """Frequencies, Hz, on which tones are proposed, shape (f,): evenly spaced by 1 / (8 durations)."""
    return np.arange(FREQUENCIES[0], min(FREQUENCIES[1], 0.4 * rate_hz), SPACING * rate_hz / samples)


@dataclass(frozen=True)
class Law:
    """What depends on the length of a recording and on the sensor only; columns whitened."""

    whiten: Array  # (n, n) or, for white noise alone, (n,)
    time: Array  # (n,) s
    frequency: Array  # (f,) Hz
    log_prior: Array  # (f,) of one tone in the cell around each frequency
    constant: Array  # (n,)
    settling: Array  # (n, k) exponentials in units of their prior deviation
    log_settling: Array  # (1 + k,) log prior of no settling and of each exponential

    def whitened(self, columns: Array) -> Array:
        """Columns (n, m) in units of the noise, and without its correlation."""
        return self.whiten[:, None] * columns if self.whiten.ndim == 1 else self.whiten @ columns

    def tones(self, frequency: Array) -> Array:
        """Cosines, then sines, (n, 2 f), whitened, in units of their prior deviation."""
        phase = 2 * np.pi * self.time[:, None] * frequency
        return self.whitened(np.concatenate([np.cos(phase), np.sin(phase)], axis=1) * (TONE_RATE / np.sqrt(2)))


@lru_cache(maxsize=16)
def law(samples: int, rate_hz: float, errors: TriadErrors) -> Law:
    """The law for recordings of one length of one sensor."""
    edges = np.arange(samples + 1)
    covariance = mean_covariance(errors, edges[:-1], edges[1:], rate_hz=rate_hz)
    if np.count_nonzero(covariance) == samples:
        whiten = 1 / np.sqrt(np.diag(covariance))
    else:
        whiten = np.linalg.inv(np.linalg.cholesky(covariance))
    time = (edges[:-1] + 0.5) / rate_hz
    frequency = grid_frequencies(samples, rate_hz)
    bins = np.array(TIME_CONSTANT_BINS)
    decay = np.exp(-time[:, None] / ((bins[1:] + bins[:-1]) / 2)) * SETTLING_RATE
    share = np.diff(bins) / (bins[-1] - bins[0])
    made = Law(
        whiten=whiten,
        time=time,
        frequency=frequency,
        log_prior=np.log(1 / frequency / np.sum(1 / frequency)),
        constant=np.zeros(0),
        settling=np.zeros((0, 0)),
        log_settling=np.log(np.concatenate([[1 - SETTLING], SETTLING * share])),
    )
    constant, settling = made.whitened(np.ones((samples, 1)))[:, 0], made.whitened(decay)
    return Law(whiten, time, frequency, made.log_prior, constant, settling, made.log_settling)


@dataclass(frozen=True)
class Evidence:
    """Every model: settling (1 + k) by no tone, each tone and each two tones (m = 1 + f + f (f - 1) / 2)."""

    log_weight: Array  # (1 + k, m) prior, determinant and residual, without the constant's own
    information: Array  # (1 + k, m) of the constant, (rad/s)^-2
    rate: Array  # (3, 1 + k, m) estimate of the constant, rad/s
    first: NDArray[np.int64]  # (m,) number of the first tone, -1 for none
    second: NDArray[np.int64]  # (m,) of the second

    @property
    def posterior(self) -> Array:
        """Probability (1 + k, m) of each model when nothing is known of the constant."""
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
    known: Array  # (n, 4 + k) constant, three axes, exponentials
    tone: Array  # (n, 2 f)


def columns(law: Law, gyro_l: Array, masked: Mask, frequency: Array) -> Columns:
    """Columns of one recording (n, 3), rad/s; a masked sample is one more unknown."""
    known = np.concatenate([law.constant[:, None], law.whitened(gyro_l), law.settling], axis=1)
    tone = law.tones(frequency)
    if masked.any():
        if law.whiten.ndim == 1:
            return Columns(frequency, known * ~masked[:, None], tone * ~masked[:, None])
        basis = np.linalg.qr(law.whiten[:, masked])[0]
        known, tone = known - basis @ (basis.T @ known), tone - basis @ (basis.T @ tone)
    return Columns(frequency, known, tone)


def evidence(law: Law, seen: Columns, log_prior: Array, *, scale: float = 1.0) -> Evidence:
    """All models over the frequencies of `seen`, each with its log prior; noise `scale` times the law's.

    Unknowns are eliminated one after the other, exponential, tone, tone, by Schur complements.
    """
    f = len(log_prior)
    gram, cross = seen.tone.T @ seen.tone / scale**2, seen.tone.T @ seen.known / scale**2
    inner = seen.known.T @ seen.known / scale**2
    pivot = np.concatenate([[1.0], np.diag(inner)[4:] + 1])
    through = np.concatenate([np.zeros((1, 2 * f)), cross[:, 4:].T]) / np.sqrt(pivot)[:, None]  # (1 + k, 2 f)
    into = np.concatenate([np.zeros((1, 4)), inner[4:, :4]]) / np.sqrt(pivot)[:, None]  # (1 + k, 4)
    rest = inner[_FIRST, _SECOND] - into[:, _FIRST] * into[:, _SECOND]  # (1 + k, 7)
    # Cosine and sine of a frequency, orthonormalised by the Cholesky factor of their 2 x 2 block.
    v0, v1 = through[:, :f], through[:, f:]
    own = np.arange(f)
    a = gram[own, own] + 1 - v0 * v0
    b = gram[own, own + f] - v0 * v1
    d = gram[own + f, own + f] + 1 - v1 * v1
    l0 = np.sqrt(a)
    l10 = b / l0
    l1 = np.sqrt(d - l10 * l10)
    p = cross[:, :4].T - into[:, :, None] * through[:, None, :]  # (1 + k, 4, 2 f)
    q0 = p[:, :, :f] / l0[:, None]
    q1 = (p[:, :, f:] - l10[:, None] * q0) / l1[:, None]
    log_det_one = 2 * np.log(l0 * l1)
    single = rest[:, :, None] - q0[:, _FIRST] * q0[:, _SECOND] - q1[:, _FIRST] * q1[:, _SECOND]
    # Off-diagonal blocks in the same orthonormal coordinates: m = L_i^-1 G_ij L_j^-T.
    i, j = np.triu_indices(f, 1)
    g = [[gram[r * f + i, c * f + j] - through[:, r * f + i] * through[:, c * f + j] for c in (0, 1)] for r in (0, 1)]
    i0, i10, i1, j0, j10, j1 = l0[:, i], l10[:, i], l1[:, i], l0[:, j], l10[:, j], l1[:, j]
    t00, t01 = g[0][0] / i0, g[0][1] / i0
    t10, t11 = (g[1][0] - i10 * t00) / i1, (g[1][1] - i10 * t01) / i1
    m00, m10 = t00 / j0, t10 / j0
    m01, m11 = (t01 - m00 * j10) / j1, (t11 - m10 * j10) / j1
    s00, s01, s11 = 1 - m00 * m00 - m10 * m10, -m00 * m01 - m10 * m11, 1 - m01 * m01 - m11 * m11
    det = s00 * s11 - s01 * s01
    r0 = q0[:, :, j] - m00[:, None] * q0[:, :, i] - m10[:, None] * q1[:, :, i]
    r1 = q1[:, :, j] - m01[:, None] * q0[:, :, i] - m11[:, None] * q1[:, :, i]
    k0 = np.sqrt(s11 / det)[:, None] * (r0 - (s01 / s11)[:, None] * r1)
    k1 = r1 / np.sqrt(s11)[:, None]
    double = single[:, :, i] - k0[:, _FIRST] * k0[:, _SECOND] - k1[:, _FIRST] * k1[:, _SECOND]

    total = np.concatenate([rest[:, :, None], single, double], axis=2)
    log_det = np.concatenate([0 * pivot[:, None], log_det_one, log_det_one[:, i] + log_det_one[:, j] + np.log(det)], 1)
    prior = np.concatenate(
        [[np.log(TONES[0])], np.log(TONES[1]) + log_prior, np.log(2 * TONES[2]) + log_prior[i] + log_prior[j]]
    )
    information, product = total[:, 0], np.moveaxis(total[:, 1:4], 1, 0)
    residual = total[:, 4:].sum(axis=1) - (product**2).sum(axis=0) / information
    log_weight = law.log_settling[:, None] + prior - 1.5 * (np.log(pivot)[:, None] + log_det) - 0.5 * residual
    first = np.concatenate([[-1], own, i])
    second = np.concatenate([np.full(1 + f, -1), j])
    return Evidence(log_weight, information, product / information, first, second)
