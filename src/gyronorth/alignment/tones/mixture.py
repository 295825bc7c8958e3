"""The heading of many models, each a von Mises law with its weight: summed on a grid, for `bayes`.

`posterior.density` gathers the laws of thousands of hypotheses in bins; `bayes`, its yardstick, shares nothing with it.
"""

from __future__ import annotations

import numpy as np

from gyronorth.angles import mean_direction, wrap, wrap_heading
from gyronorth.arrays import Array

#: Headings on which the posterior is computed.
HEADINGS = 1440


def mixture(centre: Array, concentration: Array, weight: Array) -> tuple[float, float, tuple[float, float]]:
    """Mean, root mean square deviation and shortest 95 % interval of a mixture of von Mises laws."""
    from scipy.special import i0e, i1e

    pull = weight * i1e(concentration) / i0e(concentration)
    mean = float(mean_direction(centre, pull))
    off = wrap(centre - mean)
    spread = np.sqrt(weight @ (off**2 + 1 / np.maximum(concentration, 1e-3)))
    reach = min(np.pi, 10 * spread)
    grid = (np.arange(HEADINGS) + 0.5) / HEADINGS * 2 * reach - reach
    density = np.zeros(HEADINGS)
    order = np.argsort(-weight)
    order = order[: np.searchsorted(np.cumsum(weight[order]), 0.9999) + 1]
    for part in np.array_split(order, -(-len(order) // 500)):
        peak = concentration[part, None] * (np.cos(grid - off[part, None]) - 1)
        density += weight[part] / i0e(concentration[part]) @ np.exp(peak)
    density /= density.sum()
    middle = float(density @ grid)
    edges = np.linspace(-reach, reach, HEADINGS + 1)
    cumulative = np.concatenate([[0.0], np.cumsum(density)])
    starts = edges[cumulative <= 0.05]
    ends = np.interp(cumulative[: len(starts)] + 0.95, cumulative, edges)
    shortest = int(np.argmin(ends - starts))
    low, high = mean + starts[shortest], mean + ends[shortest]
    sigma = float(np.sqrt(density @ (grid - middle) ** 2))
    return float(wrap_heading(mean + middle)), sigma, (float(wrap_heading(low)), float(wrap_heading(high)))
