"""Serial messages of the Honeywell HG4930 and HG1120.

Little endian; address 0x0E and a message number; the sum of all 16-bit words before it ends the message. 0x01 is the
control message (20 bytes, 600 Hz): three int16 of rate, three of acceleration, two status words. 0x02 (HG4930) is the
inertial message (44 bytes, 100 Hz): the same, then three int32 of angle and three of velocity gained since the last
one. The inertial message is taken where both come. The HG1120 has control messages 0x04 and 0x0C, which are passed
over, and inertial messages 0x05 and 0x0D, with three int16 of magnetic field before the status words (50 bytes) or
without (44 bytes): the checksum tells.

Sources: Honeywell HG4930 interface manual, p. 6 to 9; facts in bolderflight/hg4930 (lengths, control scales) and in
the headers of Honeywell's HGuide API (lengths of 0x05 and 0x0D). The
status word says whether the sensors work, but the sources differ in which value means good: no fault is derived from
it. Not verified against a real frame: all of it, and all of the HG1120 but its scales. x, y and z are in the order
sent; where they point is to be declared (a driver of one user takes -y, z, -x as forward, right, down).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gyronorth.arrays import Index, Mask
from gyronorth.frames.checksums import column, sum_16_words
from gyronorth.frames.protocol import OTHER, Bytes, Fields, Protocol, Scale, StreamOptions

_ADDRESS = 0x0E
_CONTROL, _INERTIAL, _INERTIAL_1120, _INERTIAL_1120_B = 0x01, 0x02, 0x05, 0x0D
#: Lengths by message; those of the HG1120 without and with magnetic field.
_FIELD = 6
_LENGTHS = {
    _CONTROL: (20,), _INERTIAL: (44,), _INERTIAL_1120: (44, 44 + _FIELD), _INERTIAL_1120_B: (44, 44 + _FIELD),
    0x04: (20, 20 + _FIELD), 0x0C: (20, 20 + _FIELD),
}  # fmt: skip
_FOOT = 0.3048
#: Of one count of the inertial message: rad, and ft/s.
_INCREMENTS = {
    _INERTIAL: (2.0**-33, 2.0**-27), _INERTIAL_1120: (2.0**-34, 2.0**-28), _INERTIAL_1120_B: (2.0**-34, 2.0**-28)
}  # fmt: skip
_CONTROL_HZ, _INERTIAL_HZ = 600.0, 100.0


def _starts(data: Bytes) -> tuple[Index, Index]:
    here = np.flatnonzero(data[:-1] == _ADDRESS)
    kind = data[here + 1]
    found = [(here[kind == number], length) for number, lengths in _LENGTHS.items() for length in lengths]
    start = np.concatenate([places for places, _ in found])
    length = np.concatenate([np.full(len(places), length, np.int64) for places, length in found])
    order = np.lexsort((length, start))
    return start[order], length[order]


def _whole(rows: Bytes) -> Mask:
    return sum_16_words(rows[:, :-2]) == column(rows, rows.shape[1] - 2, "<u2")


def _layouts(rows: Bytes) -> Index:
    """The message, + its length times 256; one that is not read is none."""
    layout = rows[:, 1].astype(np.int64)
    return np.where(np.isin(layout, (_CONTROL, *_INCREMENTS)), layout + 256 * rows.shape[1], OTHER)


def _fields(rows: Bytes, layout: int) -> Fields:
    if layout % 256 == _CONTROL:
        gyro, accel = column(rows, 2, "<i2", 3), column(rows, 8, "<i2", 3)
    else:
        at = rows.shape[1] - 26
        gyro, accel = column(rows, at, "<i4", 3), column(rows, at + 12, "<i4", 3)
    return Fields(gyro.astype(float), accel.astype(float))


def _scale(layout: int, _facts: Sequence[Bytes], _options: StreamOptions) -> Scale:
    if layout % 256 == _CONTROL:
        gyro, accel = 2.0**-20 * _CONTROL_HZ, 2.0**-14 * _FOOT * _CONTROL_HZ
        return Scale(gyro, accel, usual_rate_hz=_CONTROL_HZ, profile="hg4930")
    gyro, accel = _INCREMENTS[layout % 256]
    profile = "hg4930" if layout % 256 == _INERTIAL else None
    return Scale(gyro, accel * _FOOT, True, True, usual_rate_hz=_INERTIAL_HZ, profile=profile)


PROTOCOL = Protocol(
    "hg4930",
    2,
    _starts,
    _whole,
    _layouts,
    _fields,
    rank=lambda layout: int(layout % 256 == _CONTROL),
    scale=_scale,
    message=lambda row: f"message 0x{row[1]:02X}",
    doubt="always",
)
