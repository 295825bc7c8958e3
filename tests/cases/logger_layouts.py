"""Layouts of consoles, loggers and converters: samples in words, over lines, with a minus in a title, on odd clocks."""

from __future__ import annotations

import json

from cases.field_layouts import ACCEL_RFU, GYRO_RFU, MS, RFU, SECONDS, joined, table
from cases.layouts import ACCEL, DPS, FLU, FLU_AXES, FRD, GYRO, ROWS, START, TIME, G, Layout, stamps, whole

GYRO_FLU, ACCEL_FLU, DPS_FLU = GYRO * FLU, ACCEL * FLU, DPS * FLU
RATE = (("HZ", "100"),)
NS = whole(1e9, 17 * 10**17)
#: What `rostopic echo` prints of a message.
MESSAGE = """header:
  seq: {}
  stamp:
    secs: {}
    nsecs: {}
  frame_id: "imu"
orientation:
  x: 0.0
  y: 0.0
  z: 0.0
  w: 1.0
orientation_covariance: [0.0, 0.0, 0.0]
angular_velocity:
  x: {:.14f}
  y: {:.14f}
  z: {:.14f}
linear_acceleration:
  x: {:.6f}
  y: {:.6f}
  z: {:.6f}
---
"""
LABVIEW = (
    "LabVIEW Measurement\t\nSeparator\tTab\nDate\t2024/03/01\n***End_of_Header***\t\n\t\nChannels\t6\t\t\t\t\t\t\n"
    "Samples\t800\t800\t800\t800\t800\t800\t\nY_Unit_Label\tdeg/s\tdeg/s\tdeg/s\tg\tg\tg\t\n"
    "X0\t0\t0\t0\t0\t0\t0\t\nDelta_X\t0.01\t0.01\t0.01\t0.01\t0.01\t0.01\t\n***End_of_Header***\t\t\t\t\t\t\t\n"
)
SIX = [f"Gyro {a} (deg/s)" for a in "XYZ"] + [f"Acc {a} (m/s^2)" for a in "XYZ"]
SBG = "UTC Date\tUTC Time\tStatus\tAccel X\tAccel Y\tAccel Z\tGyro X\tGyro Y\tGyro Z\tDelta Angle X\tDelta Angle Y\t"


def lines(form: str, *columns: object) -> bytes:
    """Rows of numbers by a form, which may hold ends of lines."""
    rows = zip(*columns, strict=True)  # type: ignore[call-overload]
    flat = ([x for part in row for x in (part if hasattr(part, "__len__") and not isinstance(part, str) else [part])]
            for row in rows)  # fmt: skip
    return "".join(form.format(*row) for row in flat).encode()


def in_lists() -> bytes:
    """Eight samples in each object, as Movesense sends them."""
    rows = []
    for i in range(0, ROWS, 8):
        sensors = {
            name: [dict(zip("xyz", sample, strict=True)) for sample in values[i : i + 8].tolist()]
            for name, values in (("ArrayAcc", ACCEL_FLU), ("ArrayGyro", DPS_FLU))
        }
        rows.append(json.dumps({"imu": {"Timestamp": 10 * i, **sensors}}))
    return ("\n".join(rows) + "\n").encode()


def camera() -> bytes:
    """GPMF of an action camera: two streams under a device."""
    streams = {
        name: {"samples": [{"value": sample, "cts": float(ms)} for sample, ms in zip(values.tolist(), MS, strict=True)]}
        for name, values in (("ACCL", ACCEL), ("GYRO", GYRO))
    }
    return json.dumps({"1": {"streams": streams, "device name": "camera"}}).encode()


LOGGERS: list[Layout] = [
    Layout("two_lines.txt", b"IMU test!\nGyro range set to: +-250 deg/s\n\n" + lines(
        "Acceleration X: {:.6f}, Y: {:.6f}, Z: {:.6f} m/s^2\nRotation X: {:.14f}, Y: {:.14f}, Z: {:.14f} rad/s\n\n",
        ACCEL_FLU, GYRO_FLU), FLU_AXES, asks=True, fill=RATE),
    Layout("three_lines.txt", lines(
        "\t\tTemperature 25.41 deg C\n\t\tAccel X: {:.6f} \tY: {:.6f} \tZ: {:.6f} m/s^2 \n"
        "\t\tGyro X: {:.14f} \tY: {:.14f} \tZ: {:.14f} radians/s \n\n", ACCEL_FLU, GYRO_FLU), FLU_AXES, asks=True,
        fill=RATE),
    Layout("headed.txt", lines(
        "Time: {} s\nGyro:\n X: {:.14f} Y: {:.14f} Z: {:.14f} rad/s\n"
        "Accelerometer:\n X: {:.6f} Y: {:.6f} Z: {:.6f} m/s^2\n", SECONDS, GYRO, ACCEL), FRD),
    Layout("console.log", lines("I ({}) IMU: gx={:.10f} gy={:.10f} gz={:.10f} ax={:.7f} ay={:.7f} az={:.7f}\n",
        whole(1e3, 1000), DPS, G), FRD, asks=True),
    Layout("influx.lp", lines(
        "imu,host=pi,sensor=adis gx={:.14f},gy={:.14f},gz={:.14f},ax={:.6f},ay={:.6f},az={:.6f} {}\n",
        GYRO, ACCEL, NS), FRD, asks=True),
    Layout("teleplot.txt", lines(
        ">gx:{0}:{1:.10f}\n>gy:{0}:{2:.10f}\n>gz:{0}:{3:.10f}\n>ax:{0}:{4:.7f}\n>ay:{0}:{5:.7f}\n>az:{0}:{6:.7f}\n",
        MS, DPS, G), FRD, asks=True),
    Layout("echo.yaml", lines(MESSAGE, range(ROWS), [n[:10] for n in NS], [str(int(n[10:])) for n in NS],
        GYRO_FLU, ACCEL_FLU), FLU_AXES, says="sensor_msgs/Imu"),
    Layout("printed.txt", lines("[" + " ".join(["{}", *["{:.14e}"] * 6]) + "]\n", SECONDS, DPS, ACCEL), FRD,
        asks=True),
    Layout("minus.csv", table("GPS Week,GPS Seconds of Week (s),Z Accel (m/s^2),-Y Accel (m/s^2),X Accel (m/s^2),"
        "Z Gyro (deg/s),-Y Gyro (deg/s),X Gyro (deg/s)", ["2300"] * ROWS, [f"{t + 388800:.3f}" for t in TIME],
        ACCEL[:, [2, 1, 0]] * [1, -1, 1], DPS[:, [2, 1, 0]] * [1, -1, 1]).encode(), FRD, says="with the sign turned"),
    Layout("hyphen.csv", table("Time,Accel-X (g),Accel-Y (g),Accel-Z (g),Gyro-X (d/s),Gyro-Y (d/s),Gyro-Z (d/s)",
        stamps(lambda t: t.strftime("%Y-%m-%d %H:%M:%S.%f")), G, DPS).encode(), FRD),
    Layout("filetime.csv", table("FileTime," + ",".join(SIX), whole(1e7, 1335 * 10**14), DPS, ACCEL).encode(), FRD,
        says="steps of 100 ns"),
    Layout("dotnet.csv", table("Timestamp," + ",".join(SIX), whole(1e7, 6384 * 10**14), DPS, ACCEL).encode(), FRD),
    Layout("day_of_year.csv", table("Time," + ",".join(SIX), stamps(lambda t: t.strftime("%Y:%j:%H:%M:%S.%f"),
        START.replace(month=12, day=31, hour=23, minute=59, second=56)), DPS, ACCEL).encode(), FRD),
    Layout("mti.csv", table("PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z", whole(100.0),
        whole(1e4, 123), ACCEL_FLU, [joined(row, form="%.14f")[:-1] for row in GYRO_FLU]).encode(),
        ("--preset", "xsens-mt"), says="of Xsens MTi"),
    Layout("mjd.csv", table("MJD," + ",".join(SIX), [f"{60370.5 + t / 86400:.11f}" for t in TIME], DPS, ACCEL).encode(),
        FRD, says="days"),
    Layout("channels.lvm", (LABVIEW + table("X_Value\tGyro X\tGyro Y\tGyro Z\tAccel X\tAccel Y\tAccel Z\tComment",
        SECONDS, DPS, G, [""] * ROWS, sep="\t")).encode(), FRD),
    Layout("delta_th.txt", table("   TIME     DELTA_VX     DELTA_VY     DELTA_VZ     DELTA_THX    DELTA_THY   "
        "DELTA_THZ\n   (sec)     (m/s)   (m/s)   (m/s)   (rad)   (rad)  (rad)", SECONDS, [
            " ".join(f"{x:.12f}" for x in row) for row in ACCEL / 100], [
            " ".join(f"{x:.16f}" for x in row) for row in GYRO / 100], sep="   ").encode(), FRD),
    Layout("urad.csv", table("Time (s),dTheta X (urad),dTheta Y (urad),dTheta Z (urad),dV X (mm/s),dV Y (mm/s),"
        "dV Z (mm/s)", SECONDS, 1e4 * GYRO, 10 * ACCEL).encode(), FRD),
    Layout("rates_and_increments.txt", table(SBG + "Delta Angle Z\nyyyy-mm-dd\thh:mm:ss.sss\t\tm/s^2\tm/s^2\tm/s^2\t°/s"
        "\t°/s\t°/s\t°/s\t°/s\t°/s", stamps(lambda t: t.strftime("%Y-%m-%d\t%H:%M:%S.%f")), ["0x1FF"] * ROWS,
        ACCEL, DPS, DPS, sep="\t").encode(), FRD),
    Layout("sec_sec.csv", table("Count,Time(sec)," + ",".join(f"Gyro{a}(rad/sec)" for a in "XYZ") + "," + ",".join(
        f"Accel{a}(m/sec/sec)" for a in "XYZ"), whole(100.0), SECONDS, [joined(row, form="%.14f")[:-1] for row in GYRO],
        ACCEL).encode(), FRD),
    Layout("slashes.csv", table("__time," + ",".join(f"/imu/data/angular_velocity/{a}" for a in "xyz") + "," + ",".join(
        f"/imu/data/linear_acceleration/{a}" for a in "xyz"), [f"{t + 1.7e9:.3f}" for t in TIME],
        [joined(row, form="%.14f")[:-1] for row in GYRO_RFU], ACCEL_RFU).encode(), RFU, says="PlotJuggler"),
    Layout("letters.csv", table("a,b,c,d,e,f,g", SECONDS, DPS, ACCEL).encode(), FRD, asks=True),
    Layout("camera.json", camera(), FRD, asks=True),
    Layout("lists.jsonl", in_lists(), (*FLU_AXES, "--gyro-unit", "deg/s", "--accel-unit", "m/s2"), asks=True,
        fill=RATE),
]  # fmt: skip
