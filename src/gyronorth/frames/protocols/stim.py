"""Datagrams of the STIM family (STIM300, 318, 320, 380H, 202, 210, 277H).

There is no sync byte: a datagram begins with its identifier and ends with a CRC-32, which covers the datagram filled
with zeros to a multiple of four bytes; these zeros are not sent. A start is tried at every identifier byte. The
configuration datagram (0xBC, 0xBD), sent at power-up, states ranges, units and the rate.

Sources: Safran Sensing data sheet TS1524 r27 and r31 (tables 5-16 and 5-20 to 5-23, section 7.5.2.2); facts in
vortexntnu/stim300-driver and cookednoodle/pystim300. Identifiers 0x98 to 0x9C and 0xAD to 0xAF are those of r27 (AUX),
0xF0 to 0xF7 those of r31 (PPS). Not verified against a real datagram: all of it; that the STIM202, 210 and 277H send
the same identifiers; by how much the counter moves from datagram to datagram (it is taken from the stream).

The data's axes are those marked on the unit; which of them points forward is the mounting.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gyronorth.arrays import Index, Mask
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.errors import InputError
from gyronorth.findings import Finding
from gyronorth.frames.checksums import column, crc_msb, int24
from gyronorth.frames.protocol import OTHER, Bytes, Fields, Protocol, Scale, StreamOptions

#: Parts of a datagram: r rate, a acceleration, i inclination, t their temperatures, x AUX or PPS.
PARTS = {
    0x90: "r", 0x91: "ra", 0x92: "ri", 0x93: "rai", 0x94: "rt", 0xA5: "rat", 0xA6: "rit", 0xA7: "rait",
    0x98: "rx", 0x99: "rax", 0x9A: "rix", 0x9B: "raix", 0x9C: "rtx", 0xAD: "ratx", 0xAE: "ritx", 0xAF: "raitx",
    0xF0: "rx", 0xF1: "rax", 0xF2: "rix", 0xF3: "raix", 0xF4: "rtx", 0xF5: "ratx", 0xF6: "ritx", 0xF7: "raitx",
}  # fmt: skip
#: Bytes between the identifier and the CRC of datagrams that are sent on a command or at power-up.
_SPECIAL = {
    0xB1: 15, 0xB3: 15, 0xB5: 15, 0xB7: 15, 0xBC: 21, 0xBD: 21, 0xBE: 16, 0xBF: 16, 0xD1: 35, 0xD2: 35,
}  # fmt: skip
_CONFIGURATION, _FACTS = (0xBC, 0xBD), -2
#: Scale of the gyro, powers of two per deg/s, and per deg for increments.
_RATE_BITS, _ANGLE_BITS = 14, 21
#: Scale of the accelerometer by its range, g: powers of two per g, and per m/s for increments.
_FORCE_BITS, _VELOCITY_BITS = {5: 20, 10: 19, 30: 18, 80: 16}, {5: 23, 10: 22, 30: 21, 80: 19}
_RANGES = {0b0000: 10, 0b0011: 5, 0b0100: 30, 0b0110: 80}
_RATES_HZ = (125.0, 250.0, 500.0, 1000.0, 2000.0)
#: Output units: per sample, and averaged over it; 0 is rate and acceleration.
_PER_SAMPLE, _AVERAGE = 0b001, 0b010
#: Status: bit 4 overload; bits 3, 6, 7 channel error, start-up, system integrity error.
_OVERLOAD, _FAULT = 0x10, 0xC8
#: At rest the specific force is this far from 1 g at most; and this close to it a choice of unit and range must bring
#: it to be told from the others: rates and increments are a quarter apart at the nearest.
_GRAVITY_SHARE, _GRAVITY_TELLS = 0.3, 0.08


def size_of(ident: int) -> int:
    """Bytes before the CRC."""
    if ident in _SPECIAL:
        return 1 + _SPECIAL[ident]
    parts = PARTS[ident]
    triads = len(set(parts) & set("rai"))
    return 1 + 10 * triads + (7 * triads if "t" in parts else 0) + (4 if "x" in parts else 0) + 3


_LENGTH = np.zeros(256, np.int64)
for _ident in (*PARTS, *_SPECIAL):
    _LENGTH[_ident] = size_of(_ident) + 4


def _starts(data: Bytes) -> tuple[Index, Index]:
    length = _LENGTH[data]
    start = np.flatnonzero(length)
    return start, length[start]


def _whole(rows: Bytes) -> Mask:
    size = rows.shape[1] - 4
    filled = np.zeros((len(rows), size + -size % 4), np.uint8)
    filled[:, :size] = rows[:, :size]
    return crc_msb(filled, 32, 0x04C11DB7, 0xFFFFFFFF) == column(rows, size, ">u4")


def _layouts(rows: Bytes) -> Index:
    ident = rows[:, 0].astype(np.int64)
    layout = np.where(np.isin(ident, list(PARTS)), ident, OTHER)
    return np.where(np.isin(ident, _CONFIGURATION), _FACTS, layout)


def _fields(rows: Bytes, layout: int) -> Fields:
    parts, at = PARTS[layout], 1
    values, status = {}, {}
    for part in parts.rstrip("x").rstrip("t"):
        values[part], status[part] = int24(rows, at).astype(float), rows[:, at + 9]
        at += 10
    temperature = None
    if "t" in parts:
        temperature = column(rows, at, ">i2", 3).mean(axis=1) / 2**8
    used = [status[part] for part in "ra" if part in status]
    all_status = np.bitwise_or.reduce(used)
    return Fields(
        gyro=values["r"],
        accel=values.get("a"),
        counter=rows[:, size_of(layout) - 3].astype(np.int64),
        counter_wrap=256,
        saturated=(all_status & _OVERLOAD) != 0,
        fault=(all_status & _FAULT) != 0,
        temperature=temperature,
    )


def _scale(_layout: int, facts: Sequence[Bytes], options: StreamOptions) -> Scale:
    if facts:
        return _scale_of(facts[-1][0], options)
    increments = options.increments or "none"
    return _scaled(increments in ("gyro", "both"), increments in ("accel", "both"), options.accel_range_g or 10.0)


def _scaled(gyro_increments: bool, accel_increments: bool, range_g: float) -> Scale:
    if range_g not in _FORCE_BITS:
        raise InputError(f"The accelerometer's range is {range_g:g} g; one of 5, 10, 30, 80 g is expected.")
    gyro = np.radians(2.0 ** -(_ANGLE_BITS if gyro_increments else _RATE_BITS))
    accel = 2.0 ** -_VELOCITY_BITS[int(range_g)]
    if not accel_increments:
        accel = STANDARD_GRAVITY * 2.0 ** -_FORCE_BITS[int(range_g)]
    return Scale(float(gyro), accel, gyro_increments, accel_increments, profile="stim300")


def _scale_of(configuration: Bytes, options: StreamOptions) -> Scale:
    """By a configuration datagram; byte 0 is its identifier (table 5-16)."""
    rate_code, gyro_unit, accel_unit = configuration[3] >> 5, configuration[5] & 0b0111, configuration[8] & 0b0111
    if gyro_unit == 0b011 or accel_unit in (0b011, 0b100):
        raise InputError(
            "The configuration datagram says that the unit sends integrated angle or velocity, which is no rate. "
            "Set it to angular rate and acceleration, or to increments."
        )
    gyro_increments, accel_increments = gyro_unit == _PER_SAMPLE, accel_unit == _PER_SAMPLE
    strange = [int(code) for code in (gyro_unit, accel_unit) if code not in (0, _PER_SAMPLE, _AVERAGE)]
    if strange and options.increments is None:
        raise InputError(
            f"The configuration datagram states the output unit {strange[0]:03b}, which is not known here. Declare "
            "--increments none, gyro, accel or both as the unit is set."
        )
    if strange:
        gyro_increments = options.increments in ("gyro", "both")
        accel_increments = options.increments in ("accel", "both")
    codes = configuration[17] >> 4, configuration[17] & 0b1111, configuration[18] >> 4
    ranges = {_RANGES.get(int(code)) for code in codes}
    if len(ranges) != 1 or None in ranges:
        raise InputError(
            f"The configuration datagram states the accelerometer ranges {sorted(map(str, ranges))} g; one range of "
            "5, 10, 30 or 80 g for all axes is expected."
        )
    rate_hz = _RATES_HZ[rate_code] if rate_code < len(_RATES_HZ) else None
    scale = _scaled(gyro_increments, accel_increments, float(ranges.pop() or 0))
    return replace(scale, rate_hz=rate_hz, stated=True)


def _infer(
    fields: Fields, scale: Scale, options: StreamOptions, rate_hz: float | None
) -> tuple[Scale, tuple[Finding, ...]]:
    """Without a configuration datagram: unit and range by the size of gravity, else rate and 10 g."""
    if scale.stated or (options.increments and options.accel_range_g):
        return scale, ()
    told = _by_gravity(fields, options, rate_hz)
    findings = ()
    if options.increments is None:
        per_sample = told is not None and told[1]
        how = "as gravity shows of the accelerometer" if told else "which nothing shows"
        findings = (
            Finding(
                "units_assumed",
                f"No configuration datagram was captured: the output is taken as "
                f"{'increments' if per_sample else 'rate and acceleration'}, {how}. Declare --increments to be sure.",
            ),
        )
        scale = _scaled(per_sample, per_sample, options.accel_range_g or 10.0)
    if fields.accel is None or options.accel_range_g:
        return scale, findings
    range_g = told[0] if told else 10
    how = "by the size of gravity" if told else "no range makes the specific force gravity"
    scale = _scaled(scale.gyro_increments, scale.accel_increments, range_g)
    found = Finding(
        "range_assumed", f"No configuration datagram: the accelerometer's range is taken as {range_g} g, {how}."
    )
    return scale, (*findings, found)


def _by_gravity(fields: Fields, options: StreamOptions, rate_hz: float | None) -> tuple[int, bool] | None:
    """Range, g, and whether the accelerometer's numbers are increments; None where no choice makes them gravity."""
    if fields.accel is None:
        return None
    counts = float(np.linalg.norm(fields.accel.mean(axis=0)))
    declared = options.increments in ("accel", "both")
    kinds = (False, True) if options.increments is None else (declared,)
    sizes = {(g, False): counts / 2.0**bits for g, bits in _FORCE_BITS.items()}
    if rate_hz is not None:
        sizes |= {(g, True): counts * rate_hz / STANDARD_GRAVITY / 2.0**bits for g, bits in _VELOCITY_BITS.items()}
    off = {
        choice: abs(size - 1)
        for choice, size in sizes.items()
        if choice[1] in kinds and choice[0] == (options.accel_range_g or choice[0])
    }
    best = min(off, key=off.__getitem__, default=None)
    limit = _GRAVITY_TELLS if len(kinds) > 1 else _GRAVITY_SHARE
    return best if best is not None and off[best] < limit else None


PROTOCOL = Protocol(
    "stim",
    1,
    _starts,
    _whole,
    _layouts,
    _fields,
    scale=_scale,
    infer=_infer,
    line_ends=True,
    message=lambda row: f"datagram 0x{row[0]:02X}",
)
