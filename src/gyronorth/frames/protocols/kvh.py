"""Formats A, B and C of KVH (EMCORE) fibre-optic units: 1725, 1750, 1760, 1775, P-series.

Format A (36 bytes): FE 81 FF 55, three float32 of rotation, three of acceleration in g, a status byte (bits 0 to 2:
gyros valid, 4 to 6: accelerometers valid), a sequence number 0 to 127, a temperature, a CRC-32. Format B (40 bytes,
FE 81 FF 56) has the time in microseconds before the status; units set to time since the pulse per second start it
again each second, which is counted as a jump of the clock. Format C (38 bytes,
FE 81 FF 57) has no time, and a float32 before the status instead of the temperature: by the sequence number modulo 4
the temperature (0) or one axis of the magnetic field (1 to 3).

Whether the rotation is a rate or an angle per sample, in rad or deg, is set in the unit and is not in the frame. At
rest the norm tells it: exactly one choice makes it Earth rate. Else angle per sample in rad is taken, and told.

Source: KVH ICD 56-0298, tables 5-1 to 5-9; the order of the values of format C as a user's connector states it
(RISE-Maritime/keelson). Format A and its CRC hold on the two whole frames in the test data of TRECVT/ros_kvh1750;
formats B and C are not verified against a real frame, nor is the axes' sense.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gyronorth.arrays import Index, Mask
from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY
from gyronorth.findings import Finding
from gyronorth.frames.checksums import column, crc_msb
from gyronorth.frames.protocol import Bytes, Fields, Protocol, Scale, StreamOptions, at_sync

_A, _B, _C = 0x55, 0x56, 0x57
_LENGTH = {_A: 36, _B: 40, _C: 38}
_LENGTHS = np.zeros(256, np.int64)
for _kind, _length in _LENGTH.items():
    _LENGTHS[_kind] = _length
#: Bytes from the status byte to the end.
_TAIL = {_A: 8, _B: 8, _C: 6}
#: Sequence numbers, modulo 4, at which format C holds the temperature.
_WARM, _TURN = 0, 4
_VALID = 0x77
_UNITS = {"rad/s": 1.0, "deg/s": np.pi / 180}
#: A norm within this factor of Earth rate is Earth rate, with the bias and the noise of such a unit.
_FACTOR = 2.5


def _starts(data: Bytes) -> tuple[Index, Index]:
    start = at_sync(data[:-1], (0xFE, 0x81, 0xFF))
    kind = data[start + 3]
    known = _LENGTHS[kind] > 0
    return start[known], _LENGTHS[kind[known]]


def _whole(rows: Bytes) -> Mask:
    size = rows.shape[1] - 4
    return crc_msb(rows[:, :size], 32, 0x04C11DB7, 0xFFFFFFFF) == column(rows, size, ">u4")


def _layouts(rows: Bytes) -> Index:
    return rows[:, 3].astype(np.int64)


def _fields(rows: Bytes, layout: int) -> Fields:
    at = _LENGTH[layout] - _TAIL[layout]
    if layout == _C:
        temperature = np.where(rows[:, at + 1] % _TURN == _WARM, column(rows, at - 4, ">f4").astype(float), np.nan)
    else:
        temperature = column(rows, at + 2, ">i2").astype(float)
    return Fields(
        gyro=column(rows, 4, ">f4", 3).astype(float),
        accel=column(rows, 16, ">f4", 3).astype(float),
        ticks=column(rows, 28, ">u4").astype(np.int64) if layout == _B else None,
        tick=1e-6,
        tick_wrap=1 << 32,
        counter=rows[:, at + 1].astype(np.int64),
        counter_wrap=128,
        fault=(rows[:, at] & _VALID) != _VALID,
        temperature=temperature,
    )


def _scale(_layout: int, _facts: Sequence[Bytes], options: StreamOptions) -> Scale:
    increments = options.increments in ("gyro", "both", None)
    return Scale(
        _UNITS[options.gyro_unit or "rad/s"], STANDARD_GRAVITY, gyro_increments=increments, usual_rate_hz=1000.0
    )


def _infer(
    fields: Fields, scale: Scale, options: StreamOptions, rate_hz: float | None
) -> tuple[Scale, tuple[Finding, ...]]:
    if options.gyro_unit and options.increments:
        return scale, ()
    norm = float(np.linalg.norm(fields.gyro.mean(axis=0)))
    units = (options.gyro_unit,) if options.gyro_unit else tuple(_UNITS)
    kinds = (options.increments in ("gyro", "both"),) if options.increments else (True, False)
    fitting = [
        (unit, increments)
        for unit in units
        for increments in kinds
        if 1 / _FACTOR < norm * _UNITS[unit] * (rate_hz or 1.0 if increments else 1.0) / EARTH_RATE < _FACTOR
    ]
    unit, increments = fitting[0] if len(fitting) == 1 else (units[0], kinds[0])
    how = "the only choice that makes the rate Earth rate" if len(fitting) == 1 else "as the unit leaves the factory"
    words = f"{'angle per sample' if increments else 'rate'} in {unit[:3]}"
    found = Finding(
        "units_assumed", f"The rotation of the KVH frames is taken as {words}: {how}. Declare it to be sure."
    )
    return Scale(_UNITS[unit], scale.accel, increments, usual_rate_hz=scale.usual_rate_hz), (found,)


PROTOCOL = Protocol("kvh", 4, _starts, _whole, _layouts, _fields, scale=_scale, infer=_infer)
