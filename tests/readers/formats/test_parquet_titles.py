"""Parquet files with titles of others are read as texts with the same titles."""

from __future__ import annotations

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


def test_open_units_are_asked_in_one_message(tmp_path):
    names = ("time", *(f"gyro_{a}" for a in "xyz"), *(f"acc_{a}" for a in "xyz"))
    pq.write_table(pa.table(dict(zip(names, (TIME, *DPS.T, *ACCEL.T), strict=True))), tmp_path / "t.parquet")
    with pytest.raises(InputError, match=r"(?s)--gyro-unit deg/s.*\nTry: .*--gyro-unit deg/s --accel-unit m/s2"):
        read(tmp_path / "t.parquet", ReadOptions(axes="frd"))
