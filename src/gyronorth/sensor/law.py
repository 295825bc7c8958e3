"""The noise law of a triad: what its stochastic terms do together, each as `gyronorth.sensor.terms` states it.

Samples are means over their intervals throughout.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from gyronorth.arrays import Array
from gyronorth.frozen import frozen
from gyronorth.sensor.gauss_markov import Weighting
from gyronorth.sensor.terms import TERMS, ProcessLaw, TriadErrors


@frozen
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
        from gyronorth.sensor.drawing import draw

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
        if not term.bounded_integral and getattr(errors, term.field) > 0:
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
