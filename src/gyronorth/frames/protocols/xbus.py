"""Xsens Xbus messages MTData2.

FA, FF, 0x36, length (FF: two bytes more), blocks (identifier u16, length, data; big endian), a byte that makes the sum
of all but FA zero modulo 256. Numbers are float32, fixed point 12.20, fixed point 16.32 or float64, by the low two
bits of the identifier. Taken are DeltaQ and DeltaV (integrals), where the message holds SampleTimeFine, which gives
their interval; else RateOfTurn and Acceleration, else their high-rate forms. x forward, y left, z up. Messages of one
stream may hold different blocks, as those of slower rates come in every nth: what most of them hold is read.

Sources: Xsens MT low-level protocol documentation MT0101P; status word as in the MTi user manual MT0605P, section
4.13. Not verified against a real message.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gyronorth.arrays import Array, Index, Mask
from gyronorth.frames.checksums import column
from gyronorth.frames.protocol import OTHER, Bytes, Fields, Force, Protocol, Scale, StreamOptions, at_sync, u16
from gyronorth.frames.protocols.tagged import Blocks, groups_of, layouts_of

_MTDATA2 = 0x36
_COUNTER, _TIME, _STATUS, _TEMPERATURE = 0x1020, 0x1060, 0xE020, 0x0810
_DELTA_V, _ACCEL, _ACCEL_HR = 0x4010, 0x4020, 0x4040
_DELTA_Q, _RATE, _RATE_HR = 0x8030, 0x8020, 0x8040
_VECTORS = {_DELTA_V: 3, _ACCEL: 3, _ACCEL_HR: 3, _DELTA_Q: 4, _RATE: 3, _RATE_HR: 3, _TEMPERATURE: 1}
_PLAIN = {_COUNTER: 2, _TIME: 4, _STATUS: 4}
#: Names of blocks for messages.
_NAMES = {
    0x2010: "Quaternion", 0x2020: "RotationMatrix", 0x2030: "EulerAngles", _COUNTER: "PacketCounter",
    _TIME: "SampleTimeFine", _STATUS: "StatusWord", 0x1010: "UtcTime", 0xC020: "MagneticField", _ACCEL: "Acceleration",
    0x4030: "FreeAcceleration", 0x3010: "BaroPressure", 0x5040: "LatLon", 0xD010: "VelocityXYZ",
}  # fmt: skip
#: Bytes of one number by the low two bits of its identifier.
_BYTES = (4, 4, 6, 8)
_LONGEST, _HEAD = 2048, 6
#: Status word: bits 8 to 10 and 11 to 13, an accelerometer or a gyro is out of range.
_CLIPPED = 0x3F00
#: Bits of a layout: which of the blocks are there.
_BITS = {
    name: 1 << i
    for i, name in enumerate((_DELTA_Q, _RATE, _RATE_HR, _DELTA_V, _ACCEL, _ACCEL_HR, _TIME, _COUNTER, _TEMPERATURE))
}  # fmt: skip
_GYROS = _BITS[_DELTA_Q] | _BITS[_RATE] | _BITS[_RATE_HR]


def _starts(data: Bytes) -> tuple[Index, Index]:
    start = at_sync(data, (0xFA, 0xFF))
    start = start[np.append(data, 0)[start + 2] != 0xFF]  # that is no message: fixed-point numbers hold FA FF FF
    known = start + _HEAD <= len(data)
    shown = start[known]
    short = data[shown + 3].astype(np.int64)
    length = len(data) + 1 - start  # of a header that is not all there
    length[known] = np.where(short == 0xFF, u16(data, shown + 4, big=True) + 7, short + 5)
    return start[length <= _LONGEST], length[length <= _LONGEST]


def _whole(rows: Bytes) -> Mask:
    return (rows[:, 1:].sum(axis=1, dtype=np.uint32) & np.uint32(0xFF)) == 0


def _parse(row: Bytes) -> tuple[Blocks, Index] | None:
    blocks: Blocks = {}
    at, listing = (6, [2, 3]) if row[3] == 0xFF else (4, [2, 3])
    while at < len(row) - 1:
        if at + 3 > len(row) - 1 or at + 3 + int(row[at + 2]) > len(row) - 1:
            return None
        identifier, size = int(row[at]) << 8 | int(row[at + 1]), int(row[at + 2])
        listing += [at, at + 1, at + 2]
        name = identifier & 0xFFF0
        expected = _VECTORS[name] * _BYTES[identifier & 3] if name in _VECTORS else _PLAIN.get(name, -1)
        if expected == size:
            blocks.setdefault(name, (at + 3, identifier & 3))
        at += 3 + size
    return blocks, np.array(listing)


def _flags(blocks: Blocks) -> int | None:
    bits = sum(bit for name, bit in _BITS.items() if name in blocks)
    return bits if bits & _GYROS else None


def _reads(layout: int) -> int:
    """What is read of a message: one kind of rate and of specific force, time, counter and temperature."""

    def first(*names: int) -> int:
        return next((_BITS[name] for name in names if layout & _BITS[name]), 0)

    rate = first(_RATE, _RATE_HR)
    gyro = first(_DELTA_Q) if layout & _BITS[_TIME] or not rate else 0
    accel = first(_DELTA_V, _ACCEL, _ACCEL_HR) if gyro else first(_ACCEL, _ACCEL_HR, _DELTA_V)
    return (gyro or rate) | accel | layout & (_BITS[_TIME] | _BITS[_COUNTER] | _BITS[_TEMPERATURE])


def _force(rows: Bytes, interval: float) -> Force:
    """Acceleration, else the velocity gained in the interval."""
    force = Force.none(len(rows))
    for index, blocks, _ in groups_of(rows, _parse):
        read = next((name for name in (_ACCEL, _ACCEL_HR, _DELTA_V) if name in blocks), None)
        if read is None or rows[index[0], 2] != _MTDATA2:
            continue
        force.here[index] = True
        force.value[index] = _numbers(rows[index], blocks[read], 3) / (interval if read == _DELTA_V else 1.0)
        if _STATUS in blocks:
            force.saturated[index] = (column(rows[index], blocks[_STATUS][0], ">u4") & _CLIPPED) != 0
    return force


def _layouts(rows: Bytes) -> Index:
    return np.where(rows[:, 2] == _MTDATA2, layouts_of(rows, _parse, _flags), OTHER)


def _numbers(rows: Bytes, block: tuple[int, int], count: int) -> Array:
    at, form = block
    if form == 0:
        return column(rows, at, ">f4", count).astype(float).reshape(-1, count)
    if form == 1:
        return (column(rows, at, ">i4", count) / 2.0**20).reshape(-1, count)
    if form == 3:
        return column(rows, at, ">f8", count).astype(float).reshape(-1, count)
    parts = rows[:, at : at + 6 * count].reshape(-1, count, 6)  # the fraction first, then the whole part
    fraction = np.ascontiguousarray(parts[:, :, :4]).view(">u4")[:, :, 0]
    return np.ascontiguousarray(parts[:, :, 4:]).view(">i2")[:, :, 0] + fraction / 2.0**32


def _fields(rows: Bytes, reads: int) -> Fields:
    blocks, _ = _parse(rows[0]) or ({}, None)

    def vector(*names: int) -> Array | None:
        return next((_numbers(rows, blocks[name], _VECTORS[name]) for name in names if reads & _BITS[name]), None)

    usable = None
    if reads & _BITS[_DELTA_Q]:
        turn = _numbers(rows, blocks[_DELTA_Q], 4)
        with np.errstate(over="ignore", invalid="ignore"):
            norm = np.sqrt((turn**2).sum(axis=1))
        usable = np.abs(norm - 1) < 1e-2
        turn = np.where(usable[:, None], turn, np.array([1.0, 0.0, 0.0, 0.0]))
        sine = np.linalg.norm(turn[:, 1:], axis=1)
        angle = 2 * np.arctan2(sine, turn[:, 0])
        gyro = turn[:, 1:] * np.where(sine > 0, angle / np.where(sine > 0, sine, 1.0), 2.0)[:, None]
    else:
        gyro = vector(_RATE, _RATE_HR)
    assert gyro is not None
    accel = vector(_DELTA_V, _ACCEL, _ACCEL_HR)
    temperature = vector(_TEMPERATURE)
    return Fields(
        gyro=gyro,
        accel=accel,
        ticks=column(rows, blocks[_TIME][0], ">u4").astype(np.int64) if reads & _BITS[_TIME] else None,
        tick=1e-4,
        tick_wrap=1 << 32,
        counter=column(rows, blocks[_COUNTER][0], ">u2").astype(np.int64) if reads & _BITS[_COUNTER] else None,
        counter_wrap=1 << 16,
        saturated=(column(rows, blocks[_STATUS][0], ">u4") & _CLIPPED) != 0 if _STATUS in blocks else None,
        temperature=None if temperature is None else temperature[:, 0],
        usable=usable,
    )


def _scale(reads: int, _facts: Sequence[Bytes], _options: StreamOptions) -> Scale:
    return Scale(gyro_increments=bool(reads & _BITS[_DELTA_Q]), accel_increments=bool(reads & _BITS[_DELTA_V]))


def _message(row: Bytes) -> str:
    if row[2] != _MTDATA2:
        return f"message 0x{row[2]:02X}"
    at, names = 6 if row[3] == 0xFF else 4, []
    while at + 3 <= len(row) - 1:
        kind = int(row[at]) << 8 | int(row[at + 1]) & 0xF0
        names.append(_NAMES.get(kind, f"0x{kind:04X}"))
        at += 3 + int(row[at + 2])
    return f"MTData2 with {', '.join(names)}" if names else "MTData2 without data"


PROTOCOL = Protocol(
    "xbus",
    _HEAD,
    _starts,
    _whole,
    _layouts,
    _fields,
    reads=_reads,
    force=_force,
    scale=_scale,
    weak=True,
    message=_message,
    doubt="always",
)
