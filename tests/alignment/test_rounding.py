"""Rounding of samples: what the mean of a rounded rate is off by, and where it is not."""

import numpy as np
import pytest

from gyronorth.alignment.rounding import rounding_bias
from gyronorth.pipeline import heading, heading_batch
from gyronorth.recording import Recording
from gyronorth.sensor import read_sensor
from gyronorth.simulation import Motion, simulate_batch
from gyronorth.simulation.disturbance import Draw

NOISE, RUNS, SAMPLES = 1e-5, 40, 1000


def rates(seed=1):
    rng = np.random.default_rng(seed)
    return rng.uniform(-1e-4, 1e-4, (RUNS, 1, 3)) + NOISE * rng.standard_normal((RUNS, SAMPLES, 3))


@pytest.mark.parametrize("steps", [3.0, 4.0, 6.0])
def test_the_error_of_rounding_is_held_and_not_much_overstated(steps):
    gyro, step = rates(), steps * NOISE
    rounded = np.round(gyro / step) * step
    actual = np.sqrt(np.mean((rounded - gyro).mean(axis=1) ** 2))
    found = np.median([rounding_bias(one) for one in rounded])
    assert 0.7 * actual < found < 4 * actual


def test_fine_samples_and_increments_that_carry_over_are_not_off():
    gyro = rates()
    assert max(rounding_bias(one) for one in gyro) == 0
    assert max(rounding_bias(np.round(one / NOISE) * NOISE) for one in gyro) < 0.01 * NOISE
    for steps in (3.0, 8.0):
        step = steps * NOISE
        counts = np.round(np.cumsum(gyro, axis=1) / step)
        carried = np.diff(counts, axis=1) * step
        assert np.mean([rounding_bias(one) > 0 for one in carried]) < 0.1


@pytest.mark.parametrize("method", ["mean", "inertial"])
def test_closed_forms_allow_for_rounding(method):
    """Turn-on biases spread over the steps; without the allowance two of three miss."""
    sensor, runs = read_sensor("isa100c"), 40
    truth = np.linspace(0, 6, runs)
    gyro, accel = simulate_batch(
        sensor, runs=runs, latitude=0.8, heading=truth, duration=60, rate_hz=10, rng=np.random.default_rng(4)
    )
    step = 5 * sensor.gyro.white * np.sqrt(10)
    found = heading_batch(np.round(gyro / step) * step, accel, rate_hz=10.0, latitude=0.8, sensor=sensor, method=method)
    off = (found.heading - truth + np.pi) % (2 * np.pi) - np.pi
    assert np.mean(np.abs(off) > 1.96 * found.sigma) < 0.2
    fine = heading_batch(gyro, accel, rate_hz=10.0, latitude=0.8, sensor=sensor, method=method)
    assert np.median(found.sigma) > 2 * np.median(fine.sigma)


@pytest.mark.slow
def test_a_coarse_output_widens_the_interval_and_is_told():
    sensor = read_sensor("isa100c")
    made, force = simulate_batch(
        sensor, runs=3, latitude=0.8, heading=np.arange(3.0), duration=60, rate_hz=10, rng=np.random.default_rng(3)
    )
    step = 4 * sensor.gyro.white * np.sqrt(10)
    inside = 0
    for gyro, accel, truth in zip(made, force, np.arange(3.0), strict=True):
        fine = heading(Recording(gyro, accel, 10.0), latitude=0.8, sensor=sensor)
        found = heading(Recording(np.round(gyro / step) * step, accel, 10.0), latitude=0.8, sensor=sensor)
        assert "coarse" in {warning.code for warning in found.warnings}
        assert "coarse" not in {warning.code for warning in fine.warnings}
        assert found.sigma > 2 * fine.sigma
        low, high = found.interval95
        inside += (truth - low) % (2 * np.pi) <= (high - low) % (2 * np.pi)
    assert inside == 3


def test_inertial_allows_for_a_tilt_within_a_step_of_the_accelerometer():
    """A tilt of 0.1 deg in 100 s, of which a force rounded to 10 mg shows nothing or one step."""
    rng, step, runs = np.random.default_rng(5), 0.01 * 9.80665, 20
    truth, roll, pitch = rng.uniform(0, 2 * np.pi, runs), *np.radians(rng.normal(0, 1, (2, runs)))
    lean = Motion(disturbance=lambda t, *, runs, rng: Draw(runs, t, rng).lean(np.radians(0.1) / 100))
    place = {"latitude": np.radians(48.0), "rate_hz": 10.0}
    gyro, force = simulate_batch(
        "hg9900", runs=runs, heading=truth, roll=roll, pitch=pitch, duration=100.0, rng=rng, motion=lean, **place
    )
    known = {"sensor": "hg9900", "method": "inertial", **place}
    fine = heading_batch(gyro, force, **known)
    coarse = heading_batch(gyro, np.round(force / step) * step, **known)
    assert np.all(np.isnan(fine.sigma) | (fine.sigma < np.radians(0.2)))
    off = (coarse.heading - truth + np.pi) % (2 * np.pi) - np.pi
    assert np.max(np.abs(off)) > np.radians(5)
    assert not np.any(coarse.valid & (np.abs(off) > 3 * coarse.sigma))
