"""Error propagation: from a sensor's error terms to the heading sigma, its interval and its floor.

Everything horizontal is expressed as a variance of the levelled mean rate per axis,
(rad/s)^2; dividing by the horizontal Earth rate turns it into heading. The formulas are
derived in docs/theory.md, section "Uncertainty".
"""

from __future__ import annotations

from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from gyronorth.arrays import Array
from gyronorth.earth import EARTH_RATE, normal_gravity
from gyronorth.sensor import Sensor, TriadErrors, flicker_components

#: How samples are weighted: "mean" evenly, "slope" as the slope of a straight line through
#: the integral (parabola, for rates), "ramp" as the slope of a line through the samples.
Weighting = Literal["mean", "slope", "ramp"]

#: 97.5 % points of the normal law and of Student's t with 2 degrees of freedom.
NORMAL_975 = 1.959964
STUDENT2_975 = 4.302653
#: The same with 1 and with 14 degrees of freedom.
STUDENT1_975, STUDENT14_975 = 12.706205, 2.144787
#: Root mean square error of a heading that is not known at all, rad.
SIGMA_UNKNOWN = np.pi / np.sqrt(3)


def gauss_markov_variance(variance: ArrayLike, tau: ArrayLike, duration: ArrayLike, weighting: Weighting) -> Array:
    """Variance of a weighted mean over `duration` of a stationary Gauss-Markov process.

    With a = duration / tau, exp(-a u) is averaged over the autocorrelation of the weights:

    - "mean": 2 v / a^2 (a - 1 + exp(-a)), that is 2 v tau / T^2 (T - tau (1 - exp(-T / tau)));
    - "slope" (weights 6 x (1 - x)): 2.4 v times the integral of (1 - 5 u^2 + 5 u^3 - u^5) exp(-a u);
    - "ramp" (weights 12 (x - 1/2) / T): 24 v / T^2 times the integral of (1 - 3 u + 2 u^3) exp(-a u).
    """
    duration = np.asarray(duration, dtype=float)
    a = duration / np.asarray(tau, dtype=float)
    if weighting == "mean":
        return 2 * np.asarray(variance) * _polynomial_exponential((1, -1), a)
    if weighting == "slope":
        return 2.4 * np.asarray(variance) * _polynomial_exponential((1, 0, -5, 5, 0, -1), a)
    return 24 * np.asarray(variance) / duration**2 * _polynomial_exponential((1, -3, 0, 2), a)


def _polynomial_exponential(coefficients: tuple[int, ...], a: Array) -> Array:
    """Integral over u in [0, 1] of sum c_k u^k times exp(-a u), stable for every a > 0."""
    node, weight = _legendre()
    small = np.minimum(a, 20.0)[..., None]
    quadrature = (np.polyval(coefficients[::-1], node) * np.exp(-small * node)) @ weight
    large = np.maximum(a, 20.0)
    end = np.exp(-large)
    moment = (1 - end) / large
    recursion = coefficients[0] * moment
    for power, coefficient in enumerate(coefficients[1:], start=1):
        moment = (power * moment - end) / large
        recursion = recursion + coefficient * moment
    return np.where(a <= 20, quadrature, recursion)


@lru_cache
def _legendre() -> tuple[Array, Array]:
    node, weight = np.polynomial.legendre.leggauss(32)  # exact to 1e-15 for a <= 20
    return (node + 1) / 2, weight / 2


def rate_variance(errors: TriadErrors, duration: ArrayLike, *, weighting: Weighting = "mean") -> dict[str, Array]:
    """Variance of one axis of a weighted mean over `duration` s, by part, (unit u)^2.

    Parts: "noise" (white; quantisation, whose integral is bounded), "drift" (in-run flicker
    and rate random walk from switch-on), "turn_on_bias". Under "ramp" the result is that of a
    slope, u^2/s^2, and a constant bias drops out.
    """
    duration = np.asarray(duration, dtype=float)
    white, walk, quantum, constant = {
        "mean": (1.0, 1 / 3, 1 / 6, 1.0),
        "slope": (1.2, 13 / 35, 0.0, 1.0),
        "ramp": (12.0, 6 / 5, 0.0, 0.0),
    }[weighting]
    per_second = duration ** (-3.0) if weighting == "ramp" else 1 / duration
    walk_power = 1 / duration if weighting == "ramp" else duration
    variance, tau = flicker_components(errors)
    flicker = gauss_markov_variance(variance, tau, duration[..., None], weighting).sum(-1)
    return {
        "noise": errors.white**2 * white * per_second + quantum * (errors.quantisation / duration) ** 2,
        "drift": flicker + errors.random_walk**2 * walk * walk_power,
        "turn_on_bias": constant * errors.turn_on_bias**2 * np.ones_like(duration),
    }


def mean_rate_variance(errors: TriadErrors, duration: ArrayLike) -> dict[str, Array]:
    """Variance of the plain mean of one axis over `duration` s, by part, u^2."""
    return rate_variance(errors, duration, weighting="mean")


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
    level = rate_variance(sensor.accel, duration)
    tilt = (level["noise"] + level["drift"] + level["turn_on_bias"]) / gravity**2
    constant = (sensor.g_sensitivity * gravity) ** 2 + (
        sensor.gyro.scale_factor**2 + sensor.gyro.misalignment**2
    ) * EARTH_RATE**2
    parts = {
        "noise": gyro["noise"],
        "drift": gyro["drift"],
        "turn_on_bias": gyro["turn_on_bias"] + constant,
        "levelling": (tilt + sensor.accel.misalignment**2) * (EARTH_RATE * np.sin(latitude)) ** 2,
    }
    if method == "inertial":
        slope = rate_variance(sensor.accel, duration, weighting="ramp")
        parts["noise"] = parts["noise"] + slope["noise"] / gravity**2
        parts["drift"] = parts["drift"] + slope["drift"] / gravity**2
    return parts


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
    grid, rms, half = _von_mises_table()
    # The table holds sigma sqrt(kappa) and half-width sqrt(kappa), smooth in ln kappa.
    held = np.clip(kappa, grid[0], grid[-1])
    at, knots = np.log(held), np.log(grid)
    scale = 1 / np.sqrt(np.where(kappa > grid[-1], kappa, held))
    return np.interp(at, knots, rms) * scale, np.interp(at, knots, half) * scale


@lru_cache
def _von_mises_table() -> tuple[Array, Array, Array]:
    grid = np.geomspace(1e-4, 1e6, 300)
    # Quadrature over the part of the circle that holds the mass, mirror symmetric.
    limit = np.minimum(np.pi, 9 / np.sqrt(grid))[:, None]
    angle = limit * (np.arange(1500) + 0.5) / 1500
    weight = np.exp(grid[:, None] * (np.cos(angle) - 1))
    weight /= weight.sum(axis=1, keepdims=True)
    rms = np.sqrt((weight * angle**2).sum(axis=1))
    cumulative = np.cumsum(weight, axis=1)
    step = limit[:, 0] / 1500
    half = np.array([np.interp(0.95, c, a) for c, a in zip(cumulative, angle, strict=True)]) + step / 2
    return grid, rms * np.sqrt(grid), half * np.sqrt(grid)


@lru_cache(maxsize=64)
def bent_angle_variance(errors: TriadErrors, duration: float) -> tuple[float, float]:
    """What the integrated rate of a unit at rest strays from its trend, from noise and drift alone.

    Parameters
    ----------
    errors : TriadErrors
        Error terms of the gyro.
    duration : float
        Length of the record, s.

    Returns
    -------
    mean, limit : float
        Expected variance about the fitted line, rad^2, as `conditioning.sway` measures it
        (two axes pooled), and its 3.29 sigma limit.

    Notes
    -----
    With the covariance S of the means of 100 blocks (white N^2 / block, Gauss-Markov in closed form,
    random walk K^2 min(t, t')), L the integration and P the projection away from a line,
    the expectation is tr(P L S L' P) / blocks and the variance of two pooled axes
    tr((P L S L' P)^2) / blocks^2.
    """
    blocks, block = 100, duration / 100
    lag = np.abs(np.subtract.outer(np.arange(blocks), np.arange(blocks)))
    covariance = errors.white**2 / block * np.eye(blocks)
    for variance, tau in zip(*flicker_components(errors), strict=True):
        a = block / tau
        covariance += variance * np.where(
            lag == 0, 2 / a**2 * (a - 1 + np.exp(-a)), (-np.expm1(-a) / a) ** 2 * np.exp(-(np.maximum(lag, 1) - 1) * a)
        )
    time = (np.arange(blocks) + 0.5) * block
    covariance += errors.random_walk**2 * np.minimum.outer(time, time)
    integrate = block * (np.tri(blocks) - 0.5 * np.eye(blocks))
    line = np.stack([np.ones(blocks), time], axis=1)
    orthonormal, _ = np.linalg.qr(line)
    bend = integrate - orthonormal @ (orthonormal.T @ integrate)
    strayed = bend @ covariance @ bend.T
    mean = float(np.trace(strayed) / blocks)
    spread = float(np.sqrt(np.sum(strayed**2)) / blocks)
    return mean, mean + 3.29 * spread
