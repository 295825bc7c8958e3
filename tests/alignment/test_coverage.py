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
@pytest.mark.parametrize("runs", [1500, pytest.param(20_000, marks=pytest.mark.long)])
@pytest.mark.parametrize("latitude_deg", [32.11, -60.0])
@pytest.mark.parametrize(("roll_deg", "pitch_deg"), [(0, 0), (20, -35)])
def test_white_noise_error_is_the_floor(latitude_deg, roll_deg, pitch_deg, runs):
    latitude = np.radians(latitude_deg)
    truth, gyro, accel = simulated(
        WHITE, runs, seed=1, latitude=latitude, roll=np.radians(roll_deg), pitch=np.radians(pitch_deg)
    )
    batch = heading_batch(gyro, accel, rate_hz=RATE_HZ, latitude=latitude, sensor=WHITE)
    floor = cramer_rao_floor(WHITE, latitude=latitude, duration=DURATION)
    # The root mean square is known to 1 / sqrt(2 runs): 0.5 % of 20,000; coverage to 0.15 %.
    assert_allclose(rms(angle_error(batch.heading, truth)) / floor, 1, atol=max(0.02, 3.3 / np.sqrt(2 * runs)))
    assert_allclose(rms(batch.sigma) / floor, 1, atol=0.02)
    assert abs(covered(batch, truth) - 0.95) < 3.3 * np.sqrt(0.95 * 0.05 / runs)
    assert np.mean(~batch.valid) <= 0.01


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "count"),
    [
        ("mean", 1000),
        ("auto", 50),
        ("inertial", 1000),
        pytest.param("mean", 5000, marks=pytest.mark.long),
        pytest.param("auto", 1000, marks=pytest.mark.long),
        pytest.param("inertial", 5000, marks=pytest.mark.long),
    ],
)
def test_sdc500_interval_covers_and_refuses_few(method, count):
    truth, gyro, accel = simulated("sdc500", count, seed=2)
    batch = heading_batch(gyro, accel, rate_hz=RATE_HZ, latitude=LATITUDE, sensor="sdc500", method=method)
    # 95 % of 50 runs is known to 3.1 %, of 5000 to 0.3 %.
    assert abs(covered(batch, truth) - 0.95) <= max(0.02, 3.3 * np.sqrt(0.95 * 0.05 / count))
    assert np.mean(~batch.valid) <= 0.01
    # chi-square, 99.9 %: within 3.3 % over 5000 runs; sigma is conditional on the norm, hence a little more.
    within = 0.04 * np.sqrt(5000 / count)
    least = 1 - within if method != "auto" else 0.79 - within  # auto allows for a unit beyond its profile
    assert least <= rms(angle_error(batch.heading, truth)) / rms(batch.sigma) <= 1 + within


@pytest.mark.slow
@pytest.mark.parametrize("runs", [6, pytest.param(500, marks=pytest.mark.long)])
def test_auto_costs_nothing_on_quiet_recordings(runs):
    truth, gyro, accel = simulated("sdc500", runs, seed=3)
    for sensor in ("sdc500", None):
        options = {"rate_hz": RATE_HZ, "latitude": LATITUDE, "sensor": sensor}
        auto, mean = (heading_batch(gyro, accel, method=method, **options) for method in ("auto", "mean"))
        squares = [angle_error(batch.heading, truth) ** 2 for batch in (auto, mean)]
        chance = 3.3 * np.std(squares[0] - squares[1]) / np.sqrt(runs)
        assert np.mean(squares[0]) <= 1.08**2 * np.mean(squares[1]) + chance


@pytest.mark.slow
@pytest.mark.parametrize("method", ["mean", pytest.param("auto", marks=pytest.mark.long)])
def test_interval_covers_flicker_made_another_way(method):
    sensor = read_sensor("sdc500")
    constant = Sensor(
        "constant", TriadErrors(white=sensor.gyro.white, turn_on_bias=sensor.gyro.turn_on_bias), sensor.accel
    )
    truth, gyro, accel = simulated(constant, 1500, seed=4)
    rng = np.random.default_rng(5)
    gyro = gyro + flicker_fft(sensor.gyro.flicker, gyro.shape[:2], RATE_HZ, rng=rng)
    batch = heading_batch(gyro, accel, rate_hz=RATE_HZ, latitude=LATITUDE, sensor="sdc500", method=method)
    assert 0.93 <= covered(batch, truth) <= 0.97
    assert np.mean(~batch.valid) <= 0.01


@pytest.mark.slow
@pytest.mark.parametrize(
    "bias_deg_h", [0.05, 0.5, 3.0, *(pytest.param(b, marks=pytest.mark.long) for b in (0.1, 0.2, 1.0, 2.0))]
)
def test_interval_without_a_profile_covers(bias_deg_h):
    sensor = Sensor("biased", TriadErrors(white=WHITE.gyro.white, turn_on_bias=bias_deg_h * DEG_PER_HOUR))
    truth, gyro, accel = simulated(sensor, 1500, seed=6)
    for force in (accel, None):
        batch = heading_batch(gyro, force, rate_hz=RATE_HZ, latitude=LATITUDE)
        assert 0.93 <= covered(batch, truth) <= 0.97


def sways():
    """Each sensor and amplitude over 150 runs; one, where the methods differ most, over 12 in every `make test`."""
    yield pytest.param("hg9900", 300, 12, id="hg9900-300-12")
    for name in ("sdc500", "hg9900"):
        for arcsec in (5, 30, 300):
            yield pytest.param(name, arcsec, 150, id=f"{name}-{arcsec}-150", marks=pytest.mark.long)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "arcsec", "count"), list(sways()))
def test_sway_is_in_sigma(name, arcsec, count):
    def swaying(times, *, runs, rng):
        frequency = np.exp(rng.uniform(np.log(0.02), np.log(0.5), (runs, 1, 3)))
        phase = rng.uniform(0, 2 * np.pi, (runs, 1, 3))
        return np.radians(arcsec / 3600) * np.sqrt(2) * np.sin(2 * np.pi * frequency * times[:, None] + phase)

    truth, gyro, accel = simulated(name, count, seed=7, motion=Motion(disturbance=swaying))
    errors = {}
    for method in ("mean", "auto"):
        batch = heading_batch(gyro, accel, rate_hz=RATE_HZ, latitude=LATITUDE, sensor=name, method=method)
        errors[method] = rms(angle_error(batch.heading, truth))
        # 95 % of 150 runs is known to 1.8 %, of 12 to 6.3 %; sway is no Gaussian, and tilts as seen are not exact.
        assert covered(batch, truth) > 0.95 - 4.5 * np.sqrt(0.95 * 0.05 / count)
        assert np.mean(~batch.valid) <= max(0.015, 3 / count)
    assert errors["auto"] < 1.06 * errors["mean"]
    if arcsec == 300:
        assert errors["auto"] < 0.5 * errors["mean"]  # that of `inertial` is a third
