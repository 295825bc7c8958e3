"""Data of R."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from gyronorth.errors import InputError
from gyronorth.readers import read

pd = pytest.importorskip("pandas", reason="pandas comes with the extra r")
rdata = pytest.importorskip("rdata", reason="rdata comes with the extra r")

ROWS, RATE = 300, 100.0
TIME = np.arange(ROWS) / RATE
GYRO = np.random.default_rng(9).normal([3e-5, -4e-5, -5e-5], 1e-6, (ROWS, 3))
ACCEL = np.random.default_rng(10).normal([0.0, 0.0, -9.80665], 1e-3, (ROWS, 3))
FRAME = pd.DataFrame(
    {"time": TIME}
    | {f"gyro.{axis}": GYRO[:, k] for k, axis in enumerate("xyz")}
    | {f"acc.{axis}": ACCEL[:, k] for k, axis in enumerate("xyz")}
)
SI = {"gyro_unit": "rad/s", "accel_unit": "m/s2", "axes": "frd", "latitude": 0.8}


def is_the_truth(recording):
    assert recording.rate_hz == pytest.approx(RATE)
    assert_allclose(recording.gyro_b, GYRO, rtol=1e-12)
    assert_allclose(recording.accel_b, ACCEL, rtol=1e-12)


@pytest.mark.parametrize("compression", [None, "gzip", "bzip2", "xz"])
def test_a_data_frame_by_its_titles(tmp_path, compression):
    path = tmp_path / "imu.rda"
    rdata.write_rda(path, {"imu": FRAME, "note": "in the cellar"}, compression=compression)
    is_the_truth(read(path, **SI))


@pytest.mark.parametrize(("name", "form"), [("imu.rds", "xdr"), ("imu.RDS", "ascii"), ("imu", "xdr")])
def test_one_object(tmp_path, name, form):
    path = tmp_path / name
    rdata.write_rds(path, FRAME, file_format=form)
    is_the_truth(read(path, **SI))


def test_a_list_of_vectors_and_matrices(tmp_path):
    path = tmp_path / "imu.rds"
    rdata.write_rds(path, {"t": TIME, "gyro": GYRO, "accel": ACCEL, "fs": np.array([RATE])})
    is_the_truth(read(path, **SI))


def test_two_data_frames_are_asked_for(tmp_path):
    path = tmp_path / "imu.RData"
    rdata.write_rda(path, {"a": FRAME * 2, "b": FRAME})
    with pytest.raises(InputError, match=r"imu.RData holds 2 tables: a, b.*\nTry: gyronorth info .* --variable a$"):
        read(path, **SI)
    is_the_truth(read(path, variable="b", **SI))


def test_missing_values_are_no_numbers(tmp_path):
    path = tmp_path / "imu.rds"
    frame = FRAME.assign(**{"gyro.x": np.where(np.arange(ROWS) == 7, np.nan, FRAME["gyro.x"])})
    rdata.write_rds(path, frame)
    with pytest.raises(InputError, match=r"Row 8 of imu.rds"):
        read(path, **SI)


@pytest.mark.parametrize("content", [{"note": "text"}, {"a": [1, 2, 3]}])
def test_what_is_no_recording_is_told(tmp_path, content):
    path = tmp_path / "imu.rds"
    rdata.write_rds(path, content)
    with pytest.raises(InputError, match=r"imu.rds"):
        read(path, **SI)
