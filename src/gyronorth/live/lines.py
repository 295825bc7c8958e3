"""Bytes to rows of numbers, a batch at a time: good lines are kept as they came, the rest is counted.

The lines are those of our CSV: comment lines `# key: value`, a header, rows of numbers. A source
that sends no header is taken to send t,w_x,w_y,w_z,f_x,f_y,f_z or the leading part of it that
its number of fields tells; `columns` says otherwise. As the first line may be the rest of one, two
in a row must agree in their number of fields; as many names before them that mean nothing to us
are an error. Comments count where they stand right before the header or the first row: one between
rows may be garbage.
"""

from __future__ import annotations

from itertools import compress

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.live.rows import Form, LiveRows, RowBatch, StreamTally
from gyronorth.readers.formats.csv import COMMENT, stated_facts
from gyronorth.readers.options import OUR_TITLES, ReadOptions, choose_columns
from gyronorth.readers.source import FORCES, NAMES, RATES, TIME, Facts
from gyronorth.readers.text import parse_block
from gyronorth.readers.text_head import LONGEST_LINE
from gyronorth.readers.titles import take_apart

#: The columns of a source without a header, by its number of fields.
BY_WIDTH = {7: NAMES, 6: (*RATES, *FORCES), 4: (TIME, *RATES), 3: RATES}
#: The only bytes in a row of numbers.
NUMERIC = np.isin(np.arange(256, dtype=np.uint8), np.frombuffer(b"0123456789+-.eE, \t", dtype=np.uint8))
#: What some programs put before the first line of a text.
BOM = b"\xef\xbb\xbf"
#: Of a bad line this much is shown.
SHOWN = 60
#: Different keys of comment lines that are remembered.
MOST_KEYS = 50


class LineReader:
    """Takes bytes as they come and returns rows; remembers the form and what the comments state."""

    def __init__(self, name: str, options: ReadOptions) -> None:
        self.form: Form | None = None
        self.stated: dict[str, tuple[str, int]] = {}  # comment lines: key -> (value, its row in the stream)
        self.statements = 0  # how often one of them said something new
        self.lines = 0  # lines that should have been rows, good and bad
        self.garbage = 0  # of these, bad
        self.last_garbage = ""  # the last bad one, shortened
        self._name, self._options = name, options
        self._rest = b""
        self._row = 0  # of the line that is read, from 1; blank lines and comments count
        self._unsure: bytes | None = None  # a row before the form is known
        self._heard: dict[str, tuple[str, int]] = {}  # comments since the last row
        self._unmapped: list[str] = []  # names that came before any row and are no header that is understood
        self._begun = False  # bytes have come
        self._midway = False  # the rest of a line comes first

    def push(self, data: bytes) -> list[RowBatch]:
        """The rows that `data` completes."""
        if self._midway:
            _, end, data = data.partition(b"\n")
            self._midway = not end
        data = self._rest + data
        if not self._begun and len(data) >= len(BOM):
            data, self._begun = data.removeprefix(BOM), True
        cut = data.rfind(b"\n") + 1
        data, self._rest = data[:cut], data[cut:]
        if len(self._rest) > LONGEST_LINE:
            self._bad(self._rest)
            self._rest = b""
        if b"\r" in data:
            data = data.replace(b"\r\n", b"\n")
        return self._batches(data) if data else []

    def end(self) -> list[RowBatch]:
        """The last line, which may have no end."""
        rest, self._rest = self._rest, b""
        batches = self._batches(rest + b"\n") if rest.strip() else []
        self._drop_unsure()
        return batches

    @property
    def tally(self) -> StreamTally:
        """Counts of the input."""
        return StreamTally(self.lines, self.garbage, self.last_garbage)

    def facts(self) -> Facts:
        """What the comments state.

        Raises
        ------
        InputError
            If one of them makes no sense.
        """
        stated, _ = stated_facts(self.stated, self._name)
        return stated

    def midway(self) -> None:
        """What comes next may begin in the middle of a line, which is left out."""
        self._midway = True

    def cut(self) -> None:
        """The connection broke: what is left of a line is no line."""
        if self._rest.strip():
            self._bad(self._rest)
            self._row += 1
        self._rest = b""

    def _batches(self, data: bytes) -> list[RowBatch]:
        batches: list[RowBatch] = []
        if self.form is not None and self._regular(data, self.form):
            self._heard.clear()
            self._row += data.count(b"\n")
            return self._parsed(data.split(b"\n")[:-1], self.form)
        pending: list[bytes] = []
        for line, numeric in zip(data.split(b"\n")[:-1], numeric_lines(data), strict=True):
            self._row += 1
            if numeric:
                if self.form is None:
                    pending += self._first_rows(line)
                elif line.count(b",") + 1 == len(self.form.titles):
                    self._heard.clear()
                    pending.append(line)
                elif line.strip():
                    self._bad(line)
                continue
            form = self.form
            self._word(line)
            if self.form is not form and pending and form is not None:
                batches += self._parsed(pending, form)
                pending = []
        if pending and self.form is not None:
            batches += self._parsed(pending, self.form)
        return batches

    @staticmethod
    def _regular(data: bytes, form: Form) -> bool:
        """Whether every line is numeric and of the right width."""
        symbols = np.frombuffer(data, dtype=np.uint8)
        ends = symbols == ord("\n")
        if not (NUMERIC[symbols] | ends).all():
            return False
        commas = np.cumsum(symbols == ord(","))[ends]
        return bool((np.diff(commas, prepend=0) == len(form.titles) - 1).all())

    def _parsed(self, lines: list[bytes], form: Form) -> list[RowBatch]:
        """The rows of lines of numeric characters."""
        block = parse_block(b"\n".join(lines) + b"\n", 0, form.layout)
        finite = np.isfinite(block.values).all(axis=1)
        good = np.zeros(len(lines), dtype=bool)
        good[block.rows[finite]] = True
        self.lines += int(good.sum())
        for line in compress(lines, ~good):
            self._bad(line)
        if not good.any():
            return []
        return [RowBatch(form, LiveRows(block.values[finite], lines if good.all() else list(compress(lines, good))))]

    def _word(self, line: bytes) -> None:
        """A line that is no row of numbers: a comment, a header, or garbage."""
        try:
            text = line.decode().strip()
        except UnicodeDecodeError:
            titles = [
                field.strip() for field in line.decode("latin-1").split(",")
            ]  # degrees and squares of old programs
            if self.form is None and all(title.isprintable() and title and not _is_number(title) for title in titles):
                self._unmapped = titles
            self._bad(line)
            return
        if text.startswith("#") and text.replace("\t", " ").isprintable():
            match = COMMENT.match(text)
            if match is not None and self.form is None and self._heard.get(match[1], (match[2],))[0] != match[2]:
                raise InputError(f"Row {self._row} of {self._name} states {match[1]} again, with another value.")
            if match is not None and len(self._heard) < MOST_KEYS:
                self._heard[match[1]] = (match[2], self._row)
            return
        if not text:
            return
        titles = [field.strip().strip('"') for field in text.split(",")]
        if (titles and not any(_is_number(title) for title in titles)) and self._adopt(titles):
            return
        self._bad(line)

    def _adopt(self, titles: list[str]) -> bool:
        """Take a header for the form, if it is one."""
        try:
            found = choose_columns(titles, self._options.columns, OUR_TITLES, self._name)
        except InputError:
            if self.form is None and any(title in NAMES for title in titles):
                raise
            if self.form is None and all(titles):
                self._unmapped = titles
            return False
        form = _form(found, titles)
        if form != self.form:
            self.form = form
        self._state()
        self._drop_unsure()
        return True

    def _first_rows(self, line: bytes) -> list[bytes]:
        """The first two rows of a source without a header; none before the form is known by them."""
        before, self._unsure = self._unsure, line
        if before is None:
            return []
        if before.count(b",") == line.count(b","):
            self.form = self._unnamed(line)
        if self.form is None:
            self._bad(before)
            return []
        self._unsure = None
        self._state()
        return [before, line]

    def _state(self) -> None:
        """What the comments said before the header, or the first rows, holds."""
        for key, (value, number) in self._heard.items():
            if self.stated.get(key, ("", 0))[0] != value and (key in self.stated or len(self.stated) < MOST_KEYS):
                self.stated[key] = (value, number)
                self.statements += 1
        self._heard.clear()

    def _drop_unsure(self) -> None:
        if self._unsure is not None:
            self._bad(self._unsure)
        self._unsure = None

    def _unnamed(self, line: bytes) -> Form | None:
        """The form of a source without a header, by one of its rows."""
        width = line.count(b",") + 1
        if len(self._unmapped) == width:  # a header, in the words of another: the same error as of a file
            choose_columns(self._unmapped, self._options.columns, OUR_TITLES, self._name)
        if self._options.columns:
            return _form(choose_columns(width, self._options.columns, {}, self._name), [""] * width)
        columns = BY_WIDTH.get(width)
        return None if columns is None else Form(columns, columns, tuple(range(width)))

    def _bad(self, line: bytes) -> None:
        self.lines += 1
        self.garbage += 1
        text = line[: SHOWN + 1].decode(errors="replace")
        self.last_garbage = "".join(symbol if symbol.isprintable() else "�" for symbol in text[:SHOWN])
        self.last_garbage += "..." if len(line) > SHOWN else ""


def columns_by_width(data: bytes) -> dict[str, int] | None:
    """The columns of rows without a header, by the first line; None where this is no row of ours."""
    first = next((line for line in data.split(b"\n") if line.strip()), b"")
    columns = BY_WIDTH.get(first.count(b",") + 1) if numeric_lines(first + b"\n")[0] else None
    return None if columns is None else {name: place for place, name in enumerate(columns)}


def numeric_lines(data: bytes) -> list[bool]:
    """Of each line, whether it has nothing but the characters of numbers, and a digit."""
    symbols = np.frombuffer(data, dtype=np.uint8)
    ends = np.flatnonzero(symbols == ord("\n"))
    strange = ~NUMERIC[symbols]
    strange[ends] = False
    digits = (symbols >= ord("0")) & (symbols <= ord("9"))

    def per_line(flags: NDArray[np.bool_]) -> NDArray[np.int64]:
        return np.diff(np.cumsum(flags)[ends], prepend=0)

    return ((per_line(strange) == 0) & (per_line(digits) > 0)).tolist()


def _form(found: dict[str, int], titles: list[str]) -> Form:
    """The form of the recording: our names for what is used, harmless ones for the rest."""
    columns = tuple(name for name in NAMES if name in found)
    use = tuple(found[name] for name in columns)
    if minus := [titles[position] for position in use if take_apart(titles[position]).minus]:
        raise InputError(
            f"{', '.join(minus)}: a title with a minus sign says that the values have the other sign, and a stream is "
            "recorded as it comes. Send them turned, without the sign in the title."
        )
    ours = {position: name for name, position in found.items()}
    taken = {alias for aliases in OUR_TITLES.values() for alias in aliases}
    named = []
    for position, title in enumerate(titles):
        harmless = title and title not in taken and title not in named and '"' not in title
        named.append(ours.get(position) or (title if harmless else f"column_{position}"))
    return Form(tuple(named), columns, use)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
