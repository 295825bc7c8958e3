"""The recording of a stream on disk: every good line as it came, safe within a second.

A file begins with what is known, as `# key: value`, and a header with our names; then lines are
only ever added, so that whatever ends the program leaves a file that the CSV reader reads.
Each stretch has a file of its own: rec.csv, rec.2.csv, ...; a file that exists is left alone.
"""

from __future__ import annotations

import errno
import os
import time
from contextlib import suppress
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from tempfile import TemporaryFile

import numpy as np

from gyronorth.errors import InputError
from gyronorth.live.rows import LiveRows
from gyronorth.live.stretch import Stretch
from gyronorth.readers.declared import Declared
from gyronorth.readers.facts import SIGNATURE
from gyronorth.readers.formats.csv import LIVE_FORMAT, MARK

#: Lines reach the disk itself at least so often, s.
SYNC_INTERVAL = 0.5
#: After a failure, a new file is tried for so often, s.
RETRY_INTERVAL = 2.0
#: How the files of raw bytes end.
RAW_SUFFIX = ".bin"
#: Room in the head of the file for the rate, which is known only later where it is measured.
_RATE_WIDTH = 40


class Recorder:
    """Appends to the files of one session."""

    what = "rows"  # that may be missing

    def __init__(self, path: Path) -> None:
        self.path = path  # of the file that is written, or will be next
        self.failure: str | None = None  # why nothing is written now
        self.lost = 0  # rows that could not be written
        self.bytes = 0  # of the present file
        self.files: list[Path] = []
        self._wanted = path
        self._descriptor: int | None = None
        self._rate_offset: int | None = None
        self._head: bytes | None = None  # of the present stretch
        self._first_failure = ""
        self._synced = self._failed = 0.0

    @property
    def error(self) -> str | None:
        """What the recording lacks, or why nothing is written now; None where it is whole."""
        if self.failure is not None:
            return f"{self.failure}. {self.lost} {self.what} are missing so far; it is tried again."
        if self._first_failure:
            return f"{self._first_failure}. {self.lost} {self.what} are missing; it goes on in {self.path.name}."
        return None

    def begin(self, stretch: Stretch, source: str, *, start_time_utc: str | None, raw: Path | None = None) -> None:
        """Close the present file and begin the next; `raw` holds the bytes of the same samples."""
        self.close()
        self._head, self._rate_offset = _head(stretch, source, start_time_utc, raw)
        self._open()

    def _open(self) -> None:
        """A new file with the head of the stretch."""
        assert self._head is not None
        try:
            self.path, self._descriptor = _new_file(self._wanted)
        except OSError as error:
            self.fail(error)
            return
        self.bytes, self.failure = 0, None
        self._write(self._head)
        if self._descriptor is None:  # a file with half a head is of no use
            with suppress(OSError):
                self.path.unlink()
            return
        self.files.append(self.path)
        self.sync(now=True)

    def rows(self, rows: LiveRows) -> None:
        """Append good rows."""
        if len(rows):
            self._append(rows.text(), len(rows))

    def _append(self, data: bytes, count: int) -> None:
        """Append so many rows; after a failure to a new file, as soon as there can be one."""
        if self._descriptor is None and self._head is not None and time.monotonic() - self._failed > RETRY_INTERVAL:
            self._open()
        if self._descriptor is None or not self._write(data):
            self.lost += count

    def mark(self, text: str) -> None:
        """Append a comment line that marks this moment."""
        self._write(MARK + text.encode() + b"\n")

    def rate(self, rate_hz: float) -> None:
        """Fill in the rate in the head of the file, once it has been measured."""
        offset, self._rate_offset = self._rate_offset, None
        if offset is None or self._head is None:
            return
        line = _rate_line(rate_hz)
        self._head = self._head[:offset] + line + self._head[offset + len(line) :]
        if self._descriptor is None:
            return
        try:
            os.pwrite(self._descriptor, line, offset)
        except OSError as error:
            self.fail(error)

    def sync(self, *, now: bool = False) -> None:
        """Bring what is written to the disk itself, where that was not done lately."""
        if self._descriptor is None or (not now and time.monotonic() - self._synced < SYNC_INTERVAL):
            return
        try:
            os.fsync(self._descriptor)
            if os.fstat(self._descriptor).st_nlink == 0:
                raise FileNotFoundError(errno.ENOENT, "the file was removed")
        except OSError as error:
            self.fail(error)
        self._synced = time.monotonic()

    def close(self) -> None:
        """End the present file; the next stretch gets another one."""
        self.sync(now=True)
        if self._descriptor is not None:
            os.close(self._descriptor)
        self._descriptor, self._head = None, None

    def _write(self, data: bytes) -> bool:
        """Whether all of it was written."""
        if self._descriptor is None:
            return False
        view = memoryview(data)
        try:
            while view:
                view = view[os.write(self._descriptor, view) :]
        except OSError as error:
            self.fail(error)
            return False
        self.bytes += len(data)
        return True

    def fail(self, error: OSError) -> None:
        """Note that nothing can be written for now, and why; it is tried again."""
        self.failure = f"{self.path}: {error.strerror or error}"
        self._first_failure = self._first_failure or self.failure
        self._failed = time.monotonic()
        if self._descriptor is not None:
            os.close(self._descriptor)
        self._descriptor = None


class RawRecorder(Recorder):
    """The bytes of frames as they came, beside the rows that were decoded from them: north.csv, north.bin.

    Each file replays by itself: it begins with the configuration that the unit sent before.
    """

    what = "bytes"

    def __init__(self, path: Path) -> None:
        super().__init__(path.with_suffix(RAW_SUFFIX))

    def begin_file(self) -> None:
        """Close the present file and begin the next."""
        self.close()
        self._head = b""
        self._open()

    def append(self, data: bytes) -> None:
        """Append bytes."""
        self._append(data, len(data))


def check_place(path: Path) -> None:
    """Refuse a place where no recording can be written, before anything starts.

    Raises
    ------
    InputError
        If the folder does not exist or may not be written, or the name does not end in .csv.
    """
    if path.suffix.lower() != ".csv":
        raise InputError(f"--save {path}: the name must end in .csv.")
    if not path.parent.is_dir():
        raise InputError(f"--save {path}: the folder {path.parent} does not exist; make it first.")
    try:
        with TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise InputError(
            f"--save {path}: no file can be made in {path.parent}: {error.strerror or error}. Choose another folder."
        ) from None


def _new_file(wanted: Path) -> tuple[Path, int]:
    """A file that did not exist: the wanted one, or the first free number behind its stem."""
    for number in count(1):
        path = wanted if number == 1 else wanted.with_name(f"{wanted.stem}.{number}{wanted.suffix}")
        try:
            return path, os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        except FileExistsError:
            continue
    raise AssertionError("unreachable")


def _head(stretch: Stretch, source: str, start_time_utc: str | None, raw: Path | None) -> tuple[bytes, int | None]:
    """The first lines, and where in them the rate is to be filled in."""
    declared, stated = stretch.declared, stretch.stated
    start = stated.start_time_utc or start_time_utc
    usual = stretch.form.decoded
    axes_known = declared.axes_declared or (usual is not None and usual.axes is not None)
    facts = {
        SIGNATURE[0]: LIVE_FORMAT,
        "source": " ".join(source.split()),
        "raw": None if raw is None else raw.name,
        "gyro_unit": declared.gyro_unit,
        "accel_unit": declared.accel_unit or None,
        "increments": None if stretch.form.decoded is not None else _increments(declared),
        "axes": declared.axes if axes_known else None,
        "latitude_deg": repr(float(np.degrees(stretch.latitude))),
        "heading_true_deg": (
            None if declared.heading_true is None else repr(float(np.degrees(declared.heading_true) % 360))
        ),
        "start_time_utc": start,
        "session": stated.session,
    }
    head = "".join(f"# {key}: {value}\n" for key, value in facts.items() if value is not None).encode()
    offset = None
    if declared.rate_hz is not None:
        head += _rate_line(declared.rate_hz)
    elif stretch.form.time:
        offset = len(head)
        head += b"#" + b" " * (_RATE_WIDTH - 2) + b"\n"
    return head + ",".join(stretch.form.titles).encode() + b"\n", offset


def _increments(declared: Declared) -> str | None:
    """Which sensors' lines hold increments."""
    names = {(True, True): "both", (True, False): "gyro", (False, True): "accel"}
    return names.get((declared.gyro_increments, declared.accel_increments))


def _rate_line(rate_hz: float) -> bytes:
    return f"# rate_hz: {rate_hz!r}".ljust(_RATE_WIDTH - 1).encode() + b"\n"


def utc_now() -> str:
    """The time of the system's clock, ISO 8601 with Z, to the millisecond."""
    return datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
