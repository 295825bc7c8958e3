"""Layouts of many places: national encodings, units in other tongues, phones' parts of acceleration, clocks."""

from __future__ import annotations

import json
from datetime import datetime, timedelta

import numpy as np
from cases.field_layouts import SECONDS, joined, table
from cases.layouts import ACCEL, DPS, FLU, FLU_AXES, FRD, GYRO, ROWS, TIME, G, Layout, stamps, whole

RATES, FORCES = [joined(row)[:-1] for row in DPS], [joined(row, form="%.6f")[:-1] for row in ACCEL]
RADIANS = [joined(row, form="%.14f")[:-1] for row in GYRO]
SIX = ",".join(f"{name}_{axis} [{unit}]" for name, unit in (("gyr", "deg/s"), ("acc", "m/s^2")) for axis in "xyz")
#: Just before the minute, the hour and the day end.
LATE = datetime(2024, 3, 1, 23, 59, 56)
#: Right-forward-up of forward-right-down.
RFU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
GRAVITY = np.array([0.0, 0.0, -1.0])  # as Apple has it: down, in g
USER = -G @ RFU.T - GRAVITY


def titled(time: str, rate: str, force: str, sep: str = ",") -> str:
    return sep.join([time, *(rate.format(axis) for axis in "XYZ"), *(force.format(axis) for axis in "XYZ")])


def national(name: str, encoding: str, time: str, rate: str, force: str, sep: str = ",", **more: object) -> Layout:
    """A table whose titles are in an encoding of their own."""
    text = table(titled(time, rate, force, sep), SECONDS, RATES, FORCES)
    header, rows = text.split("\n", 1)
    return Layout(name, f"{header}\n{rows.replace(',', sep)}".encode(encoding), FRD, **more)  # type: ignore[arg-type]


def clocked(name: str, title: str, times: list[str], **more: object) -> Layout:
    """A table with units in its titles whose clock is the matter."""
    content = table(f"{title},{SIX}", times, RATES, FORCES).encode()
    return Layout(name, content, FRD, **more)  # type: ignore[arg-type]


def day(form: str) -> list[str]:
    """Times close to midnight, with milliseconds."""
    return stamps(lambda t: t.strftime(form) + f".{t.microsecond // 1000:03d}", LATE)


def apple(*titles: str) -> str:
    return ",".join(f"{title}{axis}{unit}" for title, unit in (each.split("|") for each in titles) for axis in "XYZ")


def parts(values: np.ndarray) -> list[str]:
    return [joined(row, form="%.9f")[:-1] for row in values]


def of_two_units() -> bytes:
    """Rows of two whole units in turn, as ArduPilot's log is exported; the second one has another bias."""
    rows = []
    for i, (t, w, f) in enumerate(zip(whole(1e6), GYRO, ACCEL, strict=True)):
        for unit in (0, 1):
            rows.append(f"{t},{unit},{joined(w + 1e-4 * unit, form='%.14f')}{joined(f, form='%.6f')}{i % 7}\n".replace(
                "\n", ",") + "35\n")  # fmt: skip
    return ("TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,T\n" + "".join(rows)).encode()


def hexadecimal(value: float, scale: float) -> str:
    return f"0x{round(value * scale) & 0xFFFFFFFF:08X}"


def with_units(i: int) -> str:
    sensors = (("gyro", DPS, "deg/s"), ("accel", ACCEL, "m/s^2"))
    axes = {name: dict(zip("xyz", values[i].tolist(), strict=True)) | {"unit": unit} for name, values, unit in sensors}
    return json.dumps({"ts": 1_700_000_000_000 + round(1e3 * TIME[i]), "imu": axes}) + "\n"


WORLDWIDE: list[Layout] = [
    national("cyrillic.csv", "cp1251", "Время (с)", "Угловая скорость {} (град/с)", "Ускорение {} (м/с2)", ";"),
    national("gbk.csv", "gbk", "时间(s)", "角速度{}(°/s)", "加速度{}(m/s2)", says="gbk"),
    national("shift_jis.csv", "shift_jis", "時刻[s]", "角速度{}[deg/s]", "加速度{}[m/s2]", says="shift_jis"),
    national("korean.csv", "cp949", "시간(초)", "각속도{}(도/초)", "가속도{}(m/s2)"),
    national("italian.csv", "utf-8", "tempo (s)", "velocità angolare {} (gradi/s)", "accelerazione {} (m/s^2)"),
    national("portuguese_latin.csv", "latin-1", "Tempo (s)", "Velocidade angular {} (graus/s)", "Aceleração {} (m/s2)"),
    national("dutch.csv", "utf-8", "Tijd (s)", "Hoeksnelheid {} (graden/s)", "Versnelling {} (m/s2)"),
    national("swedish.csv", "utf-8", "Tid (s)", "Vinkelhastighet {} (grader/s)", "Acceleration {} (m/s2)"),
    # Of gon or, in German, of degrees: physics proposes, the user agrees.
    national("german.csv", "utf-8", "Zeit (s)", "Drehrate {} (Grad/s)", "Beschleunigung {} (m/s2)", asks=True),
    Layout("apple.csv", table(apple("motionRotationRate|(rad/s)", "motionUserAcceleration|(G)", "motionGravity|(G)")
        .join(("timestamp(s),", "")), SECONDS, [joined(row, form="%.14f")[:-1] for row in GYRO @ RFU.T], parts(USER),
        parts(np.tile(GRAVITY, (ROWS, 1)))).encode(), ("--axes", "rfu"), says="specific force X..Z (g)"),
    Layout("apple_raw.csv", table("timestamp(s)," + apple("motionRotationRate|(rad/s)",
        "accelerometerAcceleration|(G)"), SECONDS, [joined(row, form="%.14f")[:-1] for row in GYRO @ RFU.T],
        parts(-G @ RFU.T)).encode(), ("--axes", "rfu")),
    Layout("android_parts.csv", table("time_ms," + apple("gyro_|(rad/s)", "linear_acceleration_|(m/s2)",
        "gravity_|(m/s2)"), whole(1e3), [joined(row, form="%.14f")[:-1] for row in GYRO * FLU], parts(ACCEL * FLU - [
        0, 0, 9.8]), parts(np.tile([0, 0, 9.8], (ROWS, 1)))).encode(), FLU_AXES),
    clocked("digits_of_day.csv", "UTC", day("%H%M%S"), says="hours, minutes, s"),
    clocked("zero_led.csv", "time", stamps(lambda t: t.strftime("%H%M%S.%f"), LATE - timedelta(hours=16))),
    clocked("day_of_year_time.csv", "stamp", day("061:%H:%M:%S")[:400] + [text.replace("061:", "062:") for text in day(
        "061:%H:%M:%S")[400:]], says="day of the year"),
    clocked("iso_of_year.csv", "UTC", stamps(lambda t: t.strftime("%Y-%jT%H:%M:%S.%fZ"), LATE)),
    clocked("day_part.csv", "doy", [f"{61.4986 + t / 86400:.11f}" for t in TIME], says="days"),
    clocked("year_part.csv", "decimal_year", [f"{2024.1680 + t / 86400 / 366:.15f}" for t in TIME], says="years"),
    clocked("short_counter.csv", "tick_ms", [str((62_000 + round(1e3 * t)) % 65536) for t in TIME]),
    clocked("unix_ms.csv", "unixtime_ms", whole(1e3, 17 * 10**11)),
    # Ticks of 32768 a second, which are no microseconds.
    clocked("crystal.csv", "timestamp_ticks", whole(32768), asks=True, fill=(("HZ", "100"),)),
    Layout("two_units.csv", of_two_units(), FRD, asks=True, says="the rows of I 0 alone"),
    # A flag that turns in every row is none of two units.
    Layout("turning.csv", table(f"time (s),index,{SIX}", SECONDS, [str(i % 2) for i in range(ROWS)], RATES, FORCES
        ).encode(), FRD),
    Layout("seven_bits.csv", table(f"Seq,{SIX}", [str(i % 128) for i in range(ROWS)], RATES, FORCES).encode(), FRD,
        asks=True, fill=(("HZ", "100"),)),
    Layout("sixes.csv", table("timestamp,x,y,z,x.1,y.1,z.1", whole(1e3, 77), FORCES, RATES).encode(), FRD, asks=True),
    Layout("hexadecimal.csv", table(titled("t_us", "g{}", "a{}"), whole(1e6), [",".join(
        hexadecimal(x, 3.6e7) for x in row) for row in DPS], [",".join(hexadecimal(x, 1e6) for x in row) for row in G]
        ).encode(), FRD, asks=True, fill=(("DEG_PER_S_IN_ONE_COUNT", f"{1 / 3.6e7:.15g}"),)),
    Layout("units_beside.jsonl", "".join(map(with_units, range(ROWS))).encode(), FRD),
    Layout("values.jsonl", "".join(json.dumps({"sensor": name, "t_ns": round(1e9 * TIME[i]), "values": values[i].tolist(
        )}) + "\n" for i in range(ROWS) for name, values in (("gyroscope", GYRO), ("accelerometer", ACCEL))).encode(),
        FRD, asks=True, says="joined on time"),
]  # fmt: skip
