"""Advice on units: motion is told first, parts are looked at, and what is advised has been tried."""

from __future__ import annotations

import numpy as np
import pytest
from still import csv_file, rows_of, still

from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.errors import InputError
from gyronorth.readers import read

UNITS = {"gyro_unit": "rad/s", "accel_unit": "m/s2"}


def file_of(folder, gyro, accel, rate_hz=100.0):
    return csv_file(folder, rows_of([np.arange(len(gyro)) / rate_hz, gyro, accel]), comments=())


def test_a_drive_is_told_as_such_and_not_as_another_unit(tmp_path):
    gyro, accel = still(6000)
    drive = np.sin(np.arange(6000) / 640)[:, None] * [0.01, 0.01, 0.5]
    with pytest.raises(InputError, match="the unit moves") as caught:
        read(file_of(tmp_path, gyro + drive + [0, 0, 0.4], accel), **UNITS)
    assert "--gyro-unit deg/h" not in str(caught.value)


def test_the_still_part_of_a_drive_is_named_and_can_be_read(tmp_path):
    gyro, accel = still(6300)
    gyro[2400:] += np.sin(np.arange(3900) / 640)[:, None] * [0.01, 0.01, 0.5] + [0.0, 0.0, 0.6]
    path = file_of(tmp_path, gyro, accel)
    with pytest.raises(InputError, match=r"from 0 to 24 s of what was read it stands \(--window START:END\)"):
        read(path, **UNITS)
    assert read(path, **UNITS, window=(0, 24)).duration == 24


def test_a_unit_that_is_turned_over_feels_gravity_in_each_pose(tmp_path):
    gyro, accel = still(6000)
    poses = np.repeat(np.vstack([np.eye(3), -np.eye(3)]), 1000, axis=0)
    recording = read(file_of(tmp_path, gyro, accel - accel.mean(axis=0) + STANDARD_GRAVITY * poses), **UNITS)
    assert [note.code for note in recording.notes] == ["axes_assumed"]


def test_increments_of_a_faster_sensor_and_the_cure_that_works(tmp_path):
    gyro, accel = still(6000)
    path = file_of(tmp_path, gyro / 200, accel / 200)
    with pytest.raises(
        InputError, match=r"gravity over 2: each increment covers 5 ms.*--increment-interval 0.005 fits"
    ):
        read(path, **UNITS, increments=True)
    recording = read(path, **UNITS, increments=True, increment_interval=0.005)
    assert np.linalg.norm(recording.accel_b.mean(axis=0)) == pytest.approx(STANDARD_GRAVITY, rel=1e-4)
