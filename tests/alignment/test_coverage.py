"""The claimed sigma is a promise: scatter against floor, intervals against truth, refusals counted.

Refused runs stay in every count: dropping them would flatter the coverage.
"""

import numpy as np
import pytest
from flicker_fft import flicker_fft
from numpy.testing import assert_allclose

from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR, angle_error
from gyronorth.pipeline import heading_batch
from gyronorth.sensor import Sensor, TriadErrors, read_sensor
from gyronorth.simulation import Motion, simulate_batch
from gyronorth.uncertainty import cramer_rao_floor

LATITUDE = np.radians(32.11)
WHITE = Sensor("white", TriadErrors(white=0.02 * DEG_PER_SQRT_HOUR))
DURATION, RATE_HZ = 100.0, 3.0


def simulated(sensor, runs, *, seed, latitude=LATITUDE, **options):
    """Headings drawn over the circle, with the measured rate and force."""
    rng = np.random.default_rng(seed)
    truth = rng.uniform(0, 2 * np.pi, runs)
    gyro, accel = simulate_batch(
        sensor, runs=runs, latitude=latitude, heading=truth, duration=DURATION, rate_hz=RATE_HZ, rng=rng, **options
    )
    return truth, gyro, accel


def covered(batch, truth):
    """Share of intervals that contain the truth."""
    whole = batch.high - batch.low >= 2 * np.pi - 1e-9
    return np.mean(whole | ((truth - batch.low) % (2 * np.pi) <= (batch.high - batch.low) % (2 * np.pi)))


def rms(error):
    return np.sqrt(np.mean(error**2))


@pytest.mark.slow
@pytest.mark.parametrize("latitude_deg", [32.11, -60.0])
@pytest.mark.parametrize(("roll_deg", "pitch_deg"), [(0, 0), (20, -35)])
def test_white_noise_error_is_the_floor(latitude_deg, roll_deg, pitch_deg):
    latitude = np.radians(latitude_deg)
    truth, gyro, accel = simulated(
        WHITE, 20_000, seed=1, latitude=latitude, roll=np.radians(roll_deg), pitch=np.radians(pitch_deg)
    )
    batch = heading_batch(gyro, accel, rate_hz=RATE_HZ, latitude=latitude, sensor=WHITE)
    floor = cramer_rao_floor(WHITE, latitude=latitude, duration=DURATION)
    # 20,000 runs: the root mean square is known to 0.5 %.
    assert_allclose(rms(angle_error(batch.heading, truth)) / floor, 1, atol=0.02)
    assert_allclose(rms(batch.sigma) / floor, 1, atol=0.02)
    assert 0.945 < covered(batch, truth) < 0.955
    assert np.mean(~batch.valid) <= 0.01


@pytest.mark.parametrize("method", ["mean", "auto", pytest.param("inertial", marks=pytest.mark.slow)])
def test_sdc500_interval_covers_and_refuses_few(method):
    truth, gyro, accel = simulated("sdc500", 5000, seed=2)
    batch = heading_batch(gyro, accel, rate_hz=RATE_HZ, latitude=LATITUDE, sensor="sdc500", method=method)
    assert 0.93 <= covered(batch, truth) <= 0.97
    assert np.mean(~batch.valid) <= 0.01
    # chi-square over 5000 runs, 99.9 %: within 3.3 %; sigma is conditional on the norm, hence a little more.
    assert_allclose(rms(angle_error(batch.heading, truth)) / rms(batch.sigma), 1, atol=0.04)


@pytest.mark.slow
def test_auto_costs_nothing_on_quiet_recordings():
    truth, gyro, accel = simulated("sdc500", 3000, seed=3)
    for sensor in ("sdc500", None):
        options = {"rate_hz": RATE_HZ, "latitude": LATITUDE, "sensor": sensor}
        auto, mean = (heading_batch(gyro, accel, method=method, **options) for method in ("auto", "mean"))
        assert rms(angle_error(auto.heading, truth)) <= 1.05 * rms(angle_error(mean.heading, truth))


def test_interval_covers_flicker_made_another_way():
    sensor = read_sensor("sdc500")
    constant = Sensor(
        "constant", TriadErrors(white=sensor.gyro.white, turn_on_bias=sensor.gyro.turn_on_bias), sensor.accel
    )
    truth, gyro, accel = simulated(constant, 2000, seed=4)
    rng = np.random.default_rng(5)
    gyro = gyro + flicker_fft(sensor.gyro.flicker, gyro.shape[:2], RATE_HZ, rng=rng)
    batch = heading_batch(gyro, accel, rate_hz=RATE_HZ, latitude=LATITUDE, sensor="sdc500", method="auto")
    assert 0.93 <= covered(batch, truth) <= 0.97
    assert np.mean(~batch.valid) <= 0.01


@pytest.mark.parametrize("bias_deg_h", [0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 3.0])
def test_interval_without_a_profile_covers(bias_deg_h):
    sensor = Sensor("biased", TriadErrors(white=WHITE.gyro.white, turn_on_bias=bias_deg_h * DEG_PER_HOUR))
    truth, gyro, accel = simulated(sensor, 4000, seed=6)
    for force in (accel, None):
        batch = heading_batch(gyro, force, rate_hz=RATE_HZ, latitude=LATITUDE)
        assert 0.93 <= covered(batch, truth) <= 0.97


@pytest.mark.slow
@pytest.mark.parametrize("arcsec", [5, 30, 300])
@pytest.mark.parametrize("name", ["sdc500", "hg9900"])
def test_sway_is_in_sigma(name, arcsec):
    def swaying(times, *, runs, rng):
        frequency = np.exp(rng.uniform(np.log(0.02), np.log(0.5), (runs, 1, 3)))
        phase = rng.uniform(0, 2 * np.pi, (runs, 1, 3))
        return np.radians(arcsec / 3600) * np.sqrt(2) * np.sin(2 * np.pi * frequency * times[:, None] + phase)

    truth, gyro, accel = simulated(name, 600, seed=7, motion=Motion(disturbance=swaying))
    errors = {}
    for method in ("mean", "auto"):
        batch = heading_batch(gyro, accel, rate_hz=RATE_HZ, latitude=LATITUDE, sensor=name, method=method)
        errors[method] = rms(angle_error(batch.heading, truth))
        # 600 runs: 95 % is known to 0.9 %; sway is no Gaussian, and tilts as seen are not exact.
        assert covered(batch, truth) > 0.91
        assert np.mean(~batch.valid) <= 0.015
    assert errors["auto"] < 1.06 * errors["mean"]
    if arcsec == 300:
        assert errors["auto"] < 0.5 * errors["mean"]
