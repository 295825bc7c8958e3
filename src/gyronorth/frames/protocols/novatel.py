"""NovAtel logs RAWIMU (268), RAWIMUS (325), RAWIMUX (1461), RAWIMUSX (1462), as text and binary.

They hold increments per sample, z first and y negated; both are undone here, so that x, y, z are those of the IMU's
enclosure as SPAN sees it (x right, y forward, z up). RAWIMUX and RAWIMUSX name the type of the IMU, and with it
scale and rate; for the others the type must be declared. The time is that of GPS, in the week; it beats the rate of
the table.

Sources: docs.novatel.com, OEM7 logs of these names and "Raw IMU Scale Factors"; header lengths from the OEM7 manual;
the numbers of the IMU types as in the message database of `novatel-edie` (MIT). The decoder is tested against
`novatel-edie`; no real log was at hand. The status word differs between IMUs and is not read but for the error bit of
RAWIMUX and RAWIMUSX; frames marked as encrypted are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from zlib import crc32

import numpy as np

from gyronorth.arrays import Index, Mask
from gyronorth.errors import InputError
from gyronorth.frames.checksums import column
from gyronorth.frames.framing import windows
from gyronorth.frames.protocol import OTHER, Bytes, Fields, Protocol, Scale, StreamOptions, at_sync, u16, with_head
from gyronorth.frames.protocols.text import begins_with, columns_from_end, hex_at_end, line_starts, name_of

_RAWIMU, _RAWIMUS, _RAWIMUX, _RAWIMUSX = 268, 325, 1461, 1462
_NAMES = {b"RAWIMUA": _RAWIMU, b"RAWIMUSA": _RAWIMUS, b"RAWIMUXA": _RAWIMUX, b"RAWIMUSXA": _RAWIMUSX}
_TYPED = (_RAWIMUX, _RAWIMUSX)
_LONGEST_TEXT, _LONGEST_BINARY = 512, 4096
_SHORT_HEADER, _LONG_HEADER, _LONGEST_HEADER = 12, 28, 64
_WEEK_S = 604800.0
#: Bits of the information byte of RAWIMUX and RAWIMUSX.
_ERROR, _ENCRYPTED = 0x01, 0x02
_FOOT = 0.3048
#: NovAtel's CRC-32 is that of zlib, but with start 0 and without the final exclusive or.
_ONES = 0xFFFFFFFF
#: Added to the layout of lines of text.
_TEXT = 1_000_000_000
#: Stands for a type of IMU that is none.
_NO_TYPE = 999
#: Logs that are often set beside them; the corrected ones have Earth's rate taken off.
_LOGS = {
    37: "VERSION", 42: "BESTPOS", 43: "RANGE", 93: "RXSTATUS", 101: "TIME", 263: "INSATT", 319: "INSATTS",
    507: "INSPVA", 508: "INSPVAS", 812: "CORRIMUDATA", 813: "CORRIMUDATAS", 1429: "BESTGNSSPOS", 1465: "INSPVAX",
}  # fmt: skip


@dataclass(frozen=True)
class ImuType:
    """What a type of IMU behind a receiver sends."""

    number: int
    name: str
    gyro: float  # rad of one count
    accel: float  # m/s of one count
    rate_hz: float
    profile: str | None = None  # shipped sensor profile


def _hg(number: int, name: str, rate_hz: float = 100.0, feet: int = -27) -> ImuType:
    return ImuType(number, name, 2.0**-33, 2.0**feet * _FOOT, rate_hz)


_ARCSECOND = np.pi / 180 / 3600
IMU_TYPES: tuple[ImuType, ...] = (
    _hg(1, "HG1700_AG11"),
    _hg(4, "HG1700_AG17", feet=-26),
    _hg(5, "HG1900_CA29"),
    ImuType(8, "LN200", 2.0**-19, 2.0**-14, 200.0),
    ImuType(9, "LN200_400HZ", 2.0**-19, 2.0**-14, 400.0),
    _hg(11, "HG1700_AG58"),
    _hg(12, "HG1700_AG62", feet=-26),
    ImuType(13, "IMAR_FSAS", 0.1 * 2.0**-8 * _ARCSECOND, 0.05 * 2.0**-15, 200.0),
    ImuType(16, "KVH_COTS", 0.1 / (3600 * 256), 0.05 * 2.0**-15, 100.0),
    _hg(20, "HG1930_AA99"),
    ImuType(26, "ISA100C", 1e-9, 2e-8, 200.0, "isa100c"),
    _hg(27, "HG1900_CA50"),
    _hg(28, "HG1930_CA50"),
    ImuType(32, "STIM300", float(np.radians(2.0**-21)), 2.0**-22, 125.0, "stim300"),
    ImuType(33, "KVH_1750", 0.1 / (3600 * 256), 0.05 * 2.0**-15, 200.0),
    ImuType(39, "ISA100C_400HZ", 1e-9, 2e-8, 400.0, "isa100c"),
    ImuType(52, "LITEF_MICROIMU", 1e-9, 2e-8, 200.0),
    ImuType(56, "STIM300D", float(np.radians(2.0**-21)), 2.0**-22, 125.0, "stim300"),
    ImuType(58, "HG4930_AN01", 2.0**-33, 2.0**-29, 100.0, "hg4930"),
    ImuType(68, "HG4930_AN04", 2.0**-33, 2.0**-29, 200.0, "hg4930"),
    ImuType(69, "HG4930_AN04_400HZ", 2.0**-33, 2.0**-29, 400.0, "hg4930"),
)


def _starts(data: Bytes) -> tuple[Index, Index]:
    binary = with_head(data, at_sync(data, (0xAA, 0x44)), 10)
    short, long = (binary[data[binary + 2] == kind] for kind in (0x13, 0x12))
    short_length = _SHORT_HEADER + data[short + 3].astype(np.int64) + 4
    header = data[long + 3].astype(np.int64)
    long_length = header + u16(data, long + 8) + 4
    fits = (header >= _LONG_HEADER) & (header <= _LONGEST_HEADER) & (long_length <= _LONGEST_BINARY)
    mark = np.flatnonzero((data[:-1] == ord("%")) | (data[:-1] == ord("#")))
    mark = mark[(data[mark + 1] >= ord("A")) & (data[mark + 1] <= ord("Z"))]
    text, text_length = line_starts(data, mark, 8, _LONGEST_TEXT)
    start = np.concatenate((short, long[fits], text))
    length = np.concatenate((short_length, long_length[fits], text_length))
    order = np.argsort(start, kind="stable")
    return start[order], length[order]


def _whole(rows: Bytes) -> Mask:
    data, size = memoryview(rows.tobytes()), rows.shape[1]
    crc = [crc32(data[at : at + size - 4], _ONES) for at in range(0, len(data), size)]
    return np.array(crc, np.int64) ^ _ONES == column(rows, size - 4, "<u4")


def _layouts(rows: Bytes) -> Index:
    """1000 x number of the log + type of the IMU (0 where the log does not name it)."""
    log = column(rows, 4, "<u2").astype(np.int64)
    header = np.where(rows[:, 2] == 0x13, _SHORT_HEADER, rows[:, 3]).astype(np.int64)
    body = rows.shape[1] - header - 4
    imu = rows[np.arange(len(rows)), np.minimum(header + 1, rows.shape[1] - 1)].astype(np.int64)
    typed, plain = np.isin(log, _TYPED) & (body == 40), np.isin(log, (_RAWIMU, _RAWIMUS)) & (body == 40)
    return np.where(typed, log * 1000 + imu, np.where(plain, log * 1000, OTHER))


def _judge_lines(data: Bytes, start: Index, length: Index) -> tuple[Mask, Index]:
    """Which lines NAME,header;body*checksum are whole, and their layouts: the same, + `_TEXT`."""
    star, text = start + length - 9, data.tobytes()
    crc = [crc32(text[first:end], _ONES) for first, end in zip((start + 1).tolist(), star.tolist(), strict=True)]
    whole = np.array(crc, np.int64) ^ _ONES == hex_at_end(windows(data, star + 1, 8), 8)
    body = np.append(np.flatnonzero(data == ord(";")), len(data))
    body = body[np.searchsorted(body, start)]
    comma = np.flatnonzero(data == ord(","))
    first = np.searchsorted(comma, body)
    count = np.searchsorted(comma, star) - first
    layout = np.full(len(start), OTHER, np.int64)
    for name, log in _NAMES.items():
        typed = log in _TYPED
        named = np.flatnonzero(count == (10 if typed else 8))
        named = named[begins_with(data, start[named] + 1, name + b",")]
        imu = _small_numbers(data, comma[first[named]] + 1) if typed else np.zeros(len(named), np.int64)
        layout[named] = np.where(imu == _NO_TYPE, OTHER, _TEXT + log * 1000 + imu)
    return whole, layout


def _small_numbers(data: Bytes, start: Index) -> Index:
    """The number of one to three digits that begins at places of a buffer; `_NO_TYPE` where there is none."""
    field = windows(data, start, 4)
    size = np.argmax(field == ord(","), axis=1)  # 0: no field, or a longer one
    digit = field.astype(np.int64) - ord("0")
    number, good = np.zeros(len(start), np.int64), size > 0
    for place in range(3):
        within = place < size
        good &= ~within | ((digit[:, place] >= 0) & (digit[:, place] <= 9))
        number = np.where(within, 10 * number + digit[:, place], number)
    return np.where(good & (number < _NO_TYPE), number, _NO_TYPE)


def _fields(rows: Bytes, layout: int) -> Fields:
    typed = _log(layout) in _TYPED
    if layout >= _TEXT:
        body = np.argmax(rows == ord(";"), axis=1)
        table = columns_from_end(rows, -9, (-9, -8, *range(-6, 0)), begin=int(body.min()))
        week, second, counts = table[:, 0], table[:, 1], table[:, 2:]
        info = _information(rows, body + 1) if typed else np.zeros(len(rows), np.int64)
    else:
        at = _SHORT_HEADER if rows[0, 2] == 0x13 else int(rows[0, 3])
        info = rows[:, at].astype(np.int64) * typed
        week = (column(rows, at + 2, "<u2") if typed else column(rows, at, "<u4")).astype(float)
        second, counts = column(rows, at + 4, "<f8"), column(rows, at + 16, "<i4", 6).astype(float)
    usable = np.isfinite(counts).all(axis=1) & (np.abs(second) <= _WEEK_S) & (week >= 0) & (week < 10000)
    usable &= (info & _ENCRYPTED) == 0
    second, week = np.where(usable, second, 0.0), np.where(usable, week, 0.0)
    turned = np.array([1.0, -1.0, 1.0])
    return Fields(
        gyro=counts[:, [5, 4, 3]] * turned,
        accel=counts[:, [2, 1, 0]] * turned,
        ticks=np.round((week * _WEEK_S + second) * 1e6).astype(np.int64),
        tick=1e-6,
        fault=(info & _ERROR) != 0,
        usable=usable,
    )


def _information(lines: Bytes, at: Index) -> Index:
    """The information byte, two hexadecimal digits from there on; what is none counts as an error of the IMU."""
    three = lines[np.arange(len(lines))[:, None], at[:, None] + np.arange(3)]
    value = hex_at_end(three[:, :2], 2)
    return np.where((three[:, 2] == ord(",")) & (value >= 0), value, _ERROR)


def _log(layout: int) -> int:
    return layout % _TEXT // 1000


def _scale(layout: int, _facts: Sequence[Bytes], options: StreamOptions) -> Scale:
    names = ", ".join(imu.name for imu in IMU_TYPES)
    if _log(layout) in _TYPED:
        known = [imu for imu in IMU_TYPES if imu.number == layout % 1000]
        if not known:
            raise InputError(
                f"The NovAtel log names IMU type {layout % 1000}, whose scale is not known here. Known are {names}."
            )
    else:
        known = [imu for imu in IMU_TYPES if options.imu and imu.name == options.imu.upper()]
        if not known:
            raise InputError(
                f"The logs RAWIMU and RAWIMUS do not name the IMU, and {options.imu or 'none'} was declared; one of "
                f"{names} is expected. Declare it, or log RAWIMUSX, which names it."
            )
    imu = known[0]
    return Scale(imu.gyro, imu.accel, True, True, usual_rate_hz=imu.rate_hz, imu=imu.name, profile=imu.profile)


def _is_line(layout: int) -> bool:
    return layout >= _TEXT


def _rank(layout: int) -> int:
    return 0 if _log(layout) in _TYPED else 1


def _message(row: Bytes) -> str:
    if row[0] != 0xAA:
        return f"log {name_of(row)[1:]}"
    log = int(row[4]) | int(row[5]) << 8
    return f"log {_LOGS.get(log, log)}"


PROTOCOL = Protocol(
    "novatel",
    10,
    _starts,
    _whole,
    _layouts,
    _fields,
    judge_lines=_judge_lines,
    rank=_rank,
    scale=_scale,
    line_ends=True,
    lines=_is_line,
    message=_message,
)
