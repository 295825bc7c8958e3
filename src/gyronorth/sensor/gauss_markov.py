"""A stationary first-order Gauss-Markov process: variance of weighted means of it, and its Allan variance."""

from __future__ import annotations

from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from gyronorth.arrays import Array

#: How samples are weighted: "mean" evenly, "slope" as the slope of a straight line through
#: the integral (parabola, for rates), "ramp" as the slope of a line through the samples.
Weighting = Literal["mean", "slope", "ramp"]


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


def gauss_markov_allan_variance(tau: ArrayLike, time_constant: ArrayLike) -> Array:
    """Allan variance of a stationary Gauss-Markov process of unit variance; shapes broadcast.

    With r = tau / time_constant: (2 r - 3 + 4 exp(-r) - exp(-2 r)) / r^2, which follows from
    sigma^2(tau) = 2 V(tau) - 2 V(2 tau) and the variance of the mean over tau,
    V(tau) = 2 (r - 1 + exp(-r)) / r^2.
    """
    r = np.asarray(tau, dtype=float) / np.asarray(time_constant, dtype=float)
    small = r < 0.01  # the closed form loses digits there; the series is good to 1e-9
    s = np.where(small, 1.0, r)
    closed = (2 * s - 3 + 4 * np.exp(-s) - np.exp(-2 * s)) / s**2
    return np.where(small, r * (2 / 3 - r * (1 / 2 - r * (7 / 30 - r / 12))), closed)


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
    """Nodes and weights of Gauss and Legendre on [0, 1], of 32 points, exact to 1e-15 for a <= 20.

    By eigenvalues (Golub and Welsch, 1969): `numpy.polynomial` takes as long to load as a heading takes.
    """
    k = np.arange(1, 32)
    beside = k / np.sqrt(4.0 * k**2 - 1)
    node, vector = np.linalg.eigh(np.diag(beside, 1) + np.diag(beside, -1))
    return (node + 1) / 2, vector[0] ** 2
