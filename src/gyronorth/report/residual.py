"""The rate less its mean against time: drift is a slope or a bow, a bump is a spike, noise fills a band."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import matplotlib as mpl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyronorth.angles import DEG_PER_HOUR
from gyronorth.report.figures import AXIS_STYLES, FAINT, SETTINGS, legend_above, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Block means of a drawn record, at most twice as many.
BLOCKS = 60
#: Half-width of the interval that holds 95 % of a normal law, in sigma.
NORMAL_95 = 1.96


class Residual(NamedTuple):
    """Block means of a record less its mean."""

    time: NDArray[np.float64]  # (k,) middle of each block, s
    rate: NDArray[np.float64]  # (k, 3) rad/s
    span: float  # length of a block, s


def residual(x: ArrayLike, *, rate_hz: float) -> Residual:
    """Block means of a record less the mean of all blocks.

    Parameters
    ----------
    x : array_like, shape (n, 3)
        Angular rate, rad/s.
    rate_hz : float
        Sample rate, Hz.

    Returns
    -------
    Residual
        Of `BLOCKS` blocks or up to twice as many; a rest that fills no block is left out.
    """
    x = np.asarray(x, dtype=np.float64)
    length = max(1, len(x) // BLOCKS)
    count = len(x) // length
    means = x[: count * length].reshape(count, length, 3).mean(axis=1)
    time: NDArray[np.float64] = (np.arange(count, dtype=np.float64) + 0.5) * (length / rate_hz)
    return Residual(time, means - means.mean(axis=0), length / rate_hz)


def residual_figure(found: Residual, *, white: float | None = None) -> Figure:
    """The three axes, and the band that holds 95 % of them if all is white noise (rad/sqrt(s))."""
    with mpl.rc_context(SETTINGS):
        figure = new_figure(4.5, 3.3)
        axes = figure.subplots()
        axes.set(title="Rate less its mean", xlabel="time (s)", ylabel="residual (deg/h)")
        if white:
            half = NORMAL_95 * white / found.span**0.5 / DEG_PER_HOUR
            axes.axhspan(-half, half, color=FAINT, alpha=0.2, linewidth=0, label="profile")
        for (name, colour, line), rate in zip(AXIS_STYLES, found.rate.T, strict=True):
            axes.plot(
                found.time, rate / DEG_PER_HOUR, color=colour, linestyle=line, linewidth=1.2, label=f"body {name}"
            )
        legend_above(axes, columns=4)
    return figure
