"""Names for the kinds of array that pass between modules; figures of arrays that several modules need."""

from __future__ import annotations

from math import comb

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Index = NDArray[np.int64]


def mean_of_rows(x: Array) -> Array:
    """Mean (..., k) over the rows of `x` (..., n, k), bit for bit that of numpy, four times as fast for few columns."""
    return np.asarray(np.einsum("...tk->...k", x) / x.shape[-2])


def median(x: Array, axis: int | None = None) -> Array:
    """What `numpy.median` gives, which loads `numpy.ma` first: as long as all else that numpy does for a heading.

    Parameters
    ----------
    x : ndarray
        Numbers.
    axis : int, optional
        None: of all numbers.
    """
    x = np.ravel(x) if axis is None else np.moveaxis(np.asarray(x), axis, -1)
    count = x.shape[-1]
    if count == 0:
        return np.full(x.shape[:-1], np.nan)
    below, above = (count - 1) // 2, count // 2
    ordered = np.partition(x, (below, above, count - 1), axis=-1)  # a NaN comes last
    middle = (ordered[..., below] + ordered[..., above]) / 2 if below != above else ordered[..., below]
    return np.asarray(np.where(np.isnan(ordered[..., -1]), np.nan, middle))


def robust_noise(x: Array, axis: int | None = None, *, order: int = 1) -> Array:
    """Standard deviation of the white noise of one sample, whatever the record does besides: by medians.

    The question is how much neighbours scatter, not what the mean of the record is known to: that is
    `conditioning.noise_density`, and `posterior.blocks.density_at_short_lags` where vibration is to be passed over.

    Parameters
    ----------
    x : ndarray, shape (n, ...)
        Samples, one after the other along the first axis.
    axis : int, optional
        Axis of the medians; None: of all numbers.
    order : int
        Of the differences: 1 is blind to drift, 2 to slow motion too.

    Notes
    -----
    The variance of a difference of order k is binomial(2 k, k) of that of a sample; 1.4826 makes of the median size of
    Gaussian numbers their standard deviation.
    """
    size = median(np.abs(np.diff(x, n=order, axis=0)), axis)
    return np.asarray(1.4826 * size / np.sqrt(comb(2 * order, order)))
