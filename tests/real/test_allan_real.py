"""Allan deviation and identification on recorded data."""

from __future__ import annotations

import numpy as np
import pytest

from gyronorth.allan import allan_deviation, characterise
from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR
from gyronorth.pipeline import heading
from gyronorth.readers import ReadOptions, read

STIM300 = ReadOptions(
    variable="data",
    columns={"w_x": 4, "w_y": 5, "w_z": 6, "f_x": 8, "f_y": 9, "f_z": 10},
    gyro_unit="deg/s",
    accel_unit="g",
    rate_hz=125.0,
)


@pytest.mark.slow
def test_xsens_angle_random_walk(real_data):
    # 2.4 to 2.6 deg/sqrt(h) at about 1 s; its filter makes shorter averaging times look better.
    recording = read(real_data / "xsens_mti_static.txt", ReadOptions(rate_hz=100.0))
    curve = allan_deviation(recording.gyro_b, rate_hz=recording.rate_hz, taus=[1.0])
    assert np.all((curve.deviation > 2.3 * DEG_PER_SQRT_HOUR) & (curve.deviation < 2.7 * DEG_PER_SQRT_HOUR))
    found = characterise(recording)
    white = found.gyro.triad.angle_random_walk
    assert white.status == "identified"
    assert 2.3 * DEG_PER_SQRT_HOUR < white.value < 2.6 * DEG_PER_SQRT_HOUR
    assert found.gyro.triad.bias_instability.status == "upper bound"  # two minutes cannot tell it


@pytest.mark.slow
def test_stim300_is_fitted_beyond_its_filter(real_data):
    # Data sheet: 0.15 deg/sqrt(h). At 125 Hz the output filter leaves a quarter of it at one sample.
    recording = read(real_data / "stim300_cart_static_then_turn.mat", STIM300).window(0, 78)
    found = characterise(recording)
    white = found.gyro.triad.angle_random_walk
    assert white.low < 0.15 * DEG_PER_SQRT_HOUR < white.high
    assert found.gyro.triad.tau[0] > 0.03
    assert any("shorter averaging times do not follow" in note for note in found.notes)
    # Its turn-on bias of 200 deg/h shows against Earth rate, so its profile claims no heading.
    assert found.sensor.gyro.turn_on_bias > 100 * DEG_PER_HOUR
    assert not heading(recording, latitude=np.radians(41.8342), sensor=found.sensor).valid


@pytest.mark.slow
def test_ring_laser_profile_gives_an_interval_that_holds_the_truth(real_data):
    # A vehicle that sways: what is identified is the unit on its mount, and the claim is wide enough for it.
    recording = read(real_data / "lasergyro.imu")
    found = characterise(recording)
    assert found.sensor.gyro.turn_on_bias < 0.5 * DEG_PER_HOUR
    estimate = heading(recording.window(600, 950), sensor=found.sensor, method="mean")
    low, high = estimate.interval95
    truth = np.radians(90.6)
    assert (truth - low) % (2 * np.pi) <= (high - low) % (2 * np.pi)


@pytest.mark.slow
def test_a_driven_vehicle_is_not_a_sensor_at_rest(real_data):
    recording = read(real_data / "stim300_cart_static_then_turn.mat", STIM300)
    found = characterise(recording)
    still = characterise(recording.window(0, 78))
    assert found.gyro.triad.angle_random_walk.status != "identified" or (
        found.gyro.triad.angle_random_walk.value > 10 * still.gyro.triad.angle_random_walk.value
    )
    assert found.sensor.gyro.white > still.sensor.gyro.white


@pytest.mark.slow
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_allantools_agrees_on_recorded_data(real_data, axis):
    import allantools

    recording = read(real_data / "lasergyro.imu")
    x = recording.gyro_b[:, axis]
    found = allan_deviation(x, rate_hz=recording.rate_hz)
    theirs = allantools.oadev(x, rate=recording.rate_hz, data_type="freq", taus=found.tau)[1]
    np.testing.assert_allclose(found.deviation, theirs, rtol=1e-9)
