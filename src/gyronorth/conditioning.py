"""Conditioning of a recording before alignment; nothing here shifts the mean.

Decimation, block means, the noise that a recording shows of itself, how far a unit turned
about its mean attitude, sway, and the segments in which it stood still.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np
from numpy.typing import ArrayLike

from gyronorth.arrays import Array
from gyronorth.earth import EARTH_RATE
from gyronorth.errors import InputError
from gyronorth.recording import Gap, Recording

#: Two-sided 99.9 % point of the normal law: the confidence of every gate.
GATE_SIGMA = 3.29
#: Harmonics of the record in which the noise of a slope is read: next to the slope itself, and
#: enough of them, on two axes, for 16 degrees of freedom.
HARMONICS = np.arange(2, 10)
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


def longest_hold(x: ArrayLike) -> tuple[int, int]:
    """First sample and length of the longest run of equal rows in `x`, shape (n, k), n at least 1."""
    x = np.asarray(x)
    edges = np.flatnonzero(np.concatenate([[True], (x[1:] != x[:-1]).any(axis=1), [True]]))
    longest = int(np.argmax(np.diff(edges)))
    return int(edges[longest]), int(edges[longest + 1] - edges[longest])


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
    centre = x.mean(axis=-2, keepdims=True)
    total = np.zeros((*x.shape[:-2], n + 1, x.shape[-1]))
    np.cumsum(x - centre, axis=-2, out=total[..., 1:, :])
    left = np.minimum(edge.astype(int), n - 1)
    share = (edge - left)[:, None]
    at_edge = total[..., left, :] * (1 - share) + total[..., left + 1, :] * share
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
    return x[..., : count * size, :].reshape(*x.shape[:-2], count, size, x.shape[-1]).mean(axis=-2)


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
        excess_limit=_f_upper(dof_short, dof_long) if long > short else np.inf,
    )


def _allan_variance_time(x: Array, size: int) -> tuple[Array, float]:
    """Allan variance times block size in samples, pooled over axes, and its degrees of freedom."""
    difference = np.diff(block_means(x, size), axis=-2)
    value = 0.5 * size * np.mean(difference**2, axis=(-2, -1))
    # Differences of neighbours share a block: 2/3 of their number count (NIST SP 1065, 5.4.1).
    return value, max(1.0, difference.shape[-2] * x.shape[-1] * 2 / 3)


def _f_upper(dof_1: float, dof_2: float) -> float:
    """Upper 0.05 % point of Fisher's F, by Paulson's normal approximation (1942)."""
    a, b, z = 2 / (9 * dof_1), 2 / (9 * dof_2), GATE_SIGMA
    slope = (1 - b) ** 2 - z**2 * b
    if slope <= 0:
        return np.inf
    root = ((1 - a) * (1 - b) + z * np.sqrt((1 - a) ** 2 * b + a * slope)) / slope
    return float(root**3)


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
    rate = gyro_b @ turn
    angle = np.cumsum(rate, axis=-2)
    angle -= rate / 2
    angle = _without_trend(angle / rate_hz)
    horizontal = angle[..., :2]
    if accel_b is None:
        covariance = change = own = np.full(angle.shape[:-2], np.nan)
    else:
        force = accel_b @ turn
        gravity = np.linalg.norm(force.mean(axis=-2), axis=-1)[..., None, None]
        # A small roll moves f_y by -g roll, a small pitch f_x by g pitch, in frd axes at rest.
        tilt = np.stack([-force[..., 1], force[..., 0]], axis=-1) / gravity
        bent = _without_trend(tilt)
        covariance = np.mean(horizontal * bent, axis=(-2, -1))
        change = np.linalg.norm(_trend(tilt), axis=-1) * tilt.shape[-2]
        own = slope_variance(bent - horizontal, duration=1.0)
    return Sway(
        gyro_variance=np.mean(horizontal**2, axis=(-2, -1)),
        tilt_variance=covariance,
        tilt_change=change,
        tilt_noise=own,
        yaw_variance=np.mean(angle[..., 2] ** 2, axis=-1),
        excursion=np.sqrt(np.max(np.sum(angle**2, axis=-1), axis=-1)),
    )


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
    phase = np.pi * np.outer(HARMONICS, np.arange(count) + 0.5) / count
    transform = np.einsum("kt,...tc->...kc", np.sqrt(2 / count) * np.cos(phase), residual)
    power = np.mean(transform**2, axis=-1)
    walk = 1.0 / HARMONICS**2
    centred = walk - walk.mean()
    slope = np.clip(power @ centred / (centred @ centred), 0.0, None)
    intercept = power.mean(axis=-1) - slope * walk.mean()
    only_walk = power @ walk / (walk @ walk)
    at_first = np.where(intercept >= 0, intercept + slope, only_walk)
    return 12 * at_first / (count * duration**2)


def _trend(x: Array) -> Array:
    time = np.arange(x.shape[-2]) - (x.shape[-2] - 1) / 2
    return np.einsum("t,...tk->...k", time, x) / max(time @ time, 1.0)


def _without_trend(x: Array) -> Array:
    time = np.arange(x.shape[-2]) - (x.shape[-2] - 1) / 2
    return x - x.mean(axis=-2, keepdims=True) - time[:, None] * _trend(x)[..., None, :]


def still_segments(gyro_b: Array, *, rate_hz: float, shortest: float = 5.0) -> list[tuple[float, float]]:
    """Segments in which the unit stood still, by limits from the recording's own noise.

    Parameters
    ----------
    gyro_b : ndarray, shape (n, 3)
        Angular rate, rad/s.
    rate_hz : float
        Sample rate, Hz.
    shortest : float
        Segments shorter than this, s, are left out.

    Returns
    -------
    list of (start, end)
        Times in s. A block of about 0.5 s moves where its mean rate is further from the
        quiet level than 8 sigma of the quieter blocks' own noise plus twice Earth rate; the
        blocks beside it are left out too, since a turn may begin anywhere in them.
    """
    size = max(1, round(0.5 * rate_hz))
    rate = block_means(gyro_b, size)
    if len(rate) < 4:
        return [(0.0, len(gyro_b) / rate_hz)]
    distance, limit = _distance_from_quiet(rate)
    moving = distance > limit
    beside = moving.copy()
    beside[1:] |= moving[:-1]
    beside[:-1] |= moving[1:]
    still = np.concatenate([[False], ~beside, [False]])
    starts, ends = np.flatnonzero(still[1:] & ~still[:-1]), np.flatnonzero(~still[1:] & still[:-1])
    seconds = size / rate_hz
    last = len(gyro_b) / rate_hz
    segments = [
        (start * seconds, last if end == len(rate) else end * seconds) for start, end in zip(starts, ends, strict=True)
    ]
    return [segment for segment in segments if segment[1] - segment[0] >= shortest]


def _distance_from_quiet(rate: Array) -> tuple[Array, float]:
    """Distance of each block's rate from the quiet level, rad/s, and the limit for standing still."""
    step = np.linalg.norm(np.diff(rate, axis=0), axis=1) / sqrt(2)
    # The quieter half of the steps: their median is that of noise even where half the record moves.
    noise = np.median(np.sort(step)[: max(2, len(step) // 2)])
    order = np.argsort(np.concatenate([step, step[-1:]]))
    centre = np.median(rate[order[: max(2, len(rate) // 2)]], axis=0)
    distance = np.linalg.norm(rate - centre, axis=1)
    # 8 sigma of noise, and what Earth rate itself can change by when the unit is turned over.
    return distance, float(8 * noise + 2 * EARTH_RATE)
