"""Noise density of the gyro against frequency: sway and vibration show as lines above the noise of the profile."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import matplotlib as mpl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyronorth.angles import DEG_PER_HOUR
from gyronorth.report.figures import AXIS_STYLES, INK, SETTINGS, legend_above, logarithmic, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Segments of the record whose periodograms are averaged; each overlaps half of the next.
SEGMENTS = 8
#: Points of a drawn curve: frequencies are averaged in bins of equal width in the logarithm.
POINTS = 120
#: Samples from which there is something to draw.
SHORTEST = 64


class Spectrum(NamedTuple):
    """Amplitude density, two-sided convention: white noise stands at its angle random walk."""

    frequency: NDArray[np.float64]  # (k,) Hz
    density: NDArray[np.float64]  # (k, 3) rad/s/sqrt(Hz)


def spectrum(x: ArrayLike, *, rate_hz: float) -> Spectrum:
    """Amplitude density of a record, by averaged periodograms of overlapping segments [1]_.

    Parameters
    ----------
    x : array_like, shape (n, 3)
        Angular rate, rad/s, with n of at least `SHORTEST`.
    rate_hz : float
        Sample rate, Hz.

    Returns
    -------
    Spectrum
        At most `POINTS` frequencies; their first is that of one period in a segment.

    References
    ----------
    .. [1] P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra", IEEE Transactions on
           Audio and Electroacoustics 15, 1967, pp. 70-73.
    """
    from scipy.signal import welch

    x = np.asarray(x, dtype=np.float64)
    frequency, power = welch(x, rate_hz, nperseg=2 * len(x) // (SEGMENTS + 1), axis=0)
    return _in_bins(frequency[1:], power[1:] / 2)  # of both sides


def _in_bins(frequency: NDArray[np.float64], power: NDArray[np.float64]) -> Spectrum:
    """Means of the power over bins of equal width in the logarithm of the frequency."""
    edges = np.geomspace(frequency[0], frequency[-1] * (1 + 1e-9), POINTS + 1)
    number = np.clip(np.searchsorted(edges, frequency, side="right") - 1, 0, POINTS - 1)
    first = np.flatnonzero(np.diff(number, prepend=-1))
    count = np.diff(first, append=len(frequency))
    middle: NDArray[np.float64] = np.add.reduceat(frequency, first) / count
    return Spectrum(middle, np.sqrt(np.add.reduceat(power, first, axis=0) / count[:, None]))


def spectrum_figure(found: Spectrum, *, white: float | None = None) -> Figure:
    """The three axes, and the white noise of a profile (rad/sqrt(s)) beside them."""
    with mpl.rc_context(SETTINGS):
        figure = new_figure(4.5, 3.3)
        axes = figure.subplots()
        axes.set(title="Spectrum of the rate", xlabel="frequency (Hz)", ylabel="density (deg/h/√Hz)")
        logarithmic(axes)
        for (name, colour, line), density in zip(AXIS_STYLES, found.density.T, strict=True):
            if density.all():
                axes.plot(found.frequency, density / DEG_PER_HOUR, color=colour, linestyle=line, label=f"body {name}")
        if white:
            axes.axhline(white / DEG_PER_HOUR, color=INK, linewidth=1.0, label="profile")
        legend_above(axes, columns=4)
    return figure
