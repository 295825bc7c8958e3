"""The noise law of a triad: what its stochastic error terms do to means, slopes and spectra."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gyronorth.arrays import Array
from gyronorth.sensor.model import TriadErrors, flicker_components


def mean_covariance(
    errors: TriadErrors, first: ArrayLike, last: ArrayLike, *, rate_hz: float, white: bool = True, drift: bool = True
) -> Array:
    """Covariance of the mean errors of one axis over the sample ranges [first, last), shape (n, n), u^2.

    Samples are means over their intervals. Exact for white noise, quantisation, the Gauss-Markov
    sum of the in-run bias and a rate random walk that starts at zero at sample 0; without
    turn-on bias. Ranges must not overlap. `white` and `drift` leave out the parts without and
    with memory.

    Notes
    -----
    Of a Gauss-Markov process of variance v, with a = T / tau and r = (1 - exp(-a)) / a for each
    range: v r_i r_j exp(-gap / tau) for two ranges and 2 v (a - 1 + exp(-a)) / a^2 for one
    (integrals of v exp(-|s - t| / tau)).
    """
    first, last = np.asarray(first) / rate_hz, np.asarray(last) / rate_hz
    length, same = last - first, np.eye(len(first), dtype=bool)
    total = np.zeros(same.shape)
    if white:
        total += np.diag(errors.white**2 / length)
        edge = np.isclose(last[:, None], first, rtol=0, atol=0.1 / rate_hz).astype(float)
        total += errors.quantisation**2 / 12 * (2 * same - edge - edge.T) / np.outer(length, length)
    if not drift:
        return total
    gap = np.maximum(np.maximum(first[None, :] - last[:, None], first[:, None] - last[None, :]), 0.0)
    for variance, tau in zip(*flicker_components(errors), strict=True):
        a = length / tau
        lost = -np.expm1(-a)
        total += variance * np.where(same, 2 * (a - lost) / a**2, np.outer(lost / a, lost / a) * np.exp(-gap / tau))
    if errors.random_walk > 0:
        middle = (first + last) / 2
        walk = np.minimum(middle[:, None], middle[None, :])
        total += errors.random_walk**2 * (walk - np.diag(length / 6))
    return total
