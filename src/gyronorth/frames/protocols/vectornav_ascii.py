"""VectorNav text output $VNIMU: uncompensated magnetic field, acceleration, rate, temperature and pressure.

`$VNIMU,` three of magnetic field (gauss), three of acceleration (m/s^2), three of rate (rad/s), temperature (degC),
pressure, `*` and the exclusive or of all between $ and * in two digits. x forward, y right, z down. No time.

Source: VectorNav UM001 and UM005. Not verified against a real line; lines with the 16-bit checksum or with appended
counters are not read.
"""

from __future__ import annotations

import numpy as np

from gyronorth.arrays import Index, Mask
from gyronorth.frames.protocol import OTHER, Bytes, Fields, at_sync
from gyronorth.frames.protocols.text import columns_from_end, fields_if_named, line_starts, protocol_of_lines, xor_holds

_NAME, _COMMAS, _LAYOUT = b"$VNIMU,", 11, 1
_LONGEST = 256


def _starts(data: Bytes) -> tuple[Index, Index]:
    return line_starts(data, at_sync(data, b"$VN"), 2, _LONGEST)


def _judge(data: Bytes, start: Index, length: Index) -> tuple[Mask, Index]:
    layout = np.where(fields_if_named(data, start, length, _NAME) == _COMMAS, _LAYOUT, OTHER)
    return xor_holds(data, start, length), layout


def _fields(rows: Bytes, _layout: int) -> Fields:
    values = columns_from_end(rows, -3, range(-8, -1))  # acceleration, rate, temperature
    usable = np.asarray(np.isfinite(values).all(axis=1))
    return Fields(gyro=values[:, 3:6], accel=values[:, 0:3], temperature=values[:, 6], usable=usable)


PROTOCOL = protocol_of_lines("vectornav-ascii", _starts, _judge, _fields)
