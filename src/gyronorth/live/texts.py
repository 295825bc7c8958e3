"""Lines of text in any layout that the offline reader knows: titles of others, units, delimiters, clocks.

The first lines are read as the beginning of a file is, by the same rules; what follows is read by the layout that was
found. Rows leave in SI, with time in seconds, so that the recording of them is one of this package.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.live.rows import Form, LiveRows, RowBatch, StreamTally
from gyronorth.readers.declared import resolve
from gyronorth.readers.formats.csv import open_layout
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.source import TIME, Block, Facts
from gyronorth.readers.spool import Spooled
from gyronorth.readers.text import parse_block
from gyronorth.readers.text_head import LONGEST_LINE

#: Of a bad line this much is shown.
SHOWN = 120


class TextReader:
    """Takes bytes as they come and returns rows of SI; `head` is what came before, whole lines.

    Parameters
    ----------
    name : str
        Of the source, for messages.
    head : bytes
        The first lines, by which the layout is told; they are to be pushed as well.
    options : ReadOptions
        What the user declares.

    Raises
    ------
    InputError
        If the lines have no layout that is known, or leave open what must be declared.
    """

    def __init__(self, name: str, head: bytes, options: ReadOptions) -> None:
        spooled = Spooled(name)
        spooled.path.write_bytes(head)
        source, layout, rows = open_layout(spooled.path, options)
        if layout.encoding.startswith("utf-16") or rows.only is not None:
            what = "UTF-16" if rows.only is None else "rows of two kinds"
            raise InputError(f"{name} sends {what}, which a file may hold but no stream: send a line for each sample.")
        declared = resolve(source, options, name)
        if declared.increments and declared.rate_hz is None and declared.increment_interval is None:
            raise InputError(f"{name} sends increments: declare the rate that makes rates of them, --rate HZ.")
        self._clock = source.clock if source.clock is not None and source.clock.unit is not None else None
        skip = TIME in source.columns and self._clock is None  # a counter: the rate tells the time
        columns = source.columns[1:] if skip else source.columns
        self._scale = declared.scale(declared.rate_hz or 1.0)
        usual = Facts(gyro_unit="rad/s", accel_unit="m/s2", axes=source.usual.axes, rate_hz=source.usual.rate_hz)
        self.form: Form | None = Form(columns, columns, tuple(range(len(columns))), usual)
        self.read_as = source.read_as
        self.statements = 0
        self._facts = Facts(
            rate_hz=source.stated.rate_hz, axes=source.stated.axes, latitude=source.stated.latitude,
            session=source.stated.session, heading_true=source.stated.heading_true,
            start_time_utc=source.stated.start_time_utc,
        )  # fmt: skip
        self._layout, self._skip, self._first = rows, skip, layout.row
        self._lines = self._garbage = self._row = 0
        self._last_garbage, self._rest, self._midway = "", b"", False
        self._before, self._turns = -np.inf, 0.0  # the last time, and what a clock that began anew has run before

    @property
    def tally(self) -> StreamTally:
        """Counts of the input."""
        return StreamTally(self._lines, self._garbage, self._last_garbage)

    def facts(self) -> Facts:
        """What the head states."""
        return self._facts

    def push(self, data: bytes) -> list[RowBatch]:
        """The rows that `data` completes."""
        end = self._layout.newline
        if self._midway:
            _, found, data = data.partition(end)
            self._midway = not found
        data = self._rest + data
        cut = data.rfind(end) + 1
        data, self._rest = data[:cut], data[cut:]
        if len(self._rest) > LONGEST_LINE:
            self._bad(1, "a line without an end")
            self._rest = b""
        return self._batches(data)

    def end(self) -> list[RowBatch]:
        """The last line, which may have no end."""
        rest, self._rest = self._rest, b""
        return self._batches(rest + self._layout.newline) if rest.strip() else []

    def cut(self) -> None:
        """The connection broke: what is left of a line is no line."""
        if self._rest.strip():
            self._bad(1, self._rest[:SHOWN].decode(errors="replace"))
        self._rest = b""

    def midway(self) -> None:
        """What comes next may begin in the middle of a line, which is left out."""
        self._midway = True

    def _batches(self, data: bytes) -> list[RowBatch]:
        if self._row < self._first:  # the lines above the first row
            lines = data.split(self._layout.newline)
            passed = min(len(lines) - 1, self._first - self._row)
            self._row, data = self._row + passed, self._layout.newline.join(lines[passed:])
        if not data.strip():
            self._row += data.count(self._layout.newline)
            return []
        data = self._layout.plain(data)
        block = parse_block(data, self._row + 1, self._layout)
        self._row += data.count(b"\n")
        return self._of_block(block)

    def _of_block(self, block: Block) -> list[RowBatch]:
        values = block.values
        good: NDArray[np.bool_] = np.asarray(np.isfinite(values).all(axis=1))
        self._lines += int(good.sum())
        bad = int(len(good) - good.sum()) + len(block.bad.rows)
        if bad:
            reason = block.bad.reasons[0] if block.bad.reasons else (0, "it holds no number")
            self._bad(bad, f"row {reason[0]}: {reason[1]}" if reason[0] else reason[1])
        assert self.form is not None
        if not good.any():
            return []
        values = values[good][:, 1:] if self._skip else values[good]
        if self._clock is not None:
            numbers = np.column_stack([self._time(values[:, 0]), values[:, 1:] * self._scale])
        else:
            numbers = values * self._scale
        return [RowBatch(self.form, LiveRows(numbers))]

    def _time(self, stamps: NDArray[np.float64]) -> NDArray[np.float64]:
        """Times in s; a clock that begins anew at a known value goes on."""
        assert self._clock is not None
        unit, wrap = self._clock.unit or 1.0, self._clock.wrap
        if wrap is None:
            return stamps * unit
        back = np.diff(stamps, prepend=self._before if np.isfinite(self._before) else stamps[0]) < -wrap / 2
        turns = self._turns + np.cumsum(back) * wrap
        self._before, self._turns = float(stamps[-1]), float(turns[-1])
        return (stamps + turns) * unit

    def _bad(self, count: int, text: str) -> None:
        self._lines += count
        self._garbage += count
        self._last_garbage = "".join(symbol if symbol.isprintable() else "�" for symbol in text[:SHOWN])
