"""Binary rows of KF-GINS and PSINS, told by their content."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from gyronorth.errors import InputError
from gyronorth.readers import describe, read

ROWS, RATE = 500, 200.0
TIME = 388800 + np.arange(ROWS) / RATE
RNG = np.random.default_rng(8)
GYRO = RNG.normal([3e-5, -4e-5, -5e-5], 1e-6, (ROWS, 3))
ACCEL = RNG.normal([0.0, 0.0, -9.80665], 1e-3, (ROWS, 3))
RFU = np.array([1.0, 1.0, -1.0])


def turned(values):
    return values[:, [1, 0, 2]] * RFU


def rows(layout):
    increments = [GYRO / RATE, ACCEL / RATE]
    if layout == "KF-GINS":
        return np.column_stack([TIME, *increments]).astype("<f8")
    table = np.column_stack([*map(turned, increments), np.arange(ROWS) / RATE])
    return table.astype("<f8" if layout == "PSINS" else "<f4")


@pytest.mark.parametrize("suffix", [".bin", ".imu.dat", ""])
@pytest.mark.parametrize(("layout", "axes"), [("KF-GINS", "frd"), ("PSINS", "rfu"), ("PSINS (floats)", "rfu")])
def test_the_layout_is_told_by_the_content(tmp_path, layout, axes, suffix):
    path = tmp_path / f"rec{suffix}"
    rows(layout).tofile(path)
    recording = read(path)
    assert recording.rate_hz == pytest.approx(RATE, rel=1e-6)
    # The time has 7 digits in floats, which moves no sample: increments are divided by the mean interval.
    assert_allclose(recording.gyro_b, GYRO, rtol=1e-5)
    assert_allclose(recording.accel_b, ACCEL, rtol=1e-5, atol=1e-6)
    info = describe(path).info
    assert (info.axes, info.axes_declared, info.format) == (axes, False, "doubles")
    assert len(read(path, window=(0.5, 1.0)).gyro_b) == 100


def test_what_is_cut_off_or_something_else_is_refused(tmp_path):
    content = rows("KF-GINS").tobytes()
    path = tmp_path / "rec.bin"
    path.write_bytes(content[:-20])
    with pytest.raises(InputError, match=r"ends within a row of 56 bytes.*truncate -s 27944 rec.bin"):
        read(path)
    path.write_bytes(content)
    with pytest.raises(InputError, match="columns does not apply"):
        read(path, columns={"t": 0})
    without_gravity = rows("KF-GINS")
    without_gravity[:, 4:] = 0
    without_gravity.tofile(path)
    with pytest.raises(InputError, match=r"holds no rows of seven binary numbers"):
        read(path, format="doubles")


@pytest.mark.slow
def test_a_long_file_is_described_from_places(tmp_path):
    table = np.tile(rows("KF-GINS"), (4000, 1))
    table[:, 0] = 388800 + np.arange(len(table)) / RATE
    table.tofile(tmp_path / "long.bin")
    described = describe(tmp_path / "long.bin")
    assert described.estimate is not None
    assert described.samples == len(table)
    assert_allclose(described.rate_mean, GYRO.mean(axis=0), rtol=1e-3)
