"""Checksums of many frames of one length at once: an array of bytes (frames, length) in, one number a frame out."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.uint8]
Words = NDArray[np.int64]
#: Below this number of frames (a false start of its own length, a live stream) plain integers are faster.
_FEW = 32


@cache
def _table(width: int, polynomial: int, reflected: bool) -> Words:
    """CRC of each byte value."""
    mask = (1 << width) - 1
    entries = []
    for value in range(256):
        crc = value if reflected else value << (width - 8)
        for _ in range(8):
            if reflected:
                crc = (crc >> 1) ^ (polynomial if crc & 1 else 0)
            else:
                crc = ((crc << 1) & mask) ^ (polynomial if crc >> (width - 1) else 0)
        entries.append(crc)
    return np.array(entries, np.int64)


def crc_msb(rows: Rows, width: int, polynomial: int, start: int) -> Words:
    """CRC that takes the highest bit first, without final exclusive or, shape (frames,)."""
    table, mask = _table(width, polynomial, False), (1 << width) - 1
    if len(rows) < _FEW:
        entries = table.tolist()
        return np.array([_one_msb(row, entries, width, start) for row in rows.tolist()], np.int64)
    crc = np.full(len(rows), start, np.int64)
    for column in np.ascontiguousarray(rows.T):
        crc = ((crc << 8) & mask) ^ table[(crc >> (width - 8)) ^ column]
    return crc


def crc_lsb(rows: Rows, width: int, polynomial: int, start: int) -> Words:
    """CRC that takes the lowest bit first (`polynomial` reflected), without final exclusive or, shape (frames,)."""
    table = _table(width, polynomial, True)
    if len(rows) < _FEW:
        entries = table.tolist()
        return np.array([_one_lsb(row, entries, start) for row in rows.tolist()], np.int64)
    crc = np.full(len(rows), start, np.int64)
    for column in np.ascontiguousarray(rows.T):
        crc = (crc >> 8) ^ table[(crc & 0xFF) ^ column]
    return crc


def _one_msb(row: list[int], table: list[int], width: int, crc: int) -> int:
    mask, shift = (1 << width) - 1, width - 8
    for value in row:
        crc = ((crc << 8) & mask) ^ table[(crc >> shift) ^ value]
    return crc


def _one_lsb(row: list[int], table: list[int], crc: int) -> int:
    for value in row:
        crc = (crc >> 8) ^ table[(crc & 0xFF) ^ value]
    return crc


def fletcher_16(rows: Rows) -> Words:
    """Fletcher's sum modulo 256: first sum in the high byte, sum of the sums in the low byte, shape (frames,)."""
    weight = np.arange(rows.shape[1], 0, -1, dtype=np.int64)
    return ((rows.sum(axis=1, dtype=np.int64) & 0xFF) << 8) | ((rows @ weight) & 0xFF)


def xor_8(rows: Rows) -> Words:
    """Exclusive or of all bytes, shape (frames,)."""
    return np.bitwise_xor.reduce(rows, axis=1).astype(np.int64)


def sum_16_words(rows: Rows) -> Words:
    """Sum modulo 2^16 of little-endian 16-bit words; `rows` has an even length. Shape (frames,)."""
    return column(rows, 0, "<u2", rows.shape[1] // 2).sum(axis=1, dtype=np.int64) & 0xFFFF


def column(rows: Rows, offset: int, dtype: str, count: int = 1) -> NDArray:
    """`count` numbers of `dtype` at a byte offset of each frame, shape (frames, count), or (frames,) for one."""
    size = np.dtype(dtype).itemsize * count
    values = np.ascontiguousarray(rows[:, offset : offset + size]).view(dtype)
    return values if count > 1 else values[:, 0]


def int24(rows: Rows, offset: int, count: int = 3) -> NDArray[np.int32]:
    """`count` big-endian signed 24-bit numbers at a byte offset of each frame, shape (frames, count)."""
    part = rows[:, offset : offset + 3 * count].astype(np.int32)
    return ((part[:, 0::3] << 24) | (part[:, 1::3] << 16) | (part[:, 2::3] << 8)) >> 8
