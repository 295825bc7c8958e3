"""Inertial Labs user-defined data (message 0x95).

AA 55, 01, 95, length (u16; of all but the first two bytes), number of data, their types, the data (little endian), the
sum of all bytes after AA 55 modulo 2^16. Read are 0x21 rate (int32, 1e-5 deg/s), 0x23 specific force (int32, 1e-6 g),
0x01 time of the week (ms), 0x52 temperature (0.1 degC), and the unit status words 0x53 and 0x5A. x right, y forward, z
up.

Sources: facts of ArduPilot's Inertial Labs driver (lengths of the types, axes, status bits). Data after a type of
unknown length are not read. Not verified against a real message.
"""

from __future__ import annotations

import numpy as np

from gyronorth.arrays import Index, Mask
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.frames.checksums import column
from gyronorth.frames.protocol import OTHER, Bytes, Fields, Force, Protocol, at_sync, u16, with_head
from gyronorth.frames.protocols.tagged import Blocks, groups_of, layouts_of

_USER_DATA = (0x01, 0x95)
_TIME, _GYRO, _ACCEL, _TEMPERATURE, _STATUS, _STATUS_2 = 0x01, 0x21, 0x23, 0x52, 0x53, 0x5A
#: 0x53: data incorrect, gyros, accelerometers or electronics failed; a rate is out of range. 0x5A: a force is.
_FAULT, _RATE_HIGH, _FORCE_HIGH = 0x002E, 0x1C00, 0x0007
_SIZES = {
    0x01: 4, 0x3C: 2, 0x23: 12, 0x21: 12, 0x25: 6, 0x24: 6, 0x07: 6, 0x12: 12, 0x10: 12, 0x58: 3, 0x57: 6, 0x53: 2,
    0x4A: 2, 0x3B: 1, 0x30: 12, 0x32: 10, 0x3E: 4, 0x36: 2, 0x41: 1, 0xC0: 1, 0x28: 4, 0x86: 2, 0x8A: 6, 0x8D: 2,
    0x50: 2, 0x52: 2, 0x5A: 2, 0x33: 4, 0x3A: 1, 0x40: 4, 0x42: 10, 0x54: 1, 0x65: 2,
}  # fmt: skip
_LONGEST = 1024
_WEEK_MS = 604_800_000


def _starts(data: Bytes) -> tuple[Index, Index]:
    start = with_head(data, at_sync(data, (0xAA, 0x55)), 6)
    size = u16(data, start + 4)
    fits = (size >= 7) & (size <= _LONGEST)
    return start[fits], size[fits] + 2


def _whole(rows: Bytes) -> Mask:
    total = rows[:, 2:-2].sum(axis=1, dtype=np.uint32) & np.uint32(0xFFFF)
    return total == column(rows, rows.shape[1] - 2, "<u2")


def _parse(row: Bytes) -> tuple[Blocks, Index] | None:
    count = int(row[6])
    at, blocks = 7 + count, {}
    if at > len(row) - 2:
        return None
    for kind in row[7 : 7 + count].tolist():
        size = _SIZES.get(kind)
        if size is None or at + size > len(row) - 2:
            break
        blocks.setdefault(kind, (at, size))
        at += size
    return blocks, np.arange(6, 7 + count)


def _flags(blocks: Blocks) -> int | None:
    return 0 if _GYRO in blocks else None


def _force(rows: Bytes, _interval: float) -> Force:
    force = Force.none(len(rows))
    for index, blocks, _ in groups_of(rows, _parse):
        if _ACCEL in blocks and tuple(rows[index[0], 2:4].tolist()) == _USER_DATA:
            force.here[index] = True
            force.value[index] = column(rows[index], blocks[_ACCEL][0], "<i4", 3) * 1e-6 * STANDARD_GRAVITY
            force.saturated[index] = _bits(rows[index], blocks, _STATUS_2, _FORCE_HIGH)
    return force


def _bits(rows: Bytes, blocks: Blocks, status: int, bits: int) -> Mask:
    """Where one of some bits of a status word is set."""
    return (column(rows, blocks[status][0], "<u2") & bits) != 0 if status in blocks else np.zeros(len(rows), bool)


def _layouts(rows: Bytes) -> Index:
    user = (rows[:, 2] == _USER_DATA[0]) & (rows[:, 3] == _USER_DATA[1])
    return np.where(user, layouts_of(rows, _parse, _flags), OTHER)


def _fields(rows: Bytes, _layout: int) -> Fields:
    blocks, _ = _parse(rows[0]) or ({}, None)
    accel = column(rows, blocks[_ACCEL][0], "<i4", 3) * 1e-6 * STANDARD_GRAVITY if _ACCEL in blocks else None
    return Fields(
        gyro=np.radians(column(rows, blocks[_GYRO][0], "<i4", 3) * 1e-5),
        accel=accel,
        ticks=column(rows, blocks[_TIME][0], "<u4").astype(np.int64) if _TIME in blocks else None,
        tick=1e-3,
        tick_wrap=_WEEK_MS,
        saturated=_bits(rows, blocks, _STATUS, _RATE_HIGH) | _bits(rows, blocks, _STATUS_2, _FORCE_HIGH),
        fault=_bits(rows, blocks, _STATUS, _FAULT),
        temperature=column(rows, blocks[_TEMPERATURE][0], "<i2") / 10.0 if _TEMPERATURE in blocks else None,
    )


def _message(row: Bytes) -> str:
    if tuple(row[2:4].tolist()) != _USER_DATA:
        return f"message 0x{row[3]:02X}"
    return (
        f"user-defined data without rate ({', '.join(f'0x{kind:02X}' for kind in row[7 : 7 + int(row[6])].tolist())})"
    )


PROTOCOL = Protocol(
    "inertial-labs", 6, _starts, _whole, _layouts, _fields, force=_force, message=_message, doubt="always"
)
