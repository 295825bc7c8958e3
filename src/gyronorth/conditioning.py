"""Conditioning of a recording before alignment; nothing here shifts the mean.

Decimation, block means, the noise that a recording shows of itself, how far a unit turned
about its mean attitude, and sway.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import lru_cache
from math import erfc, exp, lgamma, log, log1p, sqrt

import numpy as np
from numpy.typing import ArrayLike

from gyronorth.arrays import Array, mean_of_rows
from gyronorth.errors import InputError
from gyronorth.frozen import frozen
from gyronorth.recording import Gap, Recording

#: Two-sided 99.9 % point of the normal law: the confidence of every gate.
GATE_SIGMA = 3.29
#: Harmonics in which the noise of a slope is read: next to the slope, and, on two axes, for 16 degrees of freedom.
HARMONICS = np.arange(2, 10)
#: Samples that are worked at once, so that they stay in the processor's cache and little is copied.
BLOCK_SAMPLES = 1 << 14
#: Longest block, s, over which sample noise is told from sway.
NOISE_BLOCK = 1.0


def decimate(x: ArrayLike, *, rate_hz: float, to_hz: float) -> Array:
    """Mean of `x` over each output interval, at any ratio of rates (integrate and dump).

    Parameters
    ----------
    x : array_like, shape (..., n, k)
        Samples, each the mean over its interval.
    rate_hz, to_hz : float
        Input and output rate, Hz; `to_hz` not above `rate_hz`.

    Returns
    -------
    ndarray, shape (..., floor(n to_hz / rate_hz), k)
        The mean of the output equals the mean of the input over the time covered, exactly:
        the cumulative sum is interpolated at the output's edges, then differenced.
    """
    x = np.asarray(x, dtype=float)
    n = x.shape[-2]
    _check_decimation(rate_hz, to_hz)
    count = _whole_samples(n, rate_hz, to_hz)
    if count == 0:
        raise InputError(f"{n / rate_hz:g} s of data hold no whole sample at {to_hz:g} Hz.")
    edge = np.minimum(np.arange(count + 1) * (rate_hz / to_hz), n)
    return _means_between(x, edge, to_hz / rate_hz)


def _check_decimation(rate_hz: float, to_hz: float) -> None:
    if not 0 < to_hz <= rate_hz:
        raise InputError(
            f"Cannot decimate from {rate_hz:g} Hz to {to_hz:g} Hz; a rate in (0, {rate_hz:g}] is expected."
        )


def _whole_samples(n: int, rate_hz: float, to_hz: float) -> int:
    """Samples at `to_hz` that n samples at `rate_hz` hold."""
    return int(np.floor(n / rate_hz * to_hz * (1 + 1e-12)))


def _means_between(x: Array, edge: Array, ratio: float) -> Array:
    """Means of `x` (..., n, k) between edges (m,) that are `1 / ratio` samples apart, shape (..., m - 1, k)."""
    n = x.shape[-2]
    centre = mean_of_rows(x)[..., None, :]
    left = np.minimum(edge.astype(int), n - 1)
    share = (edge - left)[:, None]
    at_edge = np.zeros((*x.shape[:-2], len(edge), x.shape[-1]))
    before = np.zeros_like(centre)
    for _, samples in _parts(x):
        total = np.concatenate([before, x[..., samples, :] - centre], axis=-2)
        np.cumsum(total, axis=-2, out=total)
        here = slice(*np.searchsorted(left, (samples.start, samples.stop)))
        place = left[here] - samples.start
        at_edge[..., here, :] = total[..., place, :] * (1 - share[here]) + total[..., place + 1, :] * share[here]
        before = total[..., -1:, :].copy()
    return np.diff(at_edge, axis=-2) * ratio + centre


def decimated(recording: Recording, to_hz: float) -> Recording:
    """The recording at a lower rate, gyro and accelerometer alike (see `decimate`)."""
    accel = recording.accel_b
    return replace(
        recording,
        gyro_b=decimate(recording.gyro_b, rate_hz=recording.rate_hz, to_hz=to_hz),
        accel_b=None if accel is None else decimate(accel, rate_hz=recording.rate_hz, to_hz=to_hz),
        rate_hz=to_hz,
        gaps=_gaps_at(recording, to_hz),
    )


def decimated_chunks(chunks: Iterable[Recording], to_hz: float) -> Iterator[Recording]:
    """The chunks of one recording at a lower rate: what `decimated` gives of the whole, but for rounding.

    A sample that straddles two chunks goes with the second one, and so do a chunk's gaps and
    dropped rows where it is too short for a sample of its own.
    """
    begin = done = dropped = 0  # samples before `held`; samples returned; rows dropped that no chunk returned tells of
    held: Array | None = None
    gaps, end, rate_hz = list[Gap](), 0, 1.0
    for chunk in chunks:
        rate_hz = chunk.rate_hz
        _check_decimation(rate_hz, to_hz)
        samples = chunk.gyro_b if chunk.accel_b is None else np.hstack([chunk.gyro_b, chunk.accel_b])
        held = samples if held is None else np.concatenate([held, samples])
        # Starts are counted from the first sample that is still to be returned.
        gaps += [Gap(end / rate_hz + gap.start - done / to_hz, gap.samples) for gap in _gaps_at(chunk, to_hz)]
        dropped += chunk.rows_dropped
        end += len(samples)
        count = _whole_samples(end, rate_hz, to_hz)
        if count == done:
            continue
        edge = np.minimum(np.arange(done, count + 1) * (rate_hz / to_hz), end)
        slow = _means_between(held, edge - begin, to_hz / rate_hz)
        yield replace(
            chunk,
            gyro_b=slow[:, :3],
            accel_b=None if chunk.accel_b is None else slow[:, 3:],
            rate_hz=to_hz,
            gaps=tuple(gaps),
            rows_dropped=dropped,
        )
        kept = min(int(edge[-1]), end - 1)
        held, begin, done, dropped, gaps = held[kept - begin :], kept, count, 0, []
    if done == 0:
        raise InputError(f"{end / rate_hz:g} s of data hold no whole sample at {to_hz:g} Hz.")


def _gaps_at(recording: Recording, to_hz: float) -> tuple[Gap, ...]:
    """The gaps of a recording, in samples of another rate."""
    ratio = to_hz / recording.rate_hz
    return tuple(Gap(gap.start, max(1, round(gap.samples * ratio))) for gap in recording.gaps)


def block_means(x: Array, size: int) -> Array:
    """Means of consecutive blocks of `size` samples along axis -2; a shorter tail is left out."""
    count = x.shape[-2] // size
    return mean_of_rows(x[..., : count * size, :].reshape(*x.shape[:-2], count, size, x.shape[-1]))


@frozen
class MeasuredNoise:
    """White noise that a recording shows of itself (arrays over recordings)."""

    density: Array  # noise density at low frequency, (unit of x) sqrt(s), pooled over axes
    excess: Array  # variance x time at `NOISE_BLOCK` over the same at long blocks; about 1 for white noise
    excess_limit: float  # 99.9 % point of `excess` for white noise


def noise_density(x: Array, *, rate_hz: float) -> MeasuredNoise:
    """White-noise density of the mean of a record, from two Allan variances, at short and at long averaging times.

    Parameters
    ----------
    x : ndarray, shape (..., n, k)
        Samples; the k axes are pooled.
    rate_hz : float
        Sample rate, Hz.

    Notes
    -----
    For white noise the Allan variance times the averaging time is N^2 at every averaging
    time. Flicker and random walk raise the long one. Sway and quantisation, whose integral
    is bounded, raise the short one: so the smaller of the two is taken, and their ratio
    tells sway from drift. Long blocks are a tenth of the record.
    """
    n = x.shape[-2]
    short = int(np.clip(round(NOISE_BLOCK * rate_hz), 1, max(1, n // 20)))
    long = max(short, n // 10)
    at_short, dof_short = _allan_variance_time(x, short)
    at_long, dof_long = _allan_variance_time(x, long)
    tiny = np.finfo(float).tiny
    return MeasuredNoise(
        density=np.sqrt(np.minimum(at_short, at_long) / rate_hz),
        excess=at_short / np.maximum(at_long, tiny),
        excess_limit=fisher_upper(dof_short, dof_long) if long > short else np.inf,
    )


def _allan_variance_time(x: Array, size: int) -> tuple[Array, float]:
    """Allan variance times block size in samples, pooled over axes, and its degrees of freedom."""
    difference = np.diff(block_means(x, size), axis=-2)
    value = 0.5 * size * np.mean(difference**2, axis=(-2, -1))
    # Differences of neighbours share a block: 2/3 of their number count (NIST SP 1065, 5.4.1).
    return value, max(1.0, difference.shape[-2] * x.shape[-1] * 2 / 3)


@lru_cache(maxsize=64)
def fisher_upper(dof_1: float, dof_2: float) -> float:
    """Point that Fisher's F exceeds with the one-sided probability of `GATE_SIGMA`, 0.05 %.

    Notes
    -----
    P(F > f) = I_x(d2 / 2, d1 / 2) at x = d2 / (d2 + d1 f) (Abramowitz and Stegun, 26.6.2); halved brackets of ln f.
    """
    probability = erfc(GATE_SIGMA / sqrt(2)) / 2
    low, high = 0.0, 1.0

    def exceeds(log_f: float) -> bool:
        return incomplete_beta(dof_2 / 2, dof_1 / 2, 1 / (1 + dof_1 / dof_2 * exp(log_f))) > probability

    while exceeds(high):
        low, high = high, 2 * high
    for _ in range(50):
        middle = (low + high) / 2
        low, high = (middle, high) if exceeds(middle) else (low, middle)
    return exp((low + high) / 2)


def incomplete_beta(a: float, b: float, x: float) -> float:
    """Regularised incomplete beta function I_x(a, b), a and b above 0, x in [0, 1].

    Notes
    -----
    The continued fraction of Numerical Recipes, 3rd ed. (2007), sec. 6.4 (Abramowitz and Stegun, 26.5.8), by the
    modified Lentz method. scipy.special has it too, but costs as much as all else that a heading imports.
    """
    if x <= 0 or x >= 1:
        return float(x >= 1)
    if x > (a + 1) / (a + b + 2):
        return 1 - incomplete_beta(b, a, 1 - x)
    front = exp(lgamma(a + b) - lgamma(a) - lgamma(b) + a * log(x) + b * log1p(-x)) / a
    tiny = 1e-300
    c, d = 1.0, 1 / max(1 - (a + b) * x / (a + 1), tiny)
    fraction = d
    for m in range(1, 10_000):
        even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))
        for term in (even, odd):
            d, c = 1 / (1 + term * d or tiny), 1 + term / c or tiny
            fraction *= c * d
        if abs(c * d - 1) < 1e-14:
            break
    return front * fraction


@frozen
class Sway:
    """How the attitude moved about a straight line in time (arrays over recordings)."""

    gyro_variance: Array  # variance of the integrated horizontal rate about its trend, per axis, rad^2
    tilt_variance: Array  # its covariance with the tilt that the accelerometer sees, rad^2; NaN for gyro only
    tilt_change: Array  # net tilt change over the record by the accelerometer's trend, rad; NaN for gyro only
    tilt_noise: Array  # variance per axis of that change from noise, by what the two do not share, rad^2; NaN
    yaw_variance: Array  # variance of the integrated vertical rate about its trend, rad^2
    excursion: Array  # largest integrated rotation from the trend, any axis, rad


def sway(gyro_b: Array, accel_b: Array | None, *, mat_lb: Array, rate_hz: float) -> Sway:
    """Sway from the integrated rate and, where there is one, the accelerometer.

    Parameters
    ----------
    gyro_b, accel_b : ndarray, shape (..., n, 3)
        Angular rate, rad/s, and specific force, m/s^2.
    mat_lb : ndarray, shape (..., 3, 3)
        Rotation to the frame levelled by the mean.
    rate_hz : float
        Sample rate, Hz.

    Notes
    -----
    The covariance of the two is free of both sensors' noise, which is independent.
    """
    lead, count = gyro_b.shape[:-2], gyro_b.shape[-2]
    to_angle, shares = mat_lb / rate_hz, _Harmonics(gyro_b, count)
    middle, slope = _line_of_integral(_moments(gyro_b, 3), count, to_angle)
    before, square, peak = np.zeros((*lead, 3, 1)), np.zeros((*lead, 3)), np.zeros(lead)
    product, transform = np.zeros(lead), np.zeros((*lead, len(HARMONICS), 2))
    to_tilt = middle_tilt = slope_tilt = np.zeros(1)
    if accel_b is not None:
        moments = _moments(accel_b, 2)
        gravity = np.linalg.norm(moments[..., 0, :] / count, axis=-1)[..., None, None]
        gravity = np.where(gravity > 0, gravity, np.inf)  # without any, nothing tells of a tilt
        # A small roll moves f_y by -g roll, a small pitch f_x by g pitch, in frd axes at rest.
        to_tilt = np.stack([-mat_lb[..., 1, :], mat_lb[..., 0, :]], axis=-2) / gravity
        middle_tilt, slope_tilt = _line(moments, count, to_tilt)
    for time, samples in _parts(gyro_b):
        step = to_angle @ np.swapaxes(gyro_b[..., samples, :], -1, -2)
        angle = np.cumsum(step, axis=-1)  # the integrated rate up to the middle of each sample
        angle += before
        before = angle[..., -1:].copy()
        step *= 0.5
        angle -= step
        angle -= middle + slope * time
        square += np.einsum("...kt,...kt->...k", angle, angle)
        peak = np.maximum(peak, np.einsum("...kt,...kt->...t", angle, angle).max(axis=-1))
        if accel_b is not None:
            tilt = to_tilt @ np.swapaxes(accel_b[..., samples, :], -1, -2)
            tilt -= middle_tilt + slope_tilt * time
            product += np.einsum("...kt,...kt->...", tilt, angle[..., :2, :])
            tilt -= angle[..., :2, :]
            transform += shares.of(samples.start, np.swapaxes(tilt, -1, -2))
    seen, nothing = accel_b is not None, np.full(lead, np.nan)
    return Sway(
        gyro_variance=square[..., :2].sum(axis=-1) / (2 * count),
        tilt_variance=product / (2 * count) if seen else nothing,
        tilt_change=np.linalg.norm(slope_tilt[..., 0], axis=-1) * count if seen else nothing,
        tilt_noise=_slope_variance_of(transform, count, duration=1.0) if seen else nothing,
        yaw_variance=square[..., 2] / count,
        excursion=np.sqrt(peak),
    )


def _parts(x: Array) -> Iterator[tuple[Array, slice]]:
    """Blocks of the samples of `x` (..., n, k): their times (m,), samples from the middle, and their numbers."""
    count, size = x.shape[-2], _block_of(x)
    for start in range(0, count, size):
        yield np.arange(start, min(start + size, count)) - (count - 1) / 2, slice(start, start + size)


def _block_of(x: Array) -> int:
    """Samples of a recording in one block of all of `x` (..., n, k)."""
    return min(max(BLOCK_SAMPLES * x.shape[-2] // max(x.size // x.shape[-1], 1), 1), x.shape[-2])


def _moments(x: Array, powers: int) -> Array:
    """Sums over the samples of `x` (..., n, k) times powers 0, 1, ... of time, samples from the middle."""
    total = np.zeros((*x.shape[:-2], powers, x.shape[-1]))
    for time, samples in _parts(x):
        total += time ** np.arange(powers)[:, None] @ x[..., samples, :]
    return total


def _line(moments: Array, count: int, mat: Array) -> tuple[Array, Array]:
    """Mean and slope per sample, (..., k, 1), of the line through `mat @ x`, from the `_moments` of x."""
    square = max(count * (count**2 - 1) / 12, 1.0)
    return mat @ (moments[..., 0, :, None] / count), mat @ (moments[..., 1, :, None] / square)


def _line_of_integral(moments: Array, count: int, mat: Array) -> tuple[Array, Array]:
    """The same of the integral of `mat @ x` up to the middle of each sample.

    In its sum, and its sum times time, a sample at time t has the shares n / 2 - t and (h^2 + h - t^2) / 2, where
    h = (n - 1) / 2 is the time of the last one.
    """
    zeroth, first, second = (moments[..., power, :] for power in range(3))
    last = (count - 1) / 2
    sums = np.stack([count / 2 * zeroth - first, ((last**2 + last) * zeroth - second) / 2], axis=-2)
    return _line(sums, count, mat)


class _Harmonics:
    """The cosine transform at `HARMONICS` of records of `count` samples, block by block as those of `x`."""

    def __init__(self, x: Array, count: int) -> None:
        self._step = np.pi * HARMONICS[:, None] / count
        angle = self._step * np.arange(_block_of(x))
        self._cosine, self._sine = np.sqrt(2 / count) * np.cos(angle), np.sqrt(2 / count) * np.sin(angle)

    def of(self, start: int, part: Array) -> Array:
        """What a block (..., m, k) from sample `start` on adds to the transform, shape (..., harmonics, k)."""
        first, size = self._step * (start + 0.5), part.shape[-2]
        cosine, sine = self._cosine[:, :size] @ part, self._sine[:, :size] @ part
        return np.cos(first) * cosine - np.sin(first) * sine


def slope_variance(residual: Array, *, duration: float) -> Array:
    """Variance of the slope of coloured noise, (unit / s)^2, read from its own low harmonics.

    Parameters
    ----------
    residual : ndarray, shape (..., n, k)
        What is left after a straight line was fitted; the k axes are pooled.
    duration : float
        Length of the record, s.

    Notes
    -----
    The cosine transform of the residual at harmonics 2..9 is fitted by white noise and random
    walk, a + b / k^2, both non-negative, and extrapolated to k = 1, where the slope lives (96 /
    pi^4 = 98.6 % of a line): its variance is 12 / (n T^2) of the level there. A slope is within
    1.96 of the root in 95 % of white, 90 % of flicker and 83 % of random-walk noise.
    """
    count = residual.shape[-2]
    transform = np.zeros((*residual.shape[:-2], len(HARMONICS), residual.shape[-1]))
    shares = _Harmonics(residual, count)
    for _, samples in _parts(residual):
        transform += shares.of(samples.start, residual[..., samples, :])
    return _slope_variance_of(transform, count, duration=duration)


def _slope_variance_of(transform: Array, count: int, *, duration: float) -> Array:
    """The variance of `slope_variance`, from the harmonics (..., harmonics, k) of `count` samples."""
    power = np.mean(transform**2, axis=-1)
    walk = 1.0 / HARMONICS**2
    centred = walk - walk.mean()
    slope = np.clip(power @ centred / (centred @ centred), 0.0, None)
    intercept = power.mean(axis=-1) - slope * walk.mean()
    only_walk = power @ walk / (walk @ walk)
    at_first = np.where(intercept >= 0, intercept + slope, only_walk)
    return 12 * at_first / (count * duration**2)
