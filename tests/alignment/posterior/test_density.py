"""The density of a mixture of von Mises laws against closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.strategies import floats
from scipy import special, stats

from gyronorth.alignment.posterior.density import log_i0e, mixture


def test_the_bessel_function_agrees_with_scipy():
    x = np.concatenate([[0.0], np.geomspace(1e-6, 1e8, 400)])
    np.testing.assert_allclose(log_i0e(x), np.log(special.i0e(x)), atol=3e-7)


@settings(deadline=None, max_examples=25)
@given(centre=floats(0, 6.28), log_kappa=floats(-2, 14))
def test_one_law_has_the_sigma_and_interval_of_von_mises(centre, log_kappa):
    kappa = float(np.exp(log_kappa))
    found = mixture(np.array([centre]), np.array([kappa]), np.array([1.0]))
    # Bins of concentration are 10 % wide, so that a width may be off by 2.5 %; a grid step adds at most 1/512 of it.
    half = float(stats.vonmises.ppf(0.975, kappa))
    if kappa > 1:
        assert abs((found.heading - centre + np.pi) % (2 * np.pi) - np.pi) < 0.02 * half
        assert (found.high - found.low) / 2 == pytest.approx(half, rel=0.04)
    angle = np.linspace(-np.pi, np.pi, 20001)
    density = np.exp(kappa * (np.cos(angle) - 1))
    rms = np.sqrt(np.sum(density * angle**2) / np.sum(density)) if kappa < 1e4 else 1 / np.sqrt(kappa)
    assert found.sigma == pytest.approx(rms, rel=0.04)
    assert np.sum(found.density) * (found.grid[1] - found.grid[0]) == pytest.approx(1.0)


def test_the_interval_is_one_arc_of_the_shortest_length():
    # A narrow law of 97 % and a wide one of 3 % far away: the arc holds the narrow one and nothing else.
    found = mixture(np.array([1.0, 2.5]), np.array([1e4, 1e4]), np.array([0.97, 0.03]))
    assert found.low <= 0 <= found.high
    narrow = 1.0 - found.heading
    half = stats.norm.ppf(0.5 + 0.95 / 0.97 / 2) * 0.01
    assert found.low == pytest.approx(narrow - half, abs=0.004)
    # Two opposite halves: nothing is known, and the arc is more than half the circle.
    found = mixture(np.array([0.0, np.pi]), np.array([100.0, 100.0]), np.array([0.5, 0.5]))
    assert found.high - found.low > np.pi


def test_two_equal_laws_have_the_mean_between_them_and_the_sigma_of_both():
    found = mixture(np.array([0.1, 0.3]), np.array([1e4, 1e4]), np.array([0.5, 0.5]))
    assert found.heading == pytest.approx(0.2, abs=1e-3)
    assert found.sigma == pytest.approx(np.hypot(0.1, 0.01), rel=0.01)
