"""ANELLO X3 binary output.

C5 50, 0xFD, length (55), data (little endian), Fletcher's sum over type, length and data. Time since power-up (u64,
ns), time of synchronisation, three int16 of acceleration and three of MEMS rate (of their ranges over 2^15), three
int32 of optical rate (1e-7 deg/s), magnetic field, temperature (0.01 degC), ranges, status of each optical gyro. The
optical gyros are taken. x forward, y right, z down.

Source: facts of ArduPilot's AnelloX3 driver (which writes 3.05e-5 for 2^-15 and uses the axes as they are). Not
verified against a real frame.
"""

from __future__ import annotations

import numpy as np

from gyronorth.arrays import Index, Mask
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.frames.checksums import column, fletcher_16
from gyronorth.frames.protocol import OTHER, Bytes, Fields, Protocol, at_sync, with_head

_IMU, _SIZE, _HEADER = 0xFD, 55, 4


def _starts(data: Bytes) -> tuple[Index, Index]:
    start = with_head(data, at_sync(data, (0xC5, 0x50)), _HEADER)
    return start, data[start + 3].astype(np.int64) + _HEADER + 2


def _whole(rows: Bytes) -> Mask:
    return fletcher_16(rows[:, 2:-2]) == column(rows, rows.shape[1] - 2, ">u2")


def _layouts(rows: Bytes) -> Index:
    return np.where((rows[:, 2] == _IMU) & (rows[:, 3] == _SIZE), _IMU, OTHER)


def _fields(rows: Bytes, _layout: int) -> Fields:
    optical = column(rows, 32, "<i4", 3)
    ranges = column(rows, 52, "<u2").astype(np.int64)
    optical_range = column(rows, 54, "<u2").astype(float)
    return Fields(
        gyro=np.radians(optical * 1e-7),
        accel=column(rows, 20, "<i2", 3) * ((ranges >> 11) / 2.0**15 * STANDARD_GRAVITY)[:, None],
        ticks=column(rows, 4, "<u8").astype(np.int64),
        tick=1e-9,
        saturated=(optical_range > 0) & (np.abs(optical * 1e-7) >= optical_range[:, None]).any(axis=1),
        fault=(rows[:, 56:59] != 0).any(axis=1),
        temperature=column(rows, 50, "<i2") / 100.0,
    )


def _message(row: Bytes) -> str:
    return f"message 0x{row[2]:02X}"


PROTOCOL = Protocol("anello-x3", _HEADER, _starts, _whole, _layouts, _fields, message=_message, doubt="always")
