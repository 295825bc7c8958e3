"""Encoders of every protocol, written apart from the decoders: checksums by zlib and binascii, numbers by struct.

A `Case` is a simulated unit: frames, what they hold after quantisation in SI, and other messages of the same family.
"""

from __future__ import annotations

import binascii
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from gyronorth.frames import StreamOptions

G = 9.80665
#: Rates of a STIM, Hz, by the code in its configuration.
RATES_HZ = (125.0, 250.0, 500.0, 1000.0, 2000.0)
_REVERSED = bytes(int(f"{i:08b}"[::-1], 2) for i in range(256))


def crc32_msb(data: bytes) -> int:
    """04C11DB7, start all ones, highest bit first: zlib's CRC of the mirrored bytes, mirrored."""
    return int(f"{zlib.crc32(data.translate(_REVERSED)) ^ 0xFFFFFFFF:032b}"[::-1], 2)


def crc32_novatel(data: bytes) -> int:
    return zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF


def crc16_sbg(data: bytes) -> int:
    return int(f"{binascii.crc_hqx(data.translate(_REVERSED), 0):016b}"[::-1], 2)


def fletcher(data: bytes) -> bytes:
    first = second = 0
    for value in data:
        first = (first + value) & 0xFF
        second = (second + first) & 0xFF
    return bytes((first, second))


def xor_line(text: str) -> bytes:
    value = 0
    for character in text[1:].encode():
        value ^= character
    return f"{text}*{value:02X}\r\n".encode()


@dataclass(frozen=True)
class Case:
    """Frames of one simulated unit."""

    name: str
    protocol: str
    rate_hz: float
    gyro: np.ndarray  # (n, 3) rad/s, as sent
    accel: np.ndarray  # (n, 3) m/s^2
    frames: list[bytes]
    gyro_step: float  # rad/s, half of it is the largest error
    accel_step: float
    options: StreamOptions = field(default_factory=StreamOptions)
    others: tuple[bytes, ...] = ()
    preamble: bytes = b""  # what the unit sends at power-up
    knows_lost: str = "bytes"


def signal(n: int, up: tuple[float, float, float], noise: float = 1e-4) -> tuple[np.ndarray, np.ndarray]:
    """Rates (about Earth rate) and specific forces of a unit at rest whose z axis, or another, is `up`."""
    rng = np.random.default_rng(15)
    gyro = np.array([4e-5, -3e-5, -5e-5]) + noise * rng.standard_normal((n, 3))
    return gyro, G * np.array(up) + 0.01 * rng.standard_normal((n, 3))


def counts(values: np.ndarray, step: float, bits: int = 32) -> np.ndarray:
    whole = np.round(values / step).astype(np.int64)
    assert np.abs(whole).max() < 1 << (bits - 1)
    return whole


FRD, FLU, RFU = (0.0, 0.0, -1.0), (0.0, 0.0, 1.0), (0.0, 0.0, 1.0)


def _int24(values: np.ndarray) -> bytes:
    return b"".join(int(value).to_bytes(3, "big", signed=True) for value in values)


def stim_datagram(body: bytes, *, line_end: bool = False) -> bytes:
    crc = crc32_msb(body + bytes(-len(body) % 4))
    return body + crc.to_bytes(4, "big") + (b"\r\n" if line_end else b"")


def stim_configuration(rate_code: int, gyro_unit: int, accel_unit: int, range_code: int) -> bytes:
    payload = bytearray(21)
    payload[0], payload[1] = ord("A"), 7
    payload[2] = rate_code << 5 | 0b1010
    payload[4], payload[7] = 0x70 | gyro_unit, 0x70 | accel_unit
    payload[16], payload[17] = range_code << 4 | range_code, range_code << 4
    return stim_datagram(b"\xbc" + bytes(payload))


def stim(n: int = 1500, *, rate: float = 500.0, increments: bool = False, line_end: bool = False) -> Case:
    gyro, accel = signal(n, FRD)
    per = rate if increments else 1.0
    gyro_step = np.radians(2.0**-21 * rate if increments else 2.0**-14)
    accel_step = 2.0**-21 * rate if increments else G * 2.0**-18  # 30 g
    w, f = counts(gyro, gyro_step, 24), counts(accel, accel_step, 24)
    assert per > 0
    frames = []
    for i in range(n):
        body = b"\xa5" + _int24(w[i]) + b"\0" + _int24(f[i]) + b"\0"
        body += struct.pack(">hhhB", 5120, 5121, 5122, 0) * 2 + bytes(((4 * i) & 0xFF,)) + struct.pack(">H", 506)
        frames.append(stim_datagram(body, line_end=line_end))
    part = stim_datagram(b"\xb1" + bytes(15))
    preamble = stim_configuration(RATES_HZ.index(rate), 1 if increments else 0, 1 if increments else 0, 0b0100)
    return Case(
        "stim-increments" if increments else "stim", "stim", rate, w * gyro_step, f * accel_step, frames, gyro_step,
        accel_step, others=(part, stim_datagram(b"\xb5" + bytes(range(15)))), preamble=preamble, knows_lost="counter",
    )  # fmt: skip


def novatel_binary_frame(log: int, body: bytes, *, long: bool) -> bytes:
    if long:
        header = b"\xaa\x44\x12\x1c" + struct.pack(
            "<HBBHHBBHIIHH", log, 0, 0x20, len(body), 0, 100, 180, 2300, 0, 0, 0, 1
        )
    else:
        header = b"\xaa\x44\x13" + struct.pack("<BHHi", len(body), log, 2300, 0)
    return header + body + struct.pack("<I", crc32_novatel(header + body))


def novatel_text_frame(text: str) -> bytes:
    return f"{text}*{crc32_novatel(text[1:].encode()):08x}\r\n".encode()


def novatel(n: int = 1500, *, log: str = "RAWIMUSX", text: bool = True, rate: float = 200.0) -> Case:
    """ISA-100C: increments of 1e-9 rad and 2e-8 m/s at 200 Hz; z first and y negated."""
    gyro, accel = signal(n, RFU)
    gyro_step, accel_step = 1e-9 * rate, 2e-8 * rate
    w, f = counts(gyro, gyro_step), counts(accel, accel_step)
    number = {"RAWIMU": 268, "RAWIMUS": 325, "RAWIMUX": 1461, "RAWIMUSX": 1462}[log]
    typed, long = "X" in log, log in ("RAWIMU", "RAWIMUX")
    frames = []
    for i in range(n):
        second = 123456.0 + i / rate
        six = (f[i, 2], -f[i, 1], f[i, 0], w[i, 2], -w[i, 1], w[i, 0])
        if text:
            head = (
                f"#{log}A,COM1,0,79.5,FINESTEERING,2300,{second:.3f},02000020,0000,15000"
                if long
                else (f"%{log}A,2300,{second:.3f}")
            )
            start = f"00,26,2300,{second:.9f},00000000," if typed else f"2300,{second:.9f},00000000,"
            frames.append(novatel_text_frame(head + ";" + start + ",".join(str(value) for value in six)))
        else:
            start = struct.pack("<BBHdI", 0, 26, 2300, second, 0) if typed else struct.pack("<IdI", 2300, second, 0)
            frames.append(novatel_binary_frame(number, start + struct.pack("<6i", *six), long=long))
    others = (
        novatel_text_frame(
            "#TIMEA,COM1,0,50.5,FINESTEERING,2300,0.000,02000000,9924,15000;VALID,1.0e-09,2.0e-09,-17.9"
        ),
        novatel_text_frame(
            "%INSPVASA,2300,1.0;2300,1.0,51.1,-114.0,1000.0,0.0,0.0,0.0,0.1,0.2,270.0,INS_SOLUTION_GOOD"
        ),
        novatel_binary_frame(508, bytes(88), long=False),
        novatel_binary_frame(42, bytes(72), long=True),
    )
    options = StreamOptions() if typed else StreamOptions(imu="isa100c")
    return Case(
        f"novatel-{log}-{'text' if text else 'binary'}", "novatel", rate, w * gyro_step, f * accel_step, frames,
        gyro_step, accel_step, options, others, knows_lost="clock",
    )  # fmt: skip


def kvh(n: int = 1500, *, form: str = "A", increments: bool = True, rate: float = 1000.0) -> Case:
    gyro, accel = signal(n, FRD, noise=2e-5)
    sent = (gyro / rate if increments else gyro).astype(">f4")
    force = (accel / G).astype(">f4")
    frames = []
    for i in range(n):
        body = b"\xfe\x81\xff" + bytes((0x55 + "ABC".index(form),)) + sent[i].tobytes() + force[i].tobytes()
        if form == "B":
            body += struct.pack(">I", (4294900000 + round(1e6 / rate) * i) % (1 << 32))
        if form == "C":  # the temperature, or an axis of the magnetic field
            body += struct.pack(">f", (29.25, 0.1, -0.2, 0.4)[i % 4])
        body += struct.pack(">BB", 0x77, i % 128) + (b"" if form == "C" else struct.pack(">h", 29))
        frames.append(body + crc32_msb(body).to_bytes(4, "big"))
    options = StreamOptions(rate_hz=rate, gyro_unit="rad/s", increments="gyro" if increments else "none")
    return Case(
        f"kvh-{form}-{'angle' if increments else 'rate'}", "kvh", rate,
        sent.astype(float) * (rate if increments else 1.0), force.astype(float) * G, frames, 1e-12, 1e-9, options,
        knows_lost="counter",
    )  # fmt: skip


def sum16_frame(body: bytes) -> bytes:
    return body + struct.pack("<H", sum(struct.unpack(f"<{len(body) // 2}H", body)) & 0xFFFF)


def hg4930(n: int = 1500, *, rate: float = 100.0) -> Case:
    gyro, accel = signal(n, FRD)
    gyro_step, accel_step = 2.0**-33 * rate, 2.0**-27 * 0.3048 * rate
    w, f = counts(gyro, gyro_step), counts(accel, accel_step)
    head = struct.pack("<6hHH", 1, 2, 3, 4, 5, 6, 0x80F0, 0x0000)
    frames = [sum16_frame(b"\x0e\x02" + head + struct.pack("<6i", *w[i], *f[i])) for i in range(n)]
    control = sum16_frame(b"\x0e\x01" + head)
    return Case(
        "hg4930",
        "hg4930",
        rate,
        w * gyro_step,
        f * accel_step,
        frames,
        gyro_step,
        accel_step,
        StreamOptions() if rate == 100.0 else StreamOptions(rate_hz=rate),
        (control,),
    )


def sbg_frame(log: int, payload: bytes) -> bytes:
    body = bytes((log, 0)) + struct.pack("<H", len(payload)) + payload
    return b"\xff\x5a" + body + struct.pack("<H", crc16_sbg(body)) + b"\x33"


def sbg(n: int = 1500, *, short: bool = True, rate: float = 200.0) -> Case:
    gyro, accel = signal(n, FRD)
    gyro_step, accel_step = 1 / 67108864, 1 / 1048576
    frames = []
    if short:
        w, f = counts(gyro, gyro_step), counts(accel, accel_step)
        for i in range(n):
            time = (4294000000 + round(1e6 / rate) * i) % (1 << 32)
            frames.append(sbg_frame(44, struct.pack("<IH6ih", time, 0x03FF, *f[i], *w[i], 5120)))
        gyro, accel = w * gyro_step, f * accel_step
    else:
        gyro, accel = gyro.astype("<f4"), accel.astype("<f4")
        for i in range(n):
            time = (4294000000 + round(1e6 / rate) * i) % (1 << 32)
            frames.append(sbg_frame(3, struct.pack("<IH6ff6f", time, 0x03FF, *[0.0] * 6, 20.0, *accel[i], *gyro[i])))
        gyro, accel, gyro_step, accel_step = gyro.astype(float), accel.astype(float), 1e-12, 1e-9
    others = (sbg_frame(1, bytes(22)), sbg_frame(6, bytes(32)))
    return Case(
        f"sbg-{'short' if short else 'data'}", "sbg", rate, gyro, accel, frames, gyro_step, accel_step, others=others,
        knows_lost="clock",
    )  # fmt: skip


def anpp_frame(packet: int, data: bytes) -> bytes:
    rest = bytes((packet, len(data))) + struct.pack("<H", binascii.crc_hqx(data, 0xFFFF))
    return bytes((((sum(rest) ^ 0xFF) + 1) & 0xFF,)) + rest + data


def anpp(n: int = 1500, *, rate: float = 100.0) -> Case:
    gyro, accel = (values.astype("<f4") for values in signal(n, FRD))
    frames = [anpp_frame(28, struct.pack("<12f", *accel[i], *gyro[i], 1, 2, 3, 25.0, 101325, 25.0)) for i in range(n)]
    return Case(
        "anpp", "anpp", rate, gyro.astype(float), accel.astype(float), frames, 1e-12, 1e-9, StreamOptions(rate_hz=rate),
        (anpp_frame(20, bytes(100)), anpp_frame(3, bytes(12))),
    )  # fmt: skip


def vectornav_frame(groups: int, masks: tuple[int, ...], payload: bytes) -> bytes:
    body = bytes((groups,)) + b"".join(struct.pack("<H", mask) for mask in masks) + payload
    return b"\xfa" + body + struct.pack(">H", binascii.crc_hqx(body, 0))


def vectornav(n: int = 1500, *, delta: bool = True, rate: float = 100.0) -> Case:
    """Common: TimeStartup and a wrong AngularRate; IMU: UncompAccel, UncompGyro, Temp, and DeltaTheta and DeltaVel."""
    gyro, accel = signal(n, FRD)
    interval = float(np.float32(1 / rate))
    turn, speed = np.degrees(gyro * interval).astype("<f4"), (accel * interval).astype("<f4")
    raw, force = gyro.astype("<f4"), accel.astype("<f4")
    frames = []
    for i in range(n):
        common = struct.pack("<Q3f", 10**9 + round(1e9 / rate) * i, 0.5, 0.5, 0.5)
        imu = force[i].tobytes() + raw[i].tobytes() + struct.pack("<f", 25.0)
        if delta:
            imu += struct.pack("<f", interval) + turn[i].tobytes() + speed[i].tobytes()
        frames.append(vectornav_frame(0b101, (0x0021, 0x00DC if delta else 0x001C), common + imu))
    if delta:
        raw, force = np.radians(turn.astype(float)) / interval, speed.astype(float) / interval
    return Case(
        f"vectornav-{'delta' if delta else 'raw'}", "vectornav", rate, raw.astype(float), force.astype(float), frames,
        1e-12, 1e-9, others=(vectornav_frame(0b1000, (0x000C,), bytes(3)),), knows_lost="clock",
    )  # fmt: skip


def vectornav_ascii(n: int = 1500, *, rate: float = 40.0) -> Case:
    gyro, accel = signal(n, FRD)
    w, f = counts(gyro, 1e-6), counts(accel, 1e-3)
    lines = [
        xor_line(
            f"$VNIMU,+01.0640,-00.2531,+03.0614,{f[i, 0] / 1e3:+07.3f},{f[i, 1] / 1e3:+07.3f},{f[i, 2] / 1e3:+07.3f},"
            f"{w[i, 0] / 1e6:+010.6f},{w[i, 1] / 1e6:+010.6f},{w[i, 2] / 1e6:+010.6f},+15.5,+101.325"
        )
        for i in range(n)
    ]
    return Case(
        "vectornav-ascii", "vectornav-ascii", rate, w * 1e-6, f * 1e-3, lines, 1e-6, 1e-3, StreamOptions(rate_hz=rate),
        (xor_line("$VNYMR,-022.302,-006.402,-005.432,+01.0670,-00.2568,+03.0696,-00.8,+01.0,-09.7,+0.0,+0.0,+0.0"),),
    )  # fmt: skip


def mip_frame(fields: list[tuple[int, bytes]], descriptor_set: int = 0x80) -> bytes:
    payload = b"".join(bytes((len(data) + 2, name)) + data for name, data in fields)
    body = b"\x75\x65" + bytes((descriptor_set, len(payload))) + payload
    return body + fletcher(body)


def mip(n: int = 1500, *, delta: bool = True, rate: float = 250.0) -> Case:
    gyro, accel = signal(n, FRD)
    scale = 1 / rate if delta else 1.0
    w, f = (gyro * scale).astype(">f4"), (accel * scale / G).astype(">f4")
    frames = []
    for i in range(n):
        fields = [(0xD5, struct.pack(">Q", round(1e9 / rate) * i)), (0x08 if delta else 0x04, f[i].tobytes())]
        fields += [(0x07 if delta else 0x05, w[i].tobytes()), (0x18, struct.pack(">H", 0x0100))]
        frames.append(mip_frame(fields))
    return Case(
        f"mip-{'delta' if delta else 'scaled'}", "mip", rate, w.astype(float) / scale, f.astype(float) * G / scale,
        frames, 1e-12, 1e-9, others=(mip_frame([(0x05, bytes(14))], 0x82), mip_frame([(0x06, bytes(12))])),
        knows_lost="clock",
    )  # fmt: skip


def xbus_frame(blocks: list[tuple[int, bytes]], message: int = 0x36) -> bytes:
    data = b"".join(struct.pack(">HB", name, len(part)) + part for name, part in blocks)
    length = bytes((len(data),)) if len(data) < 255 else b"\xff" + struct.pack(">H", len(data))
    body = b"\xff" + bytes((message,)) + length + data
    return b"\xfa" + body + bytes((-sum(body) & 0xFF,))


def _fixed_16_32(values: np.ndarray) -> bytes:
    parts = b""
    for value in values:
        whole = round(float(value) * 2**32)
        parts += struct.pack(">Ih", whole & 0xFFFFFFFF, whole >> 32)
    return parts


def xbus(n: int = 1500, *, form: str = "dq", rate: float = 100.0) -> Case:
    gyro, accel = signal(n, FLU)
    gyro_step, accel_step = 1e-9, 1e-9
    frames = []
    for i in range(n):
        blocks = [(0x1020, struct.pack(">H", (65000 + i) & 0xFFFF)), (0x1060, struct.pack(">I", round(1e4 / rate) * i))]
        if form == "dq":
            half = gyro[i] / rate / 2
            blocks.append((0x8033, struct.pack(">4d", np.cos(np.linalg.norm(half)), *half)))
            blocks.append((0x4013, struct.pack(">3d", *(accel[i] / rate))))
        elif form == "16.32":
            blocks += [(0x8022, _fixed_16_32(gyro[i])), (0x4022, _fixed_16_32(accel[i]))]
        else:
            blocks += [(0x8021, struct.pack(">3i", *np.round(gyro[i] * 2**20).astype(int)))]
            blocks += [(0x4021, struct.pack(">3i", *np.round(accel[i] * 2**20).astype(int)))]
            gyro_step = accel_step = 2.0**-20
        blocks.append((0xE020, struct.pack(">I", 0x3)))
        frames.append(xbus_frame(blocks))
    return Case(
        f"xbus-{form}", "xbus", rate, gyro, accel, frames, gyro_step, accel_step,
        others=(xbus_frame([(0x2010, bytes(16))]), xbus_frame([], 0x31), xbus_frame([(0x7010, bytes(280 // 2))] * 2)),
        knows_lost="counter",
    )  # fmt: skip


def inertial_labs_frame(types: bytes, data: bytes) -> bytes:
    body = b"\x01\x95" + struct.pack("<H", 4 + 1 + len(types) + len(data) + 2) + bytes((len(types),)) + types + data
    return b"\xaa\x55" + body + struct.pack("<H", sum(body) & 0xFFFF)


def inertial_labs(n: int = 1500, *, rate: float = 200.0) -> Case:
    gyro, accel = signal(n, RFU)
    gyro_step, accel_step = np.radians(1e-5), 1e-6 * G
    w, f = counts(gyro, gyro_step), counts(accel, accel_step)
    frames = []
    for i in range(n):
        data = struct.pack("<IH3i3i3hh", 604_799_000 + round(1000 * i / rate), 2300, *f[i], *w[i], 1, 2, 3, 234)
        wrapped = struct.pack("<I", (604_799_000 + round(1000 * i / rate)) % 604_800_000)
        frames.append(inertial_labs_frame(bytes((0x01, 0x3C, 0x23, 0x21, 0x24, 0x52)), wrapped + data[4:]))
    return Case(
        "inertial-labs", "inertial-labs", rate, w * gyro_step, f * accel_step, frames, gyro_step, accel_step,
        others=(inertial_labs_frame(bytes((0x01, 0x07)), bytes(10)),), knows_lost="clock",
    )  # fmt: skip


def anello(n: int = 1500, *, rate: float = 200.0) -> Case:
    gyro, accel = signal(n, FLU)
    gyro_step, accel_step = np.radians(1e-6), 1e-5 * G
    w, f = counts(gyro, gyro_step), counts(accel, accel_step)
    lines = []
    for i in range(n):
        acc = ",".join(f"{value / 1e5:.5f}" for value in f[i])
        optical = ",".join(f"{value / 1e6:.6f}" for value in w[i])
        time = 318214.937 + 1000 * i / rate
        lines.append(xor_line(f"#APIMU,{time:.3f},0.000,{acc},-0.0817,0.0013,-0.0038,{optical},0.1,0.2,0.3,47.0547"))
    others = (xor_line("#APHDG,31527.383,1362269876750000128,2.13,1.60,3.23,4.19,36.92845,0.2796,4.00156,303"),)
    return Case(
        "anello", "anello", rate, w * gyro_step, f * accel_step, lines, gyro_step, accel_step, others=others,
        knows_lost="clock",
    )  # fmt: skip


def x3_frame(kind: int, payload: bytes) -> bytes:
    body = bytes((kind, len(payload))) + payload
    return b"\xc5\x50" + body + fletcher(body)


def anello_x3(n: int = 1500, *, rate: float = 200.0) -> Case:
    gyro, accel = signal(n, FRD)
    gyro_step, accel_step = np.radians(1e-7), 8 / 2**15 * G
    w, f = counts(gyro, gyro_step), counts(accel, accel_step)
    frames = []
    for i in range(n):
        payload = struct.pack("<QQ3h3h3i", round(1e9 / rate) * i, 0, *f[i], 1, 2, 3, *w[i])
        frames.append(x3_frame(253, payload + struct.pack("<3hhHHBBB", 4, 5, 6, 2500, 8 << 11 | 400, 200, 0, 0, 0)))
    return Case(
        "anello-x3", "anello-x3", rate, w * gyro_step, f * accel_step, frames, gyro_step, accel_step,
        others=(x3_frame(251, bytes(20)),), knows_lost="clock",
    )  # fmt: skip


#: Every form of every protocol; each takes the number of frames and, by name, their rate.
CASES: dict[str, Callable[..., Case]] = {
    "stim": stim,
    "stim-increments": partial(stim, increments=True, line_end=True),
    "novatel-RAWIMUSX-text": novatel,
    "novatel-RAWIMUSX-binary": partial(novatel, text=False),
    "novatel-RAWIMUX-text": partial(novatel, log="RAWIMUX"),
    "novatel-RAWIMUX-binary": partial(novatel, log="RAWIMUX", text=False),
    "novatel-RAWIMUS-text": partial(novatel, log="RAWIMUS"),
    "novatel-RAWIMU-binary": partial(novatel, log="RAWIMU", text=False),
    "kvh-A-angle": kvh,
    "kvh-A-rate": partial(kvh, increments=False),
    "kvh-B-angle": partial(kvh, form="B"),
    "kvh-C-angle": partial(kvh, form="C"),
    "hg4930": hg4930,
    "sbg-short": sbg,
    "sbg-data": partial(sbg, short=False),
    "anpp": anpp,
    "vectornav-delta": vectornav,
    "vectornav-raw": partial(vectornav, delta=False),
    "vectornav-ascii": vectornav_ascii,
    "mip-delta": mip,
    "mip-scaled": partial(mip, delta=False),
    "xbus-dq": xbus,
    "xbus-12.20": partial(xbus, form="12.20"),
    "xbus-16.32": partial(xbus, form="16.32"),
    "inertial-labs": inertial_labs,
    "anello": anello,
    "anello-x3": anello_x3,
}
