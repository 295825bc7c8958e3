"""Block means of the rate less their mean."""

import numpy as np
from numpy.testing import assert_allclose

from gyronorth.report.residual import BLOCKS, residual, residual_figure


def test_a_slope_stays_a_slope_and_a_constant_is_gone():
    time = np.arange(6030) / 100
    x = np.column_stack([0.3 + 2e-3 * time, np.full_like(time, -7.0), np.sin(time)])
    found = residual(x, rate_hz=100)
    assert BLOCKS <= len(found.time) < 2 * BLOCKS
    assert found.span == 1.0
    assert_allclose(np.diff(found.rate[:, 0]), 2e-3, rtol=1e-9)
    assert_allclose(found.rate[:, 1], 0, atol=1e-12)
    assert_allclose(found.time[[0, -1]], [0.5, 59.5])


def test_the_band_holds_the_share_of_white_noise_that_it_says():
    rng = np.random.default_rng(11)
    white, rate_hz = 3e-5, 50.0
    found = residual(rng.normal(scale=white * rate_hz**0.5, size=(300_000, 3)), rate_hz=rate_hz)
    band = residual_figure(found, white=white).axes[0].patches[0].get_extents()
    low, high = residual_figure(found, white=white).axes[0].transData.inverted().transform(band.get_points())[:, 1]
    inside = np.mean((found.rate * 206264.806 > low) & (found.rate * 206264.806 < high))
    assert abs(inside - 0.95) < 4 * (0.95 * 0.05 / found.rate.size) ** 0.5
    assert not residual_figure(found).axes[0].patches
