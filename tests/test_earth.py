"""Earth rate and gravity against published values."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis.strategies import floats
from numpy.testing import assert_allclose
from pyins import earth as pyins_earth

from gyronorth.earth import (
    EARTH_RATE,
    FLATTENING,
    GRAVITY_RATIO,
    SEMI_MAJOR_AXIS,
    earth_rate_n,
    mat_ne,
    normal_gravity,
)

LATITUDES = floats(-np.pi / 2, np.pi / 2)
LONGITUDES = floats(-np.pi, np.pi)


def test_earth_rate_is_one_turn_per_sidereal_day():
    # 86164.0905 s: IAU mean sidereal day (Explanatory Supplement to the Astronomical Almanac, 2013, table 3.1).
    assert_allclose(2 * np.pi / EARTH_RATE, 86164.0905, rtol=1e-6)


def test_components_by_hand():
    assert_allclose(earth_rate_n(np.radians(60)) / EARTH_RATE, [0.5, 0, -np.sqrt(3) / 2], atol=1e-15)
    assert_allclose(earth_rate_n(np.radians(-30)) / EARTH_RATE, [np.sqrt(3) / 2, 0, 0.5], atol=1e-15)


@given(LATITUDES, LONGITUDES)
def test_corrected_eq3_is_a_rotation_and_gives_the_earth_rate(latitude, longitude):
    mat = mat_ne(latitude, longitude)
    assert_allclose(mat @ mat.T, np.eye(3), atol=1e-14)
    assert_allclose(np.linalg.det(mat), 1, atol=1e-14)
    assert_allclose(mat @ [0, 0, EARTH_RATE], earth_rate_n(latitude), atol=1e-19)


def test_eq3_as_printed_is_no_rotation():
    # The misprint of the paper: cos(lon) twice in the third row.
    latitude, longitude = np.radians(32.11), np.radians(35.0)
    printed = mat_ne(latitude, longitude)
    printed[2, 1] = printed[2, 0]
    assert np.abs(printed @ printed.T - np.eye(3)).max() > 0.1


@pytest.mark.parametrize(("latitude", "gravity"), [(0, 9.7803253359), (90, 9.8321849379), (45, 9.8061977694)])
def test_normal_gravity_of_the_standard(latitude, gravity):
    # NIMA TR8350.2, 3rd ed., 2000: table 3.4 (equator, pole) and eq. 4-1 at 45 deg.
    assert_allclose(normal_gravity(np.radians(latitude)), gravity, atol=1e-9)


@given(floats(-90, 90), floats(0, 5000))
def test_gravity_agrees_with_pyins(latitude, height):
    # pyins continues it with 1 - 2 h / a alone: it leaves out 2 (f + m) h / a and 3 (h / a)^2.
    ours = normal_gravity(np.radians(latitude), height)
    left_out = 9.84 * (
        2 * (FLATTENING + GRAVITY_RATIO) * height / SEMI_MAJOR_AXIS + 3 * (height / SEMI_MAJOR_AXIS) ** 2
    )
    assert_allclose(ours, pyins_earth.gravity(latitude, height), rtol=0, atol=left_out + 1e-6)
