"""Frames that are lines of text: a mark, fields with commas, an asterisk and a checksum in hexadecimal."""

from __future__ import annotations

import warnings

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
    size = max(rows.shape[1] + last - first, 0)
    data = rows[:, first : first + size].tobytes()
    return [data[at : at + size] for at in range(0, len(rows) * size, size)] if size else [b""] * len(rows)


def numbers(fields: list[list[bytes]], columns: slice | list[int]) -> Array:
    """Numbers of the columns of split lines, (n, columns); NaN for a line in which one is none."""
    picked = [line[columns] if isinstance(columns, slice) else [line[i] for i in columns] for line in fields]
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # how older versions tell of text that is no number
        try:
            values = np.fromstring(b",".join(map(b",".join, picked)).decode("latin-1"), sep=",")
        except (ValueError, DeprecationWarning):
            values = np.zeros(0)
    width = len(picked[0]) if picked else 0
    if len(values) == width * len(picked) > 0:
        return values.reshape(len(picked), width)
    return np.array([[_number(text) for text in line] for line in picked])


def _number(text: bytes) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan
