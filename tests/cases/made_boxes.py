"""The unit of `made.py` in files that are no text, and in bags as foreign drivers make them."""

from __future__ import annotations

import gzip
import io
import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import openpyxl
import scipy.io
from cases import made
from cases.made import FLU, SECONDS_OF_WEEK, SEVEN, SHORT, TEXTS, swapped
from ros_files import ROS1, message, write_bag1

from gyronorth.earth import STANDARD_GRAVITY

NAMES = ("t", "w_x", "w_y", "w_z", "f_x", "f_y", "f_z")
TIME, GYRO, ACCEL = made.TIME[:SHORT], made.GYRO[:SHORT], made.ACCEL[:SHORT]
TABLE = np.column_stack([TIME, GYRO, ACCEL])
#: Samples of a bag, 20 s, and its accelerometer's rate where that has messages of its own.
BAG_ROWS, SLOW_HZ = 2000, 62.5
#: Rows of a workbook, which are slow to write.
SHEET_ROWS = 500
START = 1_700_000_000_000_000_000


def saved(write: Callable[[io.BytesIO], object]) -> bytes:
    file = io.BytesIO()
    write(file)
    return file.getvalue()


def matlab(**variables: object) -> bytes:
    return saved(lambda file: scipy.io.savemat(file, variables, do_compression=True))  # pyright: ignore


def navego() -> bytes:
    zero = np.zeros((1, 3))
    return matlab(imu1={"t": TIME[:, None], "fb": ACCEL, "wb": GYRO, "freq": 100.0, "arw": zero, "ini_align": zero})


def psins() -> bytes:
    turned = [np.column_stack(swapped(values)) / 100 for values in (GYRO, ACCEL)]
    return matlab(trj={"imu": np.column_stack([*turned, TIME + 0.01]), "ts": 0.01, "avp0": np.zeros((9, 1))})


def records() -> np.ndarray:
    return np.rec.fromarrays(TABLE.T, names=list(NAMES))


def phone() -> bytes:
    def write(file: io.BytesIO) -> None:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("Gyroscope.csv", TEXTS["gyro-0.csv"]())
            archive.writestr("Accelerometer.csv", TEXTS["accel-0.csv"]())

    return saved(write)


def sheet() -> bytes:
    book = openpyxl.Workbook(write_only=True)
    page = book.create_sheet()
    page.append(NAMES)
    for row in np.column_stack(SEVEN)[:SHEET_ROWS].tolist():
        page.append(row)
    return saved(book.save)


#: File -> its content.
BOXES: dict[str, Callable[[], bytes]] = {
    "navego.mat": navego,
    "psins_trj.mat": psins,
    "separate.mat": lambda: matlab(t=TIME[:, None], gyro=GYRO, acc=ACCEL),
    "transposed.mat": lambda: matlab(data=TABLE.T),
    "ascii.mat": lambda: saved(lambda file: np.savetxt(file, TABLE, fmt="%16.9e")),
    "array.npy": lambda: saved(lambda file: np.save(file, TABLE)),
    "named.npy": lambda: saved(lambda file: np.save(file, np.asarray(records()))),
    "foreign.npz": lambda: saved(lambda file: np.savez_compressed(file, t=TIME, gyro=GYRO, accel=ACCEL)),
    "dict.pkl": lambda: pickle.dumps({"t": TIME, "gyro": GYRO, "accel": ACCEL}),
    "kfgins.bin": lambda: np.column_stack([TIME + SECONDS_OF_WEEK, GYRO / 100, ACCEL / 100]).astype("<f8").tobytes(),
    "base.csv.gz": lambda: gzip.compress(TEXTS["base.csv"](), 1),
    "phone_export.zip": phone,
    "sheet.xlsx": sheet,
}


def stamped(time: float, rate: object, force: object) -> tuple[int, bytes]:
    stamp = START + round(time * 1e9)
    content = message(ROS1, (stamp, rate, force))  # type: ignore[arg-type]
    content.angular_velocity_covariance[::4] = content.linear_acceleration_covariance[::4] = 0.01
    return stamp, bytes(ROS1.serialize_ros1(content, "sensor_msgs/msg/Imu"))


def topic(gyro: np.ndarray, accel: np.ndarray) -> list[tuple[int, bytes]]:
    return [stamped(*row) for row in zip(TIME[:BAG_ROWS], gyro, accel, strict=True)]


def bags() -> dict[str, dict[str, list[tuple[int, bytes]]]]:
    """Bag -> topic -> its messages.

    Sources: novatel_gps_driver 19 (a SPAN frame right-forward-up goes out unturned), novatel_oem7_driver 79 and 110
    (half the true rate in a table halves both quantities), realsense-ros 2452 and 598 (two topics, the other quantity
    zero with a positive covariance) and 186 (each message holds one of the two), duro_gps_driver 9 (counts, not SI).
    """
    gyro, accel, zero = GYRO[:BAG_ROWS], ACCEL[:BAG_ROWS], np.zeros(3)
    rates = [stamped(time, rate, zero) for time, rate in zip(TIME[:BAG_ROWS], gyro * FLU, strict=True)]
    slow = np.arange(round(BAG_ROWS / 100 * SLOW_HZ)) / SLOW_HZ
    forces = [stamped(time, zero, (0, 0, STANDARD_GRAVITY)) for time in slow]
    late = [stamped(time + 1e-3, zero, (0, 0, STANDARD_GRAVITY)) for time in slow]
    counts = np.round(gyro * FLU / np.radians(1 / 262.4)), np.round(accel * FLU / STANDARD_GRAVITY * 4096)
    turned = [np.column_stack(swapped(values)) for values in (gyro, accel)]
    return {
        "novatel_rfu.bag": {"/novatel/imu": topic(*turned)},
        "oem7_half.bag": {"/gps/imu": topic(gyro * FLU / 2, accel * FLU / 2)},
        "realsense_two_topics.bag": {"/camera/gyro/sample": rates, "/camera/accel/sample": forces},
        "zr300_interleaved.bag": {"/camera/imu/data_raw": sorted(rates + late)},
        "duro_counts.bag": {"/imu": topic(*counts)},
    }


def write_bags(folder: Path) -> None:
    """All bags."""
    for name, topics in bags().items():
        write_bag1(folder / name, topics)
