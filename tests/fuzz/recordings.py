"""Small recordings in every format, each with the declarations it needs: what damage is done to."""

from __future__ import annotations

import gzip
import io
import json
import lzma
import struct
import zipfile
from math import radians
from pathlib import Path
from typing import Any

import h5py
import mcap.writer
import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.io
import zstandard
from fuzz.libraries import foreign
from pyarrow import orc

from gyronorth import Recording
from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY
from gyronorth.readers import write

SEED = 20240501
ROWS = 64
RATE_HZ = 1.0  # so that few rows last long enough for a valid heading
LATITUDE = radians(32.11)

Options = dict[str, Any]


def samples() -> tuple[np.ndarray, np.ndarray]:
    """Angular rate, rad/s, and specific force, m/s^2, of a level body at rest, heading 40 deg."""
    rng = np.random.default_rng(SEED)
    north, down = EARTH_RATE * np.cos(LATITUDE), -EARTH_RATE * np.sin(LATITUDE)
    rate = [north * np.cos(radians(40)), -north * np.sin(radians(40)), down]
    force = [0.0, 0.0, -STANDARD_GRAVITY]
    return rng.normal(rate, 1e-5, (ROWS, 3)), rng.normal(force, 1e-3, (ROWS, 3))


def rows_of(columns: list[np.ndarray], delimiter: str, end: str = "\n") -> str:
    return "".join(delimiter.join(f"{value:.9g}" for value in row) + end for row in np.column_stack(columns))


def base_files(folder: Path) -> list[tuple[str, bytes, Options]]:
    """File name, content and the declarations it needs, for every format."""
    gyro, accel = samples()
    time = np.arange(ROWS) / RATE_HZ
    flu = np.array([1, -1, -1])
    recording = Recording(gyro, accel, RATE_HZ, latitude=LATITUDE, session="one", start_time_utc="2024-05-01T12:00:00Z")
    bases: list[tuple[str, bytes, Options]] = []
    for suffix in (".csv", ".npz"):
        write(recording, folder / f"base{suffix}")
        bases.append((f"ours{suffix}", (folder / f"base{suffix}").read_bytes(), {}))
    mapped = "Time,gx,gy,gz,ax,ay,az,\r\n" + rows_of([time, np.degrees(gyro), accel / STANDARD_GRAVITY], ",", ",\r\n")
    columns = dict(zip(("w_x", "w_y", "w_z", "f_x", "f_y", "f_z"), ("gx", "gy", "gz", "ax", "ay", "az"), strict=True))
    units = {"gyro_unit": "deg/s", "accel_unit": "g", "latitude": LATITUDE}
    bases.append(("mapped.csv", mapped.encode(), {"columns": columns, "time_unit": "s", **units}))
    # The published layout implies 600 Hz: at the declared rate they are as long as the others.
    published = ",w_x,w_y,w_z,f_x,f_y,f_z\n" + rows_of([np.arange(ROWS), np.degrees(gyro), accel], ",")
    bases.append(("x_40.0.csv", published.encode(), {"latitude": LATITUDE, "rate_hz": RATE_HZ}))
    titles = "Time (s);Gyro X (deg/s);Gyro Y (deg/s);Gyro Z (deg/s);Acc X (g);Acc Y (g);Acc Z (g)"
    logger = f"LOGGER 3.2\n\n{titles}\n" + rows_of([time, np.degrees(gyro), accel / STANDARD_GRAVITY], ";")
    axes = {"axes": "frd", "latitude": LATITUDE}
    bases.append(("logger.csv", f"{logger}End of log\n".replace(".", ",").encode(), axes))
    bases.append(("logger16.csv", logger.encode("utf-16"), axes))
    # Right-front-up from forward-right-down, and counts of 0.01 arcsec and 1 ug s.
    turn, push = gyro[:, [1, 0, 2]] * [1, 1, -1], accel[:, [1, 0, 2]] * [1, 1, -1]
    counts = np.hstack([turn / RATE_HZ / (radians(0.01) / 3600), push / RATE_HZ / 9.78e-6])
    psins = "% PSINS-format SIMU log file.\n\n0 0 -40 0 0 0\n32.11 34.8 20 0 1000 9.78\n0.01 0.01 0.01 1 1 1\n"
    psins += rows_of([np.round(counts)], " ")
    bases.append(("psins.imu", psins.encode(), {}))
    counter = (np.arange(ROWS) * 4 + 65500) % 65536
    export = f"// Start Time: Unknown\n// Update Rate: {RATE_HZ}Hz\n"
    export += "PacketCounter\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z\n" + rows_of(
        [counter, accel * flu, gyro * flu], "\t"
    )
    bases.append(("export.txt", export.encode(), {"latitude": LATITUDE}))
    table = np.column_stack([time, np.degrees(gyro), accel / STANDARD_GRAVITY])
    matlab: list[dict[str, Any]] = [{"do_compression": True}, {"do_compression": False}]
    for number, how in enumerate(matlab):
        file = io.BytesIO()
        scipy.io.savemat(file, {"note": "text", "data": table}, **how)
        numbers = dict(zip(("t", *columns), range(7), strict=True))
        bases.append(
            (
                f"matlab{number}.mat",
                file.getvalue(),
                {"variable": "data", "columns": numbers, "time_unit": "s", **units},
            )
        )
        file = io.BytesIO()
        structs = {"imu1": {"t": time[:, None], "fb": accel, "wb": gyro, "freq": RATE_HZ, "note": "text"}}
        scipy.io.savemat(file, structs, **how)
        bases.append((f"navego{number}.mat", file.getvalue(), {"latitude": LATITUDE, "axes": "frd"}))
    bases += boxes(time, gyro, accel, table, units, bases[0][1])
    others = foreign(folder, gyro, accel, {**axes, "gyro_unit": "rad/s", "accel_unit": "m/s2"})
    return bases + texts(time, gyro, accel) + others + described(folder, time, gyro, accel)


def boxes(
    time: np.ndarray, gyro: np.ndarray, accel: np.ndarray, table: np.ndarray, units: Options, ours: bytes
) -> list[tuple[str, bytes, Options]]:
    """Arrays of NumPy, binary rows, a workbook, packed files and archives."""
    si = {"gyro_unit": "rad/s", "accel_unit": "m/s2", "axes": "frd", "latitude": LATITUDE, "time_unit": "s"}
    names = ("t", "w_x", "w_y", "w_z", "f_x", "f_y", "f_z")
    found: list[tuple[str, bytes, Options]] = []
    file = io.BytesIO()
    np.save(file, table)
    found.append(
        ("array.npy", file.getvalue(), {"columns": dict(zip(names, range(7), strict=True)), "time_unit": "s", **units})
    )
    file = io.BytesIO()
    np.savez_compressed(file, t=time, gyro=gyro, accel=accel)
    found.append(("foreign.npz", file.getvalue(), si))
    increments = np.column_stack([time + 388800, gyro / RATE_HZ, accel / RATE_HZ])
    rows = np.zeros(ROWS, dtype=[("time", "<f8"), ("counts", "<i4", (6,))])
    rows["time"] = 388800 + time
    rows["counts"] = np.round(np.hstack([np.degrees(gyro) / 1e-9, accel / 1e-7]))
    head = struct.pack("<8sbdiiddd", b"$IMURAW\0", 0, 8.8, 0, 0, RATE_HZ, 1e-9, 1e-7).ljust(512, b"\0")
    found.append(("waypoint.imr", head + rows.tobytes(), {"latitude": LATITUDE, "axes": "frd"}))
    found.append(("kfgins.bin", increments.astype("<f8").tobytes(), {"latitude": LATITUDE, "axes": "frd"}))
    book = openpyxl.Workbook()
    book.active.append(names)
    for row in np.column_stack([time, gyro, accel]).tolist():
        book.active.append(row)
    file = io.BytesIO()
    book.save(file)
    found.append(("sheet.xlsx", file.getvalue(), si))
    for suffix, pack in ((".gz", gzip.compress), (".xz", lzma.compress), (".zst", zstandard.compress)):
        found.append((f"packed.csv{suffix}", pack(ours), {}))
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, letter, values in (("Gyroscope.csv", "w", gyro), ("Accelerometer.csv", "f", accel)):
            header = f"t,{letter}_x,{letter}_y,{letter}_z\n"
            archive.writestr(name, header + rows_of([time, values], ","))
    found.append(("phone.zip", file.getvalue(), si))
    for name, clock in clocks(time).items():
        file = io.BytesIO()
        columns = [*clock.items(), *zip(("gx", "gy", "gz", "ax", "ay", "az"), [*gyro.T, *accel.T], strict=True)]
        pq.write_table(pa.table(dict(columns)), file)
        found.append((name, file.getvalue(), {key: si[key] for key in si if key != "time_unit"}))
    return found


def clocks(time: np.ndarray) -> dict[str, dict[str, np.ndarray]]:
    """Times in two columns."""
    since = 1_700_000_000_000_000_000 + (time * 1e9).astype("i8")
    return {
        "stamps.parquet": {"sec": since // 10**9, "nanosec": since % 10**9},
        "weeks.parquet": {"week": np.full(ROWS, 2200), "tow": 345600.0 + time},
    }


#: A sample over several lines, a message as ROS prints it, a line of InfluxDB, and a header of LabVIEW.
CONSOLE = "Time: {} s\nRotation X: {}, Y: {}, Z: {} rad/s\nAcceleration X: {}, Y: {}, Z: {} m/s^2\n\n"
ECHO = (
    "header:\n  stamp:\n    secs: {}\n    nsecs: 0\nangular_velocity:\n  x: {}\n  y: {}\n  z: {}\n"
    "linear_acceleration:\n  x: {}\n  y: {}\n  z: {}\n---\n"
)
INFLUX = "imu,unit=one gyro_x={},gyro_y={},gyro_z={},acc_x={},acc_y={},acc_z={} {}\n"
LABVIEW = (
    "LabVIEW Measurement\nSeparator\tTab\n***End_of_Header***\n\nChannels\t6\nY_Unit_Label\trad/s\trad/s\trad/s\tm/s2"
    "\tm/s2\tm/s2\nDelta_X\t1\t1\t1\t1\t1\t1\n***End_of_Header***\nX_Value\tgx\tgy\tgz\tax\tay\taz\n"
)


def texts(time: np.ndarray, gyro: np.ndarray, accel: np.ndarray) -> list[tuple[str, bytes, Options]]:
    """Texts that are no tables, and GnssLogger's own files."""
    si = {"gyro_unit": "rad/s", "accel_unit": "m/s2", "axes": "frd", "latitude": LATITUDE, "time_unit": "s"}
    rows = np.column_stack([time, gyro, accel]).tolist()
    objects = [{"t": row[0], "gyro": dict(zip("xyz", row[1:4], strict=True)), "acc": row[4:]} for row in rows]
    labels = "t: {} gx: {} gy: {} gz: {} ax: {} ay: {} az: {}\n"
    triples = "t={}; Gyro: {}, {}, {} Acc: {}, {}, {}\n"
    forms = {
        "lines.jsonl": "".join(json.dumps(each) + "\n" for each in objects),
        "array.json": json.dumps(objects, indent=1),
        "labels.txt": "".join(labels.format(*row) for row in rows),
        "triples.log": "".join(triples.format(*row) for row in rows),
        "console.txt": "".join(CONSOLE.format(*row) for row in rows),
        "echo.txt": "".join(ECHO.format(*row) for row in rows),
        "lab.txt": LABVIEW + "".join("\t".join(map(repr, row)) + "\n" for row in rows),
        "brackets.txt": "t,gx,gy,gz,ax,ay,az\n" + "".join(f"{row},\n" for row in rows),
    }
    logger = ["# Raw,utcTimeMillis,TimeNanos"]
    for kind in ("Accel", "Gyro"):
        fields = ",".join(f"Uncal{kind}{axis}" for axis in "XYZ")
        logger.append(f"# Uncal{kind},utcTimeMillis,elapsedRealtimeNanos,{fields},BiasX,BiasY,BiasZ")
    for i, row in enumerate(rows):
        stamp = f"{17 * 10**11 + 1000 * i},{10**14 + i * 10**9}"
        for kind, (x, y, z) in (("Gyro", row[1:4]), ("Accel", row[4:])):
            logger.append(f"Uncal{kind},{stamp},{x!r},{-y!r},{-z!r},0,0,0")
    found = [(name, text.encode(), si) for name, text in forms.items()]
    influx = "".join(INFLUX.format(*row[1:], 17 * 10**17 + i * 10**9) for i, row in enumerate(rows))
    found.append(("influx.txt", influx.encode(), {**si, "time_unit": "ns"}))
    return [*found, ("gnss_log.txt", ("\n".join(logger) + "\n").encode(), {"axes": "flu", "latitude": LATITUDE})]


def described(folder: Path, time: np.ndarray, gyro: np.ndarray, accel: np.ndarray) -> list[tuple[str, bytes, Options]]:
    """Messages with their definition, streams of Arrow, ORC, groups of HDF5, and columns of phones and of counts."""
    si = {"gyro_unit": "rad/s", "accel_unit": "m/s2", "axes": "frd", "latitude": LATITUDE}
    file = io.BytesIO()
    writer = mcap.writer.Writer(file)
    writer.start(profile="ros2", library="")
    definition = b"V stamp\nfloat64[3] gyro\nfloat64[] accel\n" + b"=" * 80 + b"\nMSG: p/V\nint32 sec\nuint32 nanosec\n"
    schema = writer.register_schema("p/msg/M", "ros2msg", definition)
    channel = writer.register_channel("/imu", "cdr", schema)
    for i in range(ROWS):
        body = struct.pack("<iI3dI4x3d", 1_700_000_000 + int(time[i]), 0, *gyro[i], 3, *accel[i])
        writer.add_message(channel, 10**18 + i * 10**9, b"\0\1\0\0" + body, 0)
    writer.finish()
    titles = ("t", "w_x", "w_y", "w_z", "f_x", "f_y", "f_z")
    table = pa.table(dict(zip(titles, (time, *gyro.T, *accel.T), strict=True)))
    stream = pa.BufferOutputStream()
    with pa.ipc.new_stream(stream, table.schema) as sink:
        sink.write_table(table)
    orc.write_table(table, str(folder / "base.orc"))
    with h5py.File(folder / "base.h5", "w") as groups:
        for name, values in (("gyro", gyro), ("accel", accel)):
            groups[f"{name}/data"], groups[f"{name}/time"] = values, time
    header = ",".join(["t (s)", *(f"{name}{a}" for name in ("gyro", "userAcceleration", "gravity") for a in "XYZ")])
    user, down = -accel / STANDARD_GRAVITY - [0, 0, 1], np.tile([0.0, 0.0, 1.0], (ROWS, 1))
    counts = [
        [f"0x{round(x) & 0xFFFFFFFF:08X}" for x in (*w / 1e-9, *f / 1e-6)] for w, f in zip(gyro, accel, strict=True)
    ]
    text = "t_ms,gx,gy,gz,ax,ay,az\n" + "".join(f"{1000 * i},{','.join(row)}\n" for i, row in enumerate(counts))
    scales = {"gyro_scale": 1e-9, "accel_scale": 1e-6}
    return [
        ("own.mcap", file.getvalue(), si),
        ("stream.arrows", stream.getvalue().to_pybytes(), {**si, "time_unit": "s"}),
        ("table.orc", (folder / "base.orc").read_bytes(), {**si, "time_unit": "s"}),
        ("groups.h5", (folder / "base.h5").read_bytes(), {**si, "time_unit": "s"}),
        ("phone.csv", f"{header}\n{rows_of([time, gyro, user, down], ',')}".encode(), {**si, "accel_unit": "g"}),
        ("hex.csv", text.encode(), {**si, **scales}),
    ]
