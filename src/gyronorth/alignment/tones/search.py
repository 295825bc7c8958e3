"""Heading under sway, warm-up and bumps by averaging over models of the disturbance.

A level rate record of three axes is a constant (Earth rate and bias) plus at most two tones,
at most one settling exponential and noise of the sensor; samples in a bump are left out. Given
the frequencies and the time constant, all the rest is linear and Gaussian, so that the
evidence of each such model and its estimate of the constant have closed forms. All models of
a fine grid are weighed by their evidence, and their headings are averaged: Bayesian model
averaging (Hoeting et al., Statistical Science 14, 1999, 382-417; tones as in Bretthorst,
"Bayesian Spectrum Analysis and Parameter Estimation", 1988, ch. 3).

What is known of the constant takes part: its horizontal part has the size of Earth's
horizontal rate, its vertical part is Earth's, both within the turn-on bias.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from itertools import product
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyronorth.alignment.tones.mixture import mixture
from gyronorth.alignment.tones.unexplained import STILL, BoundedMotion, unexplained
from gyronorth.angles import DEG_PER_HOUR
from gyronorth.arrays import Array, Index, median, robust_noise
from gyronorth.attitude import heading_of_rate
from gyronorth.earth import EARTH_RATE
from gyronorth.frozen import frozen
from gyronorth.sensor import TriadErrors
from gyronorth.sensor.law import NoiseLaw

#: Tones: lowest and highest frequency, Hz, and spacing x duration: 0.00125 Hz at 100 s.
FREQUENCIES, SPACING = (0.008, 0.3), 0.125
#: Cells of the grid that hold more of the posterior than this are divided by so many, at most so many cells.
REFINED, DIVISIONS, MOST_CELLS = 1e-4, 7, 24
#: Probability of no, one and two tones.
TONES = (0.3, 0.35, 0.35)
#: Rate amplitude of a tone per axis, rad/s (root mean square of the amplitude): 0.002 deg/s.
TONE_RATE = 7.2 * DEG_PER_HOUR
#: Settling: probability, rate per axis, rad/s, and bins of its time constant, s, which is uniform over them.
SETTLING, SETTLING_RATE = 0.5, 2 * DEG_PER_HOUR
TIME_CONSTANT_BINS = (15.0, 20.0, 27.0, 36.0, 48.0, 64.0, 84.0, 104.0, 120.0)
#: Squared residual of a sample over three axes, in variances, beyond which it lies in a bump
#: (chi-square with 3 degrees of freedom: 1e-5), and the rounds in which bumps are looked for.
BUMP_CHI2, BUMP_ROUNDS = 26.0, 6
#: Models that are less likely than the best by this factor are left out of the average.
NEGLIGIBLE = 1e-6
#: Turn-on biases tried for a sensor without a profile, rad/s, evenly weighted.
UNKNOWN_BIAS = tuple(b * DEG_PER_HOUR for b in (0.1, 0.3, 1.0, 3.0, 10.0, 30.0))


@frozen
class BayesFit:
    """Posterior of the heading of one recording."""

    heading: float  # circular mean, rad
    sigma: float  # root mean square deviation from it, rad
    interval95: tuple[float, float]  # shortest 95 % interval, rad, clockwise
    tones: float  # expected number of tones
    frequency: tuple[float, ...]  # Hz, of the likeliest model
    settling: float  # probability that the bias settles
    bumps: int  # samples left out
    noise: float  # residual over the noise law, root mean square; well above 1 its own law took that one's place
    rate_l: Array  # (3,) expected constant rate in the level frame, rad/s


@frozen
class _Grid:
    """What does not depend on the data: features, whitened, of every tone and exponential."""

    frequency: Array  # (f,) Hz
    log_prior: Array  # (f,) of one tone
    tone: Array  # (n, 2 f) cosines and sines, whitened, in units of their prior deviation
    gram: Array  # (2 f, 2 f)
    settling: Array  # (n, k) whitened exponentials in units of their prior deviation
    one: Array  # (n,) whitened constant
    whiten: Array  # (n, n)


def bayes(gyro_l: ArrayLike, *, rate_hz: float, latitude: float, errors: TriadErrors | None) -> BayesFit:
    """Heading of a level record that may sway, settle and be bumped.

    Parameters
    ----------
    gyro_l : array_like, shape (n, 3)
        Angular rate in the level frame, rad/s, at about 3 Hz (each sample a mean); 30-300 s.
    rate_hz : float
        Sample rate, Hz.
    latitude : float
        Geodetic latitude, rad.
    errors : TriadErrors, optional
        Error terms of the gyro. Without them the turn-on bias is averaged over `UNKNOWN_BIAS`; without white noise
        that is read from neighbouring samples.
    """
    gyro_l = np.asarray(gyro_l, dtype=float)
    known = errors or TriadErrors()
    if known.white == 0:
        known = replace(known, white=white_of(gyro_l) / np.sqrt(rate_hz))
    biases = (known.turn_on_bias,) if errors is not None else UNKNOWN_BIAS
    grid, masked, found = _searched(grid_of(len(gyro_l), rate_hz, known), gyro_l, rate_hz)
    residual = _residual(grid, gyro_l, masked, found)
    square = left = float(np.mean(residual[~masked] ** 2))
    if square > _most(masked):
        beyond = np.asarray(np.linalg.solve(grid.whiten, residual), dtype=float)
        noise, motion = unexplained(beyond, masked, rate_hz=rate_hz, errors=known)
        again = _searched(grid_of(len(gyro_l), rate_hz, noise, motion), gyro_l, rate_hz)
        less = float(np.mean(_residual(again[0], gyro_l, *again[1:])[~again[1]] ** 2))
        if less < square:
            (grid, masked, found), left = again, less
    if left > _most(masked):
        grid = _features(grid.whiten * left**-0.5, rate_hz, grid.frequency, grid.log_prior)
        found = scan(grid, gyro_l, masked)
    return _conclude(grid, masked, found, latitude, biases, noise=float(np.sqrt(square)))


def _most(masked: NDArray[np.bool_]) -> float:
    """Mean square of the residual up to which the law holds: 3 n squares scatter by sqrt(2 / 3 n), 4 of these."""
    return 1 + 4 * float(np.sqrt(2 / (3 * np.count_nonzero(~masked))))


def _searched(grid: _Grid, gyro_l: Array, rate_hz: float) -> tuple[_Grid, NDArray[np.bool_], _Models]:
    """Samples in bumps, and all models with the others on a grid that is fine where the tones are."""
    masked = _first_mask(gyro_l)
    found = scan(grid, gyro_l, masked)
    for _ in range(BUMP_ROUNDS):
        again = _bumped(grid, gyro_l, masked, found)
        if (again == masked).all():
            break
        masked = again
        found = scan(grid, gyro_l, masked)
    grid = _refined(grid, found, rate_hz)
    return grid, masked, scan(grid, gyro_l, masked)


def white_of(gyro_l: Array) -> float:
    """Noise of a sample, rad/s, where the profile states none: what slow motion, tones and bumps do not reach."""
    return max(float(robust_noise(gyro_l, order=2)), 1e-12)


@lru_cache(maxsize=8)
def grid_of(samples: int, rate_hz: float, errors: TriadErrors, motion: BoundedMotion = STILL) -> _Grid:
    """The features of every tone and exponential for recordings of one length of one sensor."""
    duration = samples / rate_hz
    edges = np.arange(samples + 1)
    covariance = NoiseLaw(errors).mean_covariance(edges[:-1], edges[1:], rate_hz=rate_hz)
    covariance = covariance + motion.covariance(samples, rate_hz)
    whiten = np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)), dtype=float)
    highest = min(FREQUENCIES[1], 0.4 * rate_hz)
    frequency = np.arange(FREQUENCIES[0], highest, SPACING / duration)
    prior = (1 / frequency) / np.sum(1 / frequency)
    return _features(whiten, rate_hz, frequency, np.log(prior))


def _features(whiten: Array, rate_hz: float, frequency: Array, log_prior: Array) -> _Grid:
    time = (np.arange(len(whiten)) + 0.5) / rate_hz
    phase = 2 * np.pi * time[:, None] * frequency
    tone = whiten @ np.concatenate([np.cos(phase), np.sin(phase)], axis=1) * (TONE_RATE / np.sqrt(2))
    bins = np.array(TIME_CONSTANT_BINS)
    settling = whiten @ np.exp(-time[:, None] / ((bins[1:] + bins[:-1]) / 2)) * SETTLING_RATE
    return _Grid(frequency, log_prior, tone, tone.T @ tone, settling, whiten.sum(axis=1), whiten)


def _refined(grid: _Grid, models: _Models, rate_hz: float) -> _Grid:
    """A finer grid where the tones are: a strong tone between two nodes fits neither, and leaks.

    Cells that hold some of the posterior, and those beside them, are divided.
    """
    weight, f = np.zeros(models.tones.shape[1]), len(grid.frequency)
    largest = models.evidence(*models.best)
    for settling in range(len(models.log_weight)):
        weight += np.exp(models.evidence(settling) - largest)
    share = sum(np.bincount(t[t >= 0], weight[t >= 0], minlength=f) for t in models.tones) / weight.sum()
    order = np.argsort(-share)[:MOST_CELLS]
    kept = order[(share[order] > REFINED) | (np.arange(len(order)) == 0)]
    cells = np.unique(np.clip(kept[:, None] + [-1, 0, 1], 0, f - 1))
    spacing = grid.frequency[1] - grid.frequency[0]
    offset = ((np.arange(DIVISIONS) + 0.5) / DIVISIONS - 0.5) * spacing
    frequency = (grid.frequency[cells, None] + offset).ravel()
    log_prior = np.repeat(grid.log_prior[cells] - np.log(DIVISIONS), DIVISIONS)
    return _features(grid.whiten, rate_hz, frequency, log_prior)


@frozen
class _Models:
    """Evidence of every model: of k exponentials or none (first row), with each of m sets of tones.

    Noise is in units of the law.
    """

    log_weight: Array  # (k + 1, m) prior and determinant and residual; without the constant
    information: Array  # (k + 1, m) of the constant, (rad/s)^-2
    rate: Array  # (3, k + 1, m) estimate of the constant, rad/s
    tones: NDArray[np.int16]  # (2, m) numbers of the tones, -1 for none

    def evidence(self, settling: int, tones: int | slice = slice(None)) -> Array:
        """Log weight when nothing is known of the constant."""
        return np.asarray(self.log_weight[settling, tones] - 1.5 * np.log(self.information[settling, tones]))

    @property
    def best(self) -> tuple[int, int]:
        """Row and column of the likeliest model when nothing is known of the constant."""
        tops = [int(np.argmax(self.evidence(settling))) for settling in range(len(self.log_weight))]
        row = int(np.argmax([self.evidence(settling, top) for settling, top in enumerate(tops)]))
        return row, tops[row]


def scan(grid: _Grid, gyro_l: Array, masked: NDArray[np.bool_]) -> _Models:
    """All models: no settling and each time constant, each with no, one and two tones."""
    f, k = len(grid.frequency), grid.settling.shape[1]
    known = np.concatenate([grid.one[:, None], grid.whiten @ gyro_l, grid.settling], axis=1)
    gram, cross, inner = grid.gram, grid.tone.T @ known, known.T @ known
    if masked.any():  # a masked sample is one more unknown: project it out
        basis = _basis(grid, masked)
        in_tone, in_known = basis.T @ grid.tone, basis.T @ known
        gram = gram - in_tone.T @ in_tone
        cross, inner = cross - in_tone.T @ in_known, inner - in_known.T @ in_known
    share = np.diff(TIME_CONSTANT_BINS) / (TIME_CONSTANT_BINS[-1] - TIME_CONSTANT_BINS[0])
    first, second = np.triu_indices(f, 1)
    none = np.full(f + 1, -1)
    tones = np.array([[-1, *range(f), *first], [*none, *second]], dtype=np.int16)
    shape = k + 1, tones.shape[1]
    models = _Models(np.empty(shape), np.empty(shape), np.empty((3, *shape)), tones)
    for row in range(k + 1):
        if row == 0:
            here, seen, rest, cost = gram, cross[:, :4], inner[:4, :4], 0.0
        else:
            column = 3 + row
            pivot = inner[column, column] + 1
            here = gram - cross[:, column, None] * (cross[:, column] / pivot)
            seen = cross[:, :4] - cross[:, column, None] * (inner[column, :4] / pivot)
            rest = inner[:4, :4] - inner[:4, column, None] * (inner[column, :4] / pivot)
            cost = np.log(pivot)
        prior = np.log(1 - SETTLING) if row == 0 else np.log(SETTLING * share[row - 1])
        found = _with_tones(here, seen, rest, cost, prior, grid.log_prior, f)
        models.log_weight[row], models.information[row], models.rate[:, row] = found
    return models


def _with_tones(
    gram: Array, seen: Array, rest: Array, cost: float, prior: float, log_prior: Array, f: int
) -> tuple[Array, Array, Array]:
    """Log weight, information of the constant and its estimate (3, .) for no, each and each two tones.

    Columns of `seen` (2 f, 4) and `rest` (4, 4) are the constant and the three axes. Tones
    are eliminated one after the other, by Schur complements of 2 x 2 blocks written out.
    """
    cosine, sine = np.arange(f), np.arange(f) + f
    p0, p1 = seen[:f], seen[f:]
    a, b, d = gram[cosine, cosine] + 1, gram[cosine, sine], gram[sine, sine] + 1
    det = a * d - b * b
    ia, ib, id_ = d / det, -b / det, a / det
    h0, h1 = ia[:, None] * p0 + ib[:, None] * p1, ib[:, None] * p0 + id_[:, None] * p1

    i, j = np.triu_indices(f, 1)
    g00, g01, g10, g11 = gram[:f, :f][i, j], gram[:f, f:][i, j], gram[f:, :f][i, j], gram[f:, f:][i, j]
    ai, bi, di = ia[i], ib[i], id_[i]
    k00, k10, k01, k11 = ai * g00 + bi * g10, bi * g00 + di * g10, ai * g01 + bi * g11, bi * g01 + di * g11
    s00, s01, s11 = a[j] - g00 * k00 - g10 * k10, b[j] - g00 * k01 - g10 * k11, d[j] - g01 * k01 - g11 * k11
    del ai, bi, di, k00, k01, k10, k11
    det_ij = s00 * s11 - s01 * s01
    q0 = [p0[j, x] - g00 * h0[i, x] - g10 * h1[i, x] for x in range(4)]
    q1 = [p1[j, x] - g01 * h0[i, x] - g11 * h1[i, x] for x in range(4)]
    del g00, g01, g10, g11
    c00, c01, c11 = s11 / det_ij, -s01 / det_ij, s00 / det_ij

    def entry(x: int, y: int) -> Array:
        """What is left of entry (x, y) of `rest` without tones, with each, and with each two."""
        single = rest[x, y] - (p0[:, x] * h0[:, y] + p1[:, x] * h1[:, y])
        pair = c00 * q0[x] * q0[y] + c01 * (q0[x] * q1[y] + q1[x] * q0[y]) + c11 * q1[x] * q1[y]
        return np.concatenate([[rest[x, y]], single, single[i] - pair])

    log_det = cost + np.concatenate([[0.0], np.log(det), np.log(det)[i] + np.log(det_ij)])
    both = log_prior[i] + log_prior[j] + np.log(2)
    log_weight = prior + np.concatenate([[np.log(TONES[0])], np.log(TONES[1]) + log_prior, np.log(TONES[2]) + both])
    log_weight -= 1.5 * log_det
    information, rate = entry(0, 0), list[Array]()
    for axis in (1, 2, 3):
        seen_by_one = entry(0, axis)
        log_weight -= 0.5 * (entry(axis, axis) - seen_by_one**2 / information)
        rate.append(seen_by_one / information)
    return log_weight, information, np.array(rate)


def _basis(grid: _Grid, masked: NDArray[np.bool_]) -> Array:
    """Orthonormal columns that span the whitened masked samples."""
    return np.asarray(np.linalg.qr(grid.whiten[:, masked])[0], dtype=float)


def _first_mask(gyro_l: Array) -> NDArray[np.bool_]:
    """Samples far off a running median over 21: large bumps, before anything is fitted."""
    from scipy.ndimage import median_filter

    smooth = median_filter(gyro_l, size=(min(21, len(gyro_l)), 1), mode="nearest")
    off: Array = gyro_l - np.asarray(smooth, dtype=float)
    scatter = 1.4826 * median(np.abs(off), axis=0)
    return _grown(np.any(np.abs(off) > 6 * np.maximum(scatter, 1e-300), axis=1))


def _grown(flags: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The flagged samples and their neighbours, which a bump may touch in part; never more than half."""
    grown = np.convolve(flags, [1, 1, 1], mode="same") > 0.5
    return grown if grown.mean() < 0.5 else np.zeros_like(flags)


def _residual(grid: _Grid, gyro_l: Array, masked: NDArray[np.bool_], models: _Models) -> Array:
    """Whitened residual (n, 3) of the likeliest model, fitted without the masked samples."""
    settling, best = models.best
    tones = [int(t) for t in models.tones[:, best] if t >= 0]
    f = len(grid.frequency)
    columns = [grid.one[:, None]] + [grid.tone[:, [t, t + f]] for t in tones]
    columns += [grid.settling[:, [settling - 1]]] if settling > 0 else []
    design, target = np.concatenate(columns, axis=1), grid.whiten @ gyro_l
    basis = _basis(grid, masked)
    inside, free = design - basis @ (basis.T @ design), np.ones(design.shape[1])
    free[0] = 0.0
    return target - design @ np.linalg.solve(inside.T @ inside + np.diag(free), inside.T @ target)


def _bumped(grid: _Grid, gyro_l: Array, masked: NDArray[np.bool_], models: _Models) -> NDArray[np.bool_]:
    square = np.sum(_residual(grid, gyro_l, masked, models) ** 2, axis=1)
    return _grown(square > BUMP_CHI2 * _excess(square[~masked]))


def _excess(square: Array) -> float:
    """Variance of the residual over the law, from its median (2.366 for chi-square with 3 degrees); at least 1."""
    return max(1.0, float(median(square)) / 2.366)


def _conclude(
    grid: _Grid,
    masked: NDArray[np.bool_],
    models: _Models,
    latitude: float,
    biases: tuple[float, ...],
    *,
    noise: float,
) -> BayesFit:
    weight, concentration, settling, tones = _weigh(models, latitude, biases)
    rate = models.rate[:, settling, tones]
    heading, sigma, interval = mixture(heading_of_rate(rate.T), concentration, weight)
    best = tones[np.argmax(weight)]
    return BayesFit(
        heading=heading,
        sigma=sigma,
        interval95=interval,
        tones=float(weight @ (models.tones[:, tones] >= 0).sum(axis=0)),
        frequency=tuple(float(grid.frequency[t]) for t in models.tones[:, best] if t >= 0),
        settling=float(weight @ (settling > 0)),
        bumps=int(masked.sum()),
        noise=noise,
        rate_l=rate @ weight,
    )


def _weigh(models: _Models, latitude: float, biases: tuple[float, ...]) -> tuple[Array, Array, Index, Index]:
    """Weight (sum 1), concentration of the heading, row and column of each model that counts, one for each bias scale.

    With variance V = 1 / information + bias^2 and headings uniform on the circle of radius w,
    the horizontal part m has the density exp(-(|m|^2 + w^2) / 2 V) I_0(|m| w / V) / (2 pi V), and
    the heading given m is von Mises with concentration |m| w / V.
    """
    from scipy.special import i0e

    north, down = EARTH_RATE * np.cos(latitude), -EARTH_RATE * np.sin(latitude)
    largest, counted = -np.inf, list[tuple[Array, Array, Index, Index]]()
    for row, bias in product(range(len(models.log_weight)), biases):  # in turn, to bound memory
        information, rate = models.information[row], models.rate[:, row]
        variance = 1 / information + bias**2
        size = np.hypot(rate[0], rate[1])
        concentration = size * north / variance
        log_weight = models.log_weight[row] - 1.5 * np.log(information * variance)
        log_weight += np.log(cast("Array", i0e(concentration)))
        misfit = np.asarray((size - north) ** 2 + (rate[2] - down) ** 2, dtype=float)
        log_weight = np.asarray(log_weight - misfit / (2 * variance), dtype=float)
        largest = max(largest, float(log_weight.max()))
        used = np.flatnonzero(log_weight > largest + np.log(NEGLIGIBLE))
        counted.append((log_weight[used], concentration[used], np.full(len(used), row), used))
    parts = tuple(zip(*counted, strict=True))
    log_weight, concentration = np.concatenate(parts[0]), np.concatenate(parts[1])
    rows, used = np.concatenate(parts[2]), np.concatenate(parts[3])
    kept = log_weight > largest + np.log(NEGLIGIBLE)
    weight = np.exp(log_weight[kept] - largest)
    return weight / weight.sum(), concentration[kept], rows[kept], used[kept]
