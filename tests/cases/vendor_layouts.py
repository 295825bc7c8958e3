"""Layouts of instruments, boards and programs: rows of processes and units, cells of several numbers, other tongues."""

from __future__ import annotations

import json
from datetime import timedelta
from functools import reduce
from operator import xor

from cases.field_layouts import MS, SECONDS, joined, table
from cases.layouts import ACCEL, DPS, FLU, FLU_AXES, FRD, GYRO, ROWS, START, TIME, G, Layout, stamps, whole
from cases.logger_layouts import lines

NS = whole(1e9, 17 * 10**17)
RATES = [joined(row, form="%.14f")[:-1] for row in GYRO]
SIX = ("gx_dps", "gy_dps", "gz_dps", "ax_g", "ay_g", "az_g")


def titles(time: str, gyro: str, accel: str) -> str:
    """A header whose titles differ in their axis."""
    return ",".join([time, *(gyro.format(a) for a in "XYZ"), *(accel.format(a) for a in "XYZ")])


def logger_json() -> bytes:
    """Rows of several sensors as objects, numbers as texts, what describes the phone first."""
    rows = [{"sensor": "Metadata", "version": "3", "device name": "phone"}]
    for at, w, f in zip(NS, GYRO, ACCEL, strict=True):
        for name, value, digits in (("Gyroscope", w, 14), ("TotalAcceleration", f, 6)):
            cells = {axis: f"{each:.{digits}f}" for axis, each in zip("zyx", value[::-1], strict=True)}
            rows.append({"sensor": name, "time": at, **cells})
    return json.dumps(rows).encode()


def of_columns() -> bytes:
    """What pandas writes: an object of columns, each an object by row."""
    columns = zip(("t_s", *SIX), (TIME, *DPS.T, *G.T), strict=True)
    return json.dumps({name: {str(i): float(x) for i, x in enumerate(column)} for name, column in columns}).encode()


def checked(text: str) -> str:
    """A sentence with its checksum."""
    return f"${text}*{reduce(xor, text.encode()):02X}\r\n"


def echo_csv() -> bytes:
    """Messages of sensor_msgs/Imu as ros2 topic echo --csv prints them."""
    none = ",0.0" * 9
    return "".join(
        f"{at[:10]},{int(at[10:])},imu,0.0,0.0,0.0,1.0{none},{w}{none},{joined(f, form='%.6f')[:-1]}{none}\n"
        for at, w, f in zip(NS, [joined(row, form="%.14f")[:-1] for row in GYRO * FLU], ACCEL * FLU, strict=True)
    ).encode()


VENDORS: list[Layout] = [
    Layout("toa5.dat", ('"TOA5","CR6","1234"\n"TIMESTAMP","RECORD","Gyro_X","Gyro_Y","Gyro_Z","Acc_X","Acc_Y","Acc_Z"\n'
        '"TS","RN","deg/s","deg/s","deg/s","m/s^2","m/s^2","m/s^2"\n"","","Smp","Smp","Smp","Smp","Smp","Smp"\n'
        + "".join(joined(t, i, d, f) for t, i, d, f in zip(
            stamps(lambda t: t.strftime('"%Y-%m-%d %H:%M:%S.%f"')), whole(100.0), DPS, ACCEL, strict=True))).encode(),
        FRD),
    Layout("units_of_all.txt", ("Data rate (Hz): 100\n\n" + table(
        "  Heading Pitch GyroX GyroY GyroZ AccX AccY AccZ MagX Temp Vdd\n  deg deg deg/s deg/s deg/s g g g nT degC V",
        ["120.1 0.1"] * ROWS, DPS, G, ["21000 31.0 12.1"] * ROWS, sep=" ")).replace(",", " ").encode(), FRD),
    Layout("geo.csv", table("# dataset: GeoCSV 2.0\n# field_unit: ISO_8601|nrad/s|nrad/s|nrad/s|m/s**2|m/s**2|m/s**2\n"
        "Time|rate_x|rate_y|rate_z|acc_x|acc_y|acc_z", stamps(lambda t: t.isoformat() + "Z", START + timedelta(
            microseconds=1)), 1e9 * GYRO, ACCEL, sep="|").encode(), FRD),
    Layout("nano.csv", table(titles("Time [s]", "Rot rate {} [nrad/s]", "Acc {} [mGal]"), SECONDS, 1e9 * GYRO,
        1e5 * ACCEL).encode(), FRD),
    Layout("powers.csv", table(titles("Time (s)", "Gyro {} (mrad·s⁻¹)", "Acc {} (mm s^-2)"), SECONDS, 1e3 * GYRO,
        1e3 * ACCEL).encode(), FRD),
    Layout("turns.csv", table(titles("Time (s)", "Gyro {} (rev/s)", "Acc {} (g)"), SECONDS, [
        joined(row / 360, form="%.14f")[:-1] for row in DPS], G).encode(), FRD),
    Layout("french.csv", table(titles("Temps", "Vitesse angulaire {}", "Accélération {}"), SECONDS, RATES, ACCEL
        ).encode(), FRD, asks=True),
    Layout("portuguese.csv", table(titles("Tempo (s)", "Velocidade angular {} (°/s)", "Aceleração {} (m/s²)"), SECONDS,
        DPS, ACCEL).encode(), FRD),
    Layout("witmotion.txt", table(titles("时间", "角速度{}(°/s)", "加速度{}(g)").replace(",", "\t"), stamps(
        lambda t: t.strftime("%Y-%m-%d %H:%M:%S.%f")), DPS, G, sep="\t").replace(",", "\t").encode(), FRD),
    Layout("device_number.csv", table(titles("Shimmer_9D1A_Timestamp_Unix_CAL", "Shimmer_9D1A_Gyro_{}_CAL",
        "Shimmer_9D1A_Accel_LN_{}_CAL") + "\nms,deg/s,deg/s,deg/s,m/(s^2),m/(s^2),m/(s^2)", whole(1e3, 17 * 10**11),
        DPS, ACCEL).encode(), FRD),
    Layout("a_time_for_each.csv", table(",".join(f'"X[s]","{s}.{a} 1[{u}]"' for s, u in (
        ("GYRO", "deg/s"), ("ACC", "g")) for a in "XYZ"), *(part for values in (DPS, G) for column in values.T
            for part in (SECONDS, [f"{x:.10f}" for x in column]))).encode(), FRD),
    Layout("offset_time.csv", table("Tick#,offsetTime,accel:X,accel:Y,accel:Z,gyro:X,gyro:Y,gyro:Z", whole(4.5e6),
        SECONDS, G, DPS).encode(), FRD, asks=True),
    Layout("seconds_and_microseconds.csv", "".join([
        "Unix Time,Microseconds,Accelerometer X,Accelerometer Y,Accelerometer Z,Gyroscope X,Gyroscope Y,Gyroscope Z\n",
        *(joined(at[:10], str(int(at[10:]) // 1000), f, w) for at, f, w in zip(NS, ACCEL, RATES, strict=True))
        ]).encode(), FRD, asks=True, says="Unix Time and Microseconds"),
    Layout("echo.csv", echo_csv(), FLU_AXES, asks=True),
    Layout("colours.log", lines("\x1b[0;32mI ({0}) imu: t_ms={0} gyro_dps=[{1:.10f} {2:.10f} {3:.10f}] "
        "acc_g=[{4:.7f} {5:.7f} {6:.7f}]\x1b[0m\n", MS, DPS, G), FRD),
    Layout("brackets.log", lines("{} INFO [imu] gyro=({:.10f}, {:.10f}, {:.10f}) deg/s accel=({:.6f}, {:.6f}, {:.6f}) "
        "m/s2\n", stamps(lambda t: t.strftime("%Y-%m-%d %H:%M:%S,%f")), DPS, ACCEL), FRD),
    Layout("vectors.csv", table("timestamp,gyro [rad/s],accel [m/s2]", SECONDS, [f'"[{w}]"' for w in RATES], [
        f'"[{joined(f, form="%.6f")[:-1]}]"' for f in ACCEL]).encode(), FRD),
    Layout("printed_vectors.csv", table("timestamp,gyro,accel", SECONDS, [
        f"[{w.replace(',', ' ')}]" for w in RATES], [f"[{joined(f, form='%.6f', sep=' ')[:-1]}]" for f in ACCEL]
        ).encode(), FRD, asks=True),
    Layout("units_in_cells.csv", table("t,gx,gy,gz,ax,ay,az", [f"{t} s" for t in SECONDS], [
        joined(row, form="%.10f deg/s")[:-1] for row in DPS], [joined(row, form="%.7f g")[:-1] for row in G]).encode(),
        FRD),
    Layout("order_in_title.csv", table('"cts","Gyroscope (z,x,y) [rad/s]","(1) [rad/s]","(2) [rad/s]"', [
        f"{1e3 * t:.3f}" for t in TIME], [joined(row[[2, 0, 1]], form="%.14f")[:-1] for row in GYRO]).encode(), FRD,
        accel=False),
    Layout("tidy.csv", "".join(["time_s,sensor,axis,value\n", *(f"{t},{name},{axis},{x:.10f}\n" for t, d, g in zip(
        SECONDS, DPS, G, strict=True) for name, row in (("gyro_dps", d), ("accel_g", g)) for axis, x in zip(
            "xyz", row, strict=True))]).encode(), FRD),
    Layout("two_sentences.log", "".join(checked(f"{kind},{t},{joined(row)[:-1]}") for t, d, g in zip(
        SECONDS, DPS, G, strict=True) for kind, row in (("GYR", d), ("ACC", g))).encode(), FRD, asks=True,
        says="joined on time"),
    Layout("logger.json", logger_json(), FRD, asks=True, says="joined on time"),
    Layout("columns.json", of_columns(), FRD),
    Layout("split.json", json.dumps({"columns": ["t_s", *SIX], "index": list(range(ROWS)), "data": [
        [float(t), *d, *g] for t, d, g in zip(TIME, DPS.tolist(), G.tolist(), strict=True)]}).encode(), FRD),
    Layout("within.jsonl", "\n".join(json.dumps({"data": dict(zip(("t_s", *SIX), (float(t), *d, *g), strict=True))})
        for t, d, g in zip(TIME, DPS.tolist(), G.tolist(), strict=True)).encode(), FRD),
    Layout("xout.csv", table("ms," + ",".join(f"ACCEL_{a}OUT" for a in "XYZ") + ",TEMP_OUT," + ",".join(
        f"GYRO_{a}OUT" for a in "XYZ"), MS, G, ["25.0"] * ROWS, DPS).encode(), FRD, asks=True),
]  # fmt: skip
