"""Raw IMU files of Inertial Explorer."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from numpy.testing import assert_allclose

from gyronorth.errors import InputError
from gyronorth.readers import read

ROWS, RATE = 600, 100.0
GYRO = np.random.default_rng(9).normal([3e-5, -4e-5, -5e-5], 1e-6, (ROWS, 3))
ACCEL = np.random.default_rng(10).normal([0.0, 0.0, -9.80665], 1e-3, (ROWS, 3))


def saved(path, *, increments=(1, 1), order="<", scales=(1e-10, 1e-8), start=388800.0):
    head = struct.pack(f"{order}8sbdiiddd", b"$IMURAW\0", order == ">", 8.8, *increments, RATE, *scales)
    values = [np.degrees(GYRO), ACCEL]  # right-forward-up of the file is taken as it is
    per_row = [each / RATE if increments[k] else each for k, each in enumerate(values)]
    rows = np.zeros(ROWS, dtype=[("time", f"{order}f8"), ("counts", f"{order}i4", (6,))])
    rows["time"] = (start + np.arange(ROWS) / RATE) % 604800
    rows["counts"] = np.round(np.hstack([each / scale for each, scale in zip(per_row, scales, strict=True)]))
    path.write_bytes(head.ljust(512, b"\0") + rows.tobytes())
    return path


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("increments", [(1, 1), (0, 0), (1, 0), (0, 1)])
@pytest.mark.parametrize("name", ["run.imr", "run.dat"])
def test_rates_and_increments(tmp_path, name, increments, order):
    scales = (1e-10 if increments[0] else 1e-8, 1e-8)
    recording = read(saved(tmp_path / name, increments=increments, order=order, scales=scales), axes="frd")
    assert recording.rate_hz == pytest.approx(RATE)
    assert recording.axes_origin == "declared"
    assert_allclose(recording.gyro_b, GYRO, atol=2e-10)
    assert_allclose(recording.accel_b, ACCEL, atol=1e-6)


def test_the_axes_are_assumed_and_the_week_may_wrap(tmp_path):
    recording = read(saved(tmp_path / "run.imr", start=604797.0), axes=None)
    assert (recording.axes, recording.axes_origin) == ("rfu", "assumed")
    assert recording.rate_hz == pytest.approx(RATE)
    assert len(recording.gyro_b) == ROWS


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (lambda data: data[:-5], r"ends within a row of 32 bytes.*truncate -s 19680 "),
        (lambda data: data[:300], "a header of 512 bytes"),
        (lambda data: data[:33] + b"\0" * 8 + data[41:], "Its header is damaged"),
        (lambda data: data[:33] + b"\xff" * 8 + data[41:], "Its header is damaged"),
        (lambda data: data[:17] + b"\7" + data[18:], "0 or 1 are expected"),
    ],
)
def test_damage_is_one_message(tmp_path, damage, says):
    path = saved(tmp_path / "run.imr")
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(InputError, match=says):
        read(path)
