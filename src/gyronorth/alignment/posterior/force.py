"""What the accelerometer of the posterior's mixture does by itself: its noise, and drift beyond its profile."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from gyronorth.alignment.posterior.blocks import COUNT
from gyronorth.arrays import Array
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.sensor import TriadErrors
from gyronorth.sensor.law import NoiseLaw

#: Drift of the accelerometer beyond its noise, over its constant and in-run bias: sizes of one that goes on or settles
#: as a tilt does and of one that wanders, at the end, and their probability.
FORCES, WANDERS, FORCE = (0.3, 1.0, 3.0, 10.0), (0.1, 0.3, 1.0), 0.12
#: Time constants of one that settles, over the duration, from and to.
FORCE_TIMES = ((0.08, 0.25), (0.25, 0.8), (0.8, 100.0))


@lru_cache(maxsize=64)
def force_noise(accel: TriadErrors, seconds: float) -> Array:
    """Covariance of the tilt that the accelerometer sees without moving, block means, rad^2."""
    edges, level = np.arange(COUNT + 1), replace(accel, turn_on_bias=0.0)
    return NoiseLaw(level).mean_covariance(edges[:-1], edges[1:], rate_hz=1 / seconds) / STANDARD_GRAVITY**2


@lru_cache(maxsize=64)
def force_difference(accel: TriadErrors, seconds: float, blocks: int) -> float:
    """Mean square of the second difference of that tilt over means of so many blocks, rad^2."""
    means: Array = np.asarray(np.kron(np.eye(COUNT // blocks), np.full(blocks, 1 / blocks)), dtype=float)
    difference: Array = np.asarray(np.diff(means, n=2, axis=0), dtype=float)
    return float(np.trace(difference @ force_noise(accel, seconds) @ difference.T)) / len(difference)


@lru_cache(maxsize=8)
def forces_of(accel: TriadErrors) -> tuple[Array, Array]:
    """Sizes at the end, rad, and covariances of block means of what an accelerometer may drift, the first nothing."""
    edges: Array = np.asarray(np.arange(COUNT + 1) / COUNT, dtype=float)
    time = (edges[:-1] + edges[1:]) / 2
    laws = [(size, np.minimum(time[:, None], time) - np.eye(COUNT) / COUNT / 6) for size in WANDERS]
    for times in FORCE_TIMES:
        tau = np.geomspace(*times, 8)[:, None]
        mean = (1 + tau * np.diff(np.exp(-edges / tau), axis=1) * COUNT) / -np.expm1(-1 / tau)
        laws += [(size, mean.T @ mean / len(tau)) for size in FORCES]
    sizes = np.array([0.0, *(size for size, _ in laws)]) * force_bias(accel)
    unit = np.array([np.zeros((COUNT, COUNT)), *(covariance for _, covariance in laws)])
    return sizes, sizes[:, None, None] ** 2 * unit


def force_bias(accel: TriadErrors) -> float:
    """Scale by which an accelerometer's drift is tried, rad: its constant and in-run bias, or a floor without any."""
    return max(float(np.hypot(accel.turn_on_bias, accel.flicker)) / STANDARD_GRAVITY, 1e-6)
