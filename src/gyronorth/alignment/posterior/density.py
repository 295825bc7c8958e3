"""The density of the heading: a mixture of von Mises laws on a grid, and what is read from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyronorth.angles import mean_direction, wrap_heading
from gyronorth.arrays import Array
from gyronorth.estimate import HeadingDensity

#: Points of the density on the circle, or on the part of it that holds the mass.
POINTS = 1024
#: Bins of concentration, relative: two laws in one bin differ by 5 % in kappa at most.
BIN = 0.1
#: Points that are handed on.
TOLD = 256
#: Most mass that may be left off the grid, for what is left to stand on it finely.
FAR_MASS = 1e-3
#: Series of Abramowitz and Stegun (1964), 9.8.1 in (x / 3.75)^2 and 9.8.2 in 3.75 / x, the highest power first.
NEAR_SERIES = (0.0045813, 0.0360768, 0.2659732, 1.2067492, 3.0899424, 3.5156229, 1.0)
FAR_SERIES = (
    *(0.00392377, -0.01647633, 0.02635537, -0.02057706, 0.00916281),
    *(-0.00157565, 0.00225319, 0.01328592, 0.39894228),
)
#: Mass of the interval.
MASS = 0.95


@dataclass(frozen=True)
class Density:
    """Density of the heading of one recording."""

    heading: float  # circular mean, rad in [0, 2 pi)
    sigma: float  # root mean square deviation from it, rad
    low: float  # ends of the shortest single arc that holds 95 %, rad from `heading`
    high: float
    grid: Array  # (POINTS,) rad from `heading`
    density: Array  # (POINTS,) 1/rad

    def told(self) -> HeadingDensity:
        """The same at `TOLD` points, each the mean of its neighbours, so that its integral stays 1."""
        grid, density = (np.asarray(each.reshape(TOLD, -1).mean(axis=1)) for each in (self.grid, self.density))
        return HeadingDensity(np.asarray(wrap_heading(self.heading + grid)), density)


def log_i0e(x: Array) -> Array:
    """log(exp(-x) I_0(x)), x >= 0, within 2e-7 (Abramowitz and Stegun 1964, 9.8.1 and 9.8.2)."""
    x = np.asarray(x, dtype=float)
    small = x < 3.75
    inverse = 1 / np.maximum(x, 3.75)
    found = np.log(_horner(FAR_SERIES, 3.75 * inverse) * np.sqrt(inverse))
    if small.any():
        near = x[small]
        found[small] = np.log(_horner(NEAR_SERIES, (near / 3.75) ** 2)) - near
    return np.asarray(found, dtype=float)


def _horner(series: tuple[float, ...], x: Array) -> Array:
    """A polynomial, its highest power first."""
    total = np.full_like(x, series[0])
    for term in series[1:]:
        total *= x
        total += term
    return total


def mixture(centre: Array, concentration: Array, weight: Array) -> Density:
    """Mixture of von Mises laws about `centre` (k,), rad, with weights that sum to 1.

    Laws of nearly the same concentration are gathered on the grid, so that each bin of concentration costs one
    convolution on the circle.
    """
    kappa = np.maximum(concentration, 1e-3)
    pull = weight * kappa / np.sqrt(4 + kappa**2)  # a weight that grows as the mean resultant length does
    mean = float(mean_direction(centre, pull))
    off = (centre - mean + np.pi) % (2 * np.pi) - np.pi
    # What lies far off and weighs next to nothing would cost all of the grid's resolution.
    each = np.abs(off) + 9 / np.sqrt(kappa)
    order = np.argsort(each)
    inner = order[: int(np.searchsorted(np.cumsum(weight[order]), 1 - FAR_MASS)) + 1]
    far = 0.0
    if each[order[-1]] >= np.pi / 3 > each[inner].max():
        outer = order[len(inner) :]
        far = float(weight[outer] @ np.minimum(off[outer] ** 2 + 1 / kappa[outer], np.pi**2))
        off, kappa, weight = off[inner], kappa[inner], weight[inner] / weight[inner].sum()
    reach = float(np.max(np.where(weight > 1e-9, np.abs(off) + 9 / np.sqrt(kappa), 0.0)))
    if reach < np.pi / 3:
        spread = float(np.sqrt(weight @ (off**2 + 1 / kappa)))
        reach = min(reach, 40 * spread)
    reach = np.pi if reach >= np.pi / 3 else reach
    step = 2 * reach / POINTS
    place = np.clip((off + reach) / step - 0.5, 0, POINTS - 1.001)
    left = place.astype(int)
    share = place - left
    bins = np.round(np.log(kappa) / BIN).astype(int)
    numbers, row = np.unique(bins, return_inverse=True)
    size = len(numbers) * POINTS
    lines = np.bincount(row * POINTS + left, weight * (1 - share), minlength=size)
    lines += np.bincount(row * POINTS + left + 1, weight * share, minlength=size)
    # The kernels are even: one half of each is worked out.
    half = np.exp(np.exp(numbers * BIN)[:, None] * (np.cos(step * np.arange(POINTS // 2 + 1)) - 1))
    kernels = np.concatenate([half, half[:, POINTS // 2 - 1 : 0 : -1]], axis=1)
    kernels /= kernels.sum(axis=1, keepdims=True)
    wave = np.sum(np.fft.rfft(lines.reshape(-1, POINTS), axis=1) * np.fft.rfft(kernels, axis=1), axis=0)
    return _read(np.maximum(np.fft.irfft(wave, POINTS), 0), mean, reach, step, far)


def _read(mass: Array, mean: float, reach: float, step: float, far: float) -> Density:
    """What the grid holds; `far` is the share of the variance, rad^2, that lies beyond it."""
    mass = mass / mass.sum()
    grid = np.asarray((np.arange(POINTS) + 0.5) * step - reach, dtype=float)
    middle = float(mean_direction(grid, mass))
    if reach == np.pi:  # turn the circle so that its cut lies opposite the mean
        shift = round(middle / step)
        mass, mean, middle = np.roll(mass, -shift), mean + shift * step, middle - shift * step
    grid = grid - middle
    low, high = _shortest_arc(mass, step)
    start = grid[0] - step / 2
    return Density(
        heading=float(wrap_heading(mean + middle)),
        sigma=float(np.sqrt(mass @ grid**2 + far)),
        low=min(low + start, 0.0),
        high=max(high + start, 0.0),
        grid=grid,
        density=mass / step,
    )


def _shortest_arc(mass: Array, step: float) -> tuple[float, float]:
    """Ends, rad from the first edge of the grid, of the shortest arc that holds `MASS`."""
    edges = np.concatenate([[0.0], np.cumsum(mass)])
    start = np.arange(len(edges))
    wanted = edges + MASS
    width = np.where(wanted <= edges[-1], np.interp(wanted, edges, start) - start, np.inf)
    best = int(np.argmin(width))
    return best * step, (best + float(width[best])) * step
