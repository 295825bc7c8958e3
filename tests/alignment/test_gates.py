"""The gates: each fails where its formula says, and not before."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from gyronorth.alignment.error_budget import TURN_LIMITS
from gyronorth.alignment.gates import (
    implied_latitude,
    length_finding,
    motion_gate,
    rate_gates,
    saturation_gate,
    width_gates,
)
from gyronorth.angles import DEG_PER_HOUR
from gyronorth.earth import EARTH_RATE, earth_rate_n
from gyronorth.pipeline import heading
from gyronorth.recording import Recording

LATITUDE = np.radians(32.11)
RATE = earth_rate_n(LATITUDE)


def gates_of(rate_l, *, sigma_deg_h, known=True, vertical_deg_h=None):
    variance = np.asarray((sigma_deg_h * DEG_PER_HOUR) ** 2)
    vertical = variance if vertical_deg_h is None else np.asarray((vertical_deg_h * DEG_PER_HOUR) ** 2)
    gates = rate_gates(rate_l, variance=variance, vertical_variance=vertical, latitude=LATITUDE, known=known)
    return {gate.code: gate for gate in gates}


@pytest.mark.parametrize(("share", "fails"), [(0.99, False), (1.01, True), (-0.99, False), (-1.01, True)])
def test_rate_norm_limit_is_329_sigma_along_the_rate(share, fails):
    rate = RATE * (1 + share * 3.29 * 1.2 * DEG_PER_HOUR / EARTH_RATE)
    gate = gates_of(rate, sigma_deg_h=1.2)["rate_norm"]
    assert bool(gate.failed) is fails
    assert_allclose(gate.limit, 3.29 * 1.2)
    assert_allclose(gate.value, abs(share) * 3.29 * 1.2, rtol=1e-9)


@pytest.mark.parametrize(("share", "fails"), [(0.99, False), (1.01, True), (-0.99, False), (-1.01, True)])
def test_implied_latitude_limit_is_329_sigma_across_the_rate(share, fails):
    turned = share * 3.29 * 1.2 * DEG_PER_HOUR / EARTH_RATE
    gate = gates_of(earth_rate_n(LATITUDE + turned), sigma_deg_h=1.2)["implied_latitude"]
    assert bool(gate.failed) is fails
    assert_allclose(gate.value, abs(np.degrees(turned)), rtol=1e-9)


def test_without_a_profile_the_limit_is_the_horizontal_earth_rate():
    gate = gates_of(RATE, sigma_deg_h=100.0, known=False)["rate_norm"]
    assert_allclose(gate.limit, EARTH_RATE * np.cos(LATITUDE) / DEG_PER_HOUR)


def test_sway_in_yaw_widens_only_what_it_touches():
    gate = gates_of(RATE, sigma_deg_h=0.0, vertical_deg_h=1.0)
    assert_allclose(gate["rate_norm"].limit, 3.29 * np.sin(LATITUDE), rtol=1e-9)
    assert_allclose(gate["implied_latitude"].limit, np.degrees(3.29 * DEG_PER_HOUR / EARTH_RATE) * np.cos(LATITUDE))


def test_message_has_value_and_limit():
    finding = gates_of(RATE * 2, sigma_deg_h=1.0)["rate_norm"].finding()
    assert finding is not None
    assert "15.04 deg/h" in finding.message
    assert "3.29 deg/h" in finding.message
    assert gates_of(RATE, sigma_deg_h=1.0)["rate_norm"].finding() is None


@pytest.mark.parametrize("latitude_deg", [-60.0, 0.0, 75.0])
def test_implied_latitude_of_earth_rate_is_the_latitude(latitude_deg):
    assert_allclose(np.degrees(implied_latitude(earth_rate_n(np.radians(latitude_deg)))), latitude_deg, atol=1e-12)


def failing(half_width_deg, variance, noise, latitude_deg=32.11, duration=100.0):
    gates = width_gates(
        np.asarray(np.radians(half_width_deg)),
        variance=np.asarray(variance * DEG_PER_HOUR**2),
        noise_variance=np.asarray(noise * DEG_PER_HOUR**2),
        latitude=np.radians(latitude_deg),
        duration=duration,
    )
    return {gate.code: gate for gate in gates if gate.failed}


def test_a_wide_interval_is_refused_for_what_would_cure_it():
    assert failing(89.0, 70.0, 70.0) == {}
    # At 32 N noise of variance H^2 / 2.36 = 68.8 (deg/h)^2 gives +-90 deg; twice it needs twice the time.
    short = failing(120.0, 137.6, 137.6)
    assert list(short) == ["too_short"]
    assert_allclose(short["too_short"].limit, 200, rtol=0.01)
    assert list(failing(120.0, 400.0, 1.0)) == ["too_noisy"]
    assert list(failing(170.0, 1.0, 0.5, latitude_deg=89.5)) == ["near_pole"]


def test_motion_limit_grows_with_sigma_and_is_generous_in_the_inertial_frame():
    def fails(excursion_deg, sigma_deg, inertial):
        limit = TURN_LIMITS["inertial" if inertial else "mean"](np.asarray(np.radians(sigma_deg)))
        return bool(motion_gate(np.asarray(np.radians(excursion_deg)), limit).failed)

    # sqrt(0.5 deg) = 5.35 deg for a precise heading, sqrt(5 deg) = 16.9 deg for a coarse one.
    assert not fails(5.3, 0.1, False)
    assert fails(5.4, 0.1, False)
    assert not fails(16.8, 5.0, False)
    assert fails(17.0, 5.0, False)
    assert not fails(44.0, 0.1, True)
    assert fails(46.0, 0.1, True)


def test_too_few_samples_or_seconds():
    assert length_finding(15, 100.0).limit == pytest.approx(16 * 100 / 15)
    assert length_finding(1000, 1.9).limit == 2.0
    assert length_finding(16, 2.0) is None


def test_saturation():
    gate = saturation_gate(np.array([0.99, 1.0]), limit=1.0, what="gyro", unit=1.0, unit_name="rad/s", quantity="rate")
    assert gate.failed.tolist() == [False, True]


@pytest.mark.parametrize("turns", [False, True])
def test_a_bias_that_drifts_beside_a_still_accelerometer_is_not_called_a_turn(turns):
    # 400 deg/h that fall over 20 min integrate to 35 deg; a true tilt of as much is seen by the accelerometer.
    rng, rate_hz, n = np.random.default_rng(3), 1.0, 3600
    drift = np.radians(400 / 3600) * np.exp(-np.arange(n) / 1200)
    angle = (np.cumsum(drift) - drift.mean() * np.arange(n)) / rate_hz
    gyro_b = np.array([5e-5, 0.0, -5e-5]) + rng.normal(0, 1e-5, (n, 3))
    gyro_b[:, 0] += drift
    roll = angle if turns else 0 * angle
    accel_b = -9.8 * np.stack([0 * roll, np.sin(roll), np.cos(roll)], axis=1) + rng.normal(0, 1e-3, (n, 3))
    found = heading(Recording(gyro_b, accel_b, rate_hz), latitude=0.8, method="mean")
    message = next(reason.message for reason in found.reasons if reason.code == "motion")
    assert ("likely the gyro bias drifts" in message) != turns
