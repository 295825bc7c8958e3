"""Long files go through the commands in memory that does not grow with them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from still import SI, csv_file, rows_of, still

RATE = 600.0
ROWS, REPEATED = 270_000, 30_000  # a chunk of the command line and a bit, 7.5 min; rows that are repeated
TIMES = 4  # as long is the long file, 30 min
#: A copy of the samples that the long file has more, MB: what holding them all would cost at least.
ADDED = (TIMES - 1) * ROWS * 6 * 8 / 1e6


def peak_megabytes(arguments: list[str], folder: Path) -> float:
    """Largest memory of one run of the command line, a process of its own."""
    command = [sys.executable, "-m", "gyronorth.cli", *arguments]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "OMP_NUM_THREADS": "1"}
    process = subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode in (0, 3)
    return usage.ru_maxrss * 1024 / 1e6


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A short and a long CSV, the latter the rows of the former again and again."""
    folder = tmp_path_factory.mktemp("long")
    gyro, accel = still(REPEATED)
    rows = rows_of([*gyro.T, *accel.T]) * (ROWS // REPEATED)
    comments, header = [f"# rate_hz: {RATE}", "# latitude_deg: 32.11", *SI], "w_x,w_y,w_z,f_x,f_y,f_z"
    csv_file(folder, rows, comments=comments, header=header, name="short.csv")
    csv_file(folder, rows * TIMES, comments=comments, header=header, name="long.csv")
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        ["heading", "{}.csv", "--window", "300:400"],
        pytest.param(["allan", "{}.csv"], marks=pytest.mark.long),
        pytest.param(["convert", "{}.csv", "-o", "{}.h5"], marks=pytest.mark.long),
        pytest.param(["convert", "{}.csv", "-o", "{}.parquet"], marks=pytest.mark.long),
        pytest.param(["convert", "{}.csv", "-o", "{}.bag", "--decimate-to", "100"], marks=pytest.mark.long),
    ],
    ids=["heading", "allan", "h5", "parquet", "decimated bag"],
)
def test_memory_grows_by_less_than_half_of_the_samples(folder, command):
    short, long = (peak_megabytes([part.format(name) for part in command], folder) for name in ("short", "long"))
    # `allan` holds one axis of six, as it is, integrated, and for a moment its mean: at most half of all.
    assert long - short < ADDED / 2
