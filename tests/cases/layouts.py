"""One still unit in the layouts that people have: what stands in each file, and how it must be read.

Truth of every file: latitude 48 deg, heading 60 deg, level, 100 Hz, `ROWS` samples, unless the layout says otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np

from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY

ROWS, RATE_HZ = 800, 100.0
LATITUDE, HEADING = np.radians(48.0), np.radians(60.0)
OURS = "t,w_x,w_y,w_z,f_x,f_y,f_z"
STATED = ("# gyro_unit: deg/s", "# accel_unit: m/s2", "# axes: frd")
TITLED = "Time (s),Gyro X (deg/s),Gyro Y (deg/s),Gyro Z (deg/s),Acc X (m/s^2),Acc Y (m/s^2),Acc Z (m/s^2)"
FLU = np.array([1.0, -1.0, -1.0])
AXES = ("forward", "right", "down")


@dataclass(frozen=True)
class Layout:
    """A file and what must become of it."""

    name: str  # of the file
    content: bytes
    options: tuple[str, ...] = ()  # what the user says at the first try
    asks: bool = False  # the first try is refused, and the line that begins with Try is followed
    fill: tuple[tuple[str, str], ...] = ()  # what only the user knows: words of that line and their values
    accel: bool = True
    rate_hz: float = RATE_HZ
    rows: int = ROWS
    says: str = ""  # what `info` must tell of the reading


def truth(rows: int = ROWS, rate_hz: float = RATE_HZ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, s, angular rate, rad/s, and specific force, m/s^2, forward-right-down."""
    rng = np.random.default_rng(1)
    north, down = EARTH_RATE * np.cos(LATITUDE), -EARTH_RATE * np.sin(LATITUDE)
    rate = np.array([north * np.cos(HEADING), -north * np.sin(HEADING), down])
    gyro = rate + rng.normal(0, 2e-6, (rows, 3))
    accel = np.array([0, 0, -STANDARD_GRAVITY]) + rng.normal(0, 2e-3, (rows, 3))
    return np.arange(rows) / rate_hz, gyro, accel


TIME, GYRO, ACCEL = truth()
DPS = np.degrees(GYRO)
G = ACCEL / STANDARD_GRAVITY
PLAIN = (TIME, *DPS.T, *ACCEL.T)
FORMATS = ("%.3f", "%.10f", "%.10f", "%.10f", "%.6f", "%.6f", "%.6f")
START = datetime(2024, 3, 1, 11, 58)


def text(
    header: Sequence[str],
    columns: Sequence[Sequence[float] | Sequence[str] | np.ndarray] = PLAIN,
    formats: Sequence[str] = FORMATS,
    *,
    sep: str = ",",
    end: str = "\n",
    encoding: str = "utf-8",
    foot: str = "",
) -> bytes:
    """Header lines and rows."""
    line = sep.join(formats)
    rows = [line % row for row in zip(*columns, strict=True)]
    return (end.join([*header, *rows]) + end + foot).encode(encoding)


def stamps(form: Callable[[datetime], str], start: datetime = START) -> list[str]:
    """Times as texts."""
    return [form(start + timedelta(seconds=float(time))) for time in TIME]


def whole(scale: float, first: int = 0) -> list[str]:
    """Times as whole numbers."""
    return [str(first + round(time * scale)) for time in TIME]


def titled(*titles: str) -> list[str]:
    """A header."""
    return [",".join(titles)]


def with_time(times: Sequence[str] | np.ndarray) -> tuple[Sequence[str] | np.ndarray, ...]:
    """The plain columns with another time."""
    return (times, *DPS.T, *ACCEL.T)


SI = (TIME, *GYRO.T, *ACCEL.T)
SI_FORMATS = ("%.3f", "%.14f", "%.14f", "%.14f", "%.6f", "%.6f", "%.6f")
TEXT_TIME = ("%s", *FORMATS[1:])
TEXT_TIME_SI = ("%s", *SI_FORMATS[1:])
FRD, FLU_AXES = ("--axes", "frd"), ("--axes", "flu")


def of_the_sniffer() -> list[Layout]:
    """Encoding, delimiter, decimal sign, quotes, preamble, header, units, blanks, comments, footers."""
    spaced = ["%10.3f", *["%17.9e"] * 3, *["%12.5f"] * 3]
    comma = text([TITLED.replace(",", ";")], sep=";").replace(b".", b",")
    quoted = "\n".join(
        ",".join(f'"{fmt % value}"' for value, fmt in zip(row, FORMATS, strict=True))
        for row in zip(*PLAIN, strict=True)
    )
    sigma = text([TITLED.replace(",", "\t")], sep="\t").replace(b".", b",")
    return [
        Layout("base.csv", text([*STATED, OURS])),
        Layout("titled.csv", text([TITLED]), FRD, says="gyro: Gyro X..Z (deg/s)"),
        Layout("tabs.txt", text([TITLED.replace(",", "\t")], sep="\t"), FRD, says="tabs"),
        Layout("tabs_ours.tsv", text([OURS.replace(",", "\t")], sep="\t"), FRD, asks=True),
        Layout("bars.txt", text([TITLED.replace(",", "|")], sep="|"), FRD),
        Layout("spaces.txt", text([], formats=spaced, sep=" "), FRD, asks=True),
        Layout("spaces_header.txt", text(["t wx wy wz fx fy fz"], formats=spaced, sep=" "), FRD, asks=True),
        Layout("aligned.dat", text(["#  t   wx   wy   wz   ax   ay   az"], formats=spaced, sep="  "), FRD, asks=True),
        Layout("semicolon.csv", text([OURS.replace(",", ";")], sep=";"), FRD, asks=True, says="semicolons"),
        Layout("semicolon_comma.csv", comma, FRD, says="decimal commas"),
        Layout("tab_comma.txt", sigma, FRD, says="decimal commas"),
        Layout("quoted_comma.csv", f"{TITLED}\n{quoted.replace('.', ',')}\n".encode(), FRD, says="decimal commas"),
        Layout("quoted.csv", f'"{TITLED.replace(",", chr(34) + "," + chr(34))}"\n{quoted}\n'.encode(), FRD),
        Layout("utf16.csv", text([*STATED, OURS], encoding="utf-16"), says="UTF-16"),
        Layout("utf16be.csv", b"\xfe\xff" + text([TITLED], encoding="utf-16-be"), FRD, says="UTF-16"),
        Layout("utf16_no_mark.csv", text([TITLED], encoding="utf-16-le"), FRD, says="UTF-16"),
        Layout("bom.csv", b"\xef\xbb\xbf" + text([TITLED]), FRD),
        Layout("latin1.csv", text([TITLED.replace("deg/s", "°/s").replace("^2", "²")], encoding="latin-1"), FRD),
        Layout("crcrlf.csv", text([*STATED, OURS], end="\r\r\n")),
        Layout("cr.csv", text([TITLED], end="\r"), FRD),
        Layout("crlf.csv", text([TITLED], end="\r\n"), FRD),
        Layout("blank_between.csv", text([*STATED, OURS], end="\n\n")),
        Layout("blank_first.csv", b"\n\n" + text([TITLED]), FRD),
        Layout("trailing.csv", text([TITLED + ","], end=",\n").replace(b",,\n", b",\n", 1), FRD),
        Layout("preamble.csv", text(["LOGGER v3", "Serial:;00000", "Sample Rate,100Hz", "", "DATA_START", TITLED]), FRD,
               says="4 lines of preamble"),
        Layout("preamble_numbers.csv", text(["Unit 7", "Range,2000", "Bandwidth,50", TITLED]), FRD),
        Layout("percent.txt", text(["% static run", "% t wx wy wz fx fy fz"], sep=" "), FRD, asks=True),
        Layout("slashes.txt", text(["// static run", "// " + TITLED]), FRD),
        Layout("marked_header.csv", text(["#" + TITLED]), FRD),
        Layout("comment_within.csv", text([*STATED, OURS]).replace(b"\n5.000", b"\n# 5 s\n5.000")),
        Layout("footer_comment.csv", text([*STATED, OURS], foot="# end of log\n")),
        Layout("footer.csv", text([TITLED], foot="END OF DATA\nTotal samples: 1500\n"), FRD, says="2 lines of footer"),
        Layout("units_row.csv", text(["Time,GyroX,GyroY,GyroZ,AccX,AccY,AccZ",
               "s,deg/s,deg/s,deg/s,m/s^2,m/s^2,m/s^2"]), FRD, says="a row of units"),
        Layout("units_row_brackets.csv", text(["Time,GyroX,GyroY,GyroZ,AccX,AccY,AccZ",
               "[ms],[rad/s],[rad/s],[rad/s],[g],[g],[g]"], (whole(1e3), *GYRO.T, *G.T), TEXT_TIME_SI), FRD),
        Layout("no_time.csv", text(titled(*TITLED.split(",")[1:]), PLAIN[1:], FORMATS[1:]), FRD, asks=True,
               fill=(("HZ", "100"),)),
        Layout("rate_in_preamble.csv", text(["Sampling rate: 100 Hz", *titled(*TITLED.split(",")[1:])], PLAIN[1:],
               FORMATS[1:]), FRD),
        Layout("more_columns.csv", text([TITLED + ",Temp (degC),Mag X (uT),Mag Y (uT),Mag Z (uT),Roll (deg),Status"],
               (*PLAIN, *[np.full(ROWS, 20.5)] * 5, ["ok"] * ROWS), (*FORMATS, *["%.1f"] * 5, "%s")), FRD),
        Layout("text_first.csv", text(["Type," + TITLED], (["IMU"] * ROWS, *PLAIN), ("%s", *FORMATS)), FRD),
        Layout("sep_line.csv", text(["sep=;", TITLED.replace(",", ";")], sep=";"), FRD),
    ]  # fmt: skip


def of_titles() -> list[Layout]:
    """Names of columns and units in them."""

    def names(gyro: str, accel: str, time: str = "time") -> list[str]:
        axes = ("x", "y", "z")
        return titled(time, *(gyro.replace("?", a).replace("!", a.upper()) for a in axes),
                      *(accel.replace("?", a).replace("!", a.upper()) for a in axes))  # fmt: skip

    si, g = (SI, SI_FORMATS), ((TIME, *DPS.T, *G.T), FORMATS)
    mg = ((TIME, *(1e3 * DPS).T, *(1e3 * G).T), FORMATS)
    return [
        Layout("gx_dps.csv", text(names("g?_dps", "a?_g"), *g), FRD),
        Layout("gyro_rads.csv", text(names("gyro_?_rads", "accel_?_mps2"), *si), FRD),
        Layout("gyro_rad_s.csv", text(names("gyro_?_rad_s", "acc_?_m_s2"), *si), FRD),
        Layout("brackets.csv", text(names("GYR_![°/s]", "ACC_![m/s²]", "Time[s]")), FRD),
        Layout("slash.csv", text(names("Gyr_!/(deg/s)", "Acc_!/(m/s^2)", "t/s")), FRD),
        Layout("comma_unit.txt", text(["\t".join(names("Gyro !; deg/s".replace(";", ","), "Accel !, g", "Time, s")[0]
               .replace(", ", "@").split(",")).replace("@", ", ")], *g, sep="\t"), FRD),
        Layout("ang_rate.csv", text(names("Angular Rate ! [rad/sec]", "Acceleration ! [m/sec^2]", "Time [sec]"), *si),
               FRD),
        Layout("omega.csv", text(names("omega_? (rad/s)", "f_? (m/s2)", "t (s)"), *si), FRD),
        Layout("specific_force.csv", text(names("angular_velocity_? [rad/s]", "specific_force_? [m/s^2]"), *si), FRD),
        Layout("imu_prefix.csv", text(names("imu.gyro.? (deg/s)", "imu.accel.? (g)", "imu.time (s)"), *g), FRD),
        Layout("mdps.csv", text(names("GYRO_! [mdps]", "ACC_! [mg]"), *mg), FRD),
        Layout("axis_first.csv", text(names("! Gyro (deg/s)", "! Accel (g)"), *g), FRD),
        Layout("indices.csv", text(titled("t", *(f"gyro[{i}] (deg/s)" for i in range(3)),
               *(f"accel[{i}] (g)" for i in range(3))), *g), FRD),
        Layout("indices_from_1.csv", text(titled("t", "w1 (deg/s)", "w2 (deg/s)", "w3 (deg/s)", "a1 (g)", "a2 (g)",
               "a3 (g)"), *g), FRD),
        Layout("no_units.csv", text(names("GyroX".replace("X", "!"), "Accel!")), FRD, asks=True),
        Layout("no_units_g.csv", text(names("g?", "a?"), *g), FRD, asks=True),
        Layout("wx_fx.csv", text(names("w?", "f?", "t"), *si), FRD, asks=True),
        Layout("two_gyros.csv", text(titled("t", *(f"gyro1_{a} (deg/s)" for a in "xyz"),
               *(f"gyro2_{a} (deg/s)" for a in "xyz"), *(f"acc_{a} (m/s2)" for a in "xyz")),
               (TIME, *DPS.T, *DPS.T, *ACCEL.T), ("%.3f", *["%.10f"] * 6, *["%.6f"] * 3)), FRD, asks=True),
        Layout("bias_columns.csv", text([TITLED + ",gyro_bias_x,gyro_bias_y,gyro_bias_z,acc_std_x,acc_std_y,acc_std_z"],
               (*PLAIN, *[np.zeros(ROWS)] * 6), (*FORMATS, *["%.1f"] * 6)), FRD),
        Layout("increments.csv", text(titled("t", *(f"delta_theta_{a} (rad)" for a in "xyz"),
               *(f"delta_v_{a} (m/s)" for a in "xyz")), (TIME, *(GYRO / 100).T, *(ACCEL / 100).T),
               ("%.3f", *["%.16f"] * 3, *["%.9f"] * 3)), FRD),
    ]  # fmt: skip


def of_times() -> list[Layout]:
    """Clocks."""
    fields = TITLED.split(",")[1:]
    ours = [*STATED, OURS]
    return [
        Layout("iso.csv", text(titled("timestamp", *fields), with_time(stamps(lambda t: t.isoformat(
            timespec="milliseconds") + "Z")), TEXT_TIME), FRD),
        Layout("iso_offset.csv", text(titled("Time", *fields), with_time(stamps(lambda t: t.isoformat(
            timespec="microseconds") + "+02:00")), TEXT_TIME), FRD),
        Layout("date_blank_time.csv", text(titled("Time", *fields), with_time(stamps(lambda t: t.strftime(
            "%Y-%m-%d %H:%M:%S.%f"))), TEXT_TIME), FRD),
        Layout("us_date.csv", text(titled("Time", *fields), with_time(stamps(lambda t: t.strftime(
            "%m/%d/%Y %H:%M:%S.%f"))), TEXT_TIME), FRD),
        Layout("german_date.csv", text([";".join(["Zeit Time", *fields])], with_time(stamps(lambda t: t.strftime(
            "%d.%m.%Y %H:%M:%S.%f"))), TEXT_TIME, sep=";"), FRD),
        Layout("time_of_day.csv", text(titled("Time", *fields), with_time(stamps(lambda t: t.strftime(
            "%H:%M:%S.%f"))), TEXT_TIME), FRD),
        Layout("midnight.csv", text(titled("Time", *fields), with_time(stamps(lambda t: t.strftime("%H:%M:%S.%f"),
            datetime(2024, 3, 1, 23, 59, 55))), TEXT_TIME), FRD),
        Layout("date_and_time.csv", text(titled("Date", "Time", *fields), (stamps(lambda t: t.strftime("%Y-%m-%d")),
            *with_time(stamps(lambda t: t.strftime("%H:%M:%S.%f")))), ("%s", *TEXT_TIME)), FRD),
        Layout("date_time_blanks.txt", text(["Date Time gx_dps gy_dps gz_dps ax_mps2 ay_mps2 az_mps2"],
            (stamps(lambda t: t.strftime("%Y/%m/%d")), *with_time(stamps(lambda t: t.strftime("%H:%M:%S.%f")))),
            ("%s", *TEXT_TIME), sep=" "), FRD),
        Layout("t_ms.csv", text(titled("t_ms", *fields), with_time(whole(1e3, 4711)), TEXT_TIME), FRD),
        Layout("time_us.csv", text(titled("time_us", *fields), with_time(whole(1e6, 4711)), TEXT_TIME), FRD),
        Layout("stamp_ns.csv", text(titled("timestamp [ns]", *fields), with_time(whole(1e9, 17 * 10**17)), TEXT_TIME),
               FRD),
        Layout("untitled_us.csv", text(titled("timestamp", *fields), with_time(whole(1e6, 5000000)), TEXT_TIME), FRD,
               says="us by its steps"),
        Layout("untitled_ms.csv", text(titled("timestamp", *fields), with_time(whole(1e3, 12345)), TEXT_TIME), FRD),
        Layout("epoch_ms.csv", text(titled("time", *fields), with_time(whole(1e3, 17 * 10**11)), TEXT_TIME), FRD,
               says="ms, since 1970"),
        Layout("epoch_us.csv", text(titled("time", *fields), with_time(whole(1e6, 17 * 10**14)), TEXT_TIME), FRD),
        Layout("epoch_ns.csv", text(titled("time", *fields), with_time(whole(1e9, 17 * 10**17)), TEXT_TIME), FRD),
        Layout("epoch_s.csv", text(titled("time", *fields), with_time(TIME + 1.7e9), FORMATS), FRD),
        Layout("secs_nsecs.csv", text(titled("header.stamp.secs", "header.stamp.nsecs", *fields),
            (*zip(*[divmod(17 * 10**17 + round(t * 1e9), 10**9) for t in TIME], strict=True), *PLAIN[1:]),
            ("%d", "%d", *FORMATS[1:])), FRD),
        Layout("week_sow.csv", text(titled("GPS Week", "GPS TOW (s)", *fields), (["2300"] * ROWS, *with_time(
            TIME + 388800)), ("%s", *FORMATS)), FRD),
        Layout("week_rollover.csv", text(titled("week", "sow", *fields), ([str(2300 + int(t + 604790 >= 604800))
            for t in TIME], *with_time((TIME + 604790) % 604800)), ("%s", *FORMATS)), FRD),
        Layout("tow_ms.csv", text(titled("tow_ms", *fields), with_time(whole(1e3, 388800000)), TEXT_TIME), FRD),
        Layout("counter.csv", text(titled("Sample", *fields), with_time(whole(100.0)), TEXT_TIME), FRD, asks=True,
               fill=(("HZ", "100"),)),
        Layout("counter_and_time.csv", text(titled("Sample", "Time (ms)", *fields), (whole(100.0), *with_time(
            whole(1e3))), ("%s", *TEXT_TIME)), FRD),
        Layout("time_at_the_end.csv", text(titled(*fields, "time (s)"), (*PLAIN[1:], TIME),
               (*FORMATS[1:], "%.3f")), FRD),
        Layout("khz.csv", text(titled("time", *fields), (whole(1e2, 156496), *PLAIN[1:]), TEXT_TIME), FRD, asks=True,
               rate_hz=1000.0),
        Layout("stated_ms.csv", text([*STATED, "# rate_hz: 100", OURS], with_time(whole(1e3)), TEXT_TIME)),
        Layout("declared_ns.csv", text(ours, with_time(whole(1e9, 5)), TEXT_TIME), ("--time-unit", "ns")),
    ]  # fmt: skip


def of_values() -> list[Layout]:
    """Units, increments and counts."""

    def ours(gyro: np.ndarray, accel: np.ndarray, *fmt: str) -> bytes:
        formats = ("%.3f", *[fmt[0]] * 3, *[fmt[-1]] * 3)
        return text([OURS], (TIME, *gyro.T, *accel.T), formats)

    counts = np.round(DPS * 3600 * 50), np.round(G * 16384)
    scales = ("--gyro-unit", "arcsec/s", "--gyro-scale", "0.02", "--accel-unit", "g", "--accel-scale", str(1 / 16384))
    return [
        Layout("deg_h.csv", ours(DPS * 3600, ACCEL, "%.8f"), FRD, asks=True),
        Layout("mg.csv", ours(DPS, 1e3 * G, "%.9f"), FRD, asks=True),
        Layout("mdps_mg.csv", ours(1e3 * DPS, 1e3 * G, "%.8f"), FRD, asks=True),
        Layout("stim_mixed.csv", ours(DPS / 100, G, "%.14f", "%.7f"), FRD, asks=True),
        Layout("arcsec_increments.csv", ours(DPS * 36, ACCEL, "%.10f", "%.6f"), FRD, asks=True),
        Layout("increments_both.csv", ours(GYRO / 100, ACCEL / 100, "%.16f", "%.9f"), FRD, asks=True),
        Layout("increments_accel.csv", ours(DPS, ACCEL / 100, "%.10f", "%.9f"), FRD, asks=True),
        Layout("decimated_increments.csv", ours(GYRO / 200, ACCEL / 200, "%.16f", "%.10f"), FRD, asks=True),
        Layout("counts.csv", ours(*counts, "%d"), (*FRD, *scales)),
        Layout("counts_asked.csv", ours(*counts, "%d"), (*FRD, "--gyro-unit", "arcsec/s", "--gyro-scale", "0.02"),
               asks=True),
        Layout("declared_mg.csv", ours(DPS, 1e3 * G, "%.9f"), (*FRD, "--gyro-unit", "deg/s", "--accel-unit", "mg")),
        Layout("declared_columns.csv", text(["a,b,c,d,e,f,g"]), (*FRD, "--columns",
               "t=a,w_x=b,w_y=c,w_z=d,f_x=e,f_y=f,f_z=g"), asks=True),
        Layout("gyro_declared.csv", text(["time,p,q,r,ax_mps2,ay_mps2,az_mps2"]), (*FRD, "--columns",
               "w_x=p,w_y=q,w_z=r", "--gyro-unit", "deg/s")),
    ]  # fmt: skip


def of_other_words() -> list[Layout]:
    """Axes in words, counters that overflow, counts without a scale, titles in another language."""
    body = ("Longitudinal", "Lateral", "Vertical")
    german = [[f"{value:.10f}".replace(".", ",") for value in column] for column in PLAIN]
    counts = (np.round(DPS * 3600 / 0.01), np.round(G * 262000))
    scales = (("HZ", "100"), ("DEG_PER_S_IN_ONE_COUNT", repr(0.01 / 3600)))
    return [
        Layout(
            "rates_and_directions.csv",
            text(
                titled(
                    "time (s)",
                    *(f"{name} Rate (deg/s)" for name in ("Roll", "Pitch", "Yaw")),
                    *(f"{a} Acc (m/s2)" for a in body),
                )
            ),
            FRD,
        ),
        Layout(
            "forward_right_down.csv",
            text(
                titled(
                    "time (s)",
                    *(f"{kind}_{a} ({unit})" for kind, unit in (("gyro", "deg/s"), ("acc", "m/s2")) for a in AXES),
                )
            ),
            FRD,
        ),
        Layout(
            "counter_of_16_bits.csv",
            text(
                ["Sample rate: 100 Hz", "Counter," + TITLED.partition(",")[2]],
                with_time([str((65000 + i) % 65536) for i in range(ROWS)]),
                TEXT_TIME,
            ),
            FRD,
        ),
        Layout(
            "counts_out.csv",
            text(
                titled("Sample", *(f"{a}_{sensor}_OUT" for sensor in ("GYRO", "ACCL") for a in "XYZ")),
                ([str(i) for i in range(ROWS)], *counts[0].T, *counts[1].T),
                ("%s", *["%.0f"] * 6),
            ),
            FRD,
            asks=True,
            fill=scales,
        ),
        Layout(
            "zeit.csv",
            text(
                ["Zeit;Drehrate X;Drehrate Y;Drehrate Z;Beschl. X;Beschl. Y;Beschl. Z", "s;°/s;°/s;°/s;m/s²;m/s²;m/s²"],
                german,
                ["%s"] * 7,
                sep=";",
            ),
            FRD,
        ),
    ]


def of_programs() -> list[Layout]:
    """Files of programs: read by a preset, or by their titles."""
    ns = whole(1e9, 17 * 10**17)
    flu_gyro, flu_accel = GYRO * FLU, ACCEL * FLU
    rfu_gyro, rfu_accel = GYRO[:, [1, 0, 2]] * [1, 1, -1], ACCEL[:, [1, 0, 2]] * [1, 1, -1]
    increments = (TIME + 388800, *(GYRO / 100).T, *(ACCEL / 100).T)
    euroc = ["#timestamp [ns]"] + [f"w_RS_S_{a} [rad s^-1]" for a in "xyz"] + [f"a_RS_S_{a} [m s^-2]" for a in "xyz"]
    ros = [f"field.angular_velocity.{a}" for a in "xyz"] + [f"field.linear_acceleration.{a}" for a in "xyz"]
    echo = ["%time", "field.header.seq", "field.header.stamp", "field.orientation.x", *ros[:3],
            "field.angular_velocity_covariance0", *ros[3:]]  # fmt: skip
    zero = np.zeros(ROWS)
    sensors = "inertial-0000.000000:"
    micro = [sensors + name for name in ("scaledGyroX", "scaledGyroY", "scaledGyroZ", "scaledAccelX", "scaledAccelY",
                                         "scaledAccelZ")]  # fmt: skip
    rows = [
        f"{kind},{17 * 10**11 + i * 10},{x:.12f},{y:.12f},{z:.12f},0,0,0"
        for i in range(ROWS)
        for kind, (x, y, z) in (("UncalAccel", flu_accel[i]), ("UncalGyro", flu_gyro[i]))
    ]
    android = "MessageType,utcTimeMillis,MeasurementX,MeasurementY,MeasurementZ,BiasX,BiasY,BiasZ"
    dot = ["sep=,", "DeviceTag:,Xsens DOT", "FirmwareVersion:,2.0.0", "OutputRate:,100Hz", "",
           "PacketCounter,SampleTimeFine,"
           "Gyr_X,Gyr_Y,Gyr_Z,Acc_X,Acc_Y,Acc_Z"]  # fmt: skip
    return [
        Layout("euroc.csv", text([",".join(euroc)], (ns, *GYRO.T, *ACCEL.T), TEXT_TIME_SI), FRD, says="EuRoC"),
        Layout("rostopic.csv", text([",".join(echo)], (ns, whole(100.0), ns, zero, *GYRO.T, zero, *ACCEL.T),
               ("%s", "%s", "%s", "%.1f", *["%.14f"] * 3, "%.1f", *["%.6f"] * 3)), FRD, says="rostopic"),
        Layout("plotjuggler.csv", text(titled("__time", *(r.removeprefix("field.") for r in ros)),
               (TIME + 1.7e9, *SI[1:]), SI_FORMATS), FRD, says="sensor_msgs/Imu"),
        Layout("px4.csv", text(titled("timestamp", *(f"gyro_rad[{i}]" for i in range(3)),
               *(f"accelerometer_m_s2[{i}]" for i in range(3))), (whole(1e6, 5000000), *SI[1:]), TEXT_TIME_SI),
               FRD, says="PX4"),
        Layout("kfgins.txt", text([], increments, ("%.6f", *["%.16e"] * 3, *["%.10e"] * 3), sep=" "),
               ("--preset", "kf-gins")),
        Layout("kfgins_asked.txt", text([], increments, ("%.6f", *["%.16e"] * 3, *["%.10e"] * 3), sep=" "), FRD,
               asks=True),
        Layout("psins.txt", text([], (*(rfu_gyro / 100).T, *(rfu_accel / 100).T, TIME + 0.01),
               (*["%.16e"] * 3, *["%.10e"] * 3, "%.3f"), sep="  "), ("--preset", "psins")),
        Layout("navego.txt", text([], (TIME, *ACCEL.T, *GYRO.T), ("%.3f", *["%.6f"] * 3, *["%.14f"] * 3), sep=" "),
               ("--preset", "navego")),
        Layout("xsens_dot.csv", text(dot, (whole(100.0), whole(1e6, 99), *np.degrees(flu_gyro).T, *flu_accel.T),
               ("%s", "%s", *FORMATS[1:])), says="Xsens DOT"),
        Layout("sensorconnect.csv", text(["LORD MicroStrain SensorConnect", "SESSION_INFO", "Name,Sensor Data",
               "DATA_START", "Time," + ",".join(micro)], (stamps(lambda t: t.strftime("%m/%d/%Y %H:%M:%S.%f000")),
               *GYRO.T, *G.T), ("%s", *["%.14f"] * 3, *["%.7f"] * 3)), FRD, says="SensorConnect"),
        Layout("phyphox.csv", text(titled('"Time (s)"', *(f'"Gyroscope {a} (rad/s)"' for a in "xyz")),
               (TIME, *rfu_gyro.T), ("%.9e",) + ("%.14e",) * 3), accel=False, says="phyphox"),
        Layout("Gyroscope.csv", text(titled("time", "seconds_elapsed", "z", "y", "x"), (ns, TIME,
               *rfu_gyro[:, ::-1].T), ("%s", "%.6f", *["%.14f"] * 3)), accel=False, says="Sensor Logger"),
        Layout("device_imu.csv", f"{android}\n{chr(10).join(rows)}\n".encode(), FLU_AXES,
               says="GnssLogger"),
        Layout("gyro-0.csv", text(titled(*(f"gyro_{a} (deg/s)" for a in "xyz")), DPS.T, FORMATS[1:4]), FRD,
               asks=True, fill=(("HZ", "100"),), accel=False, says="gnss-ins-sim"),
    ]  # fmt: skip


LAYOUTS = [*of_the_sniffer(), *of_titles(), *of_times(), *of_values(), *of_other_words(), *of_programs()]
