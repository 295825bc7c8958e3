"""Additive errors of a triad: turn-on bias, in-run bias, rate random walk and white noise.

Every sample is the mean over its interval (integrate and dump), so nothing depends on the sample
rate but the white noise, whose standard deviation is N sqrt(rate).

A Gauss-Markov process that is fast against the interval is drawn exactly: its interval means are
an ARMA(1, 1) series. One that is slow is drawn exactly at every h = m dt, h <= tau / 50, and
interpolated by straight lines, whose interval means are their midpoints. The bridge that a line
leaves out has the variance v (1 - exp(-h / tau)) / 2 in the middle and two thirds of that on
average: below 1 % of v at every sample and 0.7 % on average, and nearly all of it faster than h.
The random walk is treated alike, with h such that the bridge it leaves out, K^2 h / 4, is below
1 % of the variance of the white noise; with no white noise, h = dt.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import cast

import numpy as np

from gyronorth.arrays import Array
from gyronorth.sensor.terms import ProcessLaw, TriadErrors

#: A process is interpolated between knots no further apart than its time constant over this.
KNOTS_PER_TIME_CONSTANT = 50
#: Share of the white-noise variance that interpolating the random walk may leave out.
BRIDGE_SHARE = 0.01
# Longest step between knots, samples: beyond it nothing is gained.
_LONGEST_STRIDE = 256
# Values per block of work: 256 kB, so that a block stays in the second-level cache.
_BLOCK = 32768


def sensor_errors(errors: TriadErrors, shape: tuple[int, int], rate_hz: float, *, rng: np.random.Generator) -> Array:
    """Additive errors of one triad: turn-on bias, in-run bias, rate random walk and white noise.

    Scale factor, misalignment, quantisation and saturation act on the signal: `simulate_batch`.

    Parameters
    ----------
    errors : TriadErrors
        Error terms, unit u = rad/s or m/s^2.
    shape : (int, int)
        Runs and samples. Runs are independent, each with its own turn-on bias.
    rate_hz : float
        Sample rate, Hz.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    ndarray, shape (runs, samples, 3)
        Mean error over each sample's interval, u. The random walk starts at zero at the first
        instant; the in-run bias is stationary from the first sample.
    """
    constant = errors.turn_on_bias * rng.standard_normal((shape[0], 3))
    return draw(ProcessLaw.of(errors), shape, rate_hz, constant=constant, rng=rng)


def draw(
    law: ProcessLaw, shape: tuple[int, int], rate_hz: float, *, constant: Array, rng: np.random.Generator
) -> Array:
    """Interval means of the processes of `law` plus a `constant` (runs, 3), u: shape (runs, samples, 3)."""
    runs, samples = shape
    out = np.empty((runs, samples, 3))
    rows = max(1, _BLOCK // (3 * samples))
    for first in range(0, runs, rows):
        _fill(out[first : first + rows], law, rate_hz, constant=constant[first : first + rows], rng=rng)
    return out


def _fill(out: Array, law: ProcessLaw, rate_hz: float, *, constant: Array, rng: np.random.Generator) -> None:
    runs, samples, _ = out.shape
    stride, knots = _slow_part(law, (runs, samples), rate_hz, rng=rng)
    knots += constant[:, None]
    weights = _line_weights((np.arange(stride) + 0.5) / stride)  # the mean of a line is its middle
    fast = [
        _IntervalMeans(variance, rate_hz * tau, runs, rng=rng)
        for variance, tau in law.processes
        if _stride(tau * rate_hz) == 0
    ]
    for start, stop in _spans(runs, samples, stride):
        block = out[:, start:stop]
        if law.white > 0:
            rng.standard_normal(out=block)
            block *= law.white * np.sqrt(rate_hz)
        else:
            block[:] = 0.0
        _add_lines(block, knots[:, start // stride :], weights)
        for process in fast:
            block += process.draw(stop - start, rng=rng)


def _spans(runs: int, samples: int, stride: int) -> Iterator[tuple[int, int]]:
    """Stretches of time small enough for the cache, each starting at a knot."""
    step = max(1, _BLOCK // (3 * runs * stride)) * stride
    if runs > 1:
        step = samples  # a block of several runs must be contiguous to be drawn in place
    for start in range(0, samples, step):
        yield start, min(start + step, samples)


def _stride(samples_per_time_constant: float) -> int:
    """Samples between knots, a power of two; 0 if the process is too fast to be interpolated."""
    longest = samples_per_time_constant / KNOTS_PER_TIME_CONSTANT
    return 0 if longest < 1 else 2 ** int(np.log2(min(longest, _LONGEST_STRIDE)))


def _slow_part(
    law: ProcessLaw, shape: tuple[int, int], rate_hz: float, *, rng: np.random.Generator
) -> tuple[int, Array]:
    """Sum of all slow processes at knots every `stride` samples: stride, (runs, knots, 3)."""
    runs, samples = shape
    levels: dict[int, Array] = {}

    def add(stride: int, values: Array) -> None:
        levels[stride] = levels[stride] + values if stride in levels else values

    for variance, tau in law.processes:
        stride = _stride(tau * rate_hz)
        if stride > 0:
            add(stride, _markov(variance, stride / (rate_hz * tau), (runs, _knots(samples, stride), 3), rng=rng))
    if law.random_walk > 0:
        root = min(2 * np.sqrt(BRIDGE_SHARE) * law.white * rate_hz / law.random_walk, _LONGEST_STRIDE)
        stride = max(1, _stride(KNOTS_PER_TIME_CONSTANT * root**2))
        steps = rng.standard_normal((runs, _knots(samples, stride), 3))
        steps *= law.random_walk * np.sqrt(stride / rate_hz)
        steps[:, 0] = 0.0
        add(stride, np.cumsum(steps, axis=1))
    if not levels:
        add(_LONGEST_STRIDE, np.zeros((runs, _knots(samples, _LONGEST_STRIDE), 3)))

    strides = sorted(levels, reverse=True)
    for coarse, fine in pairwise(strides):
        ratio, knots = coarse // fine, levels[coarse]
        knots = np.concatenate([knots, knots[:, -1:]], axis=1)  # a step to stand on for the last fine knot
        _add_lines(levels[fine], knots, _line_weights(np.arange(ratio) / ratio))
    return strides[-1], levels[strides[-1]]


def _knots(samples: int, stride: int) -> int:
    return -(-samples // stride) + 1


def _markov(variance: float, step: float, shape: tuple[int, int, int], *, rng: np.random.Generator) -> Array:
    """A stationary Gauss-Markov process at knots `step` time constants apart, exact."""
    from scipy.signal import lfilter

    keep = np.exp(-step)
    noise = rng.standard_normal(shape)
    noise *= np.sqrt(variance)
    noise[:, 1:] *= np.sqrt(-np.expm1(-2 * step))
    return np.ascontiguousarray(cast(Array, lfilter([1.0], [1.0, -keep], noise, axis=1)))


def _line_weights(shares: Array) -> Array:
    """What the two knots of a step give the points that lie `shares` (k,) of the way, shape (6, 3 k)."""
    axis = np.arange(3)
    weights = np.zeros((6, len(shares), 3))
    weights[axis, :, axis], weights[axis + 3, :, axis] = 1 - shares, shares
    return weights.reshape(6, -1)


def _add_lines(points: Array, knots: Array, weights: Array) -> None:
    """Add straight lines between `knots` to `points` (runs, n, 3), which begin at the first knot."""
    runs, count, _ = points.shape
    per_step = weights.shape[1] // 3
    whole, rest = divmod(count, per_step)
    steps = whole + (rest > 0)
    pairs = np.concatenate([knots[:, :steps], knots[:, 1 : steps + 1]], axis=2)
    lines = points[:, : whole * per_step].reshape(runs, whole, 3 * per_step)  # a view
    lines += pairs[:, :whole] @ weights
    if rest:
        points[:, whole * per_step :] += (pairs[:, whole] @ weights[:, : 3 * rest]).reshape(runs, rest, 3)


class _IntervalMeans:
    """Interval means of a stationary Gauss-Markov process, exact, continued from call to call.

    With x = dt / tau and phi = exp(-x) the means have the autocovariances
    g_0 = 2 v (x - 1 + phi) / x^2 and g_k = v (1 - phi)^2 phi^(k-1) / x^2, those of an ARMA(1, 1)
    series m_k = phi m_(k-1) + e_k + theta e_(k-1): theta / (1 + theta^2) =
    (g_1 - phi g_0) / ((1 + phi^2) g_0 - 2 phi g_1). (The integral of the process and its end value
    are jointly Gauss-Markov; the covariances follow by integration.)
    """

    def __init__(self, variance: float, samples_per_tau: float, runs: int, *, rng: np.random.Generator) -> None:
        x = 1 / samples_per_tau
        phi, rise = np.exp(-x), -np.expm1(-x)
        g0, g1 = 2 * variance * (x - rise) / x**2, variance * (rise / x) ** 2
        own, next_ = (1 + phi**2) * g0 - 2 * phi * g1, g1 - phi * g0
        ratio = next_ / own
        theta = 2 * ratio / (1 + np.sqrt(1 - 4 * ratio**2))
        power = own / (1 + theta**2)
        self._sigma = np.sqrt(power)
        self._b, self._a = np.array([1.0, theta]), np.array([1.0, -phi])
        # The filter's memory phi m + theta e, drawn from its stationary law.
        memory = phi**2 * g0 + theta**2 * power + 2 * phi * theta * power
        self._state: Array = np.sqrt(memory) * rng.standard_normal((runs, 1, 3))

    def draw(self, samples: int, *, rng: np.random.Generator) -> Array:
        from scipy.signal import lfilter

        noise = self._sigma * rng.standard_normal((self._state.shape[0], samples, 3))
        means, self._state = cast("tuple[Array, Array]", lfilter(self._b, self._a, noise, axis=1, zi=self._state))
        return means
