"""Parquet and Feather tables whose columns are no plain numbers, and JSON in one piece."""

from __future__ import annotations

import json

import numpy as np
import pyarrow
import pytest
from cases.layouts import ACCEL, DPS, FLU, GYRO, TIME
from numpy.testing import assert_allclose
from pyarrow import feather, parquet

from gyronorth.errors import InputError
from gyronorth.readers import read

SAID = {"axes": "frd", "gyro_unit": "deg/s", "accel_unit": "m/s2"}
STAMPS = [1_700_000_000_000_000 + 10_000 * i for i in range(len(TIME))]


def is_the_truth(recording):
    assert recording.rate_hz == pytest.approx(100)
    assert_allclose(recording.gyro_b, GYRO, rtol=1e-9)
    assert_allclose(recording.accel_b, ACCEL, rtol=1e-9)


def fixed(values):
    return pyarrow.FixedSizeListArray.from_arrays(pyarrow.array(values.ravel()), 3)


def structs(values):
    return pyarrow.array([dict(zip("xyz", row, strict=True)) for row in values.tolist()])


@pytest.mark.slow
@pytest.mark.parametrize("made", [fixed, structs, lambda values: pyarrow.array(values.tolist())])
@pytest.mark.parametrize("clock", [TIME, pyarrow.array(STAMPS, pyarrow.timestamp("us", "Europe/Berlin"))])
def test_triples_in_one_column(tmp_path, made, clock):
    table = pyarrow.table({"time": clock, "gyro": made(DPS), "accel": made(ACCEL)})
    parquet.write_table(table, tmp_path / "rec.parquet")
    feather.write_feather(table, str(tmp_path / "rec.feather"))
    for name in ("rec.parquet", "rec.feather"):
        is_the_truth(read(tmp_path / name, **SAID))


@pytest.mark.parametrize("zone", ["", "Z"])
def test_times_as_text(tmp_path, zone):
    texts = [f"2024-03-01T11:58:{seconds:06.3f}{zone}" for seconds in TIME]
    columns = {f"gyro_{axis} (deg/s)": DPS[:, k] for k, axis in enumerate("xyz")}
    columns |= {f"acc_{axis} (m/s2)": ACCEL[:, k] for k, axis in enumerate("xyz")}
    parquet.write_table(pyarrow.table({"time": texts, **columns}), tmp_path / "rec.parquet")
    is_the_truth(read(tmp_path / "rec.parquet", axes="frd"))


def test_lists_of_different_lengths_are_told(tmp_path):
    rows = [[1.0, 2.0, 3.0]] * 50 + [[1.0]]
    parquet.write_table(pyarrow.table({"t": np.arange(51) * 0.01, "gyro": rows}), tmp_path / "rec.parquet")
    with pytest.raises(InputError, match=r"gyro of rec.parquet holds lists of different lengths"):
        read(tmp_path / "rec.parquet", **SAID)


def rows():
    each = zip(TIME.tolist(), DPS.tolist(), ACCEL.tolist(), strict=True)
    return [{"t": time, "gyro": gyro, "acc": accel} for time, gyro, accel in each]


JSON = {
    "list": rows,
    "inside": lambda: {"device": "X1", "rate": 100, "data": rows()},
    "columns": lambda: {"t": TIME.tolist(), **{f"{kind}_{axis}": values[:, k].tolist() for kind, values in
                        (("gyro", DPS), ("acc", ACCEL)) for k, axis in enumerate("xyz")}},
    "groups": lambda: {"imu": {"t": TIME.tolist(), "gyro": dict(zip("xyz", DPS.T.tolist(), strict=True)),
                               "acc": dict(zip("xyz", ACCEL.T.tolist(), strict=True))}},
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", JSON)
@pytest.mark.parametrize("indent", [None, 1])
def test_json_in_one_piece(tmp_path, name, indent):
    (tmp_path / "rec.json").write_text(json.dumps(JSON[name](), indent=indent))
    is_the_truth(read(tmp_path / "rec.json", **SAID))


def test_rows_of_two_sensors_are_told_apart_by_a_word_or_by_gravity(tmp_path):
    words, numbers = ["timestamp,sensor,x,y,z"], []
    for i in range(len(TIME)):
        for kind, number, values in (("ACCELEROMETER", 1, ACCEL[i]), ("GYROSCOPE", 4, GYRO[i])):
            listed = ",".join(f"{value:.12f}" for value in values * FLU)
            words.append(f"{1_700_000_000_000 + 10 * i},{kind},{listed}")
            numbers.append(f"{10 * i + number},{number},{listed}")
    path = tmp_path / "rec.csv"
    path.write_text("\n".join([*words, ""]))
    recording = read(path, axes="flu", gyro_unit="rad/s", accel_unit="m/s2")
    assert_allclose(recording.gyro_b, GYRO, rtol=1e-6)
    assert_allclose(recording.accel_b, ACCEL, atol=1e-9)
    path.write_text("\n".join([*numbers, ""]))
    columns = {"t": 0, "w_x": 2, "w_y": 3, "w_z": 4}
    with pytest.raises(InputError, match="does not say in which unit f_x, f_y, f_z are"):
        read(path, columns=columns, gyro_unit="rad/s", axes="flu")
    recording = read(path, columns=columns, gyro_unit="rad/s", accel_unit="m/s2", time_unit="ms", axes="flu")
    assert_allclose(recording.gyro_b, GYRO, rtol=1e-6)
    assert_allclose(recording.accel_b, ACCEL, atol=1e-2)  # samples of the other row are 3 ms away
