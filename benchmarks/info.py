"""`gyronorth info` on files of a gigabyte: a CSV of 8 h at 600 Hz and, of its first hours, the other formats.

It takes some minutes and 6 GB in the folder for temporary files. The library's reader of ROS 2 stands for a peer:
it only opens the database.
"""

from __future__ import annotations

import sqlite3
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.comparison import Comparison
from benchmarks.memory import RATE_HZ, write_long
from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY
from gyronorth.readers.imu_message import IMU_TYPES, encode

#: Seconds of the recording in each format, for about a gigabyte; 0: all.
SECONDS = {"h5": 0, "parquet": 0, "mcap": 5000, "bag": 5000}
MESSAGES, START = 2_900_000, 1_714_564_800_000_000_000
#: Promised CPU seconds.
PROMISED = 1.0
OPEN = "import sys; from pathlib import Path; from rosbags.rosbag2 import Reader\nwith Reader(Path(sys.argv[1])): pass"


def comparisons() -> Iterator[Comparison]:
    """One format after the other."""
    command = [sys.executable, "-m", "gyronorth.cli"]
    with tempfile.TemporaryDirectory() as name:
        long = Path(name) / "long.csv"
        write_long(long)
        paths = [long]
        for suffix, seconds in SECONDS.items():
            paths.append(long.with_suffix(f".{suffix}"))
            window = ["--window", f"0:{seconds}"] if seconds else []
            _run([*command, "convert", str(long), *window, "-o", str(paths[-1])])
        paths.append(long.with_suffix(".db3"))
        _write_database(paths[-1])
        for path in paths:
            ours = {"gyronorth info": partial(_run, [*command, "info", str(path)])}
            peer = {"rosbags opens it": partial(_run, [sys.executable, "-c", OPEN, str(path)])}
            title = f"info of a file {path.suffix}, {path.stat().st_size / 1e6:.0f} MB, the whole process"
            both = ours | peer if path.suffix == ".db3" else ours
            yield Comparison(title, ours="gyronorth info", candidates=both, limit=PROMISED)


def _write_database(path: Path) -> None:
    """A database of ROS 2 (schema 3) with two topics, one of Imu messages."""
    rng = np.random.default_rng(8)
    database = sqlite3.connect(path)
    database.executescript(
        "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);"
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
        " serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,"
        " data BLOB NOT NULL);"
        "CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
        "INSERT INTO schema VALUES (3, 'humble');"
        f"INSERT INTO topics VALUES (1, '/imu', '{IMU_TYPES[1]}', 'cdr', ''), (2, '/t', 'std_msgs/msg/Time', 'cdr', '')"
    )
    for first in range(0, MESSAGES, 100_000):
        stamp = START + np.rint((first + np.arange(100_000)) / RATE_HZ * 1e9).astype(np.int64)
        rate = rng.normal(EARTH_RATE * np.array([0.6, -0.5, 0.62]), 1e-4, (100_000, 3))
        force = rng.normal([0, 0, STANDARD_GRAVITY], 1e-3, (100_000, 3))
        messages = encode(stamp, rate, force, first=first, cdr=True)
        rows = ((time, bytes(message)) for time, message in zip(stamp.tolist(), messages, strict=True))
        database.executemany("INSERT INTO messages (topic_id, timestamp, data) VALUES (1, ?, ?)", rows)
    database.commit()
    database.close()


def _run(command: list[str]) -> None:
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
