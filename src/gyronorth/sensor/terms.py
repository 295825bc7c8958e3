"""The error terms of a triad, and all that is known of each.

A new stochastic term is one field of `TriadErrors` and one `Term` of `TERMS`, both here: its names and units, what it
adds to the covariance of means, to the variance of a weighted mean, to the Allan variance and to the spectrum, and what
draws it. Profiles, `allan`, the error budget and the simulation take it from there.

Error terms of one triad
------------------------
measured = (1 + scale + misalignment) true + turn_on_bias + in-run bias + rate random walk
           + white noise (+ g-sensitivity x specific force, gyro), then quantised.

*In-run bias* is flicker noise with the two-sided spectrum B^2 / (2 pi f) of IEEE Std
952-1997, annex C, so that its Allan deviation is flat at sqrt(2 ln 2 / pi) B = 0.664 B.
**B, the bias instability of this package, is that coefficient: the Allan minimum / 0.664.**
It is realised as a sum of stationary first-order Gauss-Markov processes with time constants
half a decade apart, from `flicker_longest` down to about `FLICKER_SHORTEST`
(`flicker_components`), each drawn from its stationary law at the first sample.

With the default longest time constant of 1000 s the Allan deviation stands within 2 % of
0.664 B for averaging times of 2 to 150 s and within 5 % for 0.8 to 400 s; the standard
deviation of the in-run bias at any one instant is 1.82 B, that of its mean over 100 s 1.10 B
and over 230 s 0.98 B. The turn-on bias is a separate constant: what a data sheet or a test
over one duration calls bias is the root sum square of both.

Samples are means over their intervals throughout.
"""

from __future__ import annotations

from collections.abc import Callable
from math import hypot
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR
from gyronorth.arrays import Array
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.frozen import frozen
from gyronorth.sensor.gauss_markov import Weighting, gauss_markov_allan_variance, gauss_markov_variance

#: Shortest time constant of the in-run bias, s: below it white noise hides flicker.
FLICKER_SHORTEST = 0.1
#: Spacing of the time constants in the natural logarithm: half a decade. Its ripple on 1/f is
#: 2 / cosh(pi^2 / spacing) = 0.08 % far from the ends (`flicker_components`).
FLICKER_SPACING = float(np.log(10) / 2)


@frozen
class TriadErrors:
    """Error terms of three orthogonal axes, each one standard deviation, SI.

    The unit u is rad/s for a gyro and m/s^2 for an accelerometer.
    """

    white: float = 0.0  # angle (velocity) random walk N, u sqrt(s)
    flicker: float = 0.0  # bias instability B = Allan minimum / 0.664, u
    flicker_longest: float = 1000.0  # longest time constant of the in-run bias, s
    random_walk: float = 0.0  # rate (acceleration) random walk K, u / sqrt(s)
    turn_on_bias: float = 0.0  # constant over a power-up session, u
    scale_factor: float = 0.0  # relative
    misalignment: float = 0.0  # rad, each off-diagonal term
    quantisation: float = 0.0  # step of the integrated output, u s
    saturation: float = np.inf  # full range, u

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not value >= 0 or (value == np.inf and name != "saturation"):
                raise ValueError(f"{name} is {value}; a finite number of at least 0 is expected.")
        if self.flicker_longest < FLICKER_SHORTEST:
            raise ValueError(f"flicker_longest is {self.flicker_longest} s; at least {FLICKER_SHORTEST} s is expected.")


def flicker_components(errors: TriadErrors) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Variances (k,), u^2, and time constants (k,), s, of the Gauss-Markov sum that is the in-run bias.

    Notes
    -----
    A sum over time constants spaced by d in ln(tau), each of variance v = B^2 d / pi, has the
    two-sided spectrum sum of 2 v tau / (1 + (2 pi f tau)^2), which goes to B^2 / (2 pi f) as the
    spacing falls. By Poisson summation the ripple left by a spacing d is 2 / cosh(pi^2 / d) of it:
    0.08 % for half a decade. The finite ends take away
    (2 / pi) (arctan(2 pi f tau_1 exp(-d/2)) + arccot(2 pi f tau_k exp(d/2))): the spectrum stays
    within 2 % of 1/f from 0.003 to 0.087 Hz for time constants of 0.1 to 1000 s, and turns flat
    below 1 / (2 pi tau_k), to 1/f^2 above 1 / (2 pi tau_1).
    """
    if errors.flicker == 0:
        return np.zeros(0), np.zeros(0)
    count = round(np.log(errors.flicker_longest / FLICKER_SHORTEST) / FLICKER_SPACING) + 1
    steps = np.arange(count, dtype=float)[::-1]
    tau = np.asarray(errors.flicker_longest * np.exp(-FLICKER_SPACING * steps), dtype=float)
    return np.full_like(tau, errors.flicker**2 * FLICKER_SPACING / np.pi), tau


#: What an error term counts as in a heading's error budget.
Part = Literal["noise", "drift"]

MILLI_G = 1e-3 * STANDARD_GRAVITY


@frozen
class TermUnit:
    """How a term is called and written for one kind of triad."""

    key: str  # in profiles and in the JSON of `allan`
    words: str
    unit: str
    one: float  # one unit in SI


@frozen
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
    #: errors -> the processes that it is; None: it acts on the signal, in `simulate`
    drawn: Callable[[TriadErrors], ProcessLaw] | None
    bounded_integral: bool = False  # a heading hardly sees it: a profile needs no upper bound of it
    sampled: float = 0.0  # relative error of the Allan variance at one sample where samples are no interval means


@frozen
class ProcessLaw:
    """The random processes of one axis, in the unit u of its triad, as `gyronorth.sensor.drawing` draws them."""

    white: float = 0.0  # N, u sqrt(s)
    processes: tuple[tuple[float, float], ...] = ()  # variance, u^2, and time constant, s, of Gauss-Markov processes
    random_walk: float = 0.0  # K, u / sqrt(s)

    @classmethod
    def of(cls, errors: TriadErrors) -> ProcessLaw:
        """The processes of all terms of a triad, which are independent."""
        each = [term.drawn(errors) for term in TERMS if term.drawn is not None]
        together = tuple(process for law in each for process in law.processes)
        return cls(hypot(*(law.white for law in each)), together, hypot(*(law.random_walk for law in each)))


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


# IEEE Std 952-1997, annex C; flicker as the package makes it, `flicker_components`.
QUANTISATION = Term(
    "quantisation",
    "quantisation",
    "noise",
    TermUnit("quantisation_arcsec", "quantisation", "arcsec", np.pi / 180 / 3600),
    TermUnit("quantisation_m_s", "quantisation", "m/s", 1.0),
    _quantised_covariance,
    _quantised_mean,
    lambda errors, tau: errors.quantisation**2 * 0.25 / tau**2,
    _quantised_spectrum,
    drawn=None,
    bounded_integral=True,
)
WHITE = Term(
    "white",
    "angle_random_walk",
    "noise",
    TermUnit("angle_random_walk_deg_sqrt_h", "angle random walk", "deg/sqrt(h)", DEG_PER_SQRT_HOUR),
    TermUnit("velocity_random_walk_m_s_sqrt_h", "velocity random walk", "m/s/sqrt(h)", 1 / 60),
    _white_covariance,
    _white_mean,
    lambda errors, tau: errors.white**2 / tau,
    lambda errors, f, _: np.full_like(f, errors.white**2),
    lambda errors: ProcessLaw(white=errors.white),
)
FLICKER = Term(
    "flicker",
    "bias_instability",
    "drift",
    TermUnit("bias_instability_deg_h", "bias instability B", "deg/h", DEG_PER_HOUR),
    TermUnit("bias_instability_mg", "bias instability B", "mg", MILLI_G),
    _flicker_covariance,
    _flicker_mean,
    _flicker_allan,
    _flicker_spectrum,
    lambda errors: ProcessLaw(processes=tuple(zip(*flicker_components(errors), strict=True))),
)
RANDOM_WALK = Term(
    "random_walk",
    "rate_random_walk",
    "drift",
    TermUnit("rate_random_walk_deg_h_sqrt_h", "rate random walk", "deg/h/sqrt(h)", DEG_PER_HOUR / 60),
    TermUnit("acceleration_random_walk_mg_sqrt_h", "acceleration random walk", "mg/sqrt(h)", MILLI_G / 60),
    _walk_covariance,
    _walk_mean,
    lambda errors, tau: errors.random_walk**2 * tau / 3,
    lambda errors, f, _: errors.random_walk**2 / (2 * np.pi * f) ** 2,
    lambda errors: ProcessLaw(random_walk=errors.random_walk),
    sampled=0.5,
)
#: Every stochastic term, in the order in which `allan` fits them.
TERMS: tuple[Term, ...] = (QUANTISATION, WHITE, FLICKER, RANDOM_WALK)
