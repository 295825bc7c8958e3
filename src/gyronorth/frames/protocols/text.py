"""Frames that are lines of text: a mark, fields with commas, an asterisk and a checksum in hexadecimal."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from gyronorth.arrays import Array, Index, Mask
from gyronorth.frames.framing import windows
from gyronorth.frames.protocol import OTHER, Bytes, Fields, Protocol, Scale, StreamOptions, scale_as_sent

_HEX = np.full(256, -1, np.int64)
for _digits in (b"0123456789abcdef", b"0123456789ABCDEF"):
    _HEX[np.frombuffer(_digits, np.uint8)] = np.arange(16)
#: Numbers of more characters, or more digits, are read one by one.
_LONGEST, _EXACT_DIGITS = 24, 15
_NINE = np.uint8(9)


def line_starts(data: Bytes, starts: Index, digits: int, longest: int) -> tuple[Index, Index]:
    """Those of `starts` whose line may end in an asterisk and `digits` characters, and the lengths up to there.

    A line of which neither is in the buffer yet is as long as the buffer and one more. A line in which another one
    starts was cut.
    """
    star, ends = np.flatnonzero(data == ord("*")), np.flatnonzero((data == 10) | (data == 13))
    beyond = len(data) + longest
    star_after = np.append(star, beyond)[np.searchsorted(star, starts)]
    end_after = np.append(ends, beyond)[np.searchsorted(ends, starts)]
    known, open_ = star_after < end_after, (star_after == beyond) & (end_after == beyond)
    length = np.where(known, star_after + 1 + digits - starts, len(data) + 1 - starts)
    cut = np.append(starts[1:], beyond) < np.where(known, star_after, len(data))
    possible = (known | open_) & (length <= longest) & ~cut
    return starts[possible], length[possible]


def name_of(row: Bytes) -> str:
    """Mark and name of a line."""
    return row.tobytes().split(b",")[0].split(b";")[0].split(b"*")[0].decode("ascii", "replace")


def hex_at_end(rows: Bytes, digits: int) -> Index:
    """The last `digits` characters as a hexadecimal number, (k,); -1 where they are none."""
    number, good = np.zeros(len(rows), np.int64), np.ones(len(rows), bool)
    for column in rows[:, -digits:].T:
        digit = _HEX[column]
        number, good = number << 4 | digit, good & (digit >= 0)
    return np.where(good, number, -1)


def xor_holds(data: Bytes, start: Index, length: Index) -> Mask:
    """Whether the two digits behind the asterisk are the XOR of all characters between the first one and it, (n,)."""
    if not len(start):
        return np.zeros(0, bool)
    star = start + length - 3
    part = np.column_stack((np.minimum(start + 1, star), star)).ravel()
    xor = np.where(star > start + 1, np.bitwise_xor.reduceat(data, part)[::2], 0)
    return xor == hex_at_end(windows(data, star + 1, 2), 2)


def begins_with(data: Bytes, start: Index, name: bytes) -> Mask:
    """Whether a name stands at places of a buffer, (n,)."""
    here = np.asarray(start + len(name) <= len(data))
    here[here] = (windows(data, start[here], len(name)) == np.frombuffer(name, np.uint8)).all(axis=1)
    return here


def fields_if_named(data: Bytes, start: Index, length: Index, *names: bytes) -> Index:
    """Commas of each line that begins with one of some names, (n,); `OTHER` where it does not."""
    commas = np.flatnonzero(data == ord(","))
    count = np.searchsorted(commas, start + length) - np.searchsorted(commas, start)
    return np.where(np.any([begins_with(data, start, name) for name in names], axis=0), count, OTHER)


def protocol_of_lines(
    name: str,
    starts: Callable[[Bytes], tuple[Index, Index]],
    judge: Callable[[Bytes, Index, Index], tuple[Mask, Index]],
    fields: Callable[[Bytes, int], Fields],
    scale: Callable[[int, Sequence[Bytes], StreamOptions], Scale] = scale_as_sent,
) -> Protocol:
    """A protocol whose frames are all lines with the exclusive or of their characters."""
    return Protocol(
        name,
        3,
        starts,
        lambda rows: np.zeros(len(rows), bool),
        lambda rows: np.full(len(rows), OTHER, np.int64),
        fields,
        judge_lines=judge,
        scale=scale,
        line_ends=True,
        lines=lambda _layout: True,
        message=name_of,
        doubt="always",
    )


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
    """
    size = rows.shape[1] + end - begin
    text = np.full((len(rows) + 1, size + 1), ord(","), np.uint8)  # a comma behind each line, and before the first
    text[1:, :-1] = rows[:, begin:end]
    flat = text.ravel()
    edges = np.flatnonzero((flat == ord(",")) | (flat == ord(";")))
    last = np.searchsorted(edges, np.arange(2, len(text) + 1) * (size + 1) - 1)
    return np.column_stack([_numbers(flat, edges[last + column] + 1, edges[last + column + 1]) for column in columns])


def _numbers(text: Bytes, start: Index, end: Index) -> Array:
    """The numbers from places of a text to others, (n,), as `float` reads them; NaN where there is none."""
    size = int((end - start).max(initial=1))
    if size > _LONGEST or size > end.min(initial=size):
        return _one_by_one(text, start, end)
    characters = np.ascontiguousarray(windows(text, end - size, size).T)  # one row for each place
    sign = text[start]
    negative = sign == ord("-")
    first = size - (end - start) + (negative | (sign == ord("+")))
    inside = np.arange(size, dtype=np.uint8)[:, None] >= first.astype(np.uint8)
    digits = (characters - np.uint8(ord("0"))) * inside
    points = np.flatnonzero(((characters == ord(".")) & inside).any(axis=1))[:1]
    decimals = size - 1 - int(points[0]) if len(points) else 0
    plain = first + len(points) < size  # there is a digit
    if len(points):  # at one place in all that are read together
        plain &= (characters[points[0]] == ord(".")) & inside[points[0]]
        digits, inside = np.delete(digits, points, axis=0), np.delete(inside, points, axis=0)
    plain &= (digits <= _NINE).all(axis=0) & ~inside[:-_EXACT_DIGITS].any(axis=0)
    value = 10.0 ** np.arange(len(digits) - 1, -1, -1) @ digits / 10.0**decimals  # one rounding, as that of `float`
    value[negative] *= -1
    others = np.flatnonzero(~plain)
    value[others] = _one_by_one(text, start[others], end[others])
    return value


def _one_by_one(text: Bytes, start: Index, end: Index) -> Array:
    return np.array([_number(text[a:b].tobytes()) for a, b in zip(start.tolist(), end.tolist(), strict=True)], float)


def _number(text: bytes) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan
