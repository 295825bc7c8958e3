"""VectorNav binary output.

FA, a byte of groups, a 16-bit mask of fields for each group, the fields (little endian), a CRC-16 (0x1021, start 0,
sent high byte first) over all after FA. Taken, in this order: DeltaTheta and DeltaVel (integrals, with their own
time), the uncompensated rate and acceleration, and only then AngularRate and Accel, which carry the on-board filter's
bias: at rest that bias can hold Earth rate itself. x forward, y right, z down.

Sources: UM001 and UM005 (binary output message), field lengths and SensSat bits as in VectorNav's programming library.
Not verified against a real frame. Outputs with fields of variable length (RawMeas, SatInfo) or more than seven groups
are passed over. Lines of text between them ($VN...) are whole frames that hold none of this.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator

import numpy as np

from gyronorth.arrays import Index, Mask
from gyronorth.frames.checksums import column, crc_msb
from gyronorth.frames.protocol import OTHER, Bytes, Fields, Force, Protocol, at_sync
from gyronorth.frames.protocols.text import line_starts, name_of, xor_holds

#: Bytes of the fields by group and bit; 0: not known, or of variable length.
_SIZES = np.array(
    [
        [8, 8, 8, 12, 16, 12, 24, 12, 12, 24, 20, 28, 2, 4, 8, 0],
        [8, 8, 8, 2, 8, 8, 8, 4, 4, 1, 0, 0, 0, 0, 0, 0],
        [2, 12, 12, 12, 4, 4, 16, 12, 12, 12, 12, 2, 40, 0, 0, 0],
        [8, 8, 2, 1, 1, 24, 24, 12, 12, 12, 4, 4, 2, 28, 0, 0],
        [2, 12, 16, 36, 12, 12, 12, 12, 12, 12, 28, 24, 12, 0, 0, 0],
        [2, 24, 24, 12, 12, 12, 12, 12, 12, 4, 4, 68, 64, 0, 0, 0],
        [8, 8, 2, 1, 1, 24, 24, 12, 12, 12, 4, 4, 2, 28, 0, 0],
    ]
)
_GROUPS = len(_SIZES)
_LONGEST = 512
_COMMON, _TIME, _IMU = 0, 1, 2
#: Bits of SensSat: accelerometers and gyros.
_SATURATED = 0x01F8
#: Low bits of a layout: the integral, or the filter's rate, is taken.
_DELTA, _RAW, _FILTERED = 0, 1, 2


def _starts(data: Bytes) -> tuple[Index, Index]:
    head = 2 + 2 * _GROUPS
    start = np.flatnonzero(data[: max(len(data) - head + 1, 0)] == 0xFA)
    groups = data[start + 1].astype(np.int64)
    possible = (groups > 0) & (groups < 0x80)
    at, payload = np.full(len(start), 2, np.int64), np.zeros(len(start), np.int64)
    for group in range(_GROUPS):
        present = ((groups >> group) & 1) == 1
        mask = data[start + at].astype(np.int64) | (data[start + at + 1].astype(np.int64) << 8)
        bits = (mask[:, None] >> np.arange(16)) & 1
        possible &= ~present | ((mask > 0) & ~(bits.astype(bool) & (_SIZES[group] == 0)).any(axis=1))
        payload += np.where(present, bits @ _SIZES[group], 0)
        at += 2 * present
    length = at + payload + 2
    possible &= length <= _LONGEST
    text, text_length = line_starts(data, at_sync(data, b"$VN"), 2, _LONGEST)
    start, length = np.append(start[possible], text), np.append(length[possible], text_length)
    order = np.argsort(start, kind="stable")
    return start[order], length[order]


def _whole(rows: Bytes) -> Mask:
    return crc_msb(rows[:, 1:-2], 16, 0x1021, 0) == column(rows, rows.shape[1] - 2, ">u2")


def _judge_lines(data: Bytes, start: Index, length: Index) -> tuple[Mask, Index]:
    return xor_holds(data, start, length), np.full(len(start), OTHER, np.int64)


def _header(row: Bytes) -> tuple[dict[tuple[int, int], int], int]:
    """Offsets of the fields by group and bit, and the length of the header."""
    groups = [group for group in range(_GROUPS) if row[1] >> group & 1]
    offset = size = 2 + 2 * len(groups)
    fields = {}
    for i, group in enumerate(groups):
        mask = int(row[2 + 2 * i]) | int(row[3 + 2 * i]) << 8
        for bit in range(16):
            if mask >> bit & 1:
                fields[group, bit] = offset
                offset += int(_SIZES[group][bit])
    return fields, size


def _kind(fields: dict[tuple[int, int], int]) -> int | None:
    if (_COMMON, 11) in fields or (_IMU, 6) in fields:
        return _DELTA
    if (_IMU, 3) in fields or (_COMMON, 9) in fields:
        return _RAW
    return _FILTERED if (_COMMON, 5) in fields or (_IMU, 10) in fields else None


def _force(rows: Bytes, interval: float) -> Force:
    """Uncompensated acceleration, else the filter's, else the velocity gained."""
    force = Force.none(len(rows))
    for index, at in _groups_of(rows):
        force.here[index] = True
        part = rows[index]
        plain = next((at[place] for place in ((_IMU, 2), (_COMMON, 9), (_IMU, 9), (_COMMON, 8)) if place in at), None)
        if plain is not None:
            force.value[index] = column(part, plain, "<f4", 3)
        elif (_COMMON, 11) in at:
            span = column(part, at[_COMMON, 11], "<f4").astype(float)
            span = np.where((span > 0) & (span < 10), span, interval)
            force.value[index] = column(part, at[_COMMON, 11] + 16, "<f4", 3) / span[:, None]
        elif (_IMU, 7) in at:
            force.value[index] = column(part, at[_IMU, 7], "<f4", 3) / interval
        else:
            force.here[index] = False
        if (_IMU, 11) in at:
            force.saturated[index] = (column(part, at[_IMU, 11], "<u2") & _SATURATED) != 0
    return force


def _groups_of(rows: Bytes) -> Iterator[tuple[Index, dict[tuple[int, int], int]]]:
    """Places of the binary frames (k, length) with the same header, and the offsets of their fields."""
    open_ = rows[:, 0] != ord("$")
    while open_.any():
        model = rows[np.argmax(open_)]
        fields, size = _header(model)
        alike = open_ & (rows[:, 1:size] == model[1:size]).all(axis=1)
        open_ &= ~alike
        yield np.flatnonzero(alike), fields


def _layouts(rows: Bytes) -> Index:
    layout = np.full(len(rows), OTHER, np.int64)
    for index, fields in _groups_of(rows):
        kind = _kind(fields)
        if kind is not None:
            header = rows[index[0], 1 : min(fields.values())]
            layout[index] = (zlib.crc32(header.tobytes()) << 4) | kind
    return layout


def _fields(rows: Bytes, layout: int) -> Fields:
    at, _ = _header(rows[0])

    def triad(group: int, bit: int, offset: int = 0) -> np.ndarray | None:
        return column(rows, at[group, bit] + offset, "<f4", 3).astype(float) if (group, bit) in at else None

    def first(*found: np.ndarray | None) -> np.ndarray | None:
        return next((values for values in found if values is not None), None)

    usable = span = None
    force = first(triad(_IMU, 2), triad(_COMMON, 9), triad(_IMU, 9), triad(_COMMON, 8))
    if layout & 15 == _DELTA:
        group, bit = (_COMMON, 11) if (_COMMON, 11) in at else (_IMU, 6)
        span = column(rows, at[group, bit], "<f4").astype(float)[:, None]
        usable = (span[:, 0] > 0) & (span[:, 0] < 10)
        safe = np.where(usable[:, None], span, 1.0)
        angle = triad(group, bit, 4)
        velocity = triad(_COMMON, 11, 16) if group == _COMMON else triad(_IMU, 7)
        assert angle is not None
        rate = np.radians(angle) / safe
        force = velocity / safe if velocity is not None else force
    elif layout & 15 == _RAW:
        rate = first(triad(_IMU, 3), triad(_COMMON, 9, 12))
    else:
        rate = first(triad(_IMU, 10), triad(_COMMON, 5))
    clock = at.get((_COMMON, 0), at.get((_TIME, 0)))
    saturation = at.get((_IMU, 11))
    temperature = at.get((_IMU, 4))
    assert rate is not None
    return Fields(
        gyro=rate,
        accel=force,
        ticks=None if clock is None else column(rows, clock, "<u8").astype(np.int64),
        tick=1e-9,
        span=None if span is None else span[:, 0],
        saturated=None if saturation is None else (column(rows, saturation, "<u2") & _SATURATED) != 0,
        temperature=None if temperature is None else column(rows, temperature, "<f4").astype(float),
        usable=usable,
    )


PROTOCOL = Protocol(
    "vectornav",
    2 + 2 * _GROUPS,
    _starts,
    _whole,
    _layouts,
    _fields,
    judge_lines=_judge_lines,
    force=_force,
    line_ends=True,
    doubt="beside damage",
    rank=lambda layout: layout & 15,
    message=lambda row: name_of(row) if row[0] == ord("$") else "binary output without rate",
)
