"""Angles on the circle, and the field's rate units in SI."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: One degree per hour, rad/s.
DEG_PER_HOUR = np.pi / 180 / 3600
#: One degree per square root of an hour, rad/sqrt(s).
DEG_PER_SQRT_HOUR = np.pi / 180 / 60


def wrap(angle: ArrayLike) -> NDArray[np.float64]:
    """Wrap angles to [-pi, pi) rad."""
    return (np.asarray(angle, dtype=float) + np.pi) % (2 * np.pi) - np.pi


def wrap_heading(angle: ArrayLike) -> NDArray[np.float64]:
    """Wrap angles to [0, 2 pi) rad; a tiny negative angle gives 0, never 2 pi."""
    wrapped = np.asarray(angle, dtype=float) % (2 * np.pi)
    return np.where(wrapped >= 2 * np.pi, 0.0, wrapped)


def angle_error(estimate: ArrayLike, truth: ArrayLike) -> NDArray[np.float64]:
    """Shortest signed way from `truth` to `estimate`, [-pi, pi) rad."""
    return wrap(np.asarray(estimate, dtype=float) - np.asarray(truth, dtype=float))


def mean_direction(angle: ArrayLike, weight: ArrayLike) -> NDArray[np.float64]:
    """Mean direction in [-pi, pi] rad of angles (n,) with weights (..., n), shape (...)."""
    angle, weight = np.asarray(angle, dtype=float), np.asarray(weight, dtype=float)
    return np.arctan2(weight @ np.sin(angle), weight @ np.cos(angle))


def circular_mean(angle: ArrayLike, *, axis: int | None = None) -> NDArray[np.float64]:
    """Mean direction in [0, 2 pi) rad (Mardia and Jupp, "Directional Statistics", 2000, eq. 2.2.4)."""
    angle = np.asarray(angle, dtype=float)
    return wrap_heading(np.arctan2(np.sin(angle).mean(axis), np.cos(angle).mean(axis)))


def cyclic_rmse(error: ArrayLike, *, axis: int | None = None) -> NDArray[np.float64]:
    """Cyclic root mean square error, rad (the paper's eq:25, CRMSE)."""
    return np.sqrt(np.mean(wrap(error) ** 2, axis=axis))
