"""A compass swing: a curve that is there is found, one that is not does no harm, sessions are kept apart."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR, angle_error
from gyronorth.calibration import calibrate
from gyronorth.deviation import ANY_SESSION, read_deviation
from gyronorth.errors import InputError
from gyronorth.pipeline import heading
from gyronorth.sensor import Sensor, TriadErrors
from gyronorth.simulation import simulate

LATITUDE = np.radians(32.11)
SENSOR = Sensor("quiet", TriadErrors(white=0.005 * DEG_PER_SQRT_HOUR))
BIAS = np.array([1.0, -0.6, 0.2]) * DEG_PER_HOUR


def at(heading_true, *, session="swing", bias=BIAS, seed=0):
    """A recording at a heading whose body-fixed bias makes a deviation A sin + B cos of the heading."""
    rng = np.random.default_rng([seed, int(np.degrees(heading_true))])
    recording = simulate(SENSOR, latitude=LATITUDE, heading=heading_true, duration=60, rate_hz=3, rng=rng)
    return replace(recording, gyro_b=recording.gyro_b + bias, session=session, source="swing")


@pytest.fixture(scope="module")
def swing():
    return [at(heading_true) for heading_true in np.arange(0, 2 * np.pi, np.pi / 9)]


@pytest.mark.slow
def test_a_body_fixed_bias_is_learnt_and_corrected_in_its_session(swing, tmp_path):
    found = calibrate(swing)
    assert found.ratio < 0.35
    assert found.to_json()["recordings"] == 18
    # 1.17 deg/h of bias is 5.2 deg at its worst heading, 3.7 deg root mean square.
    assert_allclose(np.degrees(np.sqrt(np.mean(found.error**2))), 3.7, atol=0.3)
    found.model.write(tmp_path / "curve.json")
    model = read_deviation(tmp_path / "curve.json")
    new = at(np.radians(50.0), seed=1)
    plain, corrected = (heading(new, sensor=SENSOR, method="mean", deviation=curve) for curve in (None, model))
    assert abs(angle_error(corrected.heading, new.heading_true)) < 0.4 * abs(
        angle_error(plain.heading, new.heading_true)
    )
    assert "deviation_applied" in {warning.code for warning in corrected.warnings}


@pytest.mark.slow
def test_another_or_no_session_is_left_alone_unless_told_otherwise(swing):
    model = calibrate(swing).model
    for session in ("another", None):
        new = at(np.radians(50.0), session=session, seed=1)
        plain = heading(new, sensor=SENSOR, method="mean")
        assert heading(new, sensor=SENSOR, method="mean", deviation=model).heading == plain.heading
        told = heading(new, sensor=SENSOR, method="mean", deviation=replace(model, session=ANY_SESSION))
        assert told.heading != plain.heading
    nameless = calibrate([replace(recording, session=None) for recording in swing]).model
    assert not nameless.covers(None)


def test_far_from_every_heading_of_the_swing_nothing_is_corrected():
    """Six recordings within 50 deg may agree on a curve; what it is on the other side they cannot know."""
    model = calibrate([at(angle) for angle in np.radians([0, 10, 20, 30, 40, 50, 15])]).model
    for degrees, code in ((90.0, "deviation_applied"), (100.0, "deviation_unused"), (230.0, "deviation_unused")):
        new = at(np.radians(degrees), seed=1)
        plain, found = (heading(new, sensor=SENSOR, method="mean", deviation=curve) for curve in (None, model))
        assert [warning.code for warning in found.warnings] == [code]
        assert (found.heading == plain.heading) == (code == "deviation_unused")
        if code == "deviation_unused":
            off = np.degrees(np.abs(angle_error(model.heading, plain.heading)).min())
            assert f"is {off:.0f} deg away; within 45 deg" in found.warnings[0].message


def test_a_swing_that_cannot_be_used_is_refused(swing):
    with pytest.raises(InputError, match="swing and a copy are one and the same recording"):
        calibrate([*swing, replace(swing[3], source="a copy")])
    with pytest.raises(InputError, match="needs at least"):
        calibrate(swing[:5])
    with pytest.raises(InputError, match="2 sessions"):
        calibrate([*swing, at(1.0, session="other")])
    with pytest.raises(InputError, match="true heading"):
        calibrate([*swing, replace(swing[0], heading_true=None)])
    with pytest.raises(InputError, match="--latitude"):
        calibrate([*swing, replace(swing[0], latitude=None)])
    with pytest.raises(InputError, match="method is inertial"):
        heading(swing[0], sensor=SENSOR, method="inertial", deviation=calibrate(swing).model)


def test_a_curve_is_of_one_latitude(swing):
    with pytest.raises(InputError, match=r"latitudes 32\.11 to 60\.00 deg"):
        calibrate([*swing, replace(swing[0], latitude=np.radians(60.0))])
    elsewhere = replace(swing[0], latitude=np.radians(35.0))
    with pytest.raises(InputError, match=r"measured at latitude 32\.11 deg"):
        heading(elsewhere, sensor=SENSOR, method="mean", deviation=calibrate(swing).model)
