"""Advanced Navigation packet protocol (ANPP): packet 28, raw sensors.

A header of five bytes (its own checksum LRC, packet, length, CRC-16), then the data; the LRC makes the five bytes sum
to 0 modulo 256, the CRC-16 (0x1021, start FFFF) covers the data. Twelve float32: specific force m/s^2, rate rad/s,
magnetic field, temperature, pressure, its temperature. x forward, y right, z down. The packet has no time.

Sources: Boreas and Certus reference manuals; the layout as in the official package `advanced-navigation` (MIT),
against which the decoder is tested. No real stream was at hand. Packet 20, the system state, holds the
filter's solution and no raw rates; the sensor faults it tells are not read.
"""

from __future__ import annotations

import numpy as np

from gyronorth.arrays import Index, Mask
from gyronorth.frames.checksums import column, crc_msb
from gyronorth.frames.protocol import OTHER, Bytes, Fields, Protocol

_RAW_SENSORS, _SIZE, _HEADER = 28, 48, 5
#: Packets that units send beside it or instead of it; none of them holds raw rates.
_PACKETS = {
    0: "acknowledge", 3: "device information", 20: "system state", 21: "unix time", 22: "formatted time", 23: "status",
    24: "position standard deviation", 25: "velocity standard deviation", 26: "Euler standard deviation",
    27: "quaternion standard deviation", 29: "raw GNSS", 30: "satellites", 32: "geodetic position",
    36: "NED velocity", 37: "body velocity", 38: "acceleration", 39: "Euler orientation", 40: "quaternion orientation",
    42: "angular velocity, with the filter's bias taken off",
}  # fmt: skip


def _starts(data: Bytes) -> tuple[Index, Index]:
    if len(data) < _HEADER:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    count = len(data) - _HEADER + 1
    total = sum(data[i : i + count].astype(np.uint32) for i in range(_HEADER))
    start = np.flatnonzero((np.asarray(total) & 0xFF) == 0)
    return start, data[start + 2].astype(np.int64) + _HEADER


def _whole(rows: Bytes) -> Mask:
    return (crc_msb(rows[:, _HEADER:], 16, 0x1021, 0xFFFF) == column(rows, 3, "<u2")) & (rows.shape[1] > _HEADER)


def _layouts(rows: Bytes) -> Index:
    known = (rows[:, 1] == _RAW_SENSORS) & (rows[:, 2] == _SIZE)
    return np.where(known, _RAW_SENSORS, OTHER)


def _fields(rows: Bytes, _layout: int) -> Fields:
    values = column(rows, _HEADER, "<f4", 12).astype(float)
    return Fields(gyro=values[:, 3:6], accel=values[:, 0:3], temperature=values[:, 9])


def _message(row: Bytes) -> str:
    name = _PACKETS.get(int(row[1]))
    return f"packet {row[1]}" + (f" ({name})" if name else "")


PROTOCOL = Protocol("anpp", _HEADER, _starts, _whole, _layouts, _fields, message=_message, doubt="beside damage")
