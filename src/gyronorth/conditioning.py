"""Conditioning of a recording before alignment; nothing here shifts the mean.

Decimation, block means, the noise that a recording shows of itself, how far a unit turned
about its mean attitude, and sway.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from math import erfc, exp, lgamma, log, log1p, sqrt

import numpy as np
from numpy.typing import ArrayLike

from gyronorth.arrays import Array, mean_of_rows
from gyronorth.errors import InputError
from gyronorth.recording import Gap, Recording

#: Two-sided 99.9 % point of the normal law: the confidence of every gate.
GATE_SIGMA = 3.29
#: Harmonics of the record in which the noise of a slope is read: next to the slope itself, and
#: enough of them, on two axes, for 16 degrees of freedom.
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
    before, start = np.zeros_like(centre), 0
    for _, part in _parts(x):
        end = start + part.shape[-2]
        total = np.concatenate([before, part - centre], axis=-2)
        np.cumsum(total, axis=-2, out=total)
        here = slice(*np.searchsorted(left, (start, end)))
        place = left[here] - start
        at_edge[..., here, :] = total[..., place, :] * (1 - share[here]) + total[..., place + 1, :] * share[here]
        before, start = total[..., -1:, :].copy(), end
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
    gaps: list[Gap] = []
    end, rate_hz = 0, 1.0
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


@dataclass(frozen=True)
class Noise:
    """White noise that a recording shows of itself (arrays over recordings)."""

    density: Array  # noise density at low frequency, (unit of x) sqrt(s), pooled over axes
    excess: Array  # variance x time at `NOISE_BLOCK` over the same at long blocks; about 1 for white noise
    excess_limit: float  # 99.9 % point of `excess` for white noise


def noise_density(x: Array, *, rate_hz: float) -> Noise:
    """White-noise density from two Allan variances, at short and at long averaging times.

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
    return Noise(
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


@dataclass(frozen=True)
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
    turn = np.swapaxes(mat_lb, -1, -2)
    lead, count = gyro_b.shape[:-2], gyro_b.shape[-2]
    middle, slope = _line(_angles(gyro_b, turn, rate_hz), count)
    square, peak = np.zeros((*lead, 3)), np.zeros(lead)
    product, transform = np.zeros(lead), np.zeros((*lead, len(HARMONICS), 2))
    tilts: Iterator[tuple[Array, Array | None]]
    if accel_b is None:
        tilts, middle_tilt, slope_tilt = ((time, None) for time, _ in _parts(gyro_b)), np.zeros(1), np.zeros(1)
    else:
        middle_tilt, slope_tilt = _line(_tilts(accel_b, turn), count)
        tilts = _tilts(accel_b, turn)
    for (time, angle), (_, tilt) in zip(_angles(gyro_b, turn, rate_hz), tilts, strict=True):
        angle -= middle + time[:, None] * slope
        square += np.einsum("...tk,...tk->...k", angle, angle)
        peak = np.maximum(peak, np.einsum("...tk,...tk->...t", angle, angle).max(axis=-1))
        if tilt is not None:
            tilt -= middle_tilt + time[:, None] * slope_tilt
            product += np.einsum("...tk,...tk->...", tilt, angle[..., :2])
            tilt -= angle[..., :2]
            transform += _harmonics(time, count) @ tilt
    seen, nothing = accel_b is not None, np.full(lead, np.nan)
    return Sway(
        gyro_variance=square[..., :2].sum(axis=-1) / (2 * count),
        tilt_variance=product / (2 * count) if seen else nothing,
        tilt_change=np.linalg.norm(slope_tilt, axis=(-2, -1)) * count if seen else nothing,
        tilt_noise=_slope_variance_of(transform, count, duration=1.0) if seen else nothing,
        yaw_variance=square[..., 2] / count,
        excursion=np.sqrt(peak),
    )


def _parts(x: Array) -> Iterator[tuple[Array, Array]]:
    """Blocks (..., m, k) of `x` (..., n, k), each with its times (m,), samples from the middle."""
    count = x.shape[-2]
    size = max(BLOCK_SAMPLES * count // max(x.size // x.shape[-1], 1), 1)
    for start in range(0, count, size):
        part = x[..., start : start + size, :]
        yield np.arange(start, start + part.shape[-2]) - (count - 1) / 2, part


def _angles(gyro_b: Array, turn: Array, rate_hz: float) -> Iterator[tuple[Array, Array]]:
    """The integrated rate in the levelled frame, rad, up to the middle of each sample, block by block."""
    before = np.zeros((*gyro_b.shape[:-2], 1, 3))
    for time, part in _parts(gyro_b):
        rate = part @ turn
        angle = np.cumsum(rate, axis=-2)
        angle += before
        before = angle[..., -1:, :].copy()
        yield time, (angle - rate / 2) / rate_hz


def _tilts(accel_b: Array, turn: Array) -> Iterator[tuple[Array, Array]]:
    """Roll and pitch from the levelled attitude by the accelerometer, rad, block by block."""
    gravity = np.linalg.norm(mean_of_rows(accel_b), axis=-1)[..., None, None]
    for time, part in _parts(accel_b):
        force = part @ turn
        # A small roll moves f_y by -g roll, a small pitch f_x by g pitch, in frd axes at rest.
        yield time, np.stack([-force[..., 1], force[..., 0]], axis=-1) / gravity


def _line(blocks: Iterator[tuple[Array, Array]], count: int) -> tuple[Array, Array]:
    """Mean and slope per sample, (..., 1, k), of the line through blocks of `count` samples in all."""
    total, moment, square = np.zeros(1), np.zeros(1), 0.0
    for time, x in blocks:
        total = total + np.einsum("...tk->...k", x)[..., None, :]
        moment = moment + time @ x
        square += float(time @ time)
    return total / count, np.expand_dims(moment, -2) / max(square, 1.0)


def _harmonics(time: Array, count: int) -> Array:
    """Rows of the cosine transform at `HARMONICS`, shape (harmonics, m), for times from the middle."""
    cosine = np.cos(np.pi * (time + count / 2) / count)
    rows = np.empty((HARMONICS[-1] + 1, len(time)))
    rows[0], rows[1] = np.sqrt(2 / count), np.sqrt(2 / count) * cosine
    for k in range(2, len(rows)):  # cos k a = 2 cos a cos (k - 1) a - cos (k - 2) a: one cosine for all of them
        np.multiply(2 * cosine, rows[k - 1], out=rows[k])
        rows[k] -= rows[k - 2]
    return rows[HARMONICS]


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
    for time, part in _parts(residual):
        transform += _harmonics(time, count) @ part
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
