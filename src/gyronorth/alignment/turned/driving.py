"""Straight driving, which a gyro takes for standing still: seen by the accelerometer.

A vehicle that drives straight at a constant speed senses gravity and Earth rate as one that stands, but for its speed
over the ground. What parts the two is how it came there: it sped up or braked.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gyronorth.arrays import Array, median, robust_noise
from gyronorth.conditioning import block_means

#: The accelerometer is looked at in means over this time, s: a vehicle rocks within it, and speeds up for longer.
STEP = 1.0
#: A vehicle speeds up or brakes where its specific force is off its usual one by this much, m/s^2, ...
SPEEDING = 0.15
#: ... and by so many times its usual scatter.
SCATTERS = 6.0
#: It drives where it has gained this speed against its stillest part, m/s.
DRIVING = 1.0


def standing(accel_b: Array, stretches: list[tuple[int, int]], *, rate_hz: float) -> list[tuple[int, int]]:
    """The parts of stretches without rotation, as samples [first, last), in which a vehicle also stands.

    A stretch is parted where the specific force shows that the vehicle speeds up or brakes. Of the parts the one with
    the least vibration stands; another drives if the speed gained between the two exceeds `DRIVING`.
    """
    size = max(1, round(STEP * rate_hz))
    return [part for stretch in stretches for part in _parts(accel_b, stretch, size, rate_hz)]


def _parts(accel_b: Array, stretch: tuple[int, int], size: int, rate_hz: float) -> list[tuple[int, int]]:
    first, last = stretch
    mean = block_means(accel_b[first:last], size)
    if len(mean) < 3:
        return [stretch]
    usual = median(mean, axis=0)
    off = mean - usual
    scatter = float(robust_noise(mean))
    speeding = (np.abs(off) > max(SPEEDING, SCATTERS * scatter)).any(axis=1)
    if not speeding.any():
        return [stretch]
    wide = np.convolve(speeding, np.ones(3), mode="same") > 0.5  # a step on each side: it begins and ends within one
    edges = np.flatnonzero(np.diff(np.concatenate([[True], wide, [True]]).astype(np.int8)))
    parts = [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    if not parts:
        return []
    speed: Array = np.cumsum(np.where(wide[:, None], off, 0.0), axis=0) * size / rate_hz
    at = np.array([speed[a] for a, _ in parts])
    noise = [_vibration(accel_b[first + a * size : first + b * size]) for a, b in parts]
    gained = np.linalg.norm(at - at[int(np.argmin(noise))], axis=1)
    ends: NDArray[np.int64] = np.array([last if b == len(mean) else first + b * size for _, b in parts])
    return [
        (first + a * size, int(end)) for (a, _), end, gain in zip(parts, ends, gained, strict=True) if gain <= DRIVING
    ]


def _vibration(accel_b: Array) -> float:
    """Scatter from sample to sample, m/s^2."""
    return float(np.sqrt(np.mean(np.diff(accel_b, axis=0) ** 2))) if len(accel_b) > 1 else np.inf
