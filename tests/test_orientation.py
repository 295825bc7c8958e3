"""The attitude for estimators: closed forms of its conventions, and its covariance against simulated units."""

from __future__ import annotations

import json
from dataclasses import replace
from math import degrees, radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gyronorth as gn
from gyronorth.attitude import orientation, rotate, rotation_vector
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.sensor import Sensor
from gyronorth.sensor.model import TriadErrors
from gyronorth.simulation import simulate

LATITUDE = radians(48.0)
ANGLE = st.floats(-3.1, 3.1)


def of(roll=0.0, pitch=0.0, heading=0.0, *, sigma=None, levelling=None, level_in_heading=True):
    known = {"latitude": LATITUDE, "level_in_heading": level_in_heading}
    return orientation(roll, pitch, heading, sigma=sigma, levelling=levelling, **known)


def test_axes_of_a_level_unit_that_heads_east():
    found = of(heading=radians(90.0))
    assert found.matrix == pytest.approx(np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]), abs=1e-12)
    assert found.yaw_enu == pytest.approx(0.0, abs=1e-12)
    assert np.abs(found.quaternion_enu) == pytest.approx([0, 0, 0, 1], abs=1e-12)  # ROS: x is east


@given(roll=ANGLE, pitch=st.floats(-1.5, 1.5), heading=st.floats(0, 6.28))
def test_quaternions_and_the_matrix_say_the_same(roll, pitch, heading):
    found = of(roll, pitch, heading)
    assert rotate(found.quaternion, np.eye(3)) == pytest.approx(found.matrix.T, abs=1e-9)
    ned = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]])
    expected = ned @ found.matrix @ np.diag([1.0, -1.0, -1.0])
    assert rotate(found.quaternion_enu, np.eye(3)) == pytest.approx(expected.T, abs=1e-9)
    forward = expected[:, 0]
    if np.hypot(forward[0], forward[1]) > 1e-3:
        assert np.cos(found.yaw_enu - np.arctan2(forward[1], forward[0])) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.slow
def test_the_covariance_is_that_of_simulated_units():
    """An accelerometer bias tilts the level by b / g and turns the heading by tan(latitude) of it: 120 units."""
    sensor = Sensor("tilted", TriadErrors(white=1e-7), TriadErrors(turn_on_bias=2e-3 * STANDARD_GRAVITY))
    true, errors = (radians(2.0), radians(-3.0), radians(40.0)), []
    found = None
    for seed in range(120):
        unit = simulate(
            sensor, latitude=LATITUDE, roll=true[0], pitch=true[1], heading=true[2], duration=40.0, rate_hz=2.0,
            rng=np.random.default_rng(seed),
        )  # fmt: skip
        found = gn.heading(unit, sensor=sensor, method="mean")
        assert found.orientation is not None
        errors.append(rotation_vector(of(*true).matrix @ found.orientation.matrix.T))
    assert found is not None
    assert found.orientation is not None
    expected = found.orientation.covariance
    assert expected is not None
    assert np.linalg.eigvalsh(expected).min() > -1e-15
    measured = np.cov(np.array(errors).T)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    # relative scatter of a variance of 120: sqrt(2 / 120) = 0.13; four of them
    assert (measured - expected) / scale == pytest.approx(np.zeros((3, 3)), abs=0.52)
    assert expected[0, 2] / scale[0, 2] < -0.9  # nearly all of the heading's error is that of the level here


def test_what_is_not_known_is_none():
    assert of(sigma=0.01).covariance is None
    full = of(sigma=0.01, levelling=0.002, level_in_heading=False).covariance
    assert full is not None
    assert full[0, 2] == 0
    assert full[2, 2] == pytest.approx(1e-4)


def test_it_is_in_the_json():
    unit = simulate(
        "isa100c", latitude=LATITUDE, heading=1.0, duration=60.0, rate_hz=20.0, rng=np.random.default_rng(1)
    )
    found = gn.heading(unit, sensor="isa100c", method="mean")
    document = json.loads(json.dumps(found.to_json()))["orientation"]
    assert found.heading is not None
    assert document["yaw_enu_deg"] == pytest.approx(90 - degrees(found.heading))
    assert np.array(document["matrix_nb"]).shape == np.array(document["covariance_n_rad2"]).shape == (3, 3)
    assert replace(found, heading=None).to_json()["orientation"] is None
