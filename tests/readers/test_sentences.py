"""Lines that wrap their numbers."""

from __future__ import annotations

from functools import reduce
from operator import xor

import numpy as np
import pytest
from cases.layouts import ACCEL, DPS, GYRO, TIME
from numpy.testing import assert_allclose

from gyronorth.errors import InputError
from gyronorth.readers import read

ROWS = 200
BARE = {"t": 0, "w_x": 1, "w_y": 2, "w_z": 3, "f_x": 4, "f_y": 5, "f_z": 6}
SAID = {"axes": "frd", "gyro_unit": "deg/s", "accel_unit": "m/s2"}
NUMBERS = [",".join(f"{value:.9f}" for value in row) for row in np.column_stack([TIME, DPS, ACCEL])[:ROWS].tolist()]
GGA = "$GPGGA,120000.00,4800.0,N,01100.0,E,1,08,0.9,500,M,46,M,,*42"


def sentence(content: str) -> str:
    return f"${content}*{reduce(xor, content.encode()):02X}"


def of(tmp_path, lines, **options):
    path = tmp_path / "rec.log"
    path.write_text("\n".join([*lines, ""]))
    return read(path, **(SAID | options))


def is_the_truth(recording):
    assert recording.rate_hz == pytest.approx(100)
    assert_allclose(recording.gyro_b, GYRO[:ROWS], atol=2e-11)
    assert_allclose(recording.accel_b, ACCEL[:ROWS], atol=1e-8)


@pytest.mark.parametrize("between", [[], [GGA]])
def test_sentences_are_rows(tmp_path, between):
    rows = [sentence(f"PIMU,{row}") for row in NUMBERS]
    lines = [line for i, row in enumerate(rows) for line in (row, *(between if i % 12 == 4 else ()))]
    is_the_truth(of(tmp_path, lines, columns=BARE))


def test_a_checksum_that_does_not_hold_is_a_bad_row(tmp_path):
    lines = [sentence(f"PIMU,{row}") for row in NUMBERS]
    lines[70] = lines[70].replace(",0.7", ",0.8")
    with pytest.raises(InputError, match=r"Row 71 of rec.log"):
        of(tmp_path, lines, columns=BARE)
    assert of(tmp_path, lines, columns=BARE, drop_bad_rows=True).rows_dropped == 1


@pytest.mark.parametrize("form", ["[2024-03-01 11:58:{:06.3f}] {}", "11:58:{:06.3f} -> {}", "[11:58:{:06.3f}]{}"])
def test_stamps_of_a_terminal_are_the_clock(tmp_path, form):
    rows = [row.split(",", 1)[1] for row in NUMBERS]
    lines = [form.format(seconds, row) for seconds, row in zip(TIME, rows, strict=False)]
    is_the_truth(of(tmp_path, lines, columns=BARE))
    titled = [form.format(0, "gx,gy,gz,ax,ay,az"), *lines]
    is_the_truth(of(tmp_path, titled))


@pytest.mark.parametrize(("delimiter", "letter"), [(" ", "D"), (",", "d")])
def test_exponents_of_fortran_are_numbers(tmp_path, delimiter, letter):
    table = np.column_stack([TIME, DPS, ACCEL])[:ROWS].tolist()
    lines = [delimiter.join(f"{value:.12E}".replace("E", letter) for value in row) for row in table]
    is_the_truth(of(tmp_path, lines, columns=BARE))


@pytest.mark.parametrize("instances", [1, 2])
def test_the_first_imu_of_an_ardupilot(tmp_path, instances):
    lines = ["FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns"]
    lines += ["FMT, 163, 35, IMU, QBffffff, TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", "PARM, 100, SYSID, 1"]
    for i in range(ROWS):
        for instance in range(instances):
            values = ", ".join(f"{value:.12f}" for value in (*(GYRO[i] * (1 + instance)), *ACCEL[i]))
            lines.append(f"IMU, {5_000_000 + 10_000 * i + 20 * instance}, {instance}, {values}")
        lines += ["BARO, 5000000, 0, 12.3, 1013"] * (i % 10 == 0)
    recording = of(tmp_path, lines, gyro_unit=None, accel_unit=None)
    is_the_truth(recording)
    assert "IMU[0] GyrX..Z (rad/s)" in recording.read_as
