"""The table of many recordings: appended to as they are finished, whole at the end, taken up where it was left.

Rows go to a CSV file beside the table, `NAME.partial`, as they come. What stood at the table's place stays until all
are there; then the rows, in the order of the sources, replace it. A run that was killed leaves the partial file.
"""

from __future__ import annotations

import csv
import io
import json
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from math import isfinite
from pathlib import Path
from typing import Any, TextIO

from gyronorth.apart import Apart
from gyronorth.errors import InputError, one_line
from gyronorth.files import written_beside
from gyronorth.readers.budget import check_claim, limits_of
from gyronorth.report.tables import COLUMNS, Outcome
from gyronorth.sources.tables import STAMPS, arrow, is_parquet

#: Rows of a Parquet table that are decoded at once.
BATCH_ROWS = 1 << 12
#: Columns of a table of windows.
WINDOW = ("start_s", "end_s", "windows")
#: Columns of text; the others hold numbers, and `valid` true or false.
TEXTS = (
    *("file", "reasons", "warnings", "method", "sensor", "message", "fitness", *STAMPS),
    *("format", "gyro_unit", "accel_unit", "axes", "axes_origin", "session", "start_time_utc", "notes", "output"),
)
#: Columns of the table of headings, and of that of windows.
HEADINGS, WINDOWS = (*COLUMNS, *STAMPS), (*COLUMNS, *WINDOW, *STAMPS)
#: How a text begins that a spreadsheet would take for a formula, and an apostrophe, which says that it is none.
FORMULA = ("=", "+", "-", "@", "\t", "\r", "'")

Row = tuple[str, ...]


class TableWriter:
    """Rows of a table that is being made; use `table`."""

    def __init__(self, path: Path, settings: str, columns: Sequence[str], journal: TextIO | None) -> None:
        self.columns, self.rows = tuple(columns), dict[str, list[Row]]()
        self._path, self._settings, self._journal = path, settings, journal

    def add(self, outcomes: Sequence[Outcome]) -> None:
        """The rows of one recording, in place of those it had."""
        self._put([_row(outcome, self.columns, len(outcomes)) for outcome in outcomes], write=True)

    def done(self) -> dict[str, str]:
        """Name -> checksum of the recordings whose rows are complete."""
        checksum = self.columns.index("checksum")
        return {name: rows[0][checksum] for name, rows in self.rows.items() if self._complete(rows)}

    def finish(self, names: Sequence[str]) -> None:
        """Write the table: recordings in this order, behind those of earlier runs that are not among them."""
        ours = set(names)
        order = [*(name for name in self.rows if name not in ours), *(name for name in names if name in self.rows)]
        rows = (row for name in order for row in self.rows[name])
        (_write_parquet if is_parquet(self._path) else _write_csv)(self._path, self.columns, rows)

    def column(self, name: str) -> Iterator[str]:
        """The cells of a column."""
        place = self.columns.index(name)
        return (row[place] for rows in self.rows.values() for row in rows)

    def take(self, rows: Iterable[Row], *, write: bool) -> None:
        """Rows of an earlier run.

        Raises
        ------
        InputError
            If they were made with other settings.
        """
        together: dict[str, list[Row]] = {}
        for row in rows:
            self._check(row[self.columns.index("settings")])
            self._check_numbers(row)
            together.setdefault(row[0], []).append(row)
        for group in together.values():
            self._put(group, write=write)

    def _put(self, rows: list[Row], *, write: bool) -> None:
        if not rows:
            return
        self.rows[rows[0][0]] = rows
        if write and self._journal is not None:
            try:
                csv.writer(self._journal, lineterminator="\n").writerows([list(map(_guarded, row)) for row in rows])
                self._journal.flush()
            except OSError as error:
                raise InputError(
                    f"{self._journal.name} cannot be written: {error.strerror or error}. It keeps what is finished: "
                    "free some space there and go on with --resume."
                ) from None

    def _complete(self, rows: list[Row]) -> bool:
        if not rows[0][self.columns.index("checksum")]:
            return False
        return "windows" not in self.columns or rows[0][self.columns.index("windows")] == str(len(rows))

    def _check_numbers(self, row: Row) -> None:
        for name, cell in zip(self.columns, row, strict=True):
            if name not in TEXTS and not _can_stand(cell, name):
                what = f"{name} of {one_line(row[0])} is {one_line(cell[:40])!r}"
                raise InputError(f"The rows for {self._path} are damaged: {what}. Leave --resume out.")

    def _check(self, theirs: str) -> None:
        if theirs == self._settings:
            return
        try:
            old, new = json.loads(theirs), json.loads(self._settings)
            differ = [n for n in sorted(old | new) if old.get(n) != new.get(n)]
            what = "; ".join(f"{n} was {_said(old.get(n))}, is now {_said(new.get(n))}" for n in differ)
        except (ValueError, TypeError):
            what = "those of the table cannot be read"
        raise InputError(
            f"{self._path} was made with other settings: {what}. Give those again to go on with it; or choose another "
            "name, or leave --resume out, for a new table."
        )


def write_table(path: Path, settings: str, outcomes: Sequence[Outcome]) -> None:
    """A table that is written at once.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    if is_parquet(path):
        arrow(path)
    made = TableWriter(path, settings, HEADINGS, None)
    for outcome in outcomes:
        made.add([outcome])
    made.finish([outcome.file for outcome in outcomes])


@contextmanager
def table(
    path: Path, settings: str, *, resume: bool = False, columns: Sequence[str] = HEADINGS
) -> Iterator[TableWriter]:
    """A table to be made at `path`, .parquet or CSV; the partial file goes when the block ends well.

    Parameters
    ----------
    path : Path
        Where it shall be.
    settings : str
        `Request.settings()`; rows made with others are refused.
    resume : bool
        Go on with the rows that are there.
    columns : sequence of str
        `HEADINGS`, `WINDOWS`, or those of another task with `STAMPS` behind them.

    Raises
    ------
    InputError
        If a partial file is there and `resume` is not given, if what is there is no such table or has other settings,
        if another run writes to it, or it cannot be written.
    """
    if is_parquet(path):
        arrow(path)
    if path.exists() and not path.is_file():  # a device or a pipe
        if resume:
            raise InputError(f"{path} is no file: there is nothing in it to go on with. Leave --resume out.")
        yield TableWriter(path, settings, columns, None)
        return
    partial = path.with_name(f"{path.name}.partial")
    made = not partial.exists()
    try:
        journal = partial.open("a+", newline="", encoding="utf-8", errors="backslashreplace")
    except OSError as error:
        raise InputError(f"{partial} cannot be written: {error.strerror or error}.") from None
    with _closed_at_last(journal):
        _lock(journal, partial)
        if not made and not resume:
            raise InputError(
                f"{partial} holds rows of a run that was not finished. Give --resume to go on with it, or remove it."
            )
        try:
            found = TableWriter(path, settings, columns, journal)
            _begin(found, path, partial, journal, resume=resume)
        except BaseException as error:
            if made:
                partial.unlink(missing_ok=True)
            if isinstance(error, OSError):
                raise InputError(f"{partial} cannot be written: {error.strerror or error}.") from None
            raise
        yield found
        partial.unlink(missing_ok=True)


@contextmanager
def _closed_at_last(journal: TextIO) -> Iterator[None]:
    """Close a file; where something went wrong with it, closing it has nothing to add."""
    try:
        yield
    except BaseException:
        with suppress(OSError):
            journal.close()
        raise
    journal.close()


def _begin(found: TableWriter, path: Path, partial: Path, journal: TextIO, *, resume: bool) -> None:
    """Take the rows that are there, cut off one that was not written whole, write the header."""
    rows, end = _read_csv(partial, found.columns, torn=True)
    journal.truncate(end)
    if end == 0:
        csv.writer(journal, lineterminator="\n").writerow(found.columns)
        journal.flush()
    if resume and path.is_file():
        old = list(_read_parquet(path, found.columns)) if is_parquet(path) else _read_csv(path, found.columns)[0]
        newer = {row[0] for row in rows}
        found.take((row for row in old if row[0] not in newer), write=True)
    found.take(rows, write=False)


def _read_csv(path: Path, columns: Sequence[str], *, torn: bool = False) -> tuple[list[Row], int]:
    """Rows of a CSV table, and where the last whole one ends, bytes."""
    content = path.read_bytes()
    if not torn:
        return _parsed(content, path, columns) or [], len(content)
    end = len(content)
    while end:
        end = content.rfind(b"\n", 0, end) + 1
        rows = _parsed(content[:end], path, columns, torn=True) if end else []
        if rows is not None:
            return rows, end
        end -= 1  # that line feed stood within a cell of a row that was not written whole
    return [], 0


def _parsed(content: bytes, path: Path, columns: Sequence[str], *, torn: bool = False) -> list[Row] | None:
    """The rows below the header; None where the last one is not whole."""
    try:
        header, *rows = list(csv.reader(io.StringIO(content.decode("utf-8"), newline=""), strict=True))
    except (ValueError, csv.Error):
        if torn:
            return None
        if content.startswith(f"{','.join(columns)}\n".encode()):
            raise InputError(
                f"{path} is damaged or cut off: its last rows are not whole. Leave --resume out."
            ) from None
        header, rows = [], []
    if tuple(header) != tuple(columns):
        raise InputError(
            f"{path} is no table of this kind: the columns {', '.join(columns)} are expected. Choose another name, or "
            "leave --resume out."
        )
    if rows and len(rows[-1]) != len(columns) and torn:
        return None
    if any(len(row) != len(columns) for row in rows):
        raise InputError(f"{path} is damaged: not all of its rows have {len(columns)} cells. Leave --resume out.")
    return [tuple(sys.intern(cell.removeprefix("'")) for cell in row) for row in rows]


def _write_csv(path: Path, columns: Sequence[str], rows: Iterable[Row]) -> None:
    with written_beside(path) as part, part.open("w", newline="", encoding="utf-8", errors="backslashreplace") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(list(map(_guarded, row)) for row in rows)


def _guarded(cell: str) -> str:
    """A text that a spreadsheet would take for a formula, made a text again by an apostrophe."""
    return f"'{cell}" if cell.startswith(FORMULA) and not _is_number(cell) else cell


def _can_stand(cell: str, name: str) -> bool:
    """Whether a cell of a column that holds no text is as it was written: empty where there is no number."""
    if name == "valid":
        return cell in ("true", "false")
    if name == "windows":
        return cell.isascii() and cell.isdigit() and len(cell) < 19
    try:
        return not cell or isfinite(float(cell))
    except ValueError:
        return False


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _read_parquet(path: Path, columns: Sequence[str]) -> Iterator[Row]:
    """Rows of a Parquet table; like every Parquet file it is decoded within limits of time and memory."""
    size = path.stat().st_size
    child = Apart(lambda: _stored_rows(path, columns), limits=limits_of(size), what=path.name)
    decoded = 0
    try:
        while rows := child.ask(None):
            decoded += sum(len(cell) for row in rows for cell in row)
            check_claim(path.name, "its table", decoded, size)
            yield from rows
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        reason = " ".join(str(error).split())[:160].rstrip(".")
        raise InputError(f"{path} cannot be read: {reason}. Leave --resume out.") from None
    finally:
        child.close()


def _stored_rows(path: Path, columns: Sequence[str]) -> Callable[[None], list[Row]]:
    """Gives the rows batch by batch, and none at the end."""
    file = arrow(path).ParquetFile(path, page_checksum_verification=True)
    if tuple(file.schema_arrow.names) != tuple(columns):
        raise InputError(f"{path} is no table of this kind. Choose another name, or leave --resume out.")
    batches = (batch.columns for batch in file.iter_batches(BATCH_ROWS, use_threads=False) if len(batch))
    found = ([[_text(value) for value in column.to_pylist()] for column in each] for each in batches)
    return lambda _: list(zip(*next(found, ()), strict=True))


def _write_parquet(path: Path, columns: Sequence[str], rows: Iterable[Row]) -> None:
    import pyarrow

    cells = list(zip(*rows, strict=True)) or [()] * len(columns)
    arrays = []
    for name, column in zip(columns, cells, strict=True):
        if name in TEXTS:
            arrays.append(pyarrow.array(column, pyarrow.string()))
        elif name == "valid":
            arrays.append(pyarrow.array([cell == "true" for cell in column], pyarrow.bool_()))
        elif name == "windows":
            arrays.append(pyarrow.array([int(cell) for cell in column], pyarrow.int64()))
        else:
            arrays.append(pyarrow.array([float(cell) if cell else None for cell in column], pyarrow.float64()))
    with written_beside(path) as part:
        arrow(path).write_table(pyarrow.table(arrays, names=list(columns)), part)


def _row(outcome: Outcome, columns: Sequence[str], windows: int) -> Row:
    cells = outcome.row() | {"checksum": outcome.checksum, "settings": outcome.settings, "windows": windows}
    if outcome.window is not None:
        cells |= {"start_s": outcome.window[0], "end_s": outcome.window[1]}
    # A text that is no UTF-8 reads back as what is written of it.
    return tuple(_text(cells.get(name)).encode("utf-8", "backslashreplace").decode() for name in columns)


def _text(value: Any) -> str:
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _said(value: Any) -> str:
    return "not given" if value is None else str(value)


def _lock(journal: TextIO, partial: Path) -> None:
    """Refuse a second run that would write to the same file, where the system can tell."""
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(journal, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError(f"{partial} is being written by another run. Wait for it, or choose another name.") from None
    except OSError:  # a disk without locks
        return
