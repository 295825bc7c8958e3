"""Other layouts, of the same kinds: each is one that some program or person writes."""

from __future__ import annotations

import numpy as np
from cases.layouts import (
    ACCEL,
    DPS,
    FORMATS,
    FRD,
    GYRO,
    OURS,
    PLAIN,
    ROWS,
    SI,
    SI_FORMATS,
    TEXT_TIME,
    TEXT_TIME_SI,
    TIME,
    TITLED,
    G,
    Layout,
    stamps,
    text,
    titled,
    whole,
    with_time,
)  # fmt: skip

fields = TITLED.split(",")[1:]
MORE = [
    Layout(
        "more_titles.csv",
        text([TITLED + ",GPS Time,Lat,Lon"], (*PLAIN, *[np.full(ROWS, 1.5)] * 3), (*FORMATS, *["%.3f"] * 3)),
        FRD,
    ),
    Layout(
        "ros_underscores.csv",
        text(
            titled(
                "seq", "stamp", *[f"angular_velocity_{a}" for a in "xyz"], *[f"linear_acceleration_{a}" for a in "xyz"]
            ),
            (whole(100.0), TIME + 1.7e9, *GYRO.T, *ACCEL.T),
            ("%s", *SI_FORMATS),
        ),
        FRD,
        asks=True,
    ),
    Layout(
        "semicolon_comma_ms.csv",
        text(
            ["Timestamp(ms);GyroX(deg/s);GyroY(deg/s);GyroZ(deg/s);AccX(g);AccY(g);AccZ(g)"],
            (whole(1e3, 5), *DPS.T, *G.T),
            ("%s", *FORMATS[1:]),
            sep=";",
        ).replace(b".", b","),
        FRD,
    ),
    Layout(
        "words_above.csv",
        text(
            [
                "IMU log",
                "Date: 2024-03-01",
                "Columns: time [s], gyro [rad/s], accel [m/s^2]",
                "",
                "time,gx,gy,gz,ax,ay,az",
            ],
            SI,
            SI_FORMATS,
        ),
        FRD,
        asks=True,
    ),
    Layout(
        "spaced_units.txt",
        text(
            ["Time[s]  Gx[deg/h]  Gy[deg/h]  Gz[deg/h]  Ax[mg]  Ay[mg]  Az[mg]"],
            (TIME, *(DPS * 3600).T, *(G * 1e3).T),
            ("%.3f", *["%.8f"] * 3, *["%.5f"] * 3),
            sep="  ",
        ),
        FRD,
    ),
    Layout(
        "packet_number.txt",
        text(
            [
                "Packet Number\tGyroscope X (deg/s)\tGyroscope Y (deg/s)\tGyroscope Z (deg/s)\tAccelerometer X (g)\tAccelerometer Y (g)\tAccelerometer Z (g)"  # noqa: E501
            ],
            (whole(100.0), *DPS.T, *G.T),
            ("%s", *FORMATS[1:]),
            sep="\t",
        ),
        FRD,
        asks=True,
        fill=(("HZ", "100"),),
    ),
    Layout(
        "units_name_the_gyro.csv", text(["Time (s),X (deg/s),Y (deg/s),Z (deg/s),Ax (m/s2),Ay (m/s2),Az (m/s2)"]), FRD
    ),
    Layout("rollrate.csv", text(["time,rollrate,pitchrate,yawrate,ax,ay,az"]), FRD, asks=True),
    Layout("pqr.csv", text(["time,p [rad/s],q [rad/s],r [rad/s],ax [m/s2],ay [m/s2],az [m/s2]"], SI, SI_FORMATS), FRD),
    Layout(
        "footer_with_numbers.csv",
        text([OURS], foot="\n\nMean;0;0\nEnd of file.\n").replace(b"Mean;0;0", b"Mean,0.1,0.2,0.3,0,0,-9.8"),
        FRD,
        asks=True,
    ),
    Layout("one_blank_line.csv", text([TITLED]).replace(b"\n4.000", b"\n\n4.000"), FRD),
    Layout(
        "quoted_titles.csv",
        text(
            [
                '"Time (s)","Gyro X (deg/s)","Gyro Y (deg/s)","Gyro Z (deg/s)","Acc X (m/s^2)","Acc Y (m/s^2)","Acc Z (m/s^2)"'  # noqa: E501
            ]
        ),
        FRD,
    ),
    Layout("signed_exponents.csv", text([TITLED], formats=("%+.3f", *["%+.10E"] * 3, *["%+.6E"] * 3)), FRD),
    Layout("comma_and_blank.csv", text([TITLED], sep=", "), FRD),
    Layout("blanks_around.csv", text([TITLED], sep=" , ", end=" \n"), FRD),
    Layout("trailing_tab.txt", text([TITLED.replace(",", "\t")], sep="\t", end="\t\r\n"), FRD),
    Layout(
        "aligned_units_row.txt",
        text(
            [
                "   Time     Gyr_X    Gyr_Y    Gyr_Z    Acc_X   Acc_Y   Acc_Z",
                "    [s]    [deg/s]  [deg/s]  [deg/s]  [m/s2]  [m/s2]  [m/s2]",
            ],
            formats=["%10.3f"] + ["%17.9e"] * 3 + ["%12.5f"] * 3,
            sep=" ",
        ),
        FRD,
    ),
    Layout(
        "fs_in_preamble.csv",
        text(
            [
                "Logger: X",
                "Start: 2024-03-01 11:58:00",
                "Fs = 100 Hz",
                "Gyro X (deg/s),Gyro Y (deg/s),Gyro Z (deg/s),Acc X (g),Acc Y (g),Acc Z (g)",
            ],
            (*DPS.T, *G.T),
            FORMATS[1:],
        ),
        FRD,
    ),
    Layout(
        "underscored_units.csv",
        text(
            titled("t", "wx_deg_h", "wy_deg_h", "wz_deg_h", "fx_mg", "fy_mg", "fz_mg"),
            (TIME, *(DPS * 3600).T, *(G * 1e3).T),
            ("%.3f", *["%.8f"] * 3, *["%.5f"] * 3),
        ),
        FRD,
    ),
    Layout(
        "units_after_axis.csv",
        text(
            titled(
                "timestamp_us",
                "gyro.x_rad_s",
                "gyro.y_rad_s",
                "gyro.z_rad_s",
                "accel.x_m_s2",
                "accel.y_m_s2",
                "accel.z_m_s2",
            ),
            (whole(1e6), *GYRO.T, *ACCEL.T),
            TEXT_TIME_SI,
        ),
        FRD,
    ),
    Layout(
        "slash_in_suffix.csv",
        text(
            titled(
                "Time",
                "Gyroscope_X_deg/s",
                "Gyroscope_Y_deg/s",
                "Gyroscope_Z_deg/s",
                "Accelerometer_X_m/s2",
                "Accelerometer_Y_m/s2",
                "Accelerometer_Z_m/s2",
            )
        ),
        FRD,
    ),
    Layout(
        "unix_ms_mdps.csv",
        text(
            titled(
                "UnixTime [ms]",
                "GYR_X (mdps)",
                "GYR_Y (mdps)",
                "GYR_Z (mdps)",
                "ACC_X (mg)",
                "ACC_Y (mg)",
                "ACC_Z (mg)",
            ),
            (whole(1e3, 17 * 10**11), *(DPS * 1e3).T, *(G * 1e3).T),
            ("%s", *["%.8f"] * 3, *["%.5f"] * 3),
        ),
        FRD,
    ),
    Layout(
        "epoch_title.csv",
        text(titled("Epoch", "wx", "wy", "wz", "ax", "ay", "az"), (TIME + 1.7e9, *GYRO.T, *ACCEL.T), SI_FORMATS),
        FRD,
        asks=True,
    ),
    Layout("marked_blanks.csv", text(["# timestamp, wx, wy, wz, ax, ay, az"], SI, SI_FORMATS), FRD, asks=True),
    Layout(
        "alpha.csv",
        text(
            [
                "#timestamp [us],omega_x [rad/s],omega_y [rad/s],omega_z [rad/s],alpha_x [m/s^2],alpha_y [m/s^2],alpha_z [m/s^2]"  # noqa: E501
            ],
            (whole(1e6), *GYRO.T, *ACCEL.T),
            TEXT_TIME_SI,
        ),
        FRD,
    ),
    Layout(
        "percent_units.txt",
        text(["% Time(s)  wx(rad/s)  wy(rad/s)  wz(rad/s)  fx(m/s^2)  fy(m/s^2)  fz(m/s^2)"], SI, SI_FORMATS, sep=" "),
        FRD,
    ),
    Layout(
        "bare_forces_first.csv",
        text([], (TIME, *ACCEL.T, *GYRO.T), ("%.3f", *["%.6f"] * 3, *["%.14f"] * 3)),
        FRD,
        asks=True,
    ),
    Layout(
        "bare_no_time.txt",
        text([], (*GYRO.T, *ACCEL.T), (*["%.14f"] * 3, *["%.6f"] * 3), sep="\t"),
        FRD,
        asks=True,
        fill=(("HZ", "100"),),
    ),
    Layout(
        "bare_time_last.txt",
        text([], (*(GYRO / 100).T, *(ACCEL / 100).T, TIME), (*["%.16f"] * 3, *["%.9f"] * 3, "%.3f"), sep=" "),
        FRD,
        asks=True,
    ),
    Layout(
        "bare_counter.csv",
        text(
            [],
            (whole(1.0), whole(1e3, 99), *DPS.T, *G.T, np.full(ROWS, 25.1)),
            ("%s", "%s", *["%.10f"] * 3, *["%.7f"] * 3, "%.1f"),
        ),
        FRD,
        asks=True,
    ),
    Layout(
        "bare_iso.csv",
        text(
            [],
            (stamps(lambda t: t.isoformat(timespec="milliseconds")), *DPS.T, *G.T),
            ("%s", *["%.10f"] * 3, *["%.7f"] * 3),
        ),
        FRD,
        asks=True,
    ),
    Layout(
        "bare_kind.csv",
        text([], (["IMU"] * ROWS, TIME, *DPS.T, *G.T), ("%s", "%.3f", *["%.10f"] * 3, *["%.7f"] * 3)),
        FRD,
        asks=True,
    ),
    Layout(
        "bare_week.csv",
        text(
            [],
            (["2300"] * ROWS, TIME + 388800, *(GYRO / 100).T, *(ACCEL / 100).T),
            ("%s", "%.3f", *["%.16f"] * 3, *["%.9f"] * 3),
        ),
        FRD,
        asks=True,
    ),
    Layout(
        "bare_semicolon.txt", text([], (TIME, *DPS.T, *ACCEL.T), FORMATS, sep=";").replace(b".", b","), FRD, asks=True
    ),
    Layout(
        "hour_minute_second.csv",
        text(titled("Hour", "Minute", "Second", *fields), ([11] * ROWS, [58] * ROWS, *PLAIN), ("%d", "%d", *FORMATS)),
        FRD,
    ),
    Layout(
        "date_in_six.csv",
        text(
            titled("YYYY", "MM", "DD", "hh", "mm", "ss.sss", *fields),
            ([2024] * ROWS, [3] * ROWS, [1] * ROWS, [11] * ROWS, [58] * ROWS, *PLAIN),
            (*["%d"] * 5, *FORMATS),
        ),
        FRD,
    ),
    Layout(
        "degree_signs.csv",
        text(titled("Time", *[f"Gyro{a} (°/sec)" for a in "XYZ"], *[f"Acc{a} (m/sec²)" for a in "XYZ"])),
        FRD,
    ),
    Layout(
        "per.csv",
        text(
            titled("time(s)", *[f"gyro_{a}(deg per sec)" for a in "xyz"], *[f"acc_{a}(meter per sec^2)" for a in "xyz"])
        ),
        FRD,
    ),
    Layout(
        "colon_ms.csv",
        text(
            titled("TimeStamp", *[f"Rate_{a}" for a in "XYZ"], *[f"Accel_{a}" for a in "XYZ"]),
            (stamps(lambda t: t.strftime("%H:%M:%S:%f")[:-3]), *DPS.T, *ACCEL.T),
            TEXT_TIME,
        ),
        FRD,
        asks=True,
    ),
    Layout(
        "am_pm.csv",
        text(titled("Time", *fields), with_time(stamps(lambda t: t.strftime("%I:%M:%S.%f %p"))), TEXT_TIME),
        FRD,
    ),
    Layout(
        "gps_increments.csv",
        text(
            titled("GPSWeek", "GPSSeconds", *[f"DeltaTheta{a}" for a in "XYZ"], *[f"DeltaVel{a}" for a in "XYZ"]),
            (["2300"] * ROWS, TIME + 388800, *(GYRO / 100).T, *(ACCEL / 100).T),
            ("%s", "%.3f", *["%.16f"] * 3, *["%.9f"] * 3),
        ),
        FRD,
        asks=True,
    ),
    Layout("two_rows_of_titles.csv", text(["Time,Gyro,,,Acc,,", "s,X,Y,Z,X,Y,Z"]), FRD, asks=True),
    Layout("two_rows_with_units.csv", text(["Time,Gyro (deg/s),,,Accel (m/s2),,", ",X,Y,Z,X,Y,Z"]), FRD),
    Layout(
        "omega_ib_b.csv",
        text(titled("t_s", *[f"omega_ib_b_{a}" for a in "xyz"], *[f"f_ib_b_{a}" for a in "xyz"]), SI, SI_FORMATS),
        FRD,
        asks=True,
    ),
    Layout(
        "magnetometer.csv",
        text(
            titled(
                "t", *[f"gyro_{a}" for a in "xyz"], *[f"acc_{a}" for a in "xyz"], *[f"mag_{a}" for a in "xyz"], "temp"
            ),
            (*PLAIN, *[np.ones(ROWS)] * 4),
            (*FORMATS, *["%.1f"] * 4),
        ),
        FRD,
        asks=True,
    ),
    Layout(
        "filtered_too.csv",
        text(
            [TITLED + ",Gyro X Filt (deg/s),Gyro Y Filt (deg/s),Gyro Z Filt (deg/s)"],
            (*PLAIN, *DPS.T),
            (*FORMATS, *["%.9f"] * 3),
        ),
        FRD,
    ),
    Layout(
        "linear_too.csv",
        text(
            [TITLED + ",Linear Acc X (m/s^2),Linear Acc Y (m/s^2),Linear Acc Z (m/s^2)"],
            (*PLAIN, *(ACCEL * 0).T),
            (*FORMATS, *["%.9f"] * 3),
        ),
        FRD,
    ),
    Layout(
        "ts_no_units.csv",
        text(
            titled("ts", *[f"g{a}" for a in "xyz"], *[f"a{a}" for a in "xyz"], *[f"m{a}" for a in "xyz"]),
            (whole(1e3), *DPS.T, *G.T, *[np.ones(ROWS)] * 3),
            ("%s", *FORMATS[1:], *["%.1f"] * 3),
        ),
        FRD,
        asks=True,
    ),
    Layout(
        "ini_sections.txt",
        text(["[HEADER]", "fs=100", "[UNITS]", "gyro=deg/s", "[DATA]"], (TIME, *DPS.T, *ACCEL.T), FORMATS, sep="\t"),
        FRD,
        asks=True,
    ),
    Layout("comma_in_comment.csv", text([TITLED + ",Comment"], (*PLAIN, ['"a, b"'] * ROWS), (*FORMATS, "%s")), FRD),
    Layout("dashes_below.csv", text([TITLED], foot="-----\n"), FRD),
    Layout("eof_below.csv", text([TITLED], foot="<EOF>\n"), FRD),
    Layout(
        "dps_and_g.csv",
        text([TITLED.replace("(deg/s)", "[dps]").replace("(m/s^2)", "[G]")], (TIME, *DPS.T, *G.T), FORMATS),
        FRD,
    ),
    Layout(
        "us_m_s_s.csv",
        text(
            titled("Time(us)", *[f"Gyro_{a}(rad/s)" for a in "XYZ"], *[f"Acc_{a}(m/s/s)" for a in "XYZ"]),
            (whole(1e6, 10**9), *GYRO.T, *ACCEL.T),
            TEXT_TIME_SI,
        ),
        FRD,
    ),
    Layout("compact_iso.csv", text(titled("Time", *fields), with_time(stamps(lambda t: t.strftime("%Y%m%dT%H%M%S.%f"))),
           TEXT_TIME), FRD),
    Layout("digits_of_a_date.csv", text(titled("timestamp", *fields), with_time(stamps(lambda t: t.strftime(
           "%Y%m%d%H%M%S%f")[:-3])), TEXT_TIME), FRD, says="without signs"),
    Layout("month_in_letters.csv", text(titled("Time", *fields), with_time(stamps(lambda t: t.strftime(
           "%d-%b-%Y %H:%M:%S.%f"))), TEXT_TIME), FRD),
    Layout("year_of_two_digits.csv", text(titled("Time", *fields), with_time(stamps(lambda t: t.strftime(
           "%m/%d/%y %H:%M:%S.%f"))), TEXT_TIME), FRD),
    Layout("timedelta.csv", text(titled("time", *fields), with_time([f"0 days 00:00:{t:09.6f}" for t in TIME]),
           TEXT_TIME), FRD),
    Layout("minutes.csv", text(titled("Time (min)", *fields), with_time(TIME / 60), ("%.9f", *FORMATS[1:])), FRD),
    Layout("ticks_of_10_us.csv", text(titled("Time (0.01 ms)", *fields), with_time(whole(1e5)), TEXT_TIME), FRD),
    Layout("spreadsheet_days.csv", text(titled("Time", *fields), with_time(45352.5 + TIME / 86400), ("%.12f",
           *FORMATS[1:])), FRD, says="days"),
    Layout("hundredths.csv", text(titled("time (s)", *[f"gyro_{a} (0.01 deg/s)" for a in "xyz"], *[f"acc_{a} (mg)"
           for a in "xyz"]), (TIME, *(100 * DPS).T, *(1e3 * G).T), FORMATS), FRD),
    Layout("rpm.csv", text(titled("time (s)", *[f"gyro_{a} (rpm)" for a in "xyz"], *[f"acc_{a} (ft/s^2)" for a in
           "xyz"]), (TIME, *(DPS / 6).T, *(ACCEL / 0.3048).T), ("%.3f", *["%.12f"] * 3, *["%.6f"] * 3)), FRD),
    Layout("chinese.csv", text(titled("时间(s)", *[f"角速度{a}(°/s)" for a in "XYZ"], *[f"加速度{a}(g)" for a in
           "XYZ"]), (TIME, *DPS.T, *G.T), FORMATS), FRD),
    Layout("raw_beside.csv", text(titled("t (s)", *[f"raw_w{a} (deg/s)" for a in "xyz"], *[f"w{a} (deg/s)" for a in
           "xyz"], *[f"g{a} (g)" for a in "xyz"]), (TIME, *(3 * DPS).T, *DPS.T, *G.T), ("%.3f", *["%.10f"] * 9)), FRD),
    Layout("wrong_titles.csv", text(titled("time (s)", *[f"gyro_{a} (rad/s)" for a in "xyz"], *[f"acc_{a} (m/s2)" for a
           in "xyz"]), (TIME, *DPS.T, *ACCEL.T), FORMATS), FRD, asks=True),
    Layout("whole_seconds.csv", text(titled("Time", *fields), with_time(stamps(lambda t: t.strftime("%H:%M:%S"))),
           TEXT_TIME), FRD, asks=True),
    Layout("sec_and_usec.csv", text(titled("tv_usec", "tv_sec", *fields), ([str(round(t * 1e6) % 10**6) for t in TIME],
           [str(17 * 10**8 + int(t + 1e-9)) for t in TIME], *PLAIN[1:]), ("%s", "%s", *FORMATS[1:])), FRD),
    Layout("seconds_twice.csv", text(titled("time_s", "time_ns", *fields), (TIME, whole(1e9), *PLAIN[1:]),
           ("%.3f", "%s", *FORMATS[1:])), FRD),
    Layout("host_and_device.csv", text(titled("host_time", "device_time_us", *fields), (TIME + 1.7e9 + 0.003 *
           (np.arange(ROWS) % 3), whole(1e6), *PLAIN[1:]), ("%.6f", "%s", *FORMATS[1:])), FRD, says="device_time_us"),
    Layout("parts_of_a_second.csv", text(titled("hour", "minute", "second", "millisecond", *fields), ([11] * ROWS,
           [58] * ROWS, [int(t + 1e-9) for t in TIME], [round(t * 1e3) % 1000 for t in TIME], *PLAIN[1:]), ("%d", "%d",
           "%d", "%d", *FORMATS[1:])), FRD),
]  # fmt: skip
