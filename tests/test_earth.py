"""Earth rate and gravity against published values."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis.strategies import floats
from numpy.testing import assert_allclose

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


@pytest.mark.slow
@given(floats(-90, 90), floats(0, 5000))
def test_gravity_agrees_with_pyins(latitude, height):
    from pyins import earth as pyins_earth

    # pyins continues it with 1 - 2 h / a alone: it leaves out 2 (f + m) h / a and 3 (h / a)^2.
    ours = normal_gravity(np.radians(latitude), height)
    left_out = 9.84 * (
        2 * (FLATTENING + GRAVITY_RATIO) * height / SEMI_MAJOR_AXIS + 3 * (height / SEMI_MAJOR_AXIS) ** 2
    )
    assert_allclose(ours, pyins_earth.gravity(latitude, height), rtol=0, atol=left_out + 1e-6)


def test_gravity_at_10_km_by_the_gravity_field():
    # Above the equator: GM / r^2 (1 + 3/2 J2 (a / r)^2 - 15/8 J4 (a / r)^4) - omega^2 r, WGS 84 (TR8350.2, table 3.2).
    def field(height):
        r = SEMI_MAJOR_AXIS + height
        ratio = SEMI_MAJOR_AXIS / r
        return (
            3.986004418e14 / r**2 * (1 + 1.5 * 1.082629821e-3 * ratio**2 + 1.875 * 2.37091e-6 * ratio**4)
            - EARTH_RATE**2 * r
        )

    assert_allclose(
        normal_gravity(0.0, 10e3) - normal_gravity(0.0), field(10e3) - field(0.0), atol=1e-6
    )  # as the docstring says
