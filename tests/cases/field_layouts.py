"""Layouts of loggers, boards and instruments: axes in words, rows of two sensors, counts, other scripts."""

from __future__ import annotations

from cases.layouts import ACCEL, DPS, FLU_AXES, FRD, GYRO, TIME, G, Layout, whole

RFU = ("--axes", "rfu")
GYRO_RFU, ACCEL_RFU, G_RFU = (each[:, [1, 0, 2]] * [1, 1, -1] for each in (GYRO, ACCEL, G))
TITLES = "time (s),gyro_x (deg/s),gyro_y (deg/s),gyro_z (deg/s),acc_x (m/s^2),acc_y (m/s^2),acc_z (m/s^2)"


def joined(*parts: object, form: str = "%.10f", sep: str = ",") -> str:
    """A row of texts and numbers."""
    cells: list[str] = []
    for part in parts:
        cells += [part] if isinstance(part, str) else [form % number for number in part]  # type: ignore[union-attr]
    return sep.join(cells) + "\n"


def table(title: str, *columns: object, sep: str = ",") -> str:
    """A header and rows; each column holds texts, or rows of numbers."""
    rows = zip(*columns, strict=True)  # type: ignore[call-overload]
    return title + "\n" + "".join(joined(*row, sep=sep) for row in rows)


SECONDS, MS = [f"{t:.3f}" for t in TIME], whole(1e3)
PITCH_FIRST = (
    "Week,GPSTime [s],PitchRate [deg/s],RollRate [deg/s],YawRate [deg/s],LateralAcc [m/s2],LongitudinalAcc [m/s2],"
)
RUSSIAN = "Время, с;Угловая скорость X, °/ч;Угловая скорость Y, °/ч;Угловая скорость Z, °/ч;Ускорение X, м/с²;"
FIELD: list[Layout] = [
    Layout(
        "pitch_roll_yaw.csv",
        table(
            PITCH_FIRST + "VerticalAcc [m/s2]",
            ["2303"] * len(TIME), [f"{475080 + t:.3f}" for t in TIME], DPS[:, [1, 0, 2]] * [1, 1, -1], ACCEL_RFU,
        ).encode(),
        RFU,
    ),
    Layout("accel_every_second_row.csv", (TITLES + "\n" + "".join(
        joined(t, d, a) if i % 2 == 0 else joined(t, d, "", "", "")
        for i, (t, d, a) in enumerate(zip(SECONDS, DPS, ACCEL, strict=True)))).encode(), FRD, says="joined on time"),
    Layout("accel_nan.csv", (TITLES + "\n" + "".join(
        joined(t, d, a) if i % 2 == 0 else joined(t, d, "NaN", "NaN", "NaN")
        for i, (t, d, a) in enumerate(zip(SECONDS, DPS, ACCEL, strict=True)))).encode(), FRD, says="joined on time"),
    Layout("words_of_kinds.txt", "".join(
        joined("GYRO", t, w) + joined("ACC", t, a) for t, w, a in zip(MS, GYRO, ACCEL, strict=True)).encode(),
        FRD, asks=True),
    Layout("numbers_of_kinds.csv", "".join(
        joined(t, "4", w) + joined(t, "1", a) for t, w, a in zip(whole(1e9), GYRO_RFU, ACCEL_RFU, strict=True)
        ).encode(),
        RFU, asks=True),
    Layout("russian.csv", table(
        RUSSIAN + "Ускорение Y, м/с²;Ускорение Z, м/с²", SECONDS, 3600 * DPS, ACCEL, sep=";"
        ).replace(".", ",").encode(),
        FRD),
    Layout("thousands.csv", ("Time (ms),Gyro X (deg/h),Gyro Y (deg/h),Gyro Z (deg/h),Acc X (mg),Acc Y (mg),Acc Z (mg)\n"
        + "".join(joined(f'"{int(t):,}"', 3600 * d) [:-1] + joined("", *(f'"{1e3 * each:,.4f}"' for each in g))
                  for t, d, g in zip(MS, DPS, G, strict=True))).encode(), FRD),
    Layout("xgyro.csv", table(
        "Sample,XGYRO (°/sec),YGYRO (°/sec),ZGYRO (°/sec),XACCL (mg),YACCL (mg),ZACCL (mg),Time (ms)",
        [str(i) for i in range(len(TIME))], DPS, 1e3 * G, MS).encode(), FRD),
    Layout("axes_by_numbers_within.txt", table(
        "% TIME (s)|XV1 rotation rate (deg/h)|XV2 rotation rate (deg/h)|XV3 rotation rate (deg/h)"
        "|XV1 acceleration (m/s2)|XV2 acceleration (m/s2)|XV3 acceleration (m/s2)",
        SECONDS, 3600 * DPS, ACCEL, sep="|").encode(), FRD),
    Layout("lin_acc.txt", table(
        "# id timestamp ang_vel_x ang_vel_y ang_vel_z lin_acc_x lin_acc_y lin_acc_z",
        [str(i) for i in range(len(TIME))], [f"{1709294280 + t:.6f}" for t in TIME], GYRO, ACCEL, sep=" ").encode(),
        FRD, asks=True),
    Layout("force_without_a_name.csv", table(
        "t_s,gyro_x_dps,gyro_y_dps,gyro_z_dps,s1,s2,s3,temp", SECONDS, DPS, ACCEL, ["25"] * len(TIME)).encode(),
        FRD, asks=True),
    Layout("quaternion_before.csv", "".join(
        joined(t, "0.0", "0.0", "0.0", "1.0", "0.0", "0.0", "0.0", w, a)
        for t, w, a in zip(whole(1e9, 17 * 10**17), GYRO, ACCEL, strict=True)).encode(), FRD, asks=True),
    Layout("labels_with_units.txt", "".join(
        f"t_ms:{t} " + " ".join(f"{name}:{value:.10f}" for name, value in zip(
            ("gx(dps)", "gy(dps)", "gz(dps)", "ax(g)", "ay(g)", "az(g)"), (*d, *g), strict=True)) + "\n"
        for t, d, g in zip(MS, DPS, G, strict=True)).encode(), FRD),
    Layout("labview.lvm", (
        "LabVIEW Measurement\nWriter_Version\t2\nSeparator\tTab\n***End_of_Header***\t\n\n***End_of_Header***\n"
        + table("X_Value\tGyro X (deg/s)\tGyro Y (deg/s)\tGyro Z (deg/s)\tAccel X (g)\tAccel Y (g)\tAccel Z (g)\tNote",
                SECONDS, DPS, G, [""] * len(TIME), sep="\t")).encode(), FRD),
    Layout("counts_in_preamble.csv", (
        "# gyro: 100000000 LSB/(deg/s), accel: 4000000 counts/g\nt_us,gx_raw,gy_raw,gz_raw,ax_raw,ay_raw,az_raw\n"
        + "".join(joined(t, d, g, form="%d") for t, d, g in zip(
            whole(1e6), (1e8 * DPS).round(), (4e6 * G).round(), strict=True))).encode(), FRD, asks=True),
    Layout("sensorlog_ios.csv", table(
        "loggingTime(txt),accelerometerAccelerationX(G),accelerometerAccelerationY(G),accelerometerAccelerationZ(G),"
        "gyroTimestamp_sinceReboot(s),gyroRotationX(rad/s),gyroRotationY(rad/s),gyroRotationZ(rad/s)",
        ["2024-03-01 11:58:00.000 +0000"] * len(TIME), -G_RFU, SECONDS, GYRO_RFU).encode(), RFU, says="SensorLog"),
    Layout("sensors_in_rows_of_their_own.csv", (TITLES + "\n" + "".join(
        joined(f"{t:.4f}", d, "", "", "") + joined(f"{t + 0.004:.4f}", "", "", "", a)
        for t, d, a in zip(TIME, DPS * [1, -1, -1], ACCEL * [1, -1, -1], strict=True))).encode(), FLU_AXES),
]  # fmt: skip
