"""Numbers from text files: the leading lines one by one, then blocks of rows at a time.

A block of regular rows is parsed in one call; only a block that fails is taken apart row by
row, to say which row is bad and why.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import compress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.readers.source import DESCRIBED, Bad, Block, Parts

#: Bytes read at a time: about 15,000 rows of six values.
BLOCK_BYTES = 1 << 20
#: Bytes of a look at one place of a file, and places at which lines are counted.
PLACE_BYTES, COUNTED = 1 << 18, 32
#: A longer line is no row of numbers.
LONGEST_LINE = 1 << 16


class TextHead:
    """The leading lines of a text file, as a context manager that remembers where it stopped."""

    def __init__(self, path: Path) -> None:
        self.name = path.name
        self.row = 0  # lines taken so far
        self.offset = 0  # bytes taken so far
        self._path = path

    def __enter__(self) -> TextHead:
        self._file = self._path.open("rb")
        start = self._file.read(4)
        if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
            self._file.close()
            raise InputError(f"{self.name} is UTF-16 text; save it as UTF-8.")
        self.offset = 3 if start[:3] == b"\xef\xbb\xbf" else 0
        self._file.seek(self.offset)
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def peek(self) -> str | None:
        """The next line without its end; None at the end of the file."""
        self._file.seek(self.offset)
        line = self._file.readline(LONGEST_LINE + 1)
        if len(line) > LONGEST_LINE:
            raise InputError(
                f"Row {self.row + 1} of {self.name} is longer than {LONGEST_LINE} characters. "
                "Lines that end in LF or CRLF are expected: is it another format?"
            )
        self._next = len(line)
        if not line:
            return None
        if b"\x00" in line:
            raise InputError(
                f"Row {self.row + 1} of {self.name} holds zero bytes: the file is damaged or not a text file."
            )
        try:
            return line.decode().rstrip("\r\n")
        except UnicodeDecodeError as error:
            raise InputError(
                f"Row {self.row + 1} of {self.name} holds the byte 0x{line[error.start]:02x}, which is not UTF-8. "
                "Save the file as UTF-8, or take the special characters out."
            ) from None

    def take(self) -> str | None:
        """Like `peek`, and go past the line."""
        line = self.peek()
        if line is not None:
            self.offset += self._next
            self.row += 1
        return line


@dataclass(frozen=True)
class Layout:
    """How a row is laid out."""

    titles: tuple[str, ...]  # names of all fields, for messages
    use: tuple[int, ...]  # positions of the fields that are read, in the order of the block's columns
    delimiter: str | None  # None: any white space
    trailing: bool = False  # rows end in a delimiter with nothing behind it
    mark: bytes | None = None  # of a live recording: lines that begin so are no rows, and the last may be cut off


def text_blocks(path: Path, offset: int, row: int, layout: Layout) -> Iterator[Block]:
    """Blocks of the rows behind `offset` bytes and `row` lines of the file."""
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(offset)
        rest = b""
        while True:
            data = file.read(BLOCK_BYTES)
            end = len(data) < BLOCK_BYTES
            data = rest + data
            cut = len(data) if end else data.rfind(b"\n") + 1
            data, rest = data[:cut], data[cut:]
            if len(rest) > LONGEST_LINE:
                last = row + data.count(b"\n")
                raise InputError(
                    f"{path.name} has a line of more than {LONGEST_LINE} characters after row {last}: it is damaged."
                )
            cut_off = False
            if end and layout.mark is not None:
                whole = data.rfind(b"\n") + 1
                cut_off, data = len(data) > whole, data[:whole]
            if end:
                data = data.rstrip()  # blank lines at the end are no rows
            if data or cut_off:
                data = data.replace(b"\r\n", b"\n")
                block = parse_block(data, row + 1, layout)
                yield replace(block, share=min(1.0, file.tell() / size), cut_off=cut_off)
                row += data.count(b"\n")
            if end:
                return


def text_parts(path: Path, offset: int, row: int, layout: Layout) -> Parts:
    """The same rows at places of the file; their number is estimated from the length of lines here and there."""
    size = path.stat().st_size
    length = 1 << 14
    with path.open("rb") as file:
        counted = lines = 0
        for share in np.linspace(0, 1, COUNTED):
            file.seek(offset + round(float(share) * max(0, size - offset - length)))
            data = file.read(length)
            counted, lines = counted + len(data), lines + data.count(b"\n")
    per_row = counted / max(lines, 1)
    return Parts(
        rows=round((size - offset) / max(per_row, 1.0)),
        exact=False,
        block=round(PLACE_BYTES / max(per_row, 1.0)),
        read=partial(_place, path, offset, row, layout, per_row),
    )


def _place(path: Path, offset: int, row: int, layout: Layout, per_row: float, share: float) -> Block:
    """Whole lines at a share of the file; their row numbers are estimates."""
    size = path.stat().st_size
    start = offset + round(share * max(0, size - offset - PLACE_BYTES))
    with path.open("rb") as file:
        file.seek(start)
        data = file.read(PLACE_BYTES)
    begin = data.find(b"\n") + 1 if start > offset else 0
    end = len(data) if start + len(data) >= size else data.rfind(b"\n") + 1
    data = data[begin:end].rstrip().replace(b"\r\n", b"\n")
    first = row + 1 + round((start + begin - offset) / per_row)
    return parse_block(data, first, layout) if data else Block(np.zeros((0, len(layout.use))), np.arange(0), Bad.none())


def parse_block(data: bytes, first_row: int, layout: Layout) -> Block:
    """The rows in `data`, lines that end in LF; `first_row` is the number of the first."""
    if data and not data.endswith(b"\n"):
        data += b"\n"
    rows = np.arange(first_row, first_row + data.count(b"\n"))
    if layout.mark is not None and layout.mark in data:
        lines = data.split(b"\n")[:-1]
        kept = np.array([not line.startswith(layout.mark) for line in lines])
        data, rows = b"".join(line + b"\n" for line in compress(lines, kept)), rows[kept]
    values = _parse_regular(data, layout)
    if values is None:
        return _parse_each(data, rows, layout)
    return Block(values, rows, Bad.none())


def _parse_regular(data: bytes, layout: Layout) -> NDArray[np.float64] | None:
    """All rows in one call, or None where any of them is irregular."""
    if not data:
        return np.zeros((0, len(layout.use)))
    width = len(layout.titles) + layout.trailing
    if layout.delimiter is not None and not _has_width(data, layout.delimiter, width):
        return None
    try:
        lines = data.decode().split("\n")[:-1]
        # Without a delimiter every field is read: numpy then insists on equal widths.
        use = layout.use if layout.delimiter is not None else None
        values = np.loadtxt(lines, delimiter=layout.delimiter, usecols=use, comments=None, quotechar='"', ndmin=2)
    except ValueError:  # UnicodeDecodeError is one
        return None
    if use is None:
        if values.shape[1] != width:
            return None
        values = values[:, layout.use]
    blank_behind = not layout.trailing or all(line.rstrip().endswith(str(layout.delimiter)) for line in lines)
    return values if len(values) == len(lines) and blank_behind else None


def _has_width(data: bytes, delimiter: str, width: int) -> bool:
    """Whether every line has `width` fields, from the pattern of delimiters and line ends."""
    symbols = np.frombuffer(data, dtype=np.uint8)
    separators = symbols[(symbols == ord(delimiter)) | (symbols == ord("\n"))]
    if len(separators) % width:
        return False
    separators = separators.reshape(-1, width)
    return bool((separators[:, -1] == ord("\n")).all() and (separators[:, :-1] == ord(delimiter)).all())


def _parse_each(data: bytes, numbers: NDArray[np.int64], layout: Layout) -> Block:
    """Row by row: the good ones, and what is wrong with the others."""
    values: list[list[float]] = []
    rows: list[int] = []
    bad: list[int] = []
    reasons: list[tuple[int, str]] = []
    lines = data.split(b"\n")[:-1]
    for row, line in zip(numbers.tolist(), lines, strict=True):
        parsed = _parse_row(line, layout)
        if isinstance(parsed, str):
            bad.append(row)
            if len(reasons) < DESCRIBED:
                reasons.append((row, parsed))
        else:
            values.append(parsed)
            rows.append(row)
    return Block(
        np.array(values, dtype=float).reshape(len(values), len(layout.use)),
        np.array(rows, dtype=np.int64),
        Bad(np.array(bad, dtype=np.int64), tuple(reasons)),
    )


def _parse_row(line: bytes, layout: Layout) -> list[float] | str:
    """The values of one row, or what is wrong with it."""
    try:
        text = line.decode()
    except UnicodeDecodeError as error:
        return f"it holds the byte 0x{line[error.start]:02x}, which is not UTF-8 text"
    if not text.strip():
        return "it is empty"
    if "\x00" in text:
        return "it holds zero bytes"
    try:
        fields = text.split() if layout.delimiter is None else next(csv.reader([text], delimiter=layout.delimiter))
    except (csv.Error, StopIteration):
        return "its quotation marks do not match"
    if layout.trailing and len(fields) > len(layout.titles) and not fields[-1].strip():
        fields = fields[:-1]
    if len(fields) != len(layout.titles):
        return f"it has {len(fields)} fields; {len(layout.titles)} are expected{_likely_cause(text, fields, layout)}"
    values = []
    for position in layout.use:
        try:
            if "_" in fields[position]:
                raise ValueError
            values.append(float(fields[position]))
        except ValueError:
            shown = fields[position] if len(fields[position]) <= 40 else fields[position][:37] + "..."
            return f"{layout.titles[position] or f'field {position + 1}'} is {shown!r}; a number is expected"
    return values


def _likely_cause(text: str, fields: list[str], layout: Layout) -> str:
    if layout.delimiter == "," and ";" in text:
        return " (semicolons between fields? commas are expected)"
    if layout.delimiter == "," and "\t" in text:
        return " (tabs between fields? commas are expected)"
    if layout.delimiter == "," and len(fields) in (2 * len(layout.titles), 2 * len(layout.titles) - 1):
        return " (decimal commas? decimal points are expected)"
    return " (cut off?)" if len(fields) < len(layout.titles) else ""
