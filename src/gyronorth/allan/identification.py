"""Error terms of a sensor from the Allan variances of its record at rest.

The Allan variance of the modelled errors is linear in the squares of their coefficients,
sigma^2(tau) = q^2 / (4 tau^2) + N^2 / tau + B^2 F(tau) + K^2 tau / 3, so weighted non-negative
least squares on the variances at octave-spaced averaging times finds them all at once. The weights
are the inverse covariance of the estimates under the model itself, correlation between averaging
times included (the generalised method of wavelet moments [1]_, of which the Allan variance is the
Haar case). Octaves lose next to nothing: the estimates between them repeat the same data.

References
----------
.. [1] S. Guerrier, J. Skaloud, Y. Stebler, M.-P. Victoria-Feser, "Wavelet-variance-based estimation
       for composite stochastic processes", J. Am. Stat. Assoc. 108(503), 2013, 1021-1030.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from gyronorth.allan.deviation import allan_variance, check_samples, chi_square_point, degrees_of_freedom, octaves
from gyronorth.arrays import Array
from gyronorth.errors import InputError
from gyronorth.sensor import TriadErrors
from gyronorth.sensor.law import NoiseLaw
from gyronorth.sensor.terms import TERMS

Status = Literal["identified", "upper bound", "not identified"]

#: Shortest record, s and samples, of which terms are identified.
SHORTEST_DURATION = 60.0
FEWEST_SAMPLES = 160
#: The fit ends at the octave below this part of the record: at least 10 degrees of freedom,
#: where a chi-square law is near enough to a normal one.
LONGEST_PART = 0.1
#: The fit keeps at least so many octaves.
FEWEST_OCTAVES = 5
#: Relative error of the model that is always allowed for in a variance, 1 sigma.
MODEL_ERROR = 0.01
#: Relative error of the terms' Allan variances at one sample: K^2 tau / 3 of a walk is that of interval means;
#: samples of the walk itself have 1 + 0.5 / m^2 of it.
SAMPLED = np.array([term.sampled for term in TERMS])
#: The variance times the averaging time squared of the steadiest of sensors, one that rounds the angle, stays
#: what it is at one sample; below this part of that, the record is periodic.
REPEATS_BELOW = 1e-6
#: Above this scatter of the variances about the fit, relative, its terms mean nothing.
WORST_MISFIT = 0.3
#: Step of the chi-square law with one degree of freedom at 95 %, and the level at which a fit is refused.
CHI_SQUARE_95 = 3.841
FIT_LEVEL = 0.99
#: A term is identified if the lower end of its interval is above this part of its value.
IDENTIFIED_ABOVE = 0.6


@dataclass(frozen=True)
class Identified:
    """One error term with its 95 % interval, in SI."""

    value: float  # best estimate
    low: float
    high: float
    status: Status  # identified: well above zero; upper bound: only `high` counts


@dataclass(frozen=True)
class Identification:
    """The error terms of an axis or a triad at rest, unit u of the data (rad/s or m/s^2)."""

    terms: Mapping[str, Identified]  # by `Term.name`
    flicker_longest: float  # longest time constant of the in-run bias in the model, s
    tau: Array  # (k,) octaves that were fitted, s
    misfit: float  # relative scatter of the variances about the model beyond their own, 1 sigma
    duration: float  # s

    @property
    def angle_random_walk(self) -> Identified:
        """N, u sqrt(s)."""
        return self.terms["angle_random_walk"]

    @property
    def bias_instability(self) -> Identified:
        """B = Allan minimum / 0.664, u."""
        return self.terms["bias_instability"]

    @property
    def rate_random_walk(self) -> Identified:
        """K, u / sqrt(s)."""
        return self.terms["rate_random_walk"]

    @property
    def quantisation(self) -> Identified:
        """Step q of the integrated signal, u s."""
        return self.terms["quantisation"]

    def deviation(self, tau: ArrayLike) -> Array:
        """Allan deviation of the fitted model at averaging times tau (k,), s."""
        square = [self.terms[term.name].value ** 2 for term in TERMS]
        return np.sqrt(_law(self.flicker_longest).allan_variance(tau) @ square)


def identify(x: ArrayLike, *, rate_hz: float, flicker_longest: float = 1000.0) -> Identification:
    """Angle random walk, bias instability, rate random walk and quantisation of a record at rest.

    Parameters
    ----------
    x : array_like, shape (n,) or (n, axes)
        Rate or specific force at rest, unit u. Several axes are taken as independent sensors of
        one kind and give one answer.
    rate_hz : float
        Sample rate, Hz.
    flicker_longest : float
        Longest time constant of the in-run bias, s, as in `TriadErrors`: a record cannot tell it
        from the bias instability unless it lasts many times longer.

    Returns
    -------
    Identification

    Raises
    ------
    InputError
        If the record is shorter than 60 s or 160 samples, constant, or not finite.

    Notes
    -----
    Intervals are those of a test at 95 %: a value is inside if the weighted sum of squares with
    that value held, the other terms refitted and the weights taken under it, is less than 3.84
    above the least one. A term is "identified" if the lower end of its interval is above 0.6 of its value; else
    all that counts is its "upper bound".

    Where the whole curve does not fit the model (chi-square at 99 %), the shortest averaging times
    are left out one by one, down to five octaves: filters, vibration and sway live there, and a
    heading needs the long ones. If nothing fits, each variance of the least strained fit is allowed
    the relative `misfit` that makes it fit; beyond 0.3 the status is "not identified" and `high` is all that the curve
    itself allows: no term can be larger than the whole.
    """
    x = check_samples(x, rate_hz)
    n = len(x)
    m = fitted_multiples(n, rate_hz)
    columns = x.reshape(n, -1)
    check_varies(np.ptp(columns, axis=0), columns[0])
    variance = np.mean([allan_variance(column, m) for column in columns.T], axis=0)
    axes = columns.shape[1]
    return identify_variance(variance, n=n, rate_hz=rate_hz, axes=axes, flicker_longest=flicker_longest)


def fitted_multiples(n: int, rate_hz: float) -> Array:
    """Averaging times that are fitted to n samples, in samples; InputError if these are too few."""
    if n < FEWEST_SAMPLES or n / rate_hz < SHORTEST_DURATION:
        raise InputError(
            f"The record holds {n} samples at {rate_hz:g} Hz ({n / rate_hz:.4g} s); to identify error terms takes at "
            f"least {FEWEST_SAMPLES} samples and {SHORTEST_DURATION:g} s, and an hour for a useful bias instability. "
            "Give a longer record."
        )
    return octaves(n, LONGEST_PART)


def check_varies(spread: Array, value: Array) -> None:
    """InputError if an axis, of the given range and with such a value, does not vary; both of shape (axes,)."""
    if not (spread**2 > 0).all():  # nor may a variance be 0
        raise InputError(
            f"The record does not vary: every sample is {value[np.argmin(spread)]:g}. A stuck channel, or rounding far "
            "above the noise, is the likely cause; give the raw output."
        )


def identify_variance(
    variance: Array, *, n: int, rate_hz: float, axes: int, flicker_longest: float = 1000.0
) -> Identification:
    """Error terms from Allan variances at `fitted_multiples`, shape (k,), the mean over `axes` axes; see `identify`."""
    m = fitted_multiples(n, rate_hz)
    _check_repeats(m, variance, rate_hz)
    fit = _best_fit(m, variance, n, rate_hz, axes=axes, flicker_longest=flicker_longest)
    return Identification(
        terms={term.name: fit.term(k) for k, term in enumerate(TERMS)},
        flicker_longest=flicker_longest,
        tau=fit.tau,
        misfit=0.0 if fit.model_error == MODEL_ERROR else fit.model_error,
        duration=n / rate_hz,
    )


def _check_repeats(m: Array, variance: Array, rate_hz: float) -> None:
    """InputError if the variance at some averaging time falls away faster than even that of a bounded angle."""
    vanished = variance * m**2 < REPEATS_BELOW * variance[0]
    if vanished.any():
        raise InputError(
            f"The record repeats itself every {m[np.argmax(vanished)] / rate_hz:.6g} s or a whole part of that: its "
            "Allan variance vanishes there. A file put together from copies of one part is the likely cause; give the "
            "record as it was taken."
        )


def _best_fit(m: Array, variance: Array, n: int, rate_hz: float, *, axes: int, flicker_longest: float) -> AllanFit:
    """The fit from the shortest averaging time that the model holds from; else the best one, with its misfit."""
    fits: list[AllanFit] = []
    for first in range(len(m) - FEWEST_OCTAVES + 1):
        fits.append(AllanFit(m[first:], variance[first:], n, rate_hz, axes=axes, flicker_longest=flicker_longest))
        if fits[-1].strain <= 1:
            return fits[-1]
    best = min(fits, key=lambda fit: fit.strain)
    best.allow_misfit()
    return best


def _law(flicker_longest: float) -> NoiseLaw:
    """Every term with a coefficient of one."""
    return NoiseLaw(TriadErrors(**{term.field: 1.0 for term in TERMS}, flicker_longest=flicker_longest))


class AllanFit:
    """Weighted non-negative least squares of one set of Allan variances.

    Parameters are the squares of the terms: q^2, N^2, B^2, K^2.

    Notes
    -----
    The covariance of two estimates is 4 / T times the integral over f > 0 of H_i H_j S^2, with
    H = 2 sin^4(pi f tau) / (m sin(pi f / rate))^2 and the two-sided spectrum S of the model. The
    record being finite, T - 1.5 tau stands for T: with it the variances agree with NIST SP 1065,
    table 5, within 20 % for white, flicker and random walk, m >= 16 and tau <= T / 10. The
    logarithmic grid undersamples H at high f, where it needs only the mean of its oscillation.
    """

    def __init__(self, m: Array, variance: Array, n: int, rate_hz: float, *, axes: int, flicker_longest: float) -> None:
        self.m, self.variance, self.n, self.axes = m, variance, n, axes
        self.tau = m / rate_hz
        self.model_error = MODEL_ERROR
        self.columns = _law(flicker_longest).allan_variance(self.tau)
        duration = n / rate_hz
        edges = np.geomspace(0.02 / duration, rate_hz / 2, int(100 * np.log2(25 * n)))
        f = np.sqrt(edges[1:] * edges[:-1])
        self._spectra = _law(flicker_longest).spectrum(f, rate_hz)
        response = 2 * np.sin(np.pi * f * self.tau[:, None]) ** 4 / np.square(m[:, None] * np.sin(np.pi * f / rate_hz))
        self._response = response / np.sqrt(duration - 1.5 * self.tau)[:, None]
        self._width = 4 * np.diff(edges) / axes
        self.parameters, self.chi_square = self._solve(self._start())

    @property
    def freedom(self) -> int:
        """Averaging times less terms in use."""
        return max(len(self.m) - int(np.count_nonzero(self.parameters)), 1)

    @property
    def strain(self) -> float:
        """Chi-square over what chance would leave: above 1 the model does not hold."""
        return self.chi_square / float(chi_square_point(FIT_LEVEL, self.freedom))

    def allow_misfit(self) -> None:
        """Raise the relative model error until chi-square equals its degrees of freedom."""
        low, high = np.log(MODEL_ERROR), np.log(10.0)
        for _ in range(20):
            self.model_error = float(np.exp((low + high) / 2))
            self.parameters, self.chi_square = self._solve(self._start())
            low, high = ((low + high) / 2, high) if self.chi_square > self.freedom else (low, (low + high) / 2)

    def term(self, k: int) -> Identified:
        """Coefficient k with its interval and status."""
        best, most = self.parameters[k], self._most(k)
        if self.model_error > WORST_MISFIT:
            return Identified(float(np.sqrt(best)), 0.0, float(np.sqrt(most)), "not identified")
        low = self._bound(k, best, 0.0) if best > 0 and self._excess(k, 0.0) > CHI_SQUARE_95 else 0.0
        high = self._bound(k, best, most) if self._excess(k, most) > CHI_SQUARE_95 else most
        low, value, high = (float(np.sqrt(square)) for square in (low, best, high))
        status: Status = "identified" if low > IDENTIFIED_ABOVE * value else "upper bound"
        return Identified(value, low, max(high, value), status)

    def covariance(self, parameters: Array) -> Array:
        """Covariance (k, k) of the Allan variances under the model."""
        density = (self._spectra @ parameters) ** 2 * self._width
        sampled = self.columns @ (parameters * SAMPLED) / self.m**2
        error = np.diag((self.model_error * self.variance) ** 2) + np.outer(sampled, sampled)
        return (self._response * density) @ self._response.T + error

    def _most(self, k: int) -> float:
        """What the curve itself allows of term k: the least over tau of its upper bounds at 99.8 % together."""
        dof = self.axes * degrees_of_freedom(self.m, self.n, 1.0)
        upper = self.variance * dof / chi_square_point(0.002 / len(self.m), dof)
        least = self.columns[:, k] * (1 - SAMPLED[k] / self.m**2)
        return float(np.min(upper / least))

    def _bound(self, k: int, inside: float, outside: float) -> float:
        """Where the test of term k turns, between a value inside its interval and one outside; by bisection."""
        inside, outside = np.sqrt(inside), np.sqrt(outside)
        while abs(outside - inside) > 1e-3 * max(inside, outside):
            middle = (inside + outside) / 2
            if self._excess(k, middle**2) > CHI_SQUARE_95:
                outside = middle
            else:
                inside = middle
        return float(((inside + outside) / 2) ** 2)

    def _excess(self, k: int, value: float) -> float:
        """Weighted sum of squares above its least, with parameter k held and weights under that hypothesis."""
        parameters = self.parameters.copy()
        parameters[k] = value
        for _ in range(3):
            covariance = self.covariance(parameters)
            parameters, held = self._least_squares(covariance, hold=(k, value))
        return held - self._least_squares(covariance)[1]

    def _start(self) -> Array:
        dof = degrees_of_freedom(self.m, self.n, 0.0)
        return self._least_squares(np.diag((2 / dof + self.model_error**2) * self.variance**2))[0]

    def _solve(self, parameters: Array) -> tuple[Array, float]:
        """Reweight until the parameters stand."""
        chi_square = np.inf
        for _ in range(20):
            before = parameters
            parameters, chi_square = self._least_squares(self.covariance(before))
            if np.allclose(parameters, before, rtol=1e-5, atol=0):
                break
        return parameters, chi_square

    def _least_squares(self, covariance: Array, hold: tuple[int, float] | None = None) -> tuple[Array, float]:
        """Non-negative least squares, parameter hold[0] held at hold[1]: parameters (terms,) and chi-square."""
        from scipy.optimize import nnls

        scale = 1 / np.sqrt(np.diag(covariance))
        factor = np.linalg.cholesky(covariance * np.outer(scale, scale))
        matrix = np.linalg.solve(factor, self.columns * scale[:, None])
        unit = 1 / np.abs(matrix).max(axis=0)
        target = np.linalg.solve(factor, self.variance * scale)
        free = [k for k in range(len(unit)) if hold is None or k != hold[0]]
        parameters = np.zeros(len(unit))
        if hold is not None:
            parameters[hold[0]] = hold[1]
            target = target - matrix[:, hold[0]] * hold[1]
        solution, norm = nnls(matrix[:, free] * unit[free], target)
        parameters[free] = solution * unit[free]
        return parameters, float(norm**2)
