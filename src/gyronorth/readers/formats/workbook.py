"""Excel workbooks (.xlsx): the sheet with the recording goes, as text, to the reader of texts.

The only sheet that has rows of numbers is taken, or a gyroscope's and an accelerometer's by their names; of others,
`--variable` names one.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import replace
from datetime import datetime, time, timedelta
from pathlib import Path
from typing import Any

from gyronorth.apart import Apart
from gyronorth.errors import InputError
from gyronorth.readers.archive import OTHER_KINDS, is_workbook
from gyronorth.readers.asking import ask
from gyronorth.readers.budget import limits_of
from gyronorth.readers.format import Format, format_info
from gyronorth.readers.formats.csv import open_csv
from gyronorth.readers.joining import joined, options_of_two
from gyronorth.readers.library import errors_translated, library
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.source import RATES, Question, Source
from gyronorth.readers.spool import Spooled

#: Rows of a sheet that are looked at for numbers; a workbook has at most 2^20 rows.
LOOKED_AT = 50
#: Bytes of the sheets unpacked, at most: 2^20 rows of 16 cells.
LARGEST = 1 << 31


def open_workbook(path: Path, options: ReadOptions) -> Source:
    """Open a workbook."""
    with path.open("rb") as file:
        if file.read(4) != b"PK\x03\x04":
            raise InputError(
                f"{path.name} is no .xlsx workbook: it does not begin as one. Save an older .xls as .xlsx or CSV."
            )
    if not is_workbook(path):
        raise InputError(f"{path.name} is a zip archive but no .xlsx workbook: it holds no xl/workbook.xml.")
    library("openpyxl", path.name, "a workbook")
    _check_size(path)
    spooled = Spooled(path.name)
    # A cell may stand in any of 2^34 places, and all before it are then gone through.
    child = Apart(lambda: lambda to: _as_text(path, options, to), limits=limits_of(path.stat().st_size), what=path.name)
    try:
        name, accel = child.ask(spooled.path)
    finally:
        child.close()
    if accel:
        of_gyro, of_accel = options_of_two(replace(options, variable=None))
        forces = replace(open_csv(_beside(spooled.path), of_accel), name=f"sheet {accel}")
        source = joined(open_csv(spooled.path, of_gyro), forces, drop_bad_rows=options.drop_bad_rows)
    else:
        source = open_csv(spooled.path, replace(options, variable=None))
    return replace(
        source,
        format="xlsx",
        name=path.name,
        ours=False,
        held=spooled,
        read_as=f"sheet {name}; {source.read_as}".removesuffix("; "),
    )


def _beside(path: Path) -> Path:
    return path.with_name(f"{path.name}-accel")


def _as_text(path: Path, options: ReadOptions, to: Path) -> tuple[str, str]:
    """Write the sheet with the recording as CSV, and give its name and that of the accelerometer's, "" without one."""
    import openpyxl

    with errors_translated(path.name, ".xlsx workbook"):
        book = openpyxl.load_workbook(path, read_only=True, data_only=True, keep_links=False)
        try:
            for sheet in book.worksheets:
                sheet.reset_dimensions()  # what a sheet says of its size, rows would be filled up to
            names = _sheets(book, options, path.name)
            for sheet, file in zip(names, (to, _beside(to)), strict=True):
                with file.open("w", newline="", encoding="utf-8") as text:
                    csv.writer(text).writerows(_rows(book[sheet]) if sheet else ())
        finally:
            book.close()
    return names


def _sheets(book: Any, options: ReadOptions, name: str) -> tuple[str, str]:
    wanted = options.variable
    titles = [sheet.title for sheet in book.worksheets]
    if wanted is not None:
        if wanted not in titles:
            raise InputError(f"{name} has no sheet {wanted!r}; it holds {', '.join(titles[:12])}.")
        return wanted, ""
    found = [sheet.title for sheet in book.worksheets if _has_numbers(sheet)]
    if not found:
        raise InputError(f"{name} has no sheet with rows of numbers; it holds {', '.join(titles[:12]) or 'no sheet'}.")
    gyros, accels = ([title for title in found if each in title.lower()] for each in ("gyr", "acc"))
    accels = [title for title in accels if not any(kind in title.lower() for kind in OTHER_KINDS)]
    if len(gyros) == len(accels) == 1 and gyros != accels and options.needed == RATES:
        return gyros[0], accels[0]
    if len(found) > 1:
        says = f"{name} has {len(found)} sheets with rows of numbers: {', '.join(found[:12])}. Which one is meant?"
        raise ask(name, options, [Question(says, ("--variable", (gyros or found)[0]), certain=False)])
    return found[0], ""


def _has_numbers(sheet: Any) -> bool:
    rows = sheet.iter_rows(max_row=LOOKED_AT, values_only=True)
    return any(sum(isinstance(cell, int | float) for cell in row) >= len(RATES) for row in rows)


def _rows(sheet: Any) -> Iterator[list[str]]:
    for row in sheet.iter_rows(values_only=True):
        cells = [_text(cell) for cell in row]
        if any(cells):
            yield cells


def _text(cell: Any) -> str:
    if cell is None:
        return ""
    if isinstance(cell, timedelta):
        return repr(cell.total_seconds())
    if isinstance(cell, datetime | time):
        return cell.isoformat()
    return repr(float(cell)) if isinstance(cell, float) else str(cell)


def _check_size(path: Path) -> None:
    import zipfile

    with errors_translated(path.name, ".xlsx workbook"), zipfile.ZipFile(path) as archive:
        total = sum(info.file_size for info in archive.infolist())
    if total > LARGEST:
        raise InputError(f"{path.name} unpacks into {total >> 20} MiB, more than a recording fills. Save it as CSV.")


FORMAT = Format(format_info("xlsx"), open_workbook)
