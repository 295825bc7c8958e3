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
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from gyronorth.alignment.tones.elimination import Models, Tones, tones_of
from gyronorth.alignment.tones.search import FREQUENCIES, SETTLING_RATE, SPACING, TIME_CONSTANT_BINS, TONE_RATE
from gyronorth.alignment.tones.unexplained import STILL, BoundedMotion
from gyronorth.angles import DEG_PER_HOUR
from gyronorth.arrays import Array, Mask
from gyronorth.frozen import frozen
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
#: Samples whose tones follow from one cosine and one sine.
STRIDE = 64
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


@frozen
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

    def log_det(self, masked: Mask) -> float:
        """Log determinant of `whitened`, masked samples (n,) left out."""
        if self.whiten.ndim == 1:
            return float(np.sum(np.log(self.whiten[~masked])))
        left = np.linalg.qr(self.whiten[:, masked], mode="r")
        return float(np.sum(np.log(np.diag(self.whiten))) - np.sum(np.log(np.abs(np.diag(left)))))

    def tones(self, frequency: Array) -> Array:
        """Cosines, then sines, (n, 2 f), whitened, in units of their prior deviation."""
        # By the sum formulas from every `STRIDE`th sample and those after it: few cosines are worked out.
        step = 2 * np.pi * (self.time[1] - self.time[0]) * frequency[:, None]
        far, near = step * (STRIDE * np.arange(-(-len(self.time) // STRIDE))), step * (np.arange(STRIDE) + 0.5)
        size = TONE_RATE / np.sqrt(2)
        cosine, sine = (size * part(near)[:, None] for part in (np.cos, np.sin))
        far_cosine, far_sine = (part(far)[..., None] for part in (np.cos, np.sin))
        tones = np.empty((2, *far.shape, STRIDE))
        np.multiply(far_cosine, cosine, out=tones[0])
        tones[0] -= far_sine * sine
        np.multiply(far_sine, cosine, out=tones[1])
        tones[1] += far_cosine * sine
        return self.whitened(tones.reshape(2 * len(frequency), far.shape[1] * STRIDE)[:, : len(self.time)].T)


@lru_cache(maxsize=16)
def _whitener(blocks: int, rate_hz: float, errors: TriadErrors, motion: BoundedMotion) -> Array:
    """What whitens the first `blocks` times 300 samples: a matrix, or its diagonal for white noise alone.

    Of fewer samples it is the first rows and columns: what comes later does not change their covariance, so that a
    recording that grows by a sample costs no new factorisation.
    """
    edges = np.arange(BLOCK * blocks + 1)
    if motion.angle == 0 and errors == TriadErrors(white=errors.white):
        variance = NoiseLaw(errors).mean_covariance(edges[:1], edges[1:2], rate_hz=rate_hz)[0, 0]
        return np.full(BLOCK * blocks, 1 / np.sqrt(variance))
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
    time, frequency, slow, share = _unwhitened(samples, rate_hz)
    slow = whiten[:, None] * slow if whiten.ndim == 1 else whiten @ slow
    return ToneLaw(
        whiten=whiten,  # type: ignore[arg-type]
        time=time,
        frequency=frequency,
        log_prior=np.log(1 / frequency / np.sum(1 / frequency)),
        constant=slow[:, 0],
        settling=slow[:, 1:],
        share=share,
        log_kinds=(log_kinds(share, bumped=False), log_kinds(share, bumped=True)),
    )


@lru_cache(maxsize=4)
def _unwhitened(samples: int, rate_hz: float) -> tuple[Array, Array, Array, Array]:
    """What does not depend on the noise: times, frequencies, slow columns and the share of each exponential."""
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
    share = np.concatenate([_share(bins), np.diff(edges) / (edges[-1] - edges[0])])
    return time, frequency, slow, share  # type: ignore[return-value]


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


@frozen
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
    def log_posterior(self) -> Array:
        """Logarithm (s, m) of the probability of each model when nothing is known of the constant, but for a number."""
        return self.log_weight - 1.5 * np.log(self.information)

    def beside(self, other: Evidence, log_odds: float) -> Evidence:
        """Its models and those of another law, whose log odds beforehand are given."""
        return Evidence(
            np.concatenate([self.log_weight, other.log_weight + log_odds], axis=1),
            np.concatenate([self.information, other.information], axis=1),
            np.concatenate([self.rate, other.rate], axis=2),
            np.concatenate([self.first, other.first]),
            np.concatenate([self.second, other.second]),
        )

    @property
    def posterior(self) -> Array:
        """This probability (s, m)."""
        weight = np.exp(self.log_posterior - self.log_posterior.max())
        return weight / weight.sum()

    def shares(self, count: int) -> Array:
        """Expected number of tones at each of `count` frequencies."""
        weight = self.posterior.sum(axis=0)
        total = np.zeros(count + 1)
        for which in (self.first, self.second):
            total += np.bincount(which + 1, weight, minlength=count + 1)
        return total[1:]


@frozen
class Columns:
    """One recording's whitened columns, masked samples projected out."""

    frequency: Array  # (f,) Hz
    every: Array  # (n, 2 f + 4 + k + modes) of tones, then `known`
    bumped: bool  # whether samples are masked

    @property
    def tone(self) -> Array:
        """Cosines, then sines, (n, 2 f)."""
        return self.every[:, : 2 * len(self.frequency)]

    @property
    def known(self) -> Array:
        """Constant, three axes, what changes slowly, (n, 4 + k + modes)."""
        return self.every[:, 2 * len(self.frequency) :]


def columns(law: ToneLaw, whitened: Array, masked: Mask, frequency: Array) -> Columns:
    """Columns of one recording, whose whitened rates (n, 3) are given; a masked sample is one more unknown."""
    every = np.concatenate([law.tones(frequency), law.constant[:, None], whitened, law.settling], axis=1)
    bumped = bool(masked.any())
    if bumped and law.whiten.ndim == 1:
        every[masked] = 0.0
    elif bumped:
        basis = np.linalg.qr(law.whiten[:, masked])[0]
        every -= basis @ (basis.T @ every)
    return Columns(frequency, every, bumped)


def evidence(law: ToneLaw, seen: Columns, log_prior: Array, *, scale: float = 1.0) -> Evidence:
    """All models over the frequencies of `seen`, each with its log prior; noise `scale` times the law's."""
    return evidences(law, [seen], [log_prior], [scale])[0]


def evidences(
    law: ToneLaw, seen: Sequence[Columns], log_prior: Sequence[Array], scale: Sequence[float]
) -> list[Evidence]:
    """The same of several recordings (b), whose models (M in all) are worked as one array.

    Unknowns are eliminated one after the other by Schur complements: the modes of a walk, where there is one, then
    tones, then the exponential, where there is one. So tones are worked twice, however many exponentials there are.
    """
    k, counts = len(law.share), [len(prior) for prior in log_prior]
    slow, walk, models = slice(4, 4 + k), slice(4 + k, None), Models.of(counts)
    products = [one.every.T @ one.every / size**2 for one, size in zip(seen, scale, strict=True)]
    gram = [one[: 2 * f, : 2 * f] for one, f in zip(products, counts, strict=True)]
    cross = [one[2 * f :, : 2 * f] for one, f in zip(products, counts, strict=True)]
    inner = np.stack([one[2 * f :, 2 * f :] for one, f in zip(products, counts, strict=True)])
    lower = np.linalg.cholesky(inner[:, walk, walk] + np.eye(WALK_MODES))
    log_walk = 2 * np.sum(np.log(np.diagonal(lower, axis1=1, axis2=2)), axis=1)
    # One by one: the matrix library sums in another order where they are stacked.
    inverse = np.linalg.inv(lower)
    into = [root @ one[walk, :4] for root, one in zip(inverse, inner, strict=True)]
    through = [root @ one[walk] for root, one in zip(inverse, cross, strict=True)]
    # Products without a walk, then with it (..., 2, ...).
    walked = [one - x.T @ x for one, x in zip(gram, through, strict=True)]
    tones = Tones.of(models, np.stack([_flat(gram), _flat(walked)]))
    walked = [one[:4] - a.T @ b for one, a, b in zip(cross, into, through, strict=True)]
    beside = _by_tone(cross, counts)
    known = tones.explained(np.stack([beside[:4], _by_tone(walked, counts)], axis=1))
    walked = [one[:4, :4] - x.T @ x for one, x in zip(inner, into, strict=True)]
    constant = np.stack([inner[:, :4, :4], walked]).transpose(2, 3, 0, 1)
    first, axes = known[:1].left_of(constant[0], known), known[1:]  # (4, 2, M) of the constant with itself and the axes
    square = axes.left_of(constant[[1, 2, 3], [1, 2, 3]], axes).sum(axis=0)  # (2, M)
    # Of each exponential: its own square, and its products with the constant and the axes (k, M).
    settling = tones.at(0).explained(beside[slow])
    pivot = settling.left_of(np.diagonal(inner, axis1=1, axis2=2)[:, slow].T + 1, settling)
    shared = [settling.left_of(inner[:, x, slow].T, known[x, 0]) for x in range(4)]

    shape = (k + 2, len(models.owner))
    information, left, log_weight, rate = np.empty(shape), np.empty(shape), np.empty(shape), np.empty((3, *shape))
    alone, settled = slice(None, None, k + 1), slice(1, -1)  # no slow change and a walk; exponentials
    information[alone], left[alone], rate[:, alone] = first[0], square, first[1:]
    divided = shared[0] / pivot
    np.subtract(first[0, 0], divided * shared[0], out=information[settled])
    for axis in range(3):
        np.subtract(first[axis + 1, 0], divided * shared[axis + 1], out=rate[axis, settled])
    explained = shared[1] ** 2 + shared[2] ** 2 + shared[3] ** 2
    np.subtract(square[0], explained / pivot, out=left[settled])
    for axis in range(3):
        product = rate[axis].copy()
        rate[axis] /= information
        product *= rate[axis]
        left -= product
    log_det = -1.5 * tones.log_det
    log_weight[0] = log_det[0]
    log_weight[-1] = log_det[1] - 1.5 * log_walk.take(models.owner)
    np.subtract(log_det[0], 1.5 * np.log(pivot), out=log_weight[settled])
    left *= 0.5
    log_weight -= left
    log_weight += models.log_prior(np.stack([law.log_kinds[one.bumped] for one in seen], axis=1), log_prior)
    return [
        Evidence(log_weight[:, low:high], information[:, low:high], rate[:, :, low:high], *tones_of(count))
        for low, high, count in zip(models.ends[:-1], models.ends[1:], counts, strict=True)
    ]


def _flat(matrices: Sequence[Array]) -> Array:
    """The entries of all, and a zero behind them."""
    return np.concatenate([*(one.ravel() for one in matrices), np.zeros(1)])


def _by_tone(matrices: Sequence[Array], counts: Sequence[int]) -> Array:
    """Columns of products with cosines, then sines (c, 2 f), of all recordings as (c, 2, sum of f)."""
    return np.concatenate([one.reshape(-1, 2, f) for one, f in zip(matrices, counts, strict=True)], axis=2)
