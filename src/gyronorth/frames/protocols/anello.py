"""ANELLO text output #APIMU and #APIM1.

`#APIMU,` time since power-up (ms), time of synchronisation (ms; only in newer firmware), AX, AY, AZ (g), WX, WY, WZ of
the MEMS gyros (deg/s), OG_WX, OG_WY, OG_WZ of the optical gyros (deg/s), ..., temperature, `*` and the exclusive or of
all between # and * in two digits. #APIM1 is the same without an odometer. The optical gyros are taken. Lines of units
with one optical gyro (EVK, Ground INS, Ground IMU: OG_WZ alone) have the MEMS rates of x and y, and are refused: these
cannot find north. A line of 11 or 12 fields is of such a unit (speed and time of an odometer follow OG_WZ), unless
three fields in place of the optical gyros have the same number of decimals.

Sources: docs-a1.readthedocs.io; facts of the ANELLO ROS driver. Its real line (an EVK, checksum 55) is in the tests:
the checksum holds and it is refused. The line with three optical gyros is not verified against a real one, nor is
where the axes point (a unit at rest showed +1 g on z).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gyronorth.arrays import Index, Mask
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.errors import InputError
from gyronorth.frames.protocol import OTHER, Bytes, Fields, Scale, StreamOptions, at_sync
from gyronorth.frames.protocols.text import columns_from_end, fields_if_named, line_starts, protocol_of_lines, xor_holds

_NAMES = b"#APIMU,", b"#APIM1,"
_LONGEST = 256
#: Fields after the name: with one optical gyro (without and with the time of synchronisation), with three.
_ONE, _LEAST_OF_THREE = (9, 10, 11, 12), 13
#: Fields of lines that end with the optical gyros, and added to the layout of such lines or those with one field more.
_SHORTEST_OF_THREE, _SHORT = 11, 1000
#: Decimals of an optical gyro, deg/s.
_FINE = 4


def _starts(data: Bytes) -> tuple[Index, Index]:
    return line_starts(data, at_sync(data, b"#AP"), 2, _LONGEST)


def _judge(data: Bytes, start: Index, length: Index) -> tuple[Mask, Index]:
    fields = fields_if_named(data, start, length, *_NAMES)
    short = np.flatnonzero((fields == _SHORTEST_OF_THREE) | (fields == _SHORTEST_OF_THREE + 1))
    if len(short):
        fields[short[_three_alike(data, start[short], start[short] + length[short] - 3)]] += _SHORT
    return xor_holds(data, start, length), np.where(fields >= min(_ONE), fields, OTHER)


def _three_alike(data: Bytes, start: Index, star: Index) -> Mask:
    """Whether the fields 8 to 10, from 0, of lines have as many decimals, four at least."""
    commas, points = np.flatnonzero(data == ord(",")), np.append(np.flatnonzero(data == ord(".")), len(data))
    edges = np.append(commas, len(data))[np.searchsorted(commas, start)[:, None] + np.arange(8, 12)]
    edges = np.minimum(edges, star[:, None])  # the last field ends with the asterisk
    point = points[np.searchsorted(points, edges[:, :-1])]
    decimals = edges[:, 1:] - point - 1  # negative without a point
    return (decimals[:, 0] >= _FINE) & (decimals == decimals[:, :1]).all(axis=1)


def _fields(rows: Bytes, layout: int) -> Fields:
    count = layout % _SHORT
    wanted = [0, *range(2, 5), *range(8, 11), count - 1]  # time, acceleration, optical rate, temperature
    values = columns_from_end(rows, -3, [min(place - count, -1) for place in wanted])  # the shortest are refused
    finite = np.isfinite(values).all(axis=1) & (np.abs(values[:, 0]) < 1e12)
    return Fields(
        gyro=np.radians(values[:, 4:7]),
        accel=values[:, 1:4] * STANDARD_GRAVITY,
        ticks=np.round(np.where(finite, values[:, 0], 0.0) * 1e3).astype(np.int64),
        tick=1e-6,
        temperature=None if count == _SHORTEST_OF_THREE else values[:, -1],
        usable=finite,
    )


def _scale(layout: int, _facts: Sequence[Bytes], _options: StreamOptions) -> Scale:
    if layout < _LEAST_OF_THREE:
        raise InputError(
            f"The #APIMU or #APIM1 lines have {layout} fields: such a unit has one optical gyro (z) and MEMS gyros, "
            "which cannot find north. Lines with OG_WX, OG_WY and OG_WZ (13 fields or more, as of the X3) are expected."
        )
    return Scale()


PROTOCOL = protocol_of_lines("anello", _starts, _judge, _fields, _scale)
