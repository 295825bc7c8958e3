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

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gyronorth.alignment.tones.search import FREQUENCIES, SETTLING_RATE, SPACING, TIME_CONSTANT_BINS, TONE_RATE
from gyronorth.alignment.tones.unexplained import STILL, Motion
from gyronorth.angles import DEG_PER_HOUR
from gyronorth.arrays import Array, Mask
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

#: The entries of the symmetric 4 x 4 matrix of the constant and the three axes that are needed:
#: the information, three products with it, three squares.
_FIRST, _SECOND = np.array([0, 0, 0, 0, 1, 2, 3]), np.array([0, 1, 2, 3, 1, 2, 3])


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
def _whitener(blocks: int, rate_hz: float, errors: TriadErrors, motion: Motion) -> Array:
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
def law(samples: int, rate_hz: float, errors: TriadErrors, motion: Motion = STILL) -> ToneLaw:
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
    return ToneLaw(
        whiten=whiten,  # type: ignore[arg-type]
        time=time,  # type: ignore[arg-type]
        frequency=frequency,
        log_prior=np.log(1 / frequency / np.sum(1 / frequency)),
        constant=slow[:, 0],
        settling=slow[:, 1:],
        share=np.concatenate([_share(bins), np.diff(edges) / (edges[-1] - edges[0])]),
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

    @property
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


def columns(law: ToneLaw, gyro_l: Array, masked: Mask, frequency: Array) -> Columns:
    """Columns of one recording (n, 3), rad/s; a masked sample is one more unknown."""
    known = np.concatenate([law.constant[:, None], law.whitened(gyro_l), law.settling], axis=1)
    tone, bumped = law.tones(frequency), bool(masked.any())
    if bumped and law.whiten.ndim == 1:
        known, tone = known * ~masked[:, None], tone * ~masked[:, None]
    elif bumped:
        basis = np.linalg.qr(law.whiten[:, masked])[0]
        known, tone = known - basis @ (basis.T @ known), tone - basis @ (basis.T @ tone)
    return Columns(frequency, known, tone, bumped)


def evidence(law: ToneLaw, seen: Columns, log_prior: Array, *, scale: float = 1.0) -> Evidence:
    """All models over the frequencies of `seen`, each with its log prior; noise `scale` times the law's.

    Unknowns are eliminated one after the other, slow change, tone, tone, by Schur complements.
    """
    f, slow = len(log_prior), slice(4, 4 + len(law.share))
    gram, cross = seen.tone.T @ seen.tone / scale**2, seen.tone.T @ seen.known / scale**2
    inner = seen.known.T @ seen.known / scale**2
    # Columns of the slow change, made orthonormal: through to the tones (s, 2 f, modes), into the rest (s, 4, modes).
    count = 2 + len(law.share)
    through, into = np.zeros((count, 2 * f, WALK_MODES)), np.zeros((count, 4, WALK_MODES))
    log_pivot = np.zeros((count, 1))
    pivot = np.diag(inner)[slow] + 1
    through[1:-1, :, 0] = (cross[:, slow] / np.sqrt(pivot)).T
    into[1:-1, :, 0] = inner[slow, :4] / np.sqrt(pivot)[:, None]
    log_pivot[1:-1, 0] = np.log(pivot)
    walk = slice(slow.stop, None)
    lower = np.linalg.cholesky(inner[walk, walk] + np.eye(WALK_MODES))
    inverse = np.linalg.inv(lower).T
    through[-1], into[-1] = cross[:, walk] @ inverse, inner[:4, walk] @ inverse
    log_pivot[-1] = 2 * np.sum(np.log(np.diag(lower)))
    gram = gram - through @ through.transpose(0, 2, 1)  # (s, 2 f, 2 f)
    rest = inner[_FIRST, _SECOND] - np.sum(into[:, _FIRST] * into[:, _SECOND], axis=2)  # (s, 7)
    p = cross[:, :4].T - into @ through.transpose(0, 2, 1)  # (s, 4, 2 f)
    # Cosine and sine of a frequency, orthonormalised by the Cholesky factor of their 2 x 2 block.
    own = np.arange(f)
    a, b, d = gram[:, own, own] + 1, gram[:, own, own + f], gram[:, own + f, own + f] + 1
    l0 = np.sqrt(a)
    l10 = b / l0
    l1 = np.sqrt(d - l10 * l10)
    q0 = p[:, :, :f] / l0[:, None]
    q1 = (p[:, :, f:] - l10[:, None] * q0) / l1[:, None]
    log_det_one = 2 * np.log(l0 * l1)
    single = rest[:, :, None] - q0[:, _FIRST] * q0[:, _SECOND] - q1[:, _FIRST] * q1[:, _SECOND]
    # Off-diagonal blocks in the same orthonormal coordinates: m = L_i^-1 G_ij L_j^-T.
    i, j = np.triu_indices(f, 1)
    g = [[gram[:, r * f + i, c * f + j] for c in (0, 1)] for r in (0, 1)]
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
    log_det = log_pivot + np.concatenate(
        [0 * log_pivot, log_det_one, log_det_one[:, i] + log_det_one[:, j] + np.log(det)], axis=1
    )
    kinds = log_kinds(law.share, bumped=seen.bumped)
    prior = np.concatenate(
        [kinds[:, :1], kinds[:, 1:2] + log_prior, kinds[:, 2:] + np.log(2) + log_prior[i] + log_prior[j]], axis=1
    )
    information, product = total[:, 0], np.moveaxis(total[:, 1:4], 1, 0)
    residual = total[:, 4:].sum(axis=1) - (product**2).sum(axis=0) / information
    log_weight = prior - 1.5 * log_det - 0.5 * residual
    first = np.concatenate([[-1], own, i])
    second = np.concatenate([np.full(1 + f, -1), j])
    return Evidence(log_weight, information, product / information, first, second)
