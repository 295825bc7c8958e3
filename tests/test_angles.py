"""Angles on the circle."""

import numpy as np
from hypothesis import given
from hypothesis.strategies import floats
from numpy.testing import assert_allclose

from gyronorth.angles import (
    DEG_PER_HOUR,
    DEG_PER_SQRT_HOUR,
    angle_error,
    circular_mean,
    cyclic_rmse,
    wrap,
    wrap_heading,
)

ANGLES = floats(-1e3, 1e3)


@given(ANGLES)
def test_wrapped_angle_lies_in_its_range_and_is_the_same_direction(angle):
    for wrapped, low in ((wrap(angle), -np.pi), (wrap_heading(angle), 0.0)):
        assert low <= wrapped < low + 2 * np.pi
        assert_allclose([np.cos(wrapped), np.sin(wrapped)], [np.cos(angle), np.sin(angle)], atol=1e-12)


def test_a_tiny_negative_heading_is_zero_not_a_full_turn():
    # Plain % gives 2 pi exactly here, which is outside [0, 2 pi).
    assert wrap_heading(-1e-20) == 0.0


def test_error_across_north_is_the_short_way():
    assert_allclose(np.degrees(angle_error(np.radians(1), np.radians(359))), 2)
    assert_allclose(np.degrees(angle_error(np.radians(359), np.radians(1))), -2)


def test_circular_mean_of_published_example():
    # Jammalamadaka and SenGupta, "Topics in Circular Statistics", 2001, page 23: 48.63 deg.
    assert_allclose(np.degrees(circular_mean(np.radians([51, 67, 40, 109, 31, 358]))), 48.63, atol=0.005)


def test_cyclic_rmse_wraps_each_error():
    # By hand: errors 3 and -4 deg, given as 363 and 356 deg: sqrt((9 + 16) / 2).
    assert_allclose(np.degrees(cyclic_rmse(np.radians([363, 356]))), np.sqrt(12.5))


def test_units():
    assert_allclose(np.degrees(DEG_PER_HOUR) * 3600, 1)
    assert_allclose(np.degrees(DEG_PER_SQRT_HOUR) * 60, 1)
