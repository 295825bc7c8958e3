"""Parquet files with titles of others are read as texts with the same titles."""

from __future__ import annotations

import numpy as np
import pytest
from cases.layouts import ACCEL, DPS, GYRO, PLAIN, TIME, TITLED
from numpy.testing import assert_allclose

from gyronorth.errors import InputError
from gyronorth.readers import ReadOptions, read

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")


def test_units_in_titles_count_as_stated(tmp_path):
    pq.write_table(pa.table(dict(zip(TITLED.split(","), PLAIN, strict=True))), tmp_path / "t.parquet")
    recording = read(tmp_path / "t.parquet", ReadOptions(axes="frd"))
    assert recording.rate_hz == pytest.approx(100.0)
    assert_allclose(recording.gyro_b, GYRO, atol=1e-12)
    assert_allclose(recording.accel_b, ACCEL)


@pytest.mark.parametrize(
    ("titles", "parts"),
    [
        (("sec", "nanosec"), (10**9, 1)),
        (("header.stamp.sec", "header.stamp.nanosec"), (10**9, 1)),
        (("gps_week", "GPSTOW_ms"), (604800 * 10**9, 10**6)),
    ],
)
def test_two_columns_are_one_clock(tmp_path, titles, parts):
    count = 10**9 * 604800 * 2300 + 10**9 * 388800 + np.rint(TIME * 1e9).astype(np.int64)
    clock = count // parts[0], count % parts[0] // parts[1]
    table = dict(zip((*titles, *TITLED.split(",")[1:]), (*clock, *PLAIN[1:]), strict=True))
    pq.write_table(pa.table(table), tmp_path / "t.parquet", row_group_size=300)
    recording = read(tmp_path / "t.parquet", ReadOptions(axes="frd"))
    assert recording.rate_hz == pytest.approx(100.0)
    assert recording.gaps == ()
    assert_allclose(recording.gyro_b, GYRO, atol=1e-12)


def test_open_units_are_asked_in_one_message(tmp_path):
    names = ("time", *(f"gyro_{a}" for a in "xyz"), *(f"acc_{a}" for a in "xyz"))
    pq.write_table(pa.table(dict(zip(names, (TIME, *DPS.T, *ACCEL.T), strict=True))), tmp_path / "t.parquet")
    with pytest.raises(InputError, match=r"(?s)--gyro-unit deg/s.*\nTry: .*--gyro-unit deg/s --accel-unit m/s2"):
        read(tmp_path / "t.parquet", ReadOptions(axes="frd"))
