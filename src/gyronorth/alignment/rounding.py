"""Rounding of the samples: a rate that is rounded far above its noise has a mean that is wrong by a part of the step.

Of a constant rate with normal noise of standard deviation s, rounded to steps of q, the mean is off by the series over
k of q / (pi k) exp(-2 (pi k s / q)^2) sin(2 pi k rate / q), up to sign (Widrow and Kollar, "Quantization Noise", 2008,
ch. 9): nothing from s = q / 2 on, q / sqrt(12) root mean square without noise. A unit that carries the rest of each
rounding over to the next sample (increments of angle) is not off: its means over longer times scatter by its noise
alone.
"""

from __future__ import annotations

from functools import lru_cache
from math import erf

import numpy as np

from gyronorth.arrays import Array
from gyronorth.conditioning import block_means

#: Samples that are looked at, and those of a block.
SAMPLES, BLOCK = 4096, 16
#: Share of samples that equal the one before, from which an output may be coarse.
REPEATED = 0.1
#: Variance of block means times their length, over that of samples, below which the rest is carried over.
CARRIED = 0.75
#: Steps below which a rate is rounded by its number format alone, rad/s.
LEAST = 1e-15
#: Share of gravity from which an axis shows no tilt.
UPRIGHT = 0.9
#: Terms of the series.
TERMS = 20


def rounding_bias(gyro_b: Array) -> float:
    """Root mean square error of a mean rate by rounding of its samples (n, 3), rad/s; of the axis where it is largest.

    0 where the samples are finer than their noise, or carry what rounding leaves over.
    """
    x = gyro_b[:SAMPLES]
    if len(x) < 3 * BLOCK:
        return 0.0
    change = np.abs(np.diff(x, axis=0))
    return max((_of_axis(x[:, k], change[:, k]) for k in range(3)), default=0.0)


def rounding_variance(vector_b: Array) -> Array:
    """Square of `rounding_bias` of each of the recordings (..., n, 3), in the square of their unit, shape (...)."""
    first = vector_b[..., :SAMPLES, :]
    repeated = np.mean(first[..., 1:, :] == first[..., :-1, :], axis=-2) if first.shape[-2] > 1 else np.zeros(3)
    found = np.zeros(vector_b.shape[:-2])
    for index in np.argwhere(np.any(repeated >= REPEATED, axis=-1) & np.ones(found.shape, dtype=bool)):
        found[tuple(index)] = rounding_bias(first[tuple(index)]) ** 2
    return found


def rounding_of_tilt(accel_b: Array) -> Array:
    """Root mean square error of the tilt by rounding of the specific force (..., n, 3), rad, shape (...).

    Infinite where an axis that gravity does not fill never changes: its step may be of any size.
    """
    first = accel_b[..., :SAMPLES, :]
    mean = first.mean(axis=-2)
    gravity: Array = np.maximum(np.linalg.norm(mean, axis=-1), np.finfo(float).tiny)
    still = np.all(first == first[..., :1, :], axis=-2) & (np.abs(mean) < UPRIGHT * gravity[..., None])
    return np.where(np.any(still, axis=-1), np.inf, np.sqrt(rounding_variance(accel_b)) / gravity)


def _of_axis(x: Array, change: Array) -> float:
    moved = change > 0
    if moved.all() or np.mean(~moved) < REPEATED or not moved.any():
        return 0.0
    step = float(change[moved].min())
    if step < LEAST:
        return 0.0
    variance, later = (
        float(np.mean(np.diff(block_means(x[:, None], size), n=2, axis=0) ** 2)) / 6 for size in (1, BLOCK)
    )
    if later * BLOCK < CARRIED * variance:
        return 0.0
    squared = _noise(variance / step**2, float(np.mean(x)) / step) ** 2
    k = np.arange(1, TERMS + 1)
    return float(step * np.sqrt(np.sum(np.exp(-4 * np.pi**2 * k**2 * squared) / (2 * np.pi**2 * k**2))))


def _noise(variance: float, mean: float) -> float:
    """Standard deviation of the noise before rounding, from variance and mean after it, all in steps."""
    noise, means, variances = _rounded()
    off = (means - mean + 0.5) % 1.0 - 0.5
    return float(noise[np.argmin(np.min(off**2 + (variances - variance) ** 2, axis=1))])


@lru_cache(maxsize=1)
def _rounded() -> tuple[Array, Array, Array]:
    """Mean and variance (s, m) of a normal law of standard deviation (s,) and mean (m,) rounded to whole steps."""
    noise, mean = np.linspace(0.02, 0.7, 69), np.linspace(-0.5, 0.5, 41)
    edge = (np.arange(-5, 5) + 0.5 - mean[:, None]) / noise[:, None, None] / np.sqrt(2)
    below = np.array([erf(float(value)) for value in edge.ravel()]).reshape(edge.shape) / 2 + 0.5
    share, value = np.diff(below, axis=2), np.arange(-4, 5)
    first = share @ value
    return noise, first, share @ value**2 - first**2
