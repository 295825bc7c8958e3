"""Numbers from text files: the leading lines one by one, then blocks of rows at a time.

A block of regular rows is parsed in one call, by pyarrow where that is installed; only a block that fails is taken
apart row by row, to say which row is bad and why.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import compress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.frozen import frozen
from gyronorth.readers.source import DESCRIBED, Bad, Block, Parts
from gyronorth.readers.text_arrow import arrow_columns, is_worthwhile, load_for
from gyronorth.readers.text_head import LONGEST_LINE
from gyronorth.readers.times import ClockColumns
from gyronorth.readers.titles import take_apart

#: Bytes read at a time: about 15,000 rows of six values.
BLOCK_BYTES = 1 << 21
#: Bytes of a look at one place of a file, and places at which lines are counted.
PLACE_BYTES, COUNTED = 1 << 18, 32
#: A number with a decimal comma between quotation marks.
QUOTED_COMMA = re.compile(rb'"([^",\n]*),([^",\n]*)"')


@frozen
class Layout:
    """How a row is laid out."""

    titles: tuple[str, ...]  # names of all fields, for messages
    use: tuple[int, ...]  # positions of the fields that are read, in the order of the block's columns
    delimiter: str | None  # None: any white space
    trailing: bool = False  # rows end in a delimiter with nothing behind it
    mark: bytes | None = None  # of a live recording: lines that begin so are no rows, and the last may be cut off
    comments: tuple[bytes, ...] = ()  # lines that begin so are no rows
    blank: bool = False  # blank lines are no rows
    sparse: bool = False  # rows in which all fields that are read are empty are no rows
    decimal: str = "."
    encoding: str = "utf-8"
    line_end: str = "\n"
    end: int | None = None  # bytes before a footer
    clock: ClockColumns | None = None  # the block's first column, where it is no plain number
    texts: bool = False  # some fields that are not read are no numbers
    only: tuple[int, str] | None = None  # rows of several kinds: those whose field holds this text

    @cached_property
    def turned(self) -> tuple[str, ...]:
        """Titles of fields that are read with the other sign: -Y Accel."""
        titles = [self.titles[position] for position in self.use]
        return tuple(title for title in titles if "-" in title and take_apart(title).minus)

    @property
    def columns(self) -> int:
        """Columns of a block."""
        return len(self.use) + (self.clock is not None)

    def plain(self, data: bytes) -> bytes:
        """Whole lines as UTF-8 with LF."""
        if self.encoding != "utf-8":
            data = data.decode(self.encoding, errors="replace").encode()
        if b"\r" not in data:
            return data
        return data.replace(b"\r\n", b"\n") if self.line_end == "\n" else data.replace(b"\r", b"\n")

    @property
    def newline(self) -> bytes:
        """The end of a line in the file."""
        return self.line_end.encode(self.encoding)


def text_blocks(path: Path, offset: int, row: int, layout: Layout) -> Iterator[Block]:
    """Blocks of the rows behind `offset` bytes and `row` lines of the file."""
    size = path.stat().st_size if layout.end is None else layout.end
    load_for(size - offset)
    with path.open("rb") as file:
        file.seek(offset)
        rest = b""
        while True:
            data = file.read(max(0, min(BLOCK_BYTES, size - file.tell())) if layout.end is not None else BLOCK_BYTES)
            end = len(data) < BLOCK_BYTES
            data = rest + data
            cut = len(data) if end else _behind_last_line(data, layout)
            data, rest = data[:cut], data[cut:]
            if len(rest) > LONGEST_LINE * len(layout.newline):
                last = row + data.count(b"\n")
                raise InputError(
                    f"{path.name} has a line of more than {LONGEST_LINE} characters after row {last}: it is damaged."
                )
            data = layout.plain(data)
            cut_off = False
            if end and layout.mark is not None:
                whole = data.rfind(b"\n") + 1
                cut_off, data = len(data) > whole, data[:whole]
            data = _without_end(data) if end else data
            if data or cut_off:
                block = parse_block(data, row + 1, layout)
                yield replace(block, share=min(1.0, file.tell() / size), cut_off=cut_off)
                row += data.count(b"\n")
            if end:
                return


def _without_end(data: bytes) -> bytes:
    """Without blank lines at the end; blanks behind the last row stay: they may be empty fields."""
    end = data.find(b"\n", len(data.rstrip()))
    return data if end < 0 else data[:end]


def _behind_last_line(data: bytes, layout: Layout) -> int:
    """Bytes of whole lines."""
    cut = data.rfind(layout.newline)
    while cut > 0 and cut % len(layout.newline):  # UTF-16: the end of a line begins at an even byte
        cut = data.rfind(layout.newline, 0, cut + len(layout.newline) - 1)
    return cut + len(layout.newline) if cut >= 0 else 0


def text_parts(path: Path, offset: int, row: int, layout: Layout) -> Parts:
    """The same rows at places of the file; their number is estimated from the length of lines here and there."""
    size = path.stat().st_size if layout.end is None else layout.end
    load_for(size - offset)
    length = 1 << 14
    with path.open("rb") as file:
        counted = lines = 0
        for share in np.linspace(0, 1, COUNTED):
            file.seek(offset + round(float(share) * max(0, size - offset - length)))
            data = file.read(length)
            counted, lines = counted + len(data), lines + data.count(layout.newline)
    per_row = counted / max(lines, 1)
    return Parts(
        rows=round((size - offset) / max(per_row, 1.0)),
        exact=False,
        block=round(PLACE_BYTES / max(per_row, 1.0)),
        read=partial(_place, path, offset, row, layout, per_row),
    )


def _place(path: Path, offset: int, row: int, layout: Layout, per_row: float, share: float) -> Block:
    """Whole lines at a share of the file; their row numbers are estimates."""
    size = path.stat().st_size if layout.end is None else layout.end
    start = offset + round(share * max(0, size - offset - PLACE_BYTES))
    with path.open("rb") as file:
        file.seek(start)
        data = file.read(min(PLACE_BYTES, max(0, size - start)))
    begin = data.find(layout.newline) + 1 if start > offset else 0
    end = len(data) if start + len(data) >= size else data.rfind(layout.newline) + 1
    data = _without_end(layout.plain(data[begin:end]))
    first = row + 1 + round((start + begin - offset) / per_row)
    return parse_block(data, first, layout) if data else Block(np.zeros((0, layout.columns)), np.arange(0), Bad.none())


def parse_block(data: bytes, first_row: int, layout: Layout) -> Block:
    """The rows in `data`, lines that end in LF; `first_row` is the number of the first."""
    block = _as_written(data, first_row, layout)
    if not layout.turned:
        return block
    signs = [-1.0 if layout.titles[position] in layout.turned else 1.0 for position in layout.use]
    return replace(block, values=block.values * [*[1.0] * (layout.columns - len(signs)), *signs])


def _as_written(data: bytes, first_row: int, layout: Layout) -> Block:
    if data and not data.endswith(b"\n"):
        data += b"\n"
    begins = (layout.mark, *layout.comments) if layout.mark is not None else layout.comments
    commented = any(begin[:1] in data and begin in data for begin in begins)  # one byte is found fastest
    given = None
    if not commented and layout.only is None and layout.decimal == ".":
        given, values = data, _by_arrow(data, layout)
        if values is not None:
            return Block(values, np.arange(first_row, first_row + len(values)), Bad.none())
    rows = np.arange(first_row, first_row + data.count(b"\n"))
    if commented or (layout.blank and b"\n\n" in b"\n" + data.replace(b"\r", b"")):
        lines = data.split(b"\n")[:-1]
        kept = np.array([not line.lstrip().startswith(begins) and not (layout.blank and not line.strip())
                         for line in lines])  # fmt: skip
        data, rows = b"".join(line + b"\n" for line in compress(lines, kept)), rows[kept]
    if layout.only is not None:
        position, text = layout.only
        delimiter = None if layout.delimiter is None else layout.delimiter.encode()
        lines = data.split(b"\n")[:-1]
        cells = (line.split(delimiter, position + 1)[position : position + 1] for line in lines)
        kept = np.array([bool(cell) and cell[0].strip(b' "') == text.encode() for cell in cells], dtype=bool)
        data, rows = b"".join(line + b"\n" for line in compress(lines, kept)), rows[kept]
    if layout.decimal == ",":
        data = data.replace(b",", b".") if layout.delimiter != "," else QUOTED_COMMA.sub(rb"\1.\2", data)
    values = None if data is given else _by_arrow(data, layout)
    if values is None:
        values = _parse_regular(data, layout)
    if values is None:
        return _parse_each(data, rows, layout)
    return Block(values, rows, Bad.none())


def _by_arrow(data: bytes, layout: Layout) -> NDArray[np.float64] | None:
    """All rows by pyarrow, or None where it is not there, not worth its loading, or any row is not plain."""
    if not is_worthwhile(len(data)):
        return None
    width, clock = len(layout.titles) + layout.trailing, layout.clock
    texts = clock.positions if clock is not None and clock.text is not None else ()
    numbers = (*(clock.positions if clock is not None and not texts else ()), *layout.use)
    found = arrow_columns(data, layout.delimiter, width, numbers, texts)
    if found is None:
        return None
    values, columns = found
    if layout.trailing and data.count(f"{layout.delimiter}\n".encode()) != len(values):
        return None
    if clock is None:
        return values
    return _with_clock(values, zip(*columns, strict=True), clock)


def _parse_regular(data: bytes, layout: Layout) -> NDArray[np.float64] | None:
    """All rows in one call, or None where any of them is irregular."""
    if not data:
        return np.zeros((0, layout.columns))
    if not data.strip():
        return None
    width = len(layout.titles) + layout.trailing
    if layout.delimiter is not None and not _has_width(data, layout.delimiter, width):
        return None
    time_fields = layout.clock.positions if layout.clock is not None and layout.clock.text is None else ()
    use = (*time_fields, *layout.use)
    try:
        lines = data.decode().split("\n")[:-1]
        if layout.delimiter is None and (layout.texts or layout.clock is not None):
            if any(len(line.split()) != width for line in lines):
                return None
        elif layout.delimiter is None:
            # Without a delimiter every field is read: numpy then insists on equal widths.
            use = None
        values = np.loadtxt(lines, delimiter=layout.delimiter, usecols=use, comments=None, quotechar='"', ndmin=2)
    except ValueError:  # UnicodeDecodeError is one
        return None
    if use is None:
        if values.shape[1] != width:
            return None
        values = values[:, layout.use]
    blank_behind = not layout.trailing or all(line.rstrip().endswith(str(layout.delimiter)) for line in lines)
    if len(values) != len(lines) or not blank_behind:
        return None
    if layout.clock is None:
        return values
    last = max(layout.clock.positions) + 1
    cut = (line.split(layout.delimiter, last) for line in lines)
    return _with_clock(values, ([fields[i] for i in layout.clock.positions] for fields in cut), layout.clock)


def _with_clock(
    values: NDArray[np.float64], texts: Iterable[Sequence[str]], clock: ClockColumns
) -> NDArray[np.float64] | None:
    """The time put together, then the values; `texts` are the fields of the time of each row."""
    if clock.text is None:
        parts = len(clock.positions)
        return np.column_stack([values[:, :parts] @ np.array(clock.factors), values[:, parts:]])
    time = clock.of_texts([" ".join(field.strip(' "') for field in fields) for fields in texts])
    return None if time is None else np.column_stack([time, values])


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
        if parsed is None:
            continue
        if isinstance(parsed, str):
            bad.append(row)
            if len(reasons) < DESCRIBED:
                reasons.append((row, parsed))
        else:
            values.append(parsed)
            rows.append(row)
    return Block(
        np.array(values, dtype=float).reshape(len(values), layout.columns),
        np.array(rows, dtype=np.int64),
        Bad(np.array(bad, dtype=np.int64), tuple(reasons)),
    )


def _parse_row(line: bytes, layout: Layout) -> list[float] | str | None:
    """The values of one row, or what is wrong with it; None for a row of other columns."""
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
    if layout.blank and not any(field.strip() for field in fields):
        return None
    if layout.sparse and not any(fields[position].strip() for position in layout.use[-3:]):
        return None
    return _values_of(fields, layout)


def _values_of(fields: list[str], layout: Layout) -> list[float] | str:
    """The values in the fields of a row, or what is wrong with one."""
    clock, before = layout.clock, list[float]()
    numbers = list(layout.use)
    if clock is not None and clock.text is not None:
        joined = " ".join(fields[position].strip() for position in clock.positions)
        time = clock.of_texts([joined])
        if time is None:
            return f"{layout.titles[clock.positions[0]]} is {joined[:40]!r}; {clock.text.form} is expected"
        before = [float(time[0])]
    elif clock is not None:
        numbers = [*clock.positions, *layout.use]
    values: list[float] = []
    for position in numbers:
        try:
            if "_" in fields[position]:
                raise ValueError
            values.append(float(fields[position]))
        except ValueError:
            shown = fields[position] if len(fields[position]) <= 40 else fields[position][:37] + "..."
            return f"{layout.titles[position] or f'field {position + 1}'} is {shown!r}; a number is expected"
    if clock is not None and clock.text is None:
        parts = len(clock.positions)
        before, values = [sum(x * y for x, y in zip(values, clock.factors, strict=False))], values[parts:]
    return before + values


def _likely_cause(text: str, fields: list[str], layout: Layout) -> str:
    if layout.delimiter == "," and ";" in text:
        return " (semicolons between fields? commas are expected)"
    if layout.delimiter == "," and "\t" in text:
        return " (tabs between fields? commas are expected)"
    if layout.delimiter == "," and len(fields) in (2 * len(layout.titles), 2 * len(layout.titles) - 1):
        return " (decimal commas? decimal points are expected)"
    return " (cut off?)" if len(fields) < len(layout.titles) else ""
