"""Axes that hang or are dead, and accelerometers without gravity: refused by every way; coarse honest units are not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis.strategies import integers

from gyronorth.alignment.outputs import axis_gates, longest_hold
from gyronorth.pipeline import heading, heading_batch
from gyronorth.sensor import read_sensor
from gyronorth.simulation import simulate_batch

RATE, LATITUDE, SENSOR = 10.0, np.radians(48.0), "isa100c"


@pytest.fixture(scope="module")
def unit():
    rng = np.random.default_rng(5)
    made = simulate_batch(
        read_sensor(SENSOR), runs=3, latitude=LATITUDE, heading=1.0, duration=100, rate_hz=RATE, rng=rng
    )
    return tuple(np.array(one) for one in made)


def verdicts(gyro, accel, **known):
    """Whether a batch is valid, and the reasons of its first recording alone; they must agree."""
    known = {"rate_hz": RATE, "latitude": LATITUDE, **known}
    batch = heading_batch(gyro, accel, method="mean", **known)
    alone = heading(gyro[0], accel_b=accel[0], method="mean", **known)
    assert alone.valid == batch.valid[0]
    return batch.valid, alone.reasons


@pytest.mark.parametrize("sensor", [SENSOR, None])
@pytest.mark.parametrize("what", ["gyro", "accelerometer"])
@pytest.mark.parametrize("stretch", [slice(None), slice(400, 425)])
def test_an_axis_that_hangs_is_named(unit, sensor, what, stretch):
    arrays = {"gyro": unit[0].copy(), "accelerometer": unit[1].copy()}
    held = arrays[what]
    held[0, stretch, 1] = held[0, 400, 1]
    valid, reasons = verdicts(*arrays.values(), sensor=sensor)
    assert list(valid) == [False, True, True]
    found = next(reason for reason in reasons if reason.code == "hung_axis")
    assert f"The y axis of the {what}" in found.message
    assert found.value == pytest.approx(100.0 if stretch == slice(None) else 2.5, abs=0.11)


def test_a_dead_axis_with_dither_and_identical_rows(unit):
    dither, same = unit[0].copy(), unit[0].copy()
    dither[0, :, 0] = 1e-10 * np.random.default_rng(1).standard_normal(1000)
    same[0] = same[0, 0]
    for gyro, axes in ((dither, "x"), (same, "xyz")):
        valid, reasons = verdicts(gyro, unit[1])
        assert list(valid) == [False, True, True]
        assert [reason.message[4] for reason in reasons if reason.code == "hung_axis"] == list(axes)


@pytest.mark.parametrize("step", [0.3, 1.0, 3.0])
def test_a_coarse_output_is_no_hang(step):
    """Rounded to steps of a third to three standard deviations of a sample, over a drifting mean."""
    rng = np.random.default_rng(2)
    x = rng.standard_normal((40, 3000, 3)) + 2 * np.linspace(0, 1, 3000)[:, None] + rng.uniform(-5, 5, (40, 1, 3))
    gates = axis_gates(np.round(x / step) * step, rate_hz=10.0, what="accelerometer")
    assert not np.any([gate.failed for gate in gates])


@pytest.mark.parametrize("factor", [0.0, 1 / 9.80665, 1.2])
def test_an_accelerometer_without_gravity_is_refused(unit, factor):
    """Gravity taken out, values in g, a wrong scale."""
    accel = unit[1].copy()
    accel[0] = accel[0] * factor if factor else accel[0] - accel[0].mean(axis=0)
    valid, reasons = verdicts(unit[0], accel)
    assert list(valid) == [False, True, True]
    assert "gravity" in {reason.code for reason in reasons}


@pytest.mark.slow
@pytest.mark.parametrize("pitch_deg", [60, 88, 88.9, 89.5])
@pytest.mark.parametrize("method", ["mean", "inertial"])
def test_near_the_gimbal_sigma_grows_or_it_is_refused(pitch_deg, method):
    """Error over sigma of units as their profile; beyond 89 deg, or without a profile near it, a reason."""
    runs, rng = 300, np.random.default_rng(1)
    truth = rng.uniform(0, 2 * np.pi, runs)
    gyro, accel = simulate_batch(
        read_sensor("hg9900"), runs=runs, latitude=LATITUDE, heading=truth, duration=60, rate_hz=2.0, rng=rng,
        roll=rng.uniform(-3, 3, runs), pitch=np.radians(pitch_deg) * rng.choice([-1, 1], runs),
    )  # fmt: skip
    found = heading_batch(gyro, accel, rate_hz=2.0, latitude=LATITUDE, sensor="hg9900", method=method)
    assert found.valid.mean() > 0.98 if pitch_deg < 89 else not found.valid.any()
    if pitch_deg < 89:
        off = ((found.heading - truth + np.pi) % (2 * np.pi) - np.pi) / found.sigma
        assert 0.85 < np.sqrt(np.mean(off**2)) < 1.15
    else:
        codes = {reason.code for reason in heading(gyro[0], accel_b=accel[0], rate_hz=2.0, latitude=LATITUDE).reasons}
        assert "gimbal" in codes


@given(length=integers(1, 40), first=integers(0, 39), held=integers(1, 40), seed=integers(0, 9))
def test_the_longest_hold_is_where_it_was_put(length, first, held, seed):
    x = np.random.default_rng(seed).normal(size=(length, 3))
    first = min(first, length - 1)
    x[first : first + held] = x[first]
    found = min(held, length - first)
    assert longest_hold(x) == ((first, found) if found > 1 else (0, 1))
    x[:, 1] = np.arange(length)  # one axis that goes on is enough
    assert longest_hold(x) == (0, 1)
