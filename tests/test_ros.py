"""The node's mapping between messages and estimates, with messages that only look like those of ROS."""

from __future__ import annotations

from dataclasses import replace
from math import radians
from types import SimpleNamespace

import numpy as np
import pytest

import gyronorth as gn
from gyronorth import ros
from gyronorth.errors import InputError
from gyronorth.findings import Finding
from gyronorth.simulation import simulate

LATITUDE, RATE_HZ = radians(48.0), 20.0


def vector(values):
    return SimpleNamespace(**dict(zip("xyz", values, strict=True)))


def imu(t: float, rate=(0, 0, 0), force=(0, 0, 0)) -> SimpleNamespace:
    stamp = SimpleNamespace(sec=int(t), nanosec=round((t - int(t)) * 1e9))
    return SimpleNamespace(
        header=SimpleNamespace(stamp=stamp), angular_velocity=vector(rate), linear_acceleration=vector(force),
        orientation=SimpleNamespace(),
    )  # fmt: skip


@pytest.fixture(scope="module")
def unit():
    return simulate(
        "isa100c", latitude=LATITUDE, roll=radians(2.0), heading=radians(40.0), duration=60.0, rate_hz=RATE_HZ,
        rng=np.random.default_rng(3),
    )  # fmt: skip


def test_messages_give_the_heading_of_the_recording(unit):
    flu = np.array([1, -1, -1])
    collector = ros.Collector(latitude=LATITUDE, sensor="isa100c", method="mean")
    assert collector.estimate() is None
    for i, (rate, force) in enumerate(zip(unit.gyro_b, unit.accel_b, strict=True)):
        collector.add(imu(1e9 + i / RATE_HZ, rate * flu, force * flu))
    found, expected = collector.estimate(), gn.heading(unit, sensor="isa100c", method="mean")
    assert found is not None
    assert found.rate_hz == pytest.approx(RATE_HZ, rel=1e-6)
    assert found.heading == pytest.approx(expected.heading, abs=1e-6)
    again = collector.estimate()  # nothing new has come
    assert again is not None
    assert again.heading == pytest.approx(found.heading)


def test_an_estimate_as_messages(unit):
    found = gn.heading(unit, sensor="isa100c", method="mean")
    message = ros.fill_imu(imu(0), found)
    assert found.orientation is not None
    assert found.sigma is not None
    turn = [getattr(message.orientation, name) for name in "xyzw"]
    assert turn == pytest.approx(found.orientation.quaternion_enu.tolist())
    assert len(message.orientation_covariance) == 9
    assert message.orientation_covariance[8] == pytest.approx(found.sigma**2)
    assert message.angular_velocity_covariance[0] == -1
    azimuth = ros.fill_azimuth(SimpleNamespace(), found)
    assert (azimuth.azimuth, azimuth.variance) == (found.heading, found.sigma**2)
    assert (azimuth.unit, azimuth.orientation, azimuth.reference) == (0, 1, 1)
    assert ros.diagnosis(found)[:2] == (ros.OK, "valid")


@pytest.mark.parametrize(("code", "level"), [("too_short", ros.WARN), ("motion", ros.ERROR)])
def test_a_refused_estimate_is_no_orientation(unit, code, level):
    refused = replace(gn.heading(unit, sensor="isa100c", method="mean"), reasons=(Finding(code, "No."),))
    message = ros.fill_imu(imu(0), refused)
    assert message.orientation_covariance == [-1.0, *[0.0] * 8]
    assert not hasattr(message.orientation, "x")
    said = ros.diagnosis(refused)
    assert (said[0], said[1], said[2]["reasons"]) == (level, "No.", code)


def test_stamps_that_tell_no_rate():
    with pytest.raises(InputError, match="do not rise"):
        ros.rate_of([1.0] * 10)
    with pytest.raises(InputError, match="some are lost"):
        ros.rate_of([*np.arange(100) / 100, *(3 + np.arange(100) / 100)])
