"""The noise law of a triad: the stochastic error terms, each with its name, units and what it does.

One `Term` says all of one error term: how its JSON keys and units read, and what it adds to the covariance of means,
to the variance of a weighted mean, to the Allan variance and to the spectrum. `NoiseLaw` sums over `TERMS`. A new
term is one more entry there, and a field of `TriadErrors`; what draws it stands in `gyronorth.sensor.drawing`.

Samples are means over their intervals throughout.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR
from gyronorth.arrays import Array
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.sensor.model import TriadErrors, flicker_components

#: How samples are weighted: "mean" evenly, "slope" as the slope of a straight line through
#: the integral (parabola, for rates), "ramp" as the slope of a line through the samples.
Weighting = Literal["mean", "slope", "ramp"]
#: What an error term counts as in a heading's error budget.
Part = Literal["noise", "drift"]

MILLI_G = 1e-3 * STANDARD_GRAVITY


@dataclass(frozen=True)
class TermUnit:
    """How a term is called and written for one kind of triad."""

    key: str  # in profiles and in the JSON of `allan`
    words: str
    unit: str
    one: float  # one unit in SI


@dataclass(frozen=True)
class Term:
    """One stochastic error term; every function gives what a triad's coefficient makes, in squares of its unit u."""

    field: str  # of TriadErrors
    name: str  # of `allan.Identification`
    part: Part
    gyro: TermUnit
    accel: TermUnit
    #: (errors, first s, last s, 1 / rate s) -> (n, n): covariance of means over the ranges
    covariance: Callable[[TriadErrors, Array, Array, float], Array]
    #: (errors, duration s, weighting) -> variance of a weighted mean
    mean: Callable[[TriadErrors, Array, Weighting], Array]
    #: (errors, tau s) -> Allan variance
    allan: Callable[[TriadErrors, Array], Array]
    #: (errors, f Hz, rate Hz) -> two-sided spectrum
    spectrum: Callable[[TriadErrors, Array, float], Array]


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
    node, weight = np.polynomial.legendre.leggauss(32)  # exact to 1e-15 for a <= 20
    return (node + 1) / 2, weight / 2


def _white_covariance(errors: TriadErrors, first: Array, last: Array, _: float) -> Array:
    return np.diag(errors.white**2 / (last - first))


def _white_mean(errors: TriadErrors, duration: Array, weighting: Weighting) -> Array:
    factor = {"mean": 1.0, "slope": 1.2, "ramp": 12.0}[weighting]
    return errors.white**2 * factor * (duration ** (-3.0) if weighting == "ramp" else 1 / duration)


def _quantised_covariance(errors: TriadErrors, first: Array, last: Array, interval: float) -> Array:
    length, same = last - first, np.eye(len(first), dtype=bool)
    edge = np.isclose(last[:, None], first, rtol=0, atol=0.1 * interval).astype(float)
    return errors.quantisation**2 / 12 * (2 * same - edge - edge.T) / np.outer(length, length)


def _quantised_mean(errors: TriadErrors, duration: Array, weighting: Weighting) -> Array:
    return (1 / 6 if weighting == "mean" else 0.0) * (errors.quantisation / duration) ** 2


def _quantised_spectrum(errors: TriadErrors, f: Array, rate_hz: float) -> Array:
    return errors.quantisation**2 * 4 * np.sin(np.pi * f / rate_hz) ** 2 * rate_hz / 12  # Q^2 = q^2 / 12


def _flicker_covariance(errors: TriadErrors, first: Array, last: Array, _: float) -> Array:
    """Of a Gauss-Markov process of variance v, with a = T / tau and r = (1 - exp(-a)) / a for each range:
    v r_i r_j exp(-gap / tau) for two ranges and 2 v (a - 1 + exp(-a)) / a^2 for one
    (integrals of v exp(-|s - t| / tau)).
    """
    length, same = last - first, np.eye(len(first), dtype=bool)
    gap = np.maximum(np.maximum(first[None, :] - last[:, None], first[:, None] - last[None, :]), 0.0)
    total: Array = np.zeros(same.shape)
    for variance, tau in zip(*flicker_components(errors), strict=True):
        a = length / tau
        lost = -np.expm1(-a)
        across = np.outer(lost / a, lost / a) * np.exp(-gap / tau)
        total = total + np.asarray(variance * np.where(same, 2 * (a - lost) / a**2, across), dtype=float)
    return total


def _flicker_mean(errors: TriadErrors, duration: Array, weighting: Weighting) -> Array:
    variance, tau = flicker_components(errors)
    return gauss_markov_variance(variance, tau, duration[..., None], weighting).sum(-1)


def _flicker_allan(errors: TriadErrors, tau: Array) -> Array:
    variance, constant = flicker_components(errors)
    return gauss_markov_allan_variance(tau[..., None], constant) @ variance


def _flicker_spectrum(errors: TriadErrors, f: Array, _: float) -> Array:
    variance, constant = flicker_components(errors)
    return (2 * variance * constant / (1 + (2 * np.pi * f[..., None] * constant) ** 2)).sum(-1)


def _walk_covariance(errors: TriadErrors, first: Array, last: Array, _: float) -> Array:
    middle = (first + last) / 2
    walk = np.minimum(middle[:, None], middle[None, :])
    return errors.random_walk**2 * (walk - np.diag((last - first) / 6))


def _walk_mean(errors: TriadErrors, duration: Array, weighting: Weighting) -> Array:
    factor = {"mean": 1 / 3, "slope": 13 / 35, "ramp": 6 / 5}[weighting]
    return errors.random_walk**2 * factor * (1 / duration if weighting == "ramp" else duration)


#: Every stochastic term (IEEE Std 952-1997, annex C; flicker as the package makes it, `flicker_components`), in the
#: order in which `allan` fits them.
TERMS: tuple[Term, ...] = (
    Term(
        "quantisation",
        "quantisation",
        "noise",
        TermUnit("quantisation_arcsec", "quantisation", "arcsec", np.pi / 180 / 3600),
        TermUnit("quantisation_m_s", "quantisation", "m/s", 1.0),
        _quantised_covariance,
        _quantised_mean,
        lambda errors, tau: errors.quantisation**2 * 0.25 / tau**2,
        _quantised_spectrum,
    ),
    Term(
        "white",
        "angle_random_walk",
        "noise",
        TermUnit("angle_random_walk_deg_sqrt_h", "angle random walk", "deg/sqrt(h)", DEG_PER_SQRT_HOUR),
        TermUnit("velocity_random_walk_m_s_sqrt_h", "velocity random walk", "m/s/sqrt(h)", 1 / 60),
        _white_covariance,
        _white_mean,
        lambda errors, tau: errors.white**2 / tau,
        lambda errors, f, _: np.full_like(f, errors.white**2),
    ),
    Term(
        "flicker",
        "bias_instability",
        "drift",
        TermUnit("bias_instability_deg_h", "bias instability B", "deg/h", DEG_PER_HOUR),
        TermUnit("bias_instability_mg", "bias instability B", "mg", MILLI_G),
        _flicker_covariance,
        _flicker_mean,
        _flicker_allan,
        _flicker_spectrum,
    ),
    Term(
        "random_walk",
        "rate_random_walk",
        "drift",
        TermUnit("rate_random_walk_deg_h_sqrt_h", "rate random walk", "deg/h/sqrt(h)", DEG_PER_HOUR / 60),
        TermUnit("acceleration_random_walk_mg_sqrt_h", "acceleration random walk", "mg/sqrt(h)", MILLI_G / 60),
        _walk_covariance,
        _walk_mean,
        lambda errors, tau: errors.random_walk**2 * tau / 3,
        lambda errors, f, _: errors.random_walk**2 / (2 * np.pi * f) ** 2,
    ),
)


@dataclass(frozen=True)
class NoiseLaw:
    """What the stochastic terms of one axis of a triad do, in its unit u (rad/s or m/s^2). Without turn-on bias."""

    errors: TriadErrors

    def mean_covariance(
        self, first: ArrayLike, last: ArrayLike, *, rate_hz: float, white: bool = True, drift: bool = True
    ) -> Array:
        """Covariance of the mean errors over the sample ranges [first, last), shape (n, n), u^2.

        Exact for every term; a rate random walk starts at zero at sample 0. Ranges must not overlap. `white` and
        `drift` leave out the parts without and with memory.
        """
        begin, end = np.asarray(first) / rate_hz, np.asarray(last) / rate_hz
        wanted = [term for term in TERMS if (white if term.part == "noise" else drift)]
        total = np.zeros((len(begin), len(begin)))
        for term in wanted:
            if getattr(self.errors, term.field) > 0:
                total += term.covariance(self.errors, begin, end, 1 / rate_hz)
        return total

    def mean_variance(self, duration: ArrayLike, *, weighting: Weighting = "mean") -> dict[str, Array]:
        """Variance of a weighted mean over `duration` s by part of the error budget, u^2.

        "noise" is white noise and quantisation, whose integral is bounded; "drift" flicker and the random walk from
        switch-on. Under "ramp" the result is that of a slope, u^2/s^2.
        """
        duration = np.asarray(duration, dtype=float)
        if duration.ndim == 0:  # recordings of one sensor are often of one length
            noise, drift = _mean_variance_once(self.errors, float(duration), weighting)
        else:
            noise, drift = _mean_variance(self.errors, duration, weighting)
        return {"noise": noise, "drift": drift}

    def allan_variance(self, tau: ArrayLike) -> Array:
        """Allan variance at averaging times (k,), s, by term, shape (k, terms), u^2."""
        tau = np.asarray(tau, dtype=float)
        return np.stack([term.allan(self.errors, tau) for term in TERMS], axis=-1)

    def spectrum(self, f: ArrayLike, rate_hz: float) -> Array:
        """Two-sided spectrum at frequencies (k,), Hz, by term, shape (k, terms), u^2/Hz."""
        f = np.asarray(f, dtype=float)
        return np.stack([term.spectrum(self.errors, f, rate_hz) for term in TERMS], axis=-1)

    def detrended_angle_variance(self, duration: float) -> tuple[float, float]:
        """What the integrated rate of a unit at rest deviates from its trend.

        Parameters
        ----------
        duration : float
            Length of the record, s.

        Returns
        -------
        mean, limit : float
            Expected variance about the fitted line, rad^2, as `conditioning.sway` measures it
            (two axes pooled), and its 3.29 sigma limit.

        Notes
        -----
        With the covariance S of the means of 100 blocks (without quantisation), L the integration and P the projection
        away from a line, the expectation is tr(P L S L' P) / blocks and the variance of two pooled axes
        tr((P L S L' P)^2) / blocks^2.
        """
        return _detrended(self.errors, duration)

    def draw(self, shape: tuple[int, int], rate_hz: float, *, constant: Array, rng: np.random.Generator) -> Array:
        """Interval means of the terms, without quantisation, plus a `constant` (runs, 3): shape (runs, samples, 3)."""
        from gyronorth.sensor.drawing import ProcessLaw, draw

        return draw(ProcessLaw.of(self.errors), shape, rate_hz, constant=constant, rng=rng)


def _mean_variance(errors: TriadErrors, duration: ArrayLike, weighting: Weighting) -> tuple[Array, Array]:
    """The two parts of `NoiseLaw.mean_variance`."""
    duration = np.asarray(duration, dtype=float)
    parts = {"noise": np.zeros_like(duration), "drift": np.zeros_like(duration)}
    for term in TERMS:
        parts[term.part] = parts[term.part] + term.mean(errors, duration, weighting)
    return parts["noise"], parts["drift"]


_mean_variance_once = lru_cache(maxsize=64)(_mean_variance)


@lru_cache(maxsize=64)
def _detrended(errors: TriadErrors, duration: float) -> tuple[float, float]:
    blocks, block = 100, duration / 100
    edges: Array = np.arange(blocks + 1, dtype=float) * block
    covariance = np.zeros((blocks, blocks))
    for term in TERMS:
        if term.field != "quantisation" and getattr(errors, term.field) > 0:
            covariance += term.covariance(errors, edges[:-1], edges[1:], block)
    time = (np.arange(blocks) + 0.5) * block
    integrate = block * (np.tri(blocks) - 0.5 * np.eye(blocks))
    line = np.stack([np.ones(blocks), time], axis=1)
    orthonormal, _ = np.linalg.qr(line)
    bend = integrate - orthonormal @ (orthonormal.T @ integrate)
    deviating = bend @ covariance @ bend.T
    mean = float(np.trace(deviating) / blocks)
    spread = float(np.sqrt(np.sum(deviating**2)) / blocks)
    return mean, mean + 3.29 * spread
