"""How a text file is laid out, from its first 64 KiB and its last 4: encoding, delimiter, titles, units, rows.

The rows decide: of all ways to cut lines into fields, that one holds in which most lines have the same number of
fields and most of these are numbers. What stands above the first such line is preamble, titles and units; what stands
below the last one is a footer.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import field
from pathlib import Path

from gyronorth.errors import InputError
from gyronorth.frozen import frozen
from gyronorth.readers import labview
from gyronorth.readers.fields import is_number, split
from gyronorth.readers.header import COMMENT_MARKS, DELIMITERS, FEWEST, titles_above, units_stated
from gyronorth.readers.spellings import counts_in
from gyronorth.readers.text_head import LONGEST_LINE
from gyronorth.readers.times import time_text
from gyronorth.readers.titles import take_apart

#: Bytes at the start that are looked at, bytes at the end, and lines of rows that are compared.
HEAD, TAIL, COMPARED = 1 << 16, 1 << 12, 200
#: Lines at the end of the start that decide how lines are cut into fields.
DECIDING = 60
#: Most lines of a footer.
LONGEST_FOOTER = 20
WORDS = {"\t": "tabs", ";": "semicolons", ",": "commas", "|": "bars", None: "blanks"}
COMMENT = re.compile(r"(?:#|%|//)\s*([A-Za-z_]+)\s*:(.*)$")
#: Encodings of titles that are no UTF-8, besides Latin-1, and titles that are looked at.
NATIONAL, MOST_TITLES = ("cp1251", "gbk", "shift_jis", "cp949", "euc_jp", "cp1250", "koi8-r"), 200
_UNIT = re.compile(r"[\[(].*")
#: Longest line that may state a rate: the pattern takes the square of it.
_LONGEST_STATEMENT = 200
_RATE = re.compile(
    r"(?:sampl\w*|update|data|output|imu|log\w*)?[ _-]*(?:rate|freq\w*|odr|fs)(?:[ _]*[\[(]hz[\])])?\W{0,8}"
    r"(\d++(?:\.\d++)?)[\s\",;]*+(hz|khz)?\W*$",
    re.IGNORECASE,
)


@frozen
class TextLayout:
    """How a text file is laid out; rows and fields count from 0 here."""

    encoding: str  # utf-8, utf-16-le, utf-16-be or latin-1
    line_end: str  # "\\n", or "\\r" of old programs
    delimiter: str | None  # None: runs of blanks
    decimal: str  # "." or ","
    titles: tuple[str, ...]  # of the header, or () where the file has none
    units: tuple[str, ...]  # of a row below the header, or ()
    width: int  # fields of a row
    trailing: bool  # rows end in a delimiter with nothing behind it
    offset: int  # bytes before the first row
    row: int  # lines before the first row
    header_row: int | None  # line of the titles
    end: int | None  # bytes before the footer; None without one
    footer: int  # lines of the footer
    preamble: tuple[tuple[int, str], ...]  # what stands above the titles and is no comment: line, text
    comments: dict[str, tuple[str, int]] = field(default_factory=dict)  # key -> (value, line from 1)
    texts: tuple[int, ...] = ()  # fields that are no numbers
    blank: bool = False  # blank lines stand between the rows
    sparse: bool = False  # some rows have empty fields
    rows: tuple[tuple[str, ...], ...] = ()  # the first rows, cut into fields
    rate_hz: float | None = None  # that the preamble states
    header: str = ""  # the line of the titles
    cut: int | None = None  # fields of the rows where they are other than the titles
    counts: dict[str, tuple[str, float, str]] = field(default_factory=dict)  # see `counts_in`
    named_in: str = ""  # the encoding of what stands above the rows, where it is another than that of the rows

    def words(self) -> str:
        """What is unusual about it, for people; "" for a plain CSV."""
        encoding = self.named_in or {"latin-1": "Latin-1", "utf-16-le": "UTF-16", "utf-16-be": "UTF-16"}.get(
            self.encoding
        )
        parts = [
            encoding,
            None if self.delimiter == "," else f"{WORDS[self.delimiter]} between fields",
            "decimal commas" if self.decimal == "," else None,
            _lines(len(self.preamble), "preamble") if self.preamble else None,
            None if self.titles else "no header",
            "a row of units" if self.units else None,
            _lines(self.footer, "footer") if self.footer else None,
        ]
        return ", ".join(part for part in parts if part)


def sniff(path: Path) -> TextLayout:
    """The layout of a text file.

    Raises
    ------
    InputError
        If the file is no text, has no line that could be a header or a row, or can be cut into fields in two ways.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        raw = file.read(HEAD)
        file.seek(max(0, size - TAIL))
        tail = file.read(TAIL)
    encoding, skip = _encoding(raw)
    body = raw[skip:]
    text = body.decode(encoding, errors="replace")
    line_end = "\r" if "\r" in text and "\n" not in text else "\n"
    lines = text.split(line_end)
    whole = size <= HEAD
    if len(lines) > 1 and (not whole or not lines[-1]):
        del lines[-1]  # the rest of a line, or nothing behind the last end
    _check_lines(lines, path.name, whole)
    plain = [line.strip("\r\n ") for line in lines]
    above = labview.lines_above(plain)
    delimiter, decimal, width, first = _cut(plain, path.name, above)
    if first is None:
        encoding = _latin(body, encoding, len(lines))
        lines = body.decode(encoding, errors="replace").split(line_end)[: len(lines)]
        return _without_rows(lines, encoding, line_end, path.name)
    encoding = _latin(body, encoding, first)
    named_in = ""
    if encoding == "latin-1":
        lines = body.decode(encoding).split(line_end)[: len(lines)]
        above_rows = line_end.join(lines[:first])
        named_in = _encoding_of_titles(above_rows.encode(encoding))
        titled = above_rows.encode(encoding).decode(named_in or encoding).split(line_end)
        plain = [line.strip("\r\n ") for line in [*titled, *lines[first:]]]
    offset = skip + len("".join(line + line_end for line in lines[:first]).encode(encoding, errors="replace"))
    if encoding == "utf-8":  # damaged bytes above the rows have made it Latin-1
        offset = skip + _byte_offset(body, line_end, first)
    comments, preamble, rate_hz = _above(plain[:first], path.name)
    header_row, titles, unit_row = titles_above(plain, first, delimiter, decimal, width)
    units = tuple(split(plain[unit_row], delimiter)) if unit_row is not None else ()
    stated = labview.stated_in(plain[:above], delimiter)
    units = units or labview.units_of(stated, titles) or units_stated(comments, delimiter, width)
    rate_hz = labview.rate_of(stated, titles, decimal) or rate_hz
    rows = [split(line, delimiter) for line in plain[first : first + COMPARED] if _is_row_text(line)]
    rows = [row for row in rows if row]
    trailing, titles, width = _trailing(titles, rows, width)
    usual = [row[:width] for row in rows if len(row) == width + trailing]
    texts = tuple(i for i in range(width) if _is_text([row[i] for row in usual], decimal))
    end, footer = _footer(tail, size, encoding, line_end, delimiter, decimal, 0 in texts)
    if header_row is not None:
        preamble = tuple((row, line) for row, line in preamble if row not in (header_row, unit_row))
    body_lines = plain[first:]
    blank = sum(not line for line in body_lines) > max(2, len(body_lines) // 5)
    return TextLayout(
        encoding=encoding, line_end=line_end, delimiter=delimiter, decimal=decimal, titles=titles, units=units,
        width=width, trailing=trailing, offset=offset, row=first, header_row=header_row, end=end, footer=footer,
        preamble=preamble, comments=comments, texts=texts, blank=blank,
        sparse=any(not cell.strip() for row in usual for cell in row),
        rows=tuple(tuple(cell.strip() for cell in row) for row in usual), rate_hz=rate_hz,
        header=plain[header_row] if header_row is not None else "",
        cut=None if usual or not rows else len(rows[0]), counts=counts_in(plain[:first]), named_in=named_in,
    )  # fmt: skip


def _lines(count: int, what: str) -> str:
    return f"{count} line{'s' if count > 1 else ''} of {what}"


def _encoding(raw: bytes) -> tuple[str, int]:
    """Name of the encoding, and the bytes of its mark."""
    for mark, name in ((b"\xef\xbb\xbf", "utf-8"), (b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be")):
        if raw.startswith(mark):
            return name, len(mark)
    even, odd = raw[0:400:2], raw[1:400:2]
    if len(odd) >= 8 and odd.count(0) > 0.8 * len(odd) and even.count(0) == 0:
        return "utf-16-le", 0
    if len(odd) >= 8 and even.count(0) > 0.8 * len(even) and odd.count(0) == 0:
        return "utf-16-be", 0
    return "utf-8", 0


def _latin(body: bytes, encoding: str, first: int) -> str:
    """Latin-1 where bytes above the rows are not UTF-8; among rows they are damage."""
    above = b"\n".join(body.split(b"\n")[:first])
    if encoding == "utf-8":
        try:
            above.decode()
        except UnicodeDecodeError:
            return "latin-1"
    return encoding


def _encoding_of_titles(above: bytes) -> str:
    """The encoding in which more titles above the rows are known than in Latin-1; "" where none is better."""

    def known(encoding: str) -> int:
        try:
            cells = re.split(r"[,;\t|]", above.decode(encoding or "latin-1"))
        except UnicodeDecodeError:
            return -1
        # A unit alone tells a sensor in any encoding, its words do not.
        return sum(bool(take_apart(text).kind) for cell in cells[:MOST_TITLES] for text in (cell, _UNIT.sub("", cell)))

    return max(("", *NATIONAL), key=known)


def _byte_offset(body: bytes, line_end: str, first: int) -> int:
    end, position = line_end.encode(), 0
    for _ in range(first):
        position = body.find(end, position) + len(end)
    return position


def _check_lines(lines: Sequence[str], name: str, whole: bool) -> None:
    for row, line in enumerate(lines, start=1):
        if len(line) >= LONGEST_LINE or (len(lines) == 1 and not whole):
            raise InputError(
                f"Row {row} of {name} is longer than {LONGEST_LINE} characters. Lines that end in LF or CRLF are "
                "expected: is it another format?"
            )
    if lines and any("\x00" in line for line in lines[:3]):
        row = next(row for row, line in enumerate(lines, start=1) if "\x00" in line)
        raise InputError(
            f"Row {row} of {name} holds zero bytes: the file is damaged, or binary in no format that is known here. "
            f"If it holds rows of numbers, in Python: numpy.save('imu.npy', numpy.fromfile({name!r}, '<f8').reshape("
            "-1, COLUMNS)), with their type and how many of them a row has; and read imu.npy."
        )


def _is_row_text(line: str) -> bool:
    return bool(line) and not line.startswith(COMMENT_MARKS)


def _numbers(fields: Sequence[str], decimal: str) -> int:
    """How many fields are numbers or times; those that hold neither must be fewer."""
    count = words = 0
    for cell in fields:
        if is_number(cell, decimal) or (":" in cell and time_text([cell]) is not None):
            count += 1
        elif cell:
            words += 1
    return count if count >= FEWEST and count > words else 0


def _cut(lines: Sequence[str], name: str, above: int) -> tuple[str | None, str, int, int | None]:
    """Delimiter, decimal sign, fields of a row, and the first row (None without one) behind the lines `above`."""
    sample = [(i, line) for i, line in enumerate(lines) if i >= above and _is_row_text(line)]
    last = [line for _, line in sample[-DECIDING:]]
    best: tuple[int, str | None, str, int] = (0, ",", ".", 0)
    for delimiter in DELIMITERS:
        if delimiter is not None and not any(delimiter in line for line in last):
            continue
        rows = [split(line, delimiter) for line in last]
        for decimal in (".", ","):
            counted = [(fields, _numbers(fields, decimal)) for fields in rows]
            widths = Counter(len(fields) for fields, numbers in counted if numbers)
            if not widths or (decimal == "," and not any("," in cell for row, n in counted if n for cell in row)):
                continue
            width = widths.most_common(1)[0][0]
            score = sum(numbers for fields, numbers in counted if len(fields) == width)
            if score > best[0]:
                best = (score, delimiter, decimal, width)
    _, delimiter, decimal, width = best
    cut = ((i, split(line, delimiter)) for i, line in sample if width)
    first = next((i for i, fields in cut if len(fields) == width and _numbers(fields, decimal)), None)
    if first is not None and delimiter == "," and decimal == ".":
        _reject_two_meanings([split(line, ",") for i, line in sample if i >= first][:50], lines[:first], name)
    return delimiter, decimal, width, first


def _reject_two_meanings(rows: list[list[str]], above: Sequence[str], name: str) -> None:
    """Commas between fields and in numbers: rows have twice the fields of the header, and none has a point."""
    header = next((split(line, ",") for line in reversed(above) if line), [])
    cells = [cell for row in rows for cell in row]
    width = len(rows[0]) if rows else 0
    doubled = width >= 6 and len(header) >= FEWEST and width in (2 * len(header), 2 * len(header) - 1)
    if doubled and not any("." in cell for cell in cells):
        raise InputError(
            f"{name} has {len(header)} titles but {width} fields in a row, and no points: commas stand between fields "
            "and in the numbers too, which cannot be told apart. Save it with decimal points, or with semicolons "
            "between the fields."
        )


def _above(
    lines: Sequence[str], name: str
) -> tuple[dict[str, tuple[str, int]], tuple[tuple[int, str], ...], float | None]:
    """Comments `# key: value`, the other lines, and a sample rate that one of them states."""
    comments: dict[str, tuple[str, int]] = {}
    others: list[tuple[int, str]] = []
    rate_hz = None
    for row, line in enumerate(lines):
        match = COMMENT.match(line)
        rate = _RATE.search(line) if len(line) <= _LONGEST_STATEMENT else None
        if rate and float(rate[1]) > 0 and not match:
            rate_hz = float(rate[1]) * (1000.0 if (rate[2] or "").lower() == "khz" else 1.0)
        if match and line.startswith("#"):
            key, value = match[1], match[2].strip()
            if key in comments and comments[key][0] != value:
                raise InputError(f"Row {row + 1} of {name} states {key} again, with another value.")
            comments[key] = (value, row + 1)
        elif line and not line.startswith(COMMENT_MARKS):
            others.append((row, line))
    return comments, tuple(others), rate_hz


def _trailing(titles: tuple[str, ...], rows: list[list[str]], width: int) -> tuple[bool, tuple[str, ...], int]:
    """Whether rows end in a delimiter with nothing behind it, and titles and width without that."""
    empty = bool(rows) and sum(len(row) == width and not row[-1] for row in rows) > len(rows) / 2
    if titles and not titles[-1] and len(titles) > 1 and (empty or len(titles) == width + 1):
        titles = titles[:-1]
    if empty and (not titles or len(titles) == width - 1):
        return True, titles, width - 1
    return False, titles, len(titles) or width


def _is_text(column: Sequence[str], decimal: str) -> bool:
    filled = [cell for cell in column if cell]
    return bool(filled) and sum(not is_number(cell, decimal) for cell in filled) > len(filled) / 2


def _footer(
    tail: bytes, size: int, encoding: str, line_end: str, delimiter: str | None, decimal: str, text_first: bool
) -> tuple[int | None, int]:
    """Bytes before the words behind the last row, and how many lines these are."""
    if encoding.startswith("utf-16") and (size - len(tail)) % 2:
        tail = tail[1:]
    text = tail.decode(encoding, errors="replace")
    lines = text.split(line_end)
    begins = size - len(tail)
    kept = len(lines)
    count = 0
    for position in range(len(lines) - 1, 0 if begins else -1, -1):
        line = lines[position].strip()
        if not line or line.startswith(COMMENT_MARKS):
            continue
        fields = split(line, delimiter)
        rows_like = _numbers(fields, decimal) and (
            text_first or not re.match(r'"?[A-Za-z]{2}', line) or is_number(fields[0])
        )
        if rows_like or not re.match(r'"?[A-Za-z\[<=*-]{2}', line) or count == LONGEST_FOOTER:
            break
        kept, count = position, count + 1
    else:
        return None, 0
    if not count:
        return None, 0
    behind = line_end.join(lines[kept:]).encode(encoding, errors="replace")
    return size - len(behind), count


def _without_rows(lines: list[str], encoding: str, line_end: str, name: str) -> TextLayout:
    """A file that has no rows of numbers, perhaps a header."""
    plain = [line.strip() for line in lines]
    comments, others, _ = _above(plain, name)
    if not others:
        raise InputError(
            f"{name} ends before its header; a line such as t,w_x,w_y,w_z,f_x,f_y,f_z is expected, and rows of numbers."
        )
    row, line = others[0]
    delimiter = max((",", ";", "\t"), key=line.count)
    titles = tuple(split(line, delimiter))
    if not titles:
        raise InputError(f"Row {row + 1} of {name}: its quotation marks do not match.")
    offset = len("".join(each + line_end for each in lines[: row + 1]).encode(encoding, errors="replace"))
    return TextLayout(
        encoding=encoding, line_end=line_end, delimiter=delimiter, decimal=".", titles=titles, units=(),
        width=len(titles), trailing=False, offset=offset, row=row + 1, header_row=row, end=None, footer=0,
        preamble=(), comments=comments,
    )  # fmt: skip
