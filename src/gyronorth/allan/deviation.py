"""Overlapped Allan deviation with confidence bounds."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from gyronorth.arrays import Array
from gyronorth.errors import InputError
from gyronorth.given import finite, numbers

#: Samples per chunk: the angle, its first and its second difference stay in a 2 MB cache.
CHUNK = 32768
#: Fewest samples of which an Allan deviation is computed.
FEWEST_SAMPLES = 10
#: Default averaging times: this many in a decade, up to this part of the record.
TAUS_PER_DECADE = 12
LONGEST_PART = 0.25
#: Probability of each bound: together they hold the deviation with 95 %.
TAIL = 0.025


@dataclass(frozen=True)
class AllanDeviation:
    """Overlapped Allan deviation of one or several axes, in the unit u of the data.

    `low` and `high` hold the true deviation with 95 % probability at each averaging time by
    itself; neighbours are correlated, so they are not a band for the whole curve.
    """

    tau: Array  # (k,) averaging times, s
    deviation: Array  # (k,) or (k, axes), u
    low: Array  # lower bound, as deviation
    high: Array  # upper bound, as deviation
    n: int  # samples
    rate_hz: float  # Hz


def allan_deviation(x: ArrayLike, *, rate_hz: float, taus: ArrayLike | None = None) -> AllanDeviation:
    """Overlapped Allan deviation of a rate (or specific force) sampled uniformly.

    Parameters
    ----------
    x : array_like, shape (n,) or (n, axes)
        Samples, unit u (rad/s, m/s^2, ...). A constant offset has no influence.
    rate_hz : float
        Sample rate, Hz.
    taus : array_like, shape (k,), optional
        Averaging times, s, rounded to multiples of the sample interval; doubles are merged.
        The longest is n / (2 rate_hz). Default: 12 in a decade up to a quarter of the record.

    Returns
    -------
    AllanDeviation

    Raises
    ------
    InputError
        If there are fewer than 10 samples, one is not finite, or a tau does not fit.

    Notes
    -----
    With the integrated signal theta_j = sum_{i<j} (x_i - mean) / rate and m = tau rate [1]_, eq. 11:
    sigma^2(tau) = sum_j (theta_{j+2m} - 2 theta_{j+m} + theta_j)^2 / (2 tau^2 (n + 1 - 2 m)).

    The bounds are those of a chi-square law with the equivalent degrees of freedom of [1]_,
    table 5, between those of white, flicker and random-walk rate noise according to the local
    slope of the curve. Steeper slopes (quantisation) count as white, which is cautious.

    References
    ----------
    .. [1] W. J. Riley, "Handbook of Frequency Stability Analysis", NIST SP 1065, 2008.
    .. [2] C. A. Greenhall, W. J. Riley, "Uncertainty of stability variances based on finite
           differences", Proc. 35th PTTI, 2003: the exact degrees of freedom behind the table.
    """
    x = check_samples(x, rate_hz)
    n = len(x)
    m = default_multiples(n) if taus is None else _multiples(taus, n, rate_hz)
    columns = x.reshape(n, -1)
    variance = np.stack([allan_variance(column, m) for column in columns.T], axis=-1)
    found = with_bounds(m, variance, n=n, rate_hz=rate_hz)
    if x.ndim == 2:
        return found
    return replace(found, deviation=found.deviation[:, 0], low=found.low[:, 0], high=found.high[:, 0])


def with_bounds(multiples: Array, variance: Array, *, n: int, rate_hz: float) -> AllanDeviation:
    """The deviation and its bounds from Allan variances (k, axes) of n samples at multiples (k,)."""
    low, high = (np.sqrt(bound) for bound in _bounds(multiples, variance, n))
    return AllanDeviation(
        tau=multiples / rate_hz, deviation=np.sqrt(variance), low=low, high=high, n=n, rate_hz=float(rate_hz)
    )


def allan_variance(x: ArrayLike, multiples: ArrayLike) -> Array:
    """Overlapped Allan variance of one axis (n,) at tau = multiples / rate, u^2, shape (k,).

    Chunk by chunk, all averaging times over one chunk before the next, so that the angle is
    read from memory once. Differences are taken of the angle itself, never as differences of
    sums of squares or of lag products, which lose digits where the data drift.
    """
    x = np.asarray(x, dtype=float)
    theta = _angle(x)
    lags = [int(m) for m in np.atleast_1d(multiples)]
    total = np.zeros(len(lags))
    first, second = np.empty(2 * CHUNK), np.empty(CHUNK)
    for a in range(0, len(theta), CHUNK):
        for i, m in enumerate(lags):
            b = min(a + CHUNK, len(theta) - 2 * m)
            if b <= a:
                continue
            if m <= CHUNK:  # one first difference serves both ends of the second
                d = np.subtract(theta[a + m : b + 2 * m], theta[a : b + m], out=first[: b - a + m])
                z = np.subtract(d[m:], d[: b - a], out=second[: b - a])
            else:
                d = np.subtract(theta[a + m : b + m], theta[a:b], out=first[: b - a])
                z = np.subtract(theta[a + 2 * m : b + 2 * m], theta[a + m : b + m], out=second[: b - a])
                z -= d
            total[i] += np.dot(z, z)
    m = np.asarray(lags, dtype=float)
    return total / (2 * m**2 * (len(theta) - 2 * m))


def _angle(x: Array) -> Array:
    """Running sum of `x` less its mean, 0 first, shape (n + 1,); in pieces, so that no copy of `x` is needed."""
    theta = np.zeros(len(x) + 1)
    mean = x.mean()
    for start in range(0, len(x), CHUNK):
        piece = x[start : start + CHUNK] - mean
        piece[0] += theta[start]
        np.cumsum(piece, out=theta[start + 1 : start + 1 + len(piece)])
    return theta


def degrees_of_freedom(multiples: ArrayLike, n: int, slope: ArrayLike) -> Array:
    """Equivalent degrees of freedom of the overlapped Allan variance of n samples.

    `slope` is d ln sigma^2 / d ln tau: -1 white, 0 flicker, +1 random walk; in between, the
    formulas of NIST SP 1065, table 5 (Howe, Allan and Barnes 1981), are interpolated linearly.
    """
    m = np.asarray(multiples, dtype=float)
    points = n + 1  # of the integrated signal
    white = (3 * (points - 1) / (2 * m) - 2 * (points - 2) / points) * 4 * m**2 / (4 * m**2 + 5)
    flicker = np.where(m == 1, 2 * (points - 2) ** 2 / (2.3 * points - 4.9), 5 * points**2 / (4 * m * (points + 3 * m)))
    walk = (points - 2) / m * ((points - 1) ** 2 - 3 * m * (points - 1) + 4 * m**2) / (points - 3) ** 2
    slope = np.clip(np.asarray(slope, dtype=float), -1, 1)
    mixed = np.where(slope < 0, flicker - slope * (white - flicker), flicker + slope * (walk - flicker))
    return np.maximum(mixed, 1.0, dtype=np.float64)


def octaves(n: int, longest_part: float) -> Array:
    """Multiples 1, 2, 4, ... up to `longest_part` of n samples."""
    return 2.0 ** np.arange(int(np.log2(n * longest_part)) + 1, dtype=float)


def check_samples(x: ArrayLike, rate_hz: float) -> Array:
    """Samples as floats, (n,) or (n, axes); InputError if they are too few or not finite."""
    x = numbers("x", x, "(n,) or (n, axes)")
    if x.ndim not in (1, 2):
        raise InputError(f"x has shape {x.shape}; (n,) or (n, axes) is expected.")
    finite("rate_hz", rate_hz, "Hz", positive=True)
    if len(x) < FEWEST_SAMPLES:
        raise InputError(
            f"The record holds {len(x)} samples ({len(x) / rate_hz:g} s); an Allan deviation needs at least "
            f"{FEWEST_SAMPLES}. Give a longer record."
        )
    whole = np.isfinite(x.reshape(len(x), -1)).all(axis=1)
    if not whole.all():
        rows = np.flatnonzero(~whole)
        raise InputError(
            f"{len(rows)} of {len(x)} samples are not finite, the first at {rows[0] / rate_hz:g} s. The Allan "
            "deviation needs an unbroken record: leave the broken part out."
        )
    return x


def _multiples(taus: ArrayLike, n: int, rate_hz: float) -> Array:
    taus = np.atleast_1d(numbers("taus", taus, "(k,)"))
    longest = n // 2 / rate_hz
    if taus.ndim != 1 or len(taus) == 0 or not np.isfinite(taus).all():
        raise InputError(f"taus is {taus}; a list of averaging times in s is expected.")
    m = np.round(taus * rate_hz)
    for tau, multiple in zip(taus, m, strict=True):
        if not 1 <= multiple <= n // 2:
            raise InputError(
                f"tau is {tau:g} s; a record of {n} samples at {rate_hz:g} Hz ({n / rate_hz:g} s) allows "
                f"{1 / rate_hz:g} to {longest:g} s (half its length)."
            )
    return np.unique(m)


def default_multiples(n: int) -> Array:
    """Averaging times of `allan_deviation` by default, in samples."""
    longest = max(1.0, n * LONGEST_PART)
    count = int(np.log10(longest) * TAUS_PER_DECADE) + 1
    return np.unique(np.geomspace(1, longest, count).round())


def _bounds(m: Array, variance: Array, n: int) -> tuple[Array, Array]:
    dof = np.stack([degrees_of_freedom(m, n, _slope(m, column)) for column in variance.T], axis=-1)
    return variance * dof / chi_square_point(1 - TAIL, dof), variance * dof / chi_square_point(TAIL, dof)


def chi_square_point(probability: ArrayLike, dof: ArrayLike) -> Array:
    """The point below which a chi-square variable of `dof` falls with `probability`."""
    from scipy.special import gammaincinv  # scipy.stats, which has it ready, takes a second to load

    return np.asarray(2 * gammaincinv(np.asarray(dof, dtype=float) / 2, np.asarray(probability, dtype=float)))


def _slope(m: Array, variance: Array) -> Array:
    """Local slope of ln variance against ln tau, a straight line over a factor of four to each side."""
    log_m, log_v = np.log(m), np.log(np.maximum(variance, np.finfo(float).tiny))
    first = np.searchsorted(log_m, log_m - np.log(4) - 1e-9)
    last = np.searchsorted(log_m, log_m + np.log(4) + 1e-9)
    count = last - first

    def mean(values: Array) -> Array:
        running = np.concatenate([[0.0], np.cumsum(values)])
        return (running[last] - running[first]) / count

    spread = mean(log_m**2) - mean(log_m) ** 2
    common = mean(log_m * log_v) - mean(log_m) * mean(log_v)
    return np.where(count > 1, common / np.where(count > 1, spread, 1.0), -1.0)
