"""Frames that are lines of text: a mark, fields with commas, an asterisk and a checksum in hexadecimal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gyronorth.arrays import Array, Index
from gyronorth.frames.protocol import Bytes

_HEX = np.full(256, -1, np.int64)
for _digits in (b"0123456789abcdef", b"0123456789ABCDEF"):
    _HEX[np.frombuffer(_digits, np.uint8)] = np.arange(16)

#: Digits of an integer that a float holds exactly, in any sum of its digits.
_EXACT_DIGITS = 15
_POWERS = 10.0 ** np.arange(_EXACT_DIGITS + 3)


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


def columns_from_end(rows: Bytes, end: int, columns: Sequence[int], *, begin: int = 0) -> Array:
    """Numbers of some of the fields between commas (or semicolons), (n, columns); NaN where a field is none.

    Parameters
    ----------
    rows : ndarray, shape (n, length)
        Lines of one length.
    end : int
        Characters at the end that belong to no field: the checksum and its mark, negative.
    columns : sequence of int
        Numbers of the fields from the end, -1: the last one. Every line has as many.
    begin : int
        Characters at the begin that belong to none of these fields.

    Notes
    -----
    Up to 15 digits are an integer that a float holds exactly, and so is the power of ten that it is divided by: the
    quotient is the float nearest to the text. Other numbers go through `float`.
    """
    text = np.full((len(rows), rows.shape[1] + end - begin + 1), ord(","), np.uint8)
    text[:, :-1] = rows[:, begin:end]
    flat = text.ravel()
    digit = flat - np.uint8(ord("0"))  # wraps: what is below 0 is far above 9
    is_digit = digit <= 9
    commas = np.flatnonzero((flat == ord(",")) | (flat == ord(";")))
    last = np.searchsorted(commas, np.arange(1, len(rows) + 1) * text.shape[1]) - 1
    ends = commas[last[:, None] + 1 + np.array(columns)]
    starts = commas[np.maximum(last[:, None] + np.array(columns), 0)] + 1
    starts = np.where(last[:, None] + np.array(columns) < 0, 0, starts)
    edges = np.stack([starts, ends], axis=-1).reshape(-1)
    order = np.argsort(starts.ravel(), kind="stable")
    back = np.argsort(order)
    edges = edges.reshape(-1, 2)[order].ravel()

    places = np.flatnonzero(is_digit)
    passed = np.cumsum(np.bincount(edges, minlength=len(flat)), dtype=np.int32)[places]  # begins and ends before it
    wanted = (passed & 1) == 1
    places, field = places[wanted], passed[wanted] >> 1
    count = np.bincount(field, minlength=len(order))
    behind = np.cumsum(count)[field] - np.arange(len(field)) - 1  # digits that follow in the field
    weight = digit[places] * _POWERS[np.minimum(behind, len(_POWERS) - 1)]
    whole = np.bincount(field, weights=weight, minlength=len(order))

    begin_at, end_at = edges[::2], edges[1::2]
    sign = flat[begin_at]
    signed = (sign == ord("-")) | (sign == ord("+"))
    dots = np.flatnonzero(flat == ord("."))
    first = np.searchsorted(dots, begin_at)
    dotted = np.searchsorted(dots, end_at) - first
    dot = np.append(dots, 0)[np.minimum(first, len(dots))]
    decimals = np.where(dotted > 0, end_at - dot - 1, 0)
    plain = (count > 0) & (count <= _EXACT_DIGITS) & (dotted <= 1) & (count + dotted + signed == end_at - begin_at)
    value = whole / _POWERS[np.minimum(decimals, len(_POWERS) - 1)]
    value = np.where(sign == ord("-"), -value, value)
    for i in np.flatnonzero(~plain).tolist():
        value[i] = _number(flat[begin_at[i] : end_at[i]].tobytes())
    return value[back].reshape(len(rows), len(columns))


def _number(text: bytes) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan
