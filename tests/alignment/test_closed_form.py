"""Closed form and inertial frame: by hand, as properties, and beside other packages."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis.strategies import floats
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from gyronorth.alignment.closed_form import align_mean, gyrocompass
from gyronorth.alignment.inertial import align_inertial
from gyronorth.angles import DEG_PER_SQRT_HOUR, angle_error, wrap
from gyronorth.attitude import attitude_path, mat_bn, rotate
from gyronorth.earth import EARTH_RATE, earth_rate_n, normal_gravity
from gyronorth.sensor import Sensor, TriadErrors
from gyronorth.simulation import Motion, simulate, simulate_batch

IDEAL = Sensor("ideal", TriadErrors())
ATTITUDES = {
    "heading": floats(0, 6.28),
    "roll": floats(-1.05, 1.05),
    "pitch": floats(-1.05, 1.05),
    "latitude": floats(-1.4, 1.4),
}


def test_east_heading_at_60_north():
    # cos 60 = 1/2: w_b = rate (0, -1/2, -sqrt(3)/2).
    rate = EARTH_RATE * np.array([0, -0.5, -np.sqrt(3) / 2])
    assert_allclose(np.degrees(gyrocompass(rate, roll=0, pitch=0)), 90, atol=1e-12)


def test_level_case_is_eq7():
    rates = np.random.default_rng(1).standard_normal((50, 3))
    assert_allclose(
        angle_error(gyrocompass(rates, roll=0, pitch=0), np.arctan2(-rates[:, 1], rates[:, 0])), 0, atol=1e-15
    )


@given(**ATTITUDES)
def test_noise_free_mean_returns_its_attitude(heading, roll, pitch, latitude):
    mat = mat_bn(roll, pitch, heading)
    gyro = np.tile(mat @ earth_rate_n(latitude), (4, 1))
    accel = np.tile(mat @ [0, 0, -normal_gravity(latitude)], (4, 1))
    found = align_mean(gyro, accel)
    assert abs(angle_error(found.heading, heading)) < 1e-9
    assert_allclose([found.roll, found.pitch], [roll, pitch], atol=1e-12)


@pytest.mark.slow
@given(**ATTITUDES)
def test_noise_free_inertial_frame_returns_its_attitude(heading, roll, pitch, latitude):
    recording = simulate(
        IDEAL, latitude=latitude, heading=heading, roll=roll, pitch=pitch, duration=100, rate_hz=2,
        rng=np.random.default_rng(1),
    )  # fmt: skip
    found = align_inertial(recording.gyro_b, recording.accel_b, rate_hz=2, latitude=latitude)
    # Double precision in a plane that gravity sweeps by 7e-3 cos(lat) rad: 1e-7 rad at 80 deg.
    assert abs(angle_error(found.heading, heading)) < 1e-6
    assert_allclose([found.roll, found.pitch], [roll, pitch], atol=1e-8)
    assert_allclose(found.rate_l[2], -EARTH_RATE * np.sin(latitude), atol=1e-12)
    assert_allclose(np.hypot(*found.rate_l[:2]), EARTH_RATE * np.cos(latitude), rtol=1e-5)


def test_heading_is_that_of_triad_in_ahrs():
    import ahrs

    # ahrs returns the transpose of what its documentation says (PEERS): rows are the n axes in b.
    rng = np.random.default_rng(2)
    for _ in range(20):
        latitude, heading, roll, pitch = rng.uniform([-1.2, 0, -1, -1], [1.2, 6.28, 1, 1])
        mat = mat_bn(roll, pitch, heading)
        rate = mat @ earth_rate_n(latitude) + 1e-6 * rng.standard_normal(3)
        force = mat @ [0, 0, -normal_gravity(latitude)]
        triad = ahrs.filters.TRIAD(w1=force, w2=rate, v1=np.array([0, 0, -1.0]), v2=earth_rate_n(latitude)).A
        for body_to_n in (triad, triad.T):
            if np.allclose(body_to_n @ force / np.linalg.norm(force), [0, 0, -1], atol=1e-9):
                expected = np.arctan2(body_to_n[1, 0], body_to_n[0, 0])
        found = align_mean(rate[None], force[None])
        assert_allclose(angle_error(found.heading, expected), 0, atol=1e-9)


def test_attitude_path_is_the_ordered_product_of_rotations():
    rng = np.random.default_rng(3)
    rate = rng.standard_normal((2, 37, 3))
    middle, end = attitude_path(rate, rate_hz=2.0)
    for run in range(2):
        product = Rotation.identity()
        for k in range(37):
            half = product * Rotation.from_rotvec(rate[run, k] / 4)
            product = product * Rotation.from_rotvec(rate[run, k] / 2)
            for found, expected in ((middle[run, k], half), (end[run, k], product)):
                assert_allclose(rotate(found, np.eye(3)), expected.apply(np.eye(3)), atol=1e-13)


def test_inertial_frame_survives_sway_that_ruins_the_mean():
    rng = np.random.default_rng(4)
    gyro, accel = simulate_batch(
        IDEAL, runs=40, latitude=0.6, heading=1.0, duration=100, rate_hz=10, rng=rng,
        motion=Motion(disturbance=_swinging),
    )  # fmt: skip
    traced = np.degrees(angle_error(align_inertial(gyro, accel, rate_hz=10, latitude=0.6).heading, 1.0))
    mean = np.degrees(angle_error(align_mean(gyro, accel).heading, 1.0))
    # 10 arcmin rms: the mean errs by sqrt(2) 600 / 100 arcsec/s = 8.5 deg/h of 12.4: some 40 deg.
    assert np.sqrt(np.mean(mean**2)) > 15
    # Left is the sway's second order (3e-3)^2 rad over 100 s: about 1 deg at most.
    assert np.sqrt(np.mean(traced**2)) < 0.6


def _swinging(times, *, runs, rng):
    frequency = rng.uniform(0.05, 0.3, (runs, 1, 3))
    phase = rng.uniform(0, 2 * np.pi, (runs, 1, 3))
    return np.radians(1 / 6) * np.sqrt(2) * np.sin(2 * np.pi * frequency * times[:, None] + phase)


@pytest.mark.slow
@pytest.mark.parametrize("accel_white", [0.0, 100e-6 * 9.80665])
def test_scatter_of_the_inertial_frame_is_the_derived_one(accel_white):
    # Gyro white noise costs sqrt(1.2) of the floor, accelerometer white noise sqrt(12) N / (g Omega cos lat T^1.5).
    latitude, duration, white = np.radians(32.11), 100.0, 0.02 * DEG_PER_SQRT_HOUR
    sensor = Sensor("white", TriadErrors(white=white), TriadErrors(white=accel_white))
    runs = 1500
    gyro, accel = simulate_batch(
        sensor, runs=runs, latitude=latitude, heading=2.0, duration=duration, rate_hz=3, rng=np.random.default_rng(5)
    )
    error = wrap(align_inertial(gyro, accel, rate_hz=3, latitude=latitude).heading - 2.0)
    signal = EARTH_RATE * np.cos(latitude)
    expected = 1.2 * white**2 / duration + 12 * (accel_white / normal_gravity(latitude)) ** 2 / duration**3
    ratio = np.mean(error**2) * signal**2 / expected
    # chi-square over 1500 runs, 99.9 %: within 12 %.
    assert 0.88 < ratio < 1.12
