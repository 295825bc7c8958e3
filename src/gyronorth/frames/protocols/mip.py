"""MicroStrain MIP packets of the sensor data set (0x80).

75 65, set, length, fields (length with header, descriptor, data; big endian), Fletcher's sum over all before it. Taken
are delta theta and delta velocity (0x07, 0x08), where the packet holds a time that gives their interval, else scaled
gyro and accelerometer (0x05, 0x04); time is the reference time 0xD5, or GPS time 0xD3 or 0x12. x forward, y right, z
down.

Sources: MicroStrain DCP manuals; descriptors and overrange bits as in `pymscl` (MIT), against which the decoder's
framing is tested. Packets of one stream may hold different fields, as those of slower rates come in every nth: what
most of them hold is read, and specific force where it comes. Not verified against a real packet.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gyronorth.arrays import Index, Mask
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.frames.checksums import column, fletcher_16
from gyronorth.frames.protocol import OTHER, Bytes, Fields, Force, Protocol, Scale, StreamOptions, at_sync, with_head
from gyronorth.frames.protocols.tagged import Blocks, groups_of, layouts_of

_SENSOR_SET = 0x80
_SETS = {0x01: "replies", 0x0C: "replies", 0x81: "GNSS", 0x82: "filter", 0x91: "GNSS", 0x92: "GNSS", 0xA0: "system"}
_ACCEL, _GYRO, _DELTA_THETA, _DELTA_VELOCITY = 0x04, 0x05, 0x07, 0x08
_GPS_TIME, _SHARED_GPS_TIME, _REFERENCE_TIME = 0x12, 0xD3, 0xD5
_TEMPERATURES, _OVERRANGE = 0x14, 0x18
#: Bytes of the data of the descriptors that are read.
_SIZES = {
    _ACCEL: 12, _GYRO: 12, _DELTA_THETA: 12, _DELTA_VELOCITY: 12, _GPS_TIME: 12, _SHARED_GPS_TIME: 12,
    _REFERENCE_TIME: 8, _TEMPERATURES: 12, _OVERRANGE: 2,
}  # fmt: skip
#: Overrange bits of accelerometers and gyros.
_SATURATED = 0x0077
_TIMES = (_REFERENCE_TIME, _SHARED_GPS_TIME, _GPS_TIME)
#: Bits of a layout: which of the descriptors are there.
_BITS = {
    name: 1 << i
    for i, name in enumerate((_GYRO, _DELTA_THETA, _ACCEL, _DELTA_VELOCITY, *_TIMES, _TEMPERATURES))
}  # fmt: skip


def _starts(data: Bytes) -> tuple[Index, Index]:
    start = with_head(data, at_sync(data, (0x75, 0x65)), 4)
    return start, data[start + 3].astype(np.int64) + 6


def _whole(rows: Bytes) -> Mask:
    return fletcher_16(rows[:, :-2]) == column(rows, rows.shape[1] - 2, ">u2")


def _parse(row: Bytes) -> tuple[Blocks, Index] | None:
    blocks: Blocks = {}
    at, listing = 4, [2]
    while at + 2 <= len(row) - 2:
        size, descriptor = int(row[at]), int(row[at + 1])
        if size < 2 or at + size > len(row) - 2:
            return None
        listing += [at, at + 1]
        if _SIZES.get(descriptor, size - 2) == size - 2:
            blocks.setdefault(descriptor, (at + 2, size - 2))
        at += size
    return blocks, np.array(listing)


def _flags(blocks: Blocks) -> int | None:
    bits = sum(bit for name, bit in _BITS.items() if name in blocks)
    return bits if _GYRO in blocks or _DELTA_THETA in blocks else None


def _reads(layout: int) -> int:
    """What is read of a packet: one kind of rate, of specific force and of time, and the temperature."""
    time = next((_BITS[name] for name in _TIMES if layout & _BITS[name]), 0)
    delta = bool(layout & _BITS[_DELTA_THETA]) and (bool(time) or not layout & _BITS[_GYRO])
    gyro = _BITS[_DELTA_THETA if delta else _GYRO]
    order = (_DELTA_VELOCITY, _ACCEL) if delta else (_ACCEL, _DELTA_VELOCITY)
    accel = next((_BITS[name] for name in order if layout & _BITS[name]), 0)
    return gyro | accel | time | layout & _BITS[_TEMPERATURES]


def _force(rows: Bytes, interval: float) -> Force:
    """Scaled specific force, else the velocity gained in the interval."""
    force = Force.none(len(rows))
    for index, blocks, _ in groups_of(rows, _parse):
        read = next((name for name in (_ACCEL, _DELTA_VELOCITY) if name in blocks), None)
        if read is None or rows[index[0], 2] != _SENSOR_SET:
            continue
        unit = STANDARD_GRAVITY / (interval if read == _DELTA_VELOCITY else 1.0)
        force.here[index] = True
        force.value[index] = column(rows[index], blocks[read][0], ">f4", 3) * unit
        if _OVERRANGE in blocks:
            force.saturated[index] = (column(rows[index], blocks[_OVERRANGE][0], ">u2") & _SATURATED) != 0
    return force


def _layouts(rows: Bytes) -> Index:
    layout = layouts_of(rows, _parse, _flags)
    return np.where(rows[:, 2] == _SENSOR_SET, layout, OTHER)


def _fields(rows: Bytes, reads: int) -> Fields:
    blocks, _ = _parse(rows[0]) or ({}, None)

    def triad(*descriptors: int) -> np.ndarray | None:
        read = next((name for name in descriptors if reads & _BITS[name]), None)
        return None if read is None else column(rows, blocks[read][0], ">f4", 3).astype(float)

    gyro = triad(_DELTA_THETA, _GYRO)
    assert gyro is not None
    accel = triad(_DELTA_VELOCITY, _ACCEL)  # g, also for increments: delta velocity is in g s
    ticks, usable = _time(rows, blocks, reads)
    saturated = None
    if _OVERRANGE in blocks:
        saturated = (column(rows, blocks[_OVERRANGE][0], ">u2") & _SATURATED) != 0
    temperature = None
    if reads & _BITS[_TEMPERATURES]:
        temperature = column(rows, blocks[_TEMPERATURES][0], ">f4", 3)[:, 2].astype(float)  # minimum, maximum, mean
    return Fields(gyro, accel, ticks=ticks, tick=1e-9, saturated=saturated, temperature=temperature, usable=usable)


def _time(rows: Bytes, blocks: Blocks, reads: int) -> tuple[Index | None, Mask | None]:
    """Time, ns, and where it is one."""
    if reads & _BITS[_REFERENCE_TIME]:
        return column(rows, blocks[_REFERENCE_TIME][0], ">u8").astype(np.int64), None
    for descriptor in (_SHARED_GPS_TIME, _GPS_TIME):
        if reads & _BITS[descriptor]:
            at = blocks[descriptor][0]
            second, week = column(rows, at, ">f8"), column(rows, at + 8, ">u2").astype(np.int64)
            usable = np.isfinite(second) & (np.abs(second) < 1e6) & (week < 10000)
            whole = np.round(np.where(usable, second, 0.0) * 1e9).astype(np.int64)
            return whole + np.where(usable, week, 0) * 604_800_000_000_000, usable
    return None, None


def _scale(reads: int, _facts: Sequence[Bytes], _options: StreamOptions) -> Scale:
    return Scale(1.0, STANDARD_GRAVITY, bool(reads & _BITS[_DELTA_THETA]), bool(reads & _BITS[_DELTA_VELOCITY]))


def _message(row: Bytes) -> str:
    if row[2] == _SENSOR_SET:
        blocks, _ = _parse(row) or ({}, None)
        return "sensor data without rate" + (
            f" ({', '.join(f'0x{name:02X}' for name in sorted(blocks))})" if blocks else ""
        )
    name = _SETS.get(int(row[2]))
    return f"set 0x{row[2]:02X}" + (f" ({name})" if name else "")


PROTOCOL = Protocol(
    "mip",
    4,
    _starts,
    _whole,
    _layouts,
    _fields,
    reads=_reads,
    scale=_scale,
    force=_force,
    message=_message,
    doubt="always",
)
