"""Gyroscope and accelerometer from two files."""

from __future__ import annotations

import shlex

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from gyronorth.errors import InputError
from gyronorth.readers import describe, read

SI = {"gyro_unit": "rad/s", "accel_unit": "m/s2", "axes": "frd"}
ROWS, RATE = 1000, 100.0
TIME = np.arange(ROWS) / RATE
GYRO = np.random.default_rng(3).normal([3e-5, -4e-5, -5e-5], 1e-6, (ROWS, 3))


def force(time):
    """A force that is a straight line in time: interpolation gives it exactly."""
    return np.column_stack([0.01 * time, -0.02 * time, -9.8 + 0.001 * time])


def table(path, names, *columns):
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=names, comments="", fmt="%.17g")
    return path


def gyro_file(folder, time=TIME):
    return table(folder / "gyro.csv", "t,w_x,w_y,w_z", time, GYRO[: len(time)])


@pytest.mark.slow
@settings(max_examples=20)
@given(st.floats(20, 400), st.floats(-0.05, 0.05), st.floats(0, 1.7e9))
def test_forces_stand_on_the_clock_of_the_gyro(tmp_path_factory, rate, shift, zero):
    folder = tmp_path_factory.mktemp("joined")
    time = shift + np.arange(-40, round(11 * rate)) / rate
    accel = table(folder / "accel.csv", "t,f_x,f_y,f_z", zero + time, force(time))
    recording = read(gyro_file(folder, zero + TIME), accel_file=accel, **SI)
    assert_allclose(recording.gyro_b, GYRO, rtol=1e-12)
    # A double of the seconds since 1970 resolves 0.24 us: times the slope of the force.
    assert_allclose(recording.accel_b, force(TIME), atol=1e-7)


def test_without_clocks_rows_belong_together_one_by_one(tmp_path):
    gyro = table(tmp_path / "gyro.csv", "w_x,w_y,w_z", GYRO)
    accel = table(tmp_path / "accel.csv", "f_x,f_y,f_z", force(TIME))
    assert_allclose(read(gyro, accel_file=accel, rate_hz=RATE, **SI).accel_b, force(TIME), rtol=1e-12)
    for rows in (ROWS - 1, 2 * ROWS):
        other = table(tmp_path / "other.csv", "f_x,f_y,f_z", force(np.arange(rows) / RATE))
        with pytest.raises(InputError, match="differ in the number of their rows"):
            read(gyro, accel_file=other, rate_hz=RATE, **SI)
    timed = table(tmp_path / "timed.csv", "t,f_x,f_y,f_z", TIME, force(TIME))
    with pytest.raises(InputError, match=r"gyro.csv has no clock, but the other file has"):
        read(gyro, accel_file=timed, rate_hz=RATE, **SI)


def test_times_with_nothing_in_common_and_a_hole_are_told(tmp_path):
    far = table(tmp_path / "far.csv", "t,f_x,f_y,f_z", TIME + 1e6, force(TIME))
    with pytest.raises(InputError, match=r"have nothing in common \(those of far.csv begin at 1000000 s\)"):
        read(gyro_file(tmp_path), accel_file=far, **SI)
    kept = (TIME < 4) | (TIME >= 5.5)
    hole = table(tmp_path / "hole.csv", "t,f_x,f_y,f_z", TIME[kept], force(TIME[kept]))
    with pytest.raises(InputError, match=r"Row 45\d of gyro.csv: hole.csv has no sample within 0.5 s"):
        read(gyro_file(tmp_path), accel_file=hole, **SI)
    assert read(gyro_file(tmp_path), accel_file=hole, drop_bad_rows=True, **SI).rows_dropped == 50
    back = table(tmp_path / "back.csv", "t,f_x,f_y,f_z", TIME[::-1], force(TIME))
    with pytest.raises(InputError, match=r"back.csv runs backwards"):
        read(gyro_file(tmp_path), accel_file=back, **SI)


def test_columns_go_to_the_file_that_holds_them(tmp_path):
    gyro = table(tmp_path / "one.csv", "stamp,a,b,c", TIME, GYRO)
    accel = table(tmp_path / "two.csv", "time,d,e,f", TIME, force(TIME))
    columns = {"t": "stamp", "w_x": "a", "w_y": "b", "w_z": "c", "f_x": "d", "f_y": "e", "f_z": "f"}
    how = SI | {"accel_file": accel, "columns": columns}
    assert_allclose(read(gyro, **how).accel_b, force(TIME), rtol=1e-9)
    assert describe(gyro, **how).info.columns == ("t", "w_x", "w_y", "w_z", "f_x", "f_y", "f_z")
    assert len(read(gyro, window=(2.0, 3.0), **how).gyro_b) == 100
    with pytest.raises(InputError, match="There is no file"):
        read(gyro, **(how | {"accel_file": tmp_path / "none.csv"}))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gyro", "accel"),
    [("gyro-0.csv", "accel-0.csv"), ("Gyroscope.csv", "Accelerometer.csv"), ("a GYR 1.csv", "a ACC 1.csv")],
)
def test_the_accelerometer_beside_is_named_and_the_line_to_try_takes_it(tmp_path, gyro, accel):
    path = table(tmp_path / gyro, "t,w_x,w_y,w_z", TIME, GYRO)
    table(tmp_path / accel, "t,f_x,f_y,f_z", TIME, force(TIME))
    alone = read(path, **SI)
    assert alone.accel_b is None
    assert [note.code for note in alone.notes] == ["accelerometer_beside"]
    with pytest.raises(InputError, match="beside it is likely its accelerometer") as caught:
        read(path)
    words = shlex.split(str(caught.value).splitlines()[-1])
    assert words[words.index("--accel") + 1] == str(tmp_path / accel)
    assert_allclose(read(path, accel_file=tmp_path / accel, **SI).accel_b, force(TIME), rtol=1e-12)


def test_of_two_candidates_and_of_other_names_none_is_named(tmp_path):
    path = table(tmp_path / "gyro.csv", "t,w_x,w_y,w_z", TIME, GYRO)
    for name in ("acc.csv", "accel.csv"):
        table(tmp_path / name, "t,f_x,f_y,f_z", TIME, force(TIME))
    gyration = table(tmp_path / "gyration.csv", "t,w_x,w_y,w_z", TIME, GYRO)
    assert not read(path, **SI).notes
    assert not read(gyration, **SI).notes
