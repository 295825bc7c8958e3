"""Error propagation: from a sensor's error terms to the heading sigma, its interval and its floor.

Everything horizontal is expressed as a variance of the levelled mean rate per axis,
(rad/s)^2; dividing by the horizontal Earth rate turns it into heading. The formulas are
derived in docs/theory/uncertainty.md, section "Uncertainty".
"""

from __future__ import annotations

from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from gyronorth.arrays import Array
from gyronorth.earth import EARTH_RATE, normal_gravity
from gyronorth.sensor import Sensor, TriadErrors
from gyronorth.sensor.gauss_markov import Weighting
from gyronorth.sensor.law import NoiseLaw

#: 97.5 % points of the normal law and of Student's t with 2 degrees of freedom.
NORMAL_975 = 1.959964
STUDENT2_975 = 4.302653
#: The same with 1 and with 14 degrees of freedom.
STUDENT1_975, STUDENT14_975 = 12.706205, 2.144787
#: Root mean square error of a heading that is not known at all, rad.
SIGMA_UNKNOWN = np.pi / np.sqrt(3)


def rate_variance(errors: TriadErrors, duration: ArrayLike, *, weighting: Weighting = "mean") -> dict[str, Array]:
    """Variance of one axis of a weighted mean over `duration` s, by part, (unit u)^2.

    Parts: "noise" (white; quantisation, whose integral is bounded), "drift" (in-run flicker
    and rate random walk from switch-on), "turn_on_bias". Under "ramp" the result is that of a
    slope, u^2/s^2, and a constant bias drops out.
    """
    duration = np.asarray(duration, dtype=float)
    constant = 0.0 if weighting == "ramp" else 1.0
    parts = NoiseLaw(errors).mean_variance(duration, weighting=weighting)
    return {**parts, "turn_on_bias": constant * errors.turn_on_bias**2 * np.ones_like(duration)}


def horizontal_rate_variance(
    sensor: Sensor, *, latitude: ArrayLike, duration: ArrayLike, method: Literal["mean", "inertial"] = "mean"
) -> dict[str, Array]:
    """Variance of a levelled horizontal rate component, by part of sigma, (rad/s)^2.

    Parameters
    ----------
    sensor : Sensor
        Error terms.
    latitude : array_like
        rad; broadcasts with `duration`.
    duration : array_like
        s.
    method : {"mean", "inertial"}
        Plain averaging, or tracing gravity in an inertial frame.

    Returns
    -------
    dict of ndarray
        noise, drift, turn_on_bias, levelling.

    Notes
    -----
    A levelling error e about the north axis turns the vertical Earth rate into e Omega sin(lat).
    Scale factor, misalignment and g-sensitivity are constant in one pose and stand with the
    turn-on bias. In an inertial frame the accelerometer's noise and drift enter as a slope of
    the direction of gravity, in rad/s.
    """
    latitude, duration = np.broadcast_arrays(np.asarray(latitude, dtype=float), np.asarray(duration, dtype=float))
    gravity = normal_gravity(latitude)
    gyro = rate_variance(sensor.gyro, duration, weighting="mean" if method == "mean" else "slope")
    tilt = tilt_variance(sensor, latitude=latitude, duration=duration)
    constant = (sensor.g_sensitivity * gravity) ** 2 + (
        sensor.gyro.scale_factor**2 + sensor.gyro.misalignment**2
    ) * EARTH_RATE**2
    parts = {
        "noise": gyro["noise"],
        "drift": gyro["drift"],
        "turn_on_bias": gyro["turn_on_bias"] + constant,
        "levelling": tilt * (EARTH_RATE * np.sin(latitude)) ** 2,
    }
    if method == "inertial":
        slope = rate_variance(sensor.accel, duration, weighting="ramp")
        parts["noise"] = parts["noise"] + slope["noise"] / gravity**2
        parts["drift"] = parts["drift"] + slope["drift"] / gravity**2
    return parts


def tilt_variance(sensor: Sensor, *, latitude: ArrayLike, duration: ArrayLike) -> Array:
    """Variance of the direction of gravity in the body, about each of two axes, rad^2."""
    level = rate_variance(sensor.accel, np.asarray(duration, dtype=float))
    noise = level["noise"] + level["drift"] + level["turn_on_bias"]
    return np.asarray(noise / normal_gravity(latitude) ** 2 + sensor.accel.misalignment**2)


def heading_sigma_parts(
    sensor: Sensor, *, latitude: ArrayLike, duration: ArrayLike, method: Literal["mean", "inertial"] = "mean"
) -> dict[str, Array]:
    """Expected heading sigma by part, rad, to first order: root variance / (Omega cos lat).

    The root sum square of the parts is the sigma; see `horizontal_rate_variance`.
    """
    signal = EARTH_RATE * np.cos(np.asarray(latitude, dtype=float))
    parts = horizontal_rate_variance(sensor, latitude=latitude, duration=duration, method=method)
    return {name: np.sqrt(variance) / signal for name, variance in parts.items()}


def cramer_rao_floor(sensor: Sensor, *, latitude: ArrayLike, duration: ArrayLike) -> Array:
    """Least possible heading sigma, rad, of one still pose: white noise alone, or with the bias.

    For white noise and a random constant bias the mean is sufficient, so the bound is
    sqrt(N^2 / T + turn-on variance) / (Omega cos lat); in-run drift only adds to it.
    """
    signal = EARTH_RATE * np.cos(np.asarray(latitude, dtype=float))
    duration = np.asarray(duration, dtype=float)
    return np.sqrt(sensor.gyro.white**2 / duration + sensor.gyro.turn_on_bias**2) / signal


def von_mises(concentration: ArrayLike) -> tuple[Array, Array]:
    """Root mean square error and half-width of the 95 % interval of a von Mises law, rad.

    Parameters
    ----------
    concentration : array_like
        kappa; the heading's posterior density is proportional to exp(kappa cos(error)).

    Notes
    -----
    With a horizontal rate h measured with isotropic Gaussian error of variance s^2 per axis
    and a true one of known size H and any heading, the posterior of the heading is von Mises
    with kappa = |h| H / s^2 (Mardia and Jupp, "Directional Statistics", 2000, sec. 3.5.4).
    For kappa -> inf sigma is 1 / sqrt(kappa); for kappa -> 0 it is pi / sqrt(3).
    """
    kappa = np.asarray(concentration, dtype=float)
    grid = np.geomspace(1e-4, 1e6, 300)
    # The table holds sigma sqrt(kappa) and half-width sqrt(kappa), smooth in ln kappa.
    held = np.clip(kappa, grid[0], grid[-1])
    first, last = 0, len(grid)
    if kappa.size == 1 and np.isfinite(kappa).all():  # a heading alone needs two rows of it
        first = min(max(int(np.searchsorted(grid, held.item(), side="right")) - 1, 0), len(grid) - 2)
        last = first + 2
    at, knots = np.log(held), np.log(grid[first:last])
    rms, half = _von_mises_rows(first, last)
    scale = 1 / np.sqrt(np.where(kappa > grid[-1], kappa, held))
    return np.interp(at, knots, rms) * scale, np.interp(at, knots, half) * scale


@lru_cache(maxsize=64)
def _von_mises_rows(first: int, last: int) -> tuple[Array, Array]:
    """Rows of the table of `von_mises`."""
    grid = np.geomspace(1e-4, 1e6, 300)[first:last]
    # Quadrature over the part of the circle that holds the mass, mirror symmetric.
    limit = np.minimum(np.pi, 9 / np.sqrt(grid))[:, None]
    angle = limit * (np.arange(1500) + 0.5) / 1500
    weight = np.exp(grid[:, None] * (np.cos(angle) - 1))
    weight /= weight.sum(axis=1, keepdims=True)
    rms = np.sqrt((weight * angle**2).sum(axis=1))
    cumulative = np.cumsum(weight, axis=1)
    step = limit[:, 0] / 1500
    half = np.array([np.interp(0.95, c, a) for c, a in zip(cumulative, angle, strict=True)]) + step / 2
    return rms * np.sqrt(grid), half * np.sqrt(grid)
