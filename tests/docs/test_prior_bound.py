"""The table of the theory page that says what any prior of a constant disturbance costs, worked out again."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import erf, ndtri

PAGE = Path(__file__).parents[2] / "docs/theory/disturbance.md"
FACTORS = (2.3, 3.0)


def row(begin: str) -> list[float]:
    line = next(line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith(f"| {begin}"))
    return [float(cell) for cell in re.findall(r"\| (\d\.\d+)", line)]


def half_width(wide, factor):
    """Half the interval of 95 % of a mixture of normal laws of standard deviation 1 and `factor`, by bisection."""
    low, high = np.zeros_like(wide), np.full_like(wide, 10 * factor)
    for _ in range(40):
        middle = (low + high) / 2
        short = (1 - wide) * erf(middle / np.sqrt(2)) + wide * erf(middle / factor / np.sqrt(2)) < 0.95
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    return high


@pytest.mark.parametrize("factor", [4, 25])
@pytest.mark.parametrize("column", range(5))
def test_what_a_tilt_costs_that_only_the_norm_shows(column, factor):
    """One of two disturbed errors is seen; it weighs still (1) against tilting (`factor`), the other is missed."""
    prior = (0.04, 0.1, 0.2, 0.3, 0.5)[column]
    # Quantiles of the size of a normal error, so that nothing scatters.
    seen = ndtri(0.5 + (np.arange(4000) + 0.5) / 8000)

    def wide(error):
        tilting = prior / factor * np.exp(-(error**2) / 2 / factor**2)
        return tilting / (tilting + (1 - prior) * np.exp(-(error**2) / 2))

    wider = half_width(wide(seen), factor).mean() / 1.96
    missed = np.mean(1 - erf(half_width(wide(seen * factor), factor) / factor / np.sqrt(2)))
    assert_allclose(wider, row(f"is wider for a still unit, $s$ = {factor}")[column], rtol=0.01)
    assert_allclose(missed, row(f"misses the tilting one, $s$ = {factor}")[column], atol=0.006)


@pytest.mark.parametrize("column", range(5))
def test_what_a_prior_costs_and_what_it_misses(column):
    """Two of three normal errors are seen; they weigh honest (1) against disturbed (`factor`), the third is missed."""
    prior = (0.02, 0.1, 0.2, 0.3, 0.5)[column]
    seen = np.sum(np.random.default_rng(1).normal(size=(4000, 2)) ** 2, axis=1)
    wider, missed = [], []
    for factor in FACTORS:

        def wide(squares, factor=factor):
            disturbed = prior / factor**2 * np.exp(-squares / 2 / factor**2)
            return disturbed / (disturbed + (1 - prior) * np.exp(-squares / 2))

        wider.append(half_width(wide(seen), factor).mean() / 1.96)
        missed.append(np.mean(1 - erf(half_width(wide(seen * factor**2), factor) / factor / np.sqrt(2))))
    assert_allclose(np.mean(wider), row("is wider, where there is no disturbance")[column], atol=0.03)
    assert_allclose(np.mean(missed), row("misses, where there is, in")[column], atol=0.015)


def test_what_the_best_rule_of_all_misses():
    """Half widths that minimise the misses of a disturbed unit plus prices of width and of misses of an honest one."""
    factor, widest, missed = 2.3, 1.2 * 1.96, 0.07
    seen = -2 * np.log((np.arange(200) + 0.5) / 200)  # quantiles of chi-square with 2 degrees of freedom
    odds = np.exp(seen / 2 * (1 - factor**-2)) / factor**2
    half = np.linspace(0, 6 * factor, 400)
    disturbed, honest = 1 - erf(half / factor / np.sqrt(2)), 1 - erf(half / np.sqrt(2))

    def rule(price: float, of_honest: float) -> tuple[float, float, float]:
        best = np.argmin(odds[:, None] * disturbed + of_honest * honest + price * half, axis=1)
        return half[best].mean(), honest[best].mean(), (odds * disturbed[best]).mean()

    least = 1.0
    for of_honest in np.geomspace(0.03, 0.6, 10):
        low, high = 1e-4, 1.0
        for _ in range(15):
            price = np.sqrt(low * high)
            low, high = (price, high) if rule(price, of_honest)[0] > widest else (low, price)
        _, honestly, disturbedly = rule(high, of_honest)
        if honestly <= missed:
            least = min(least, disturbedly)
    assert least == pytest.approx(0.12, abs=0.005)
