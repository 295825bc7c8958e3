"""The readers on recorded data; what is compared stands in the README of the data folder."""

from __future__ import annotations

from math import degrees

import numpy as np
import pytest
from numpy.testing import assert_allclose

from gyronorth.angles import DEG_PER_HOUR
from gyronorth.errors import InputError
from gyronorth.readers import describe, parse_columns, read, read_chunks
from gyronorth.recording import Recording

STIM300 = {
    "variable": "data",
    "columns": parse_columns("t=3,w_x=4,w_y=5,w_z=6,f_x=8,f_y=9,f_z=10"),
    "gyro_unit": "deg/s",
    "accel_unit": "g",
}
DOT = {"gyro_unit": "deg/s", "accel_unit": "m/s2"}


def mean_deg_h(recording: Recording) -> np.ndarray:
    return recording.gyro_b.mean(axis=0) / DEG_PER_HOUR


def test_laser_gyro_on_a_parked_vehicle(real_data):
    recording = read(real_data / "lasergyro.imu")
    assert recording.rate_hz == 100
    assert recording.duration == pytest.approx(1847, abs=0.5)
    assert degrees(recording.latitude or 0) == pytest.approx(34.246048, abs=1e-9)
    assert degrees(recording.heading_true or 0) == pytest.approx(90.6, abs=1e-9)
    assert recording.notes == ()
    # File axes right-front-up: the README's (-12.406, -0.061, 8.396) deg/h become (front, right, -up).
    part = read(real_data / "lasergyro.imu", window=(600, 950))
    assert_allclose(mean_deg_h(part), [-0.061, -12.406, -8.396], atol=1e-3)
    assert_allclose(mean_deg_h(recording.window(600, 950)), mean_deg_h(part), rtol=1e-12)
    # Normal gravity at 34.25 N and 380 m; such accelerometers agree to 0.3 mg.
    assert part.accel_b is not None
    assert np.linalg.norm(part.accel_b.mean(axis=0)) == pytest.approx(9.7955, abs=0.003)


def test_laser_gyro_in_chunks(real_data):
    info, chunks = read_chunks(real_data / "lasergyro.imu", chunk_samples=10_000)
    assert (info.format, info.axes, info.increments, info.axes_declared) == ("psins", "rfu", True, False)
    gyro = np.concatenate([chunk.gyro_b for chunk in chunks])
    assert np.array_equal(gyro, read(real_data / "lasergyro.imu").gyro_b)


def test_stim300(real_data):
    path = real_data / "stim300_cart_static_then_turn.mat"
    recording = read(path, axes="flu", window=(0, 78), **STIM300)
    assert (recording.rate_hz, recording.duration) == (125, 78)
    assert_allclose(mean_deg_h(recording), [-208.4, -43.0, -139.5], atol=0.1)
    assert recording.notes == ()
    assert len(read(path, axes="flu", **STIM300).gyro_b) == 20_606
    with pytest.raises(InputError, match=r"Variable data of stim300.* has 16 columns without names"):
        read(path)
    with pytest.raises(InputError, match=r"mean specific force is 0.98.*--accel-unit g fits"):
        read(path, **(STIM300 | {"accel_unit": "m/s2"}))
    (note,) = read(path, **STIM300).notes
    assert (note.code, note.blocking) == ("axes_suspect", True)
    assert "flu (forward-left-up) or rfu (right-forward-up)" in note.message


def test_mt_manager_export(real_data):
    path = real_data / "xsens_mti_static.txt"
    with pytest.raises(InputError, match="PacketCounter, not time, and does not state its rate"):
        read(path)
    recording = read(path, rate_hz=100)
    assert recording.duration == pytest.approx(120, abs=0.2)
    assert (recording.gaps, recording.notes) == ((), ())
    # (367, -64, -249) deg/h in the sensor's forward-left-up axes.
    assert_allclose(mean_deg_h(recording), [367, 64, 249], atol=0.6)


def test_dirty_file_names_its_rows_or_drops_them(real_data):
    path = real_data / "xsens_dot_static_dirty.csv"
    with pytest.raises(InputError) as caught:
        read(path, **DOT)
    message = str(caught.value)
    assert message.startswith("Row 2 of xsens_dot_static_dirty.csv: f_x, f_y and f_z are all exactly 0")
    assert "Bad rows in all: 2; row 13003: w_x is inf" in message
    recording = read(path, axes="flu", drop_bad_rows=True, **DOT)
    assert recording.rows_dropped == 2
    assert recording.rate_hz == pytest.approx(120)
    assert [note.code for note in recording.notes] == ["gaps_bridged", "rows_dropped"]
    assert (np.abs(mean_deg_h(recording)) > 1000).all()
    by_rate = read(path, axes="flu", drop_bad_rows=True, rate_hz=120, columns={"t": "-"}, **DOT)
    assert np.array_equal(by_rate.gyro_b, recording.gyro_b)


def test_tables_beside_the_recordings_are_no_recordings(real_data):
    with pytest.raises(InputError, match=r"has no time column|has no column"):
        read(real_data / "published_recordings.csv")


def test_description(real_data):
    description = describe(real_data / "lasergyro.imu")
    assert description.samples == 184_718
    # The whole file: Earth rate to 1.5 % in spite of the sway.
    assert description.to_json()["rate_norm_earth_rates"] == pytest.approx(1, abs=0.015)
