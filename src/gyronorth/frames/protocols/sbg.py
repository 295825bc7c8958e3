"""SBG Systems sbgECom: logs IMU_SHORT (44) and IMU_DATA (3).

FF 5A, log, class, length (u16), payload, CRC-16 (0x8408 reflected, start 0) over log to payload, 33; little endian. The
integrals over the sample interval are taken (sent as rates), IMU_SHORT before IMU_DATA. x forward, y right, z down.

Sources: sbgECom firmware reference manual; facts of SBG-Systems/sbgECom (MIT): status bits, the gyro's high scale
(bit 10). Not verified against a real frame.
"""

from __future__ import annotations

import numpy as np

from gyronorth.arrays import Index, Mask
from gyronorth.frames.checksums import column, crc_lsb
from gyronorth.frames.protocol import OTHER, Bytes, Fields, Protocol, at_sync, u16, with_head

_IMU_DATA, _IMU_SHORT = 3, 44
_PAYLOAD = {_IMU_DATA: 58, _IMU_SHORT: 32}
#: Logs of class 0 that units send beside them.
_LOGS = {
    1: "STATUS", 2: "UTC_TIME", 4: "MAG", 5: "MAG_CALIB", 6: "EKF_EULER", 7: "EKF_QUAT", 8: "EKF_NAV",
    9: "SHIP_MOTION", 13: "GPS1_VEL", 14: "GPS1_POS", 15: "GPS1_HDT", 19: "ODO_VEL", 36: "AIR_DATA",
}  # fmt: skip
_LONGEST = 4086
_ACCEL_LSB, _GYRO_LSB, _GYRO_HIGH_LSB = 1048576.0, 67108864.0, 12304174.0
#: Status: bits 0 to 7, set where communication, built-in tests and each sensor are good; 8 and 9, set where in range.
_GOOD, _IN_RANGE, _HIGH = 0x00FF, 0x0300, 0x0400


def _starts(data: Bytes) -> tuple[Index, Index]:
    start = with_head(data, at_sync(data, (0xFF, 0x5A)), 6)
    size = u16(data, start + 4)
    fits = size <= _LONGEST
    return start[fits], size[fits] + 9


def _whole(rows: Bytes) -> Mask:
    size = rows.shape[1]
    return (crc_lsb(rows[:, 2:-3], 16, 0x8408, 0) == column(rows, size - 3, "<u2")) & (rows[:, -1] == 0x33)


def _layouts(rows: Bytes) -> Index:
    log, size = rows[:, 2].astype(np.int64), rows.shape[1] - 9
    known = (rows[:, 3] == 0) & np.isin(log, [number for number, payload in _PAYLOAD.items() if payload == size])
    return np.where(known, log, OTHER)


def _fields(rows: Bytes, layout: int) -> Fields:
    status = column(rows, 10, "<u2")
    if layout == _IMU_SHORT:
        accel = column(rows, 12, "<i4", 3) / _ACCEL_LSB
        gyro = column(rows, 24, "<i4", 3) / np.where(status & _HIGH, _GYRO_HIGH_LSB, _GYRO_LSB)[:, None]
        temperature = column(rows, 36, "<i2") / 256.0
    else:
        accel, gyro = column(rows, 40, "<f4", 3).astype(float), column(rows, 52, "<f4", 3).astype(float)
        temperature = column(rows, 36, "<f4").astype(float)
    return Fields(
        gyro=gyro,
        accel=accel,
        ticks=column(rows, 6, "<u4").astype(np.int64),
        tick=1e-6,
        tick_wrap=1 << 32,
        saturated=(status & _IN_RANGE) != _IN_RANGE,
        fault=(status & _GOOD) != _GOOD,
        temperature=temperature,
    )


def _message(row: Bytes) -> str:
    name = _LOGS.get(int(row[2])) if row[3] == 0 else None
    return f"log {row[2]}" + (f" ({name})" if name else f" of class {row[3]}")


PROTOCOL = Protocol(
    "sbg",
    6,
    _starts,
    _whole,
    _layouts,
    _fields,
    rank=lambda layout: int(layout == _IMU_DATA),
    message=_message,
    doubt="beside damage",
)
