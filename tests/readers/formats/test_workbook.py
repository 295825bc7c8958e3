"""Excel workbooks."""

from __future__ import annotations

import re
import zipfile
from datetime import datetime, timedelta

import numpy as np
import openpyxl
import pytest
from numpy.testing import assert_allclose

from gyronorth.errors import InputError
from gyronorth.readers import read

ROWS, RATE = 300, 100.0
GYRO = np.random.default_rng(9).normal([3e-5, -4e-5, -5e-5], 1e-6, (ROWS, 3))
ACCEL = np.random.default_rng(10).normal([0.0, 0.0, -9.80665], 1e-3, (ROWS, 3))
TITLES = [
    "Time (s)",
    "Gyro X (rad/s)",
    "Gyro Y (rad/s)",
    "Gyro Z (rad/s)",
    "Acc X (m/s2)",
    "Acc Y (m/s2)",
    "Acc Z (m/s2)",
]


def fill(sheet, *, above=(), dates=False):
    for row in above:
        sheet.append(row)
    sheet.append(TITLES if not dates else ["Time", *TITLES[1:]])
    for i, numbers in enumerate(np.hstack([GYRO, ACCEL]).tolist()):
        seconds = i / RATE
        sheet.append([datetime(2024, 3, 1, 12) + timedelta(seconds=seconds) if dates else seconds, *numbers])


def saved(path, **how):
    book = openpyxl.Workbook()
    fill(book.active, **how)
    book.create_sheet("Notes").append(["made by hand", 3])
    book.save(path)
    return path


@pytest.mark.slow
@pytest.mark.parametrize("how", [{}, {"above": (["Logger", "v3"], [], ["Sample Rate", 100])}, {"dates": True}])
def test_the_only_sheet_of_numbers_with_titles_is_read_without_declarations(tmp_path, how):
    recording = read(saved(tmp_path / "rec.xlsx", **how))
    assert recording.rate_hz == pytest.approx(RATE)
    assert recording.source == "rec.xlsx"
    assert_allclose(recording.gyro_b, GYRO, rtol=1e-12)
    assert_allclose(recording.accel_b, ACCEL, rtol=1e-12)


@pytest.mark.slow
def test_one_of_two_sheets_is_asked_for(tmp_path):
    path = saved(tmp_path / "rec.xlsx")
    book = openpyxl.load_workbook(path)
    fill(book.create_sheet("second run"))
    book.save(path)
    with pytest.raises(InputError, match=r"has 2 sheets with rows of numbers: Sheet, second run.*\nTry: .*Sheet"):
        read(path)
    assert_allclose(read(path, variable="second run").gyro_b, GYRO, rtol=1e-12)
    with pytest.raises(InputError, match=r"has no sheet 'x'; it holds Sheet, Notes, second run"):
        read(path, variable="x")


def test_damaged_workbooks_and_other_files_are_one_message(tmp_path):
    path = saved(tmp_path / "rec.xlsx")
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(InputError, match=r"rec.xlsx cannot be read"):
        read(path)
    path.write_bytes(b"a,b\n1,2\n")
    with pytest.raises(InputError, match=r"is no .xlsx workbook: it does not begin as one"):
        read(path)
    empty = openpyxl.Workbook()
    empty.save(path)
    with pytest.raises(InputError, match="has no sheet with rows of numbers; it holds Sheet"):
        read(path)


def test_a_sheet_that_claims_all_cells_is_read_as_what_it_holds(tmp_path):
    """A claimed width of 16,384 columns, which all rows before the last were filled up to, went on for hours."""
    book = openpyxl.Workbook()
    book.active.append(("t", "w_x", "w_y", "w_z"))
    for k in range(100):
        book.active.append((k / 10, 1e-5, 2e-5, 3e-5))
    book.save(tmp_path / "honest.xlsx")
    with (
        zipfile.ZipFile(tmp_path / "honest.xlsx") as honest,
        zipfile.ZipFile(tmp_path / "wide.xlsx", "w", zipfile.ZIP_DEFLATED) as wide,
    ):
        for info in honest.infolist():
            text = honest.read(info)
            if info.filename.endswith("sheet1.xml"):
                cells = "".join(
                    f'<c r="{letter}100000"><v>{v}</v></c>'
                    for letter, v in zip("ABCD", (10, 1e-5, 2e-5, 3e-5), strict=True)
                )
                text = re.sub(rb'<dimension ref="[^"]*"', b'<dimension ref="A1:XFD1048576"', text)
                text = text.replace(b"</sheetData>", f'<row r="100000">{cells}</row></sheetData>'.encode())
            wide.writestr(info, text)
    found = read(tmp_path / "wide.xlsx", gyro_unit="rad/s", axes="frd", latitude=0.5, time_unit="s")
    assert len(found.gyro_b) == 101
