"""Text files of one still unit as people really have them; `test_made.py` holds what must become of each.

Truth unless a case says otherwise: latitude 48 deg, heading 60 deg, level, 100 Hz for 120 s, angle random walk
0.003 deg/sqrt(h), bias 0.02 deg/h. Sources are named beside the cases.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta
from functools import reduce
from operator import xor

import numpy as np
from cases.layouts import OURS, STATED, TITLED, text

from gyronorth.earth import STANDARD_GRAVITY

LATITUDE, HEADING = np.radians(48.0), np.radians(60.0)
EARTH = 7.292115e-5
FLU = np.array([1.0, -1.0, -1.0])
FINE = ("%.3f", *["%.9f"] * 3, *["%.5f"] * 3)
OWN = (*STATED, OURS)
#: Rows of a file in which it is the layout that matters, and of one with a clock to be read.
SHORT, ALL = 3_000, 12_000
START = datetime(2024, 3, 1, 11, 58)
#: Seconds of the GPS week at the start of the files that have them.
SECONDS_OF_WEEK = 388800.0


def unit(rate_hz: float = 100.0, seconds: float = 120.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, s, angular rate, rad/s, and specific force, m/s^2, forward-right-down."""
    rng = np.random.default_rng(1)
    count = round(rate_hz * seconds)
    north, down = EARTH * np.cos(LATITUDE), -EARTH * np.sin(LATITUDE)
    rate = np.array([north * np.cos(HEADING), -north * np.sin(HEADING), down])
    walk = np.radians(0.003) / 60
    gyro = rate + np.radians(0.02) / 3600 * rng.standard_normal(3)
    gyro = gyro + walk * np.sqrt(rate_hz) * rng.standard_normal((count, 3))
    return np.arange(count) / rate_hz, gyro, [0, 0, -STANDARD_GRAVITY] + 0.002 * rng.standard_normal((count, 3))


TIME, GYRO, ACCEL = unit()
DPS, G = np.degrees(GYRO), ACCEL / STANDARD_GRAVITY
SEVEN = (TIME, *DPS.T, *ACCEL.T)
NS = [str(1_700_000_000_000_000_000 + round(seconds * 1e9)) for seconds in TIME]


def table(header, columns=SEVEN, formats=FINE, *, rows: int = SHORT, **how) -> bytes:
    """A text with a clock of texts or numbers in front; all rows where the clock is what matters."""
    formats = ("%s", *formats[1:]) if isinstance(columns[0][0], str) else formats
    return text(header, [column[:rows] for column in columns], formats, **how)


def swapped(values: np.ndarray) -> list[np.ndarray]:
    """Right-forward-up of forward-right-down."""
    return [values[:, 1], values[:, 0], -values[:, 2]]


def si(digits: int = 12) -> tuple[str, ...]:
    return ("%s", *[f"%.{digits}f"] * 3, *["%.5f"] * 3)


def euroc(keep: np.ndarray | None = None, header: str = "#timestamp [ns],w_x,w_y,w_z,f_x,f_y,f_z") -> bytes:
    rows = np.arange(len(TIME)) if keep is None else np.flatnonzero(keep)
    return table([header], [[NS[i] for i in rows], *GYRO[rows].T, *ACCEL[rows].T], si(), rows=ALL)


def milliseconds(header: str) -> bytes:
    """A clock whose step is 1: milliseconds at 1 kHz."""
    time, gyro, accel = unit(1000.0, 30.0)
    stamps = [str(round(seconds * 1e3) + 156496) for seconds in time]
    return table(
        [header], [stamps, *np.degrees(gyro).T, *accel.T], ("%s", *["%.7f"] * 3, *["%.4f"] * 3), rows=len(time)
    )


def iso() -> bytes:
    stamps = [(START + timedelta(seconds=float(t))).isoformat(timespec="milliseconds") + "Z" for t in TIME]
    return table([OURS], [stamps, *SEVEN[1:]])


def sensorconnect() -> bytes:
    """MicroStrain: preamble, DATA_START, dates with nanoseconds."""
    stamps = [(START + timedelta(seconds=float(t))).strftime("%m/%d/%Y %H:%M:%S.%f") + "000" for t in TIME]
    names = [f"inertial-0000.000000:scaled{sensor}{axis}" for sensor in ("Gyro", "Accel") for axis in "XYZ"]
    head = [
        "LORD MicroStrain SensorConnect",
        "SESSION_INFO",
        "Name,Sensor Data",
        "DATA_START",
        "Time," + ",".join(names),
    ]
    return table(head, [stamps, *GYRO.T, *G.T], ("%s", *["%.12f"] * 3, *["%.6f"] * 3))


def device_imu() -> bytes:
    """Android: rows of two kinds."""
    rows = ["MessageType,utcTimeMillis,MeasurementX,MeasurementY,MeasurementZ,BiasX,BiasY,BiasZ"]
    for time, gyro, accel in zip(TIME[:SHORT], GYRO * FLU, ACCEL * FLU, strict=False):
        stamp = 1_700_000_000_000 + round(time * 1e3)
        rows.append("UncalAccel,{},{:.5f},{:.5f},{:.5f},0,0,0".format(stamp, *accel))
        rows.append("UncalGyro,{},{:.12f},{:.12f},{:.12f},0,0,0".format(stamp, *gyro))
    return ("\n".join(rows) + "\n").encode()


def novatel_crc(content: str) -> int:
    """The CRC of NovAtel's messages: that of zlib without its two inversions."""
    import zlib

    return zlib.crc32(content.encode(), 0xFFFFFFFF) ^ 0xFFFFFFFF


def span() -> bytes:
    """NovAtel RAWIMUS as text: counts, order z, -y, x, right-forward-up."""
    lines = []
    right, forward, up = (np.round(column / 100 / 1e-9).astype(int) for column in swapped(GYRO))
    force = [np.round(column / 100 / 2e-8).astype(int) for column in swapped(ACCEL)]
    for i, time in enumerate(TIME[:SHORT] + SECONDS_OF_WEEK):
        counts = (force[2][i], -force[1][i], force[0][i], up[i], -forward[i], right[i])
        listed = ",".join(map(str, counts))
        lines.append(f"RAWIMUSXA,2300,{time:.3f};00,26,2300,{time:.9f},00000077,{listed}")
    return "".join(f"%{line}*{novatel_crc(line):08x}\r\n" for line in lines).encode()


def vnimu() -> bytes:
    form = "VNIMU,+00.0000,+00.0000,+00.0000" + ",{:+.4f}" * 3 + ",{:+.9f}" * 3 + ",+25.0,+101.325"
    lines = [form.format(*accel, *gyro) for gyro, accel in zip(GYRO[:SHORT], ACCEL, strict=False)]
    return "".join(f"${line}*{reduce(xor, line.encode()):02X}\r\n" for line in lines).encode()


def six_poses() -> bytes:
    """A tumble in six positions: the mean force cancels (imucal, imu_tk)."""
    rng = np.random.default_rng(4)
    force = np.repeat(np.vstack([np.eye(3), -np.eye(3)]) * STANDARD_GRAVITY, 1000, 0)
    force = force + 0.01 * rng.standard_normal((6000, 3))
    gyro = 0.02 * rng.standard_normal((6000, 3)) + [0.3, -0.2, 0.1]
    return table([OURS], [np.arange(6000) / 100, *gyro.T, *force.T], rows=ALL)


def drive() -> bytes:
    """A drive with the unit in its header (demo files of gnss-ins-sim)."""
    rng = np.random.default_rng(4)
    time = np.arange(6000) / 100
    gyro = 30 * np.sin(2 * np.pi * time / 40)[:, None] * [0.02, 0.01, 1] + 0.1 * rng.standard_normal((6000, 3))
    force = [0, 0, -STANDARD_GRAVITY] + 0.5 * rng.standard_normal((6000, 3))
    return table([TITLED], [time, *(gyro + np.array([0, 0, 24.0])).T, *force.T], rows=ALL)


def decimated() -> bytes:
    """Increments of a 200 Hz sensor logged at 100 Hz: every second one is thrown away (novatel_gps_driver 148)."""
    time, gyro, accel = unit(200.0)
    columns = [time[::2], *(gyro / 200)[::2].T, *(accel / 200)[::2].T]
    return table([OURS], columns, ("%.3f", *["%.14f"] * 3, *["%.9f"] * 3))


def duplicates() -> np.ndarray:
    """4 % of the stamps repeat the one before (zed-ros-wrapper 577)."""
    time = TIME.copy()
    time[2::25] = time[1::25]
    return time


def pairs() -> np.ndarray:
    """Stamps in pairs, values distinct (zed-ros-wrapper 577, Citrus-Farm-Dataset 1)."""
    time = TIME.copy()
    odd = np.arange(300, len(TIME)) % 2 == 1
    time[300:][odd] = TIME[299:-1][odd]
    return time


def restarted() -> np.ndarray:
    """The clock begins anew in the middle (allan_variance_ros 3)."""
    half = len(TIME) // 2
    return np.concatenate([TIME[:half] + 500, TIME[half:] - TIME[half] + 3])


def bursts() -> np.ndarray:
    """Every 20 samples the stamps are 50 ms late, then catch up (imu_vn_100 25)."""
    late = np.zeros(20)
    late[:6] = [0.05, 0.041, 0.032, 0.023, 0.014, 0.005]
    return TIME + np.resize(late, len(TIME))


def stalled() -> np.ndarray:
    """A host stalls 20 ms every 20 samples and then reads its queue, 1 ms a message; nothing is lost."""
    time = TIME.copy()
    for first in range(20, len(TIME), 20):
        behind = TIME[first] + 0.02 + np.arange(3) * 1e-3
        time[first : first + 3] = np.maximum(time[first : first + 3], behind)
    return time


def clocked(time: np.ndarray, digits: int = 3) -> bytes:
    return table(OWN, [time, *SEVEN[1:]], (f"%.{digits}f", *FINE[1:]), rows=ALL)


LOST = np.ones(len(TIME), dtype=bool)
LOST[4000:4500] = False
UNITS_ROW = ("Time,GyroX,GyroY,GyroZ,AccX,AccY,AccZ", "(s),(deg/s),(deg/s),(deg/s),(m/s^2),(m/s^2),(m/s^2)")
LATIN = "Time (s),Gyr X (°/s),Gyr Y (°/s),Gyr Z (°/s),Acc X (m/s²),Acc Y (m/s²),Acc Z (m/s²)"
EUROC = "#timestamp [ns]," + ",".join(
    [f"w_RS_S_{axis} [rad s^-1]" for axis in "xyz"] + [f"a_RS_S_{axis} [m s^-2]" for axis in "xyz"]
)
PX4 = "timestamp,gyro_rad[0],gyro_rad[1],gyro_rad[2],accelerometer_m_s2[0],accelerometer_m_s2[1],accelerometer_m_s2[2]"
MILLI = ("%.3f", *["%.9f"] * 3, *["%.3f"] * 3)
SPACED = ("%10.3f", *["%17.9e"] * 3, *["%12.5f"] * 3)

#: File -> its content.
TEXTS: dict[str, Callable[[], bytes]] = {
    "base.csv": lambda: table(OWN),
    "tabs.txt": lambda: table([OURS.replace(",", "\t")], sep="\t"),
    "spaces.txt": lambda: table([], formats=SPACED, sep=" "),
    "semicolon.csv": lambda: table([OURS.replace(",", ";")], sep=";"),
    "semicolon_comma.csv": lambda: table([OURS.replace(",", ";")], sep=";").replace(b".", b","),
    "utf16.csv": lambda: table(OWN, encoding="utf-16"),
    "latin1_degree.csv": lambda: table([LATIN], encoding="latin-1"),
    "crcrlf.csv": lambda: table(OWN, end="\r\r\n"),  # println() of a board, and CRLF translation
    "blank_between.csv": lambda: table(OWN, end="\n\n"),
    "header_units_dps.csv": lambda: table([TITLED]),
    "header_units_row.csv": lambda: table(UNITS_ROW),
    "preamble.csv": lambda: table(
        ["LOGGER v3", "Serial:;00000", "Sample Rate,100Hz", "", "DATA_START", OURS],
    ),
    "percent.txt": lambda: table(["% static run", "% t wx wy wz fx fy fz"], sep=" "),
    "footer.csv": lambda: table(OWN, foot="# end of log\n"),
    "euroc_ns.csv": lambda: euroc(header=EUROC),
    "euroc_ns_gap.csv": lambda: euroc(LOST),
    "us_px4.csv": lambda: table([PX4], [[str(round(t * 1e6) + 5_000_000) for t in TIME], *GYRO.T, *ACCEL.T], si()),
    "ms_1khz.csv": lambda: milliseconds("t_ms,gx_dps,gy_dps,gz_dps,ax,ay,az"),
    "ms_1khz_time.csv": lambda: milliseconds("time,w_x,w_y,w_z,f_x,f_y,f_z"),
    "iso.csv": iso,
    "week_wrap.csv": lambda: clocked((TIME + 604740) % 604800),
    "gps_week_sow.csv": lambda: table(
        ["week,sow,dtheta_x,dtheta_y,dtheta_z,dvel_x,dvel_y,dvel_z"],
        [["2300"] * len(TIME), TIME + SECONDS_OF_WEEK, *(GYRO / 100).T, *(ACCEL / 100).T],
        ("%s", "%.3f", *["%.14f"] * 3, *["%.8f"] * 3),
    ),
    "kfgins.txt": lambda: table(
        [],
        [TIME + SECONDS_OF_WEEK, *(GYRO / 100).T, *(ACCEL / 100).T],
        ("%.6f", *["%.14e"] * 3, *["%.10e"] * 3),
        sep=" ",
    ),
    "gyro-0.csv": lambda: table(["gyro_x (deg/s),gyro_y (deg/s),gyro_z (deg/s)"], DPS.T, ["%.10f"] * 3),
    "accel-0.csv": lambda: table(["accel_x (m/s^2),accel_y (m/s^2),accel_z (m/s^2)"], ACCEL.T, ["%.6f"] * 3),
    "sensorlogger_Gyroscope.csv": lambda: table(
        ["time,seconds_elapsed,z,y,x"], [NS, TIME, *(GYRO * FLU)[:, ::-1].T], ("%s", "%.6f", *["%.12f"] * 3)
    ),
    "gsdc_device_imu.csv": device_imu,
    "span.asc": span,
    "vnimu.txt": vnimu,
    "arcsec_increments.csv": lambda: table([OURS], [TIME, *(DPS * 3600 / 100).T, *ACCEL.T]),
    "mg.csv": lambda: table([OURS], [TIME, *DPS.T, *(G * 1000).T], MILLI),
    "mdps_mg.csv": lambda: table(
        [OURS], [TIME, *(DPS * 1000).T, *(G * 1000).T], ("%.3f", *["%.6f"] * 3, *["%.3f"] * 3)
    ),
    "counts.csv": lambda: table(
        [OURS], [TIME, *np.round(DPS * 36000).T, *np.round(G * 16384).T], ("%.3f", *["%d"] * 6)
    ),
    "decimated_increments.csv": decimated,
    "zed_duplicates.csv": lambda: clocked(duplicates()),
    "zed_pairs.csv": lambda: clocked(pairs()),
    "clock_restart.csv": lambda: clocked(restarted()),
    "vn100_bursts.csv": lambda: clocked(bursts(), 4),
    "stall_20ms.csv": lambda: clocked(stalled(), 4),
    "stall_20ms_increments.csv": lambda: table(
        [OURS], [stalled(), *(GYRO / 100).T, *(ACCEL / 100).T], ("%.4f", *["%.14f"] * 3, *["%.9f"] * 3), rows=ALL
    ),
    "six_poses.csv": six_poses,
    "drive_dps.csv": drive,
    "zup_undeclared.csv": lambda: table([OURS], [TIME, *swapped(DPS), *swapped(ACCEL)]),
    "sensorconnect.csv": sensorconnect,
    "stim_mixed.csv": lambda: table(  # deg a sample and g, as STIM300 sends them
        [OURS], [TIME, *(DPS / 100).T, *G.T], ("%.3f", *["%.12f"] * 3, *["%.6f"] * 3)
    ),
}
