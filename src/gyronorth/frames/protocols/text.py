"""Frames that are lines of text: a mark, fields with commas, an asterisk and a checksum in hexadecimal."""

from __future__ import annotations

import numpy as np

from gyronorth.arrays import Array, Index
from gyronorth.frames.protocol import Bytes

_HEX = np.full(256, -1, np.int64)
for _digits in (b"0123456789abcdef", b"0123456789ABCDEF"):
    _HEX[np.frombuffer(_digits, np.uint8)] = np.arange(16)


def line_starts(data: Bytes, starts: Index, digits: int, longest: int) -> tuple[Index, Index]:
    """Those of `starts` whose line may end in an asterisk and `digits` characters, and the lengths up to there.

    A line of which neither is in the buffer yet is as long as the buffer and one more.
    """
    star, ends = np.flatnonzero(data == ord("*")), np.flatnonzero((data == 10) | (data == 13))
    beyond = len(data) + longest
    star_after = np.append(star, beyond)[np.searchsorted(star, starts)]
    end_after = np.append(ends, beyond)[np.searchsorted(ends, starts)]
    known, open_ = star_after < end_after, (star_after == beyond) & (end_after == beyond)
    length = np.where(known, star_after + 1 + digits - starts, len(data) + 1 - starts)
    possible = (known | open_) & (length <= longest)
    return starts[possible], length[possible]


def hex_at_end(rows: Bytes, digits: int) -> Index:
    """The last `digits` characters as a hexadecimal number, (k,); -1 where they are none."""
    values = _HEX[rows[:, -digits:]]
    number = (values << (4 * np.arange(digits - 1, -1, -1))).sum(axis=1)
    return np.where((values >= 0).all(axis=1), number, -1)


def texts(rows: Bytes, first: int, last: int) -> list[bytes]:
    """The characters from `first` to `last` (from the end, negative) of each row."""
    return [row.tobytes() for row in np.ascontiguousarray(rows[:, first : rows.shape[1] + last])]


def numbers(fields: list[list[bytes]], columns: slice | list[int]) -> Array:
    """Numbers of the columns of split lines, (n, columns); NaN for a line in which one is none."""
    picked = [line[columns] if isinstance(columns, slice) else [line[i] for i in columns] for line in fields]
    try:
        return np.array(picked, dtype=float)
    except ValueError:
        return np.array([[_number(text) for text in line] for line in picked])


def _number(text: bytes) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan
