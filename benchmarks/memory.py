"""Peak memory of the commands on a long CSV: 8 h at 600 Hz, six axes, 5 GB in the folder for temporary files."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.comparison import Comparison
from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY

RATE_HZ, DURATION = 600.0, 8 * 3600
#: Rows of text that are made once and repeated.
REPEATED = 60_000
SEED = 8
#: Promised peak, MB.
PROMISED = 500.0
COMMANDS = {
    "heading --window": ["heading", "{}", "--window", "28600:28700"],
    "allan": ["allan", "{}"],
    "convert to HDF5": ["convert", "{}", "-o", "out.h5"],
    "convert to Parquet": ["convert", "{}", "-o", "out.parquet"],
    "convert to CSV": ["convert", "{}", "-o", "out.csv"],
}


def comparisons() -> Iterator[Comparison]:
    """One command after the other."""
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "long.csv"
        write_long(path)
        rows = round(RATE_HZ * DURATION)
        for title, arguments in COMMANDS.items():
            command = [argument.format(path) for argument in arguments]
            yield Comparison(
                f"{title}, a CSV of {rows} rows, {path.stat().st_size / 1e6:.0f} MB",
                ours="gyronorth",
                candidates={"gyronorth": partial(peak_megabytes, command, folder=Path(name))},
                rounds=1,
                megabytes=PROMISED,
            )


def peak_megabytes(arguments: list[str], *, folder: Path) -> float:
    """Largest memory of one run of the command line, a process of its own."""
    command = [sys.executable, "-m", "gyronorth.cli", *arguments]
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(map(os.path.abspath, sys.path))
    }  # the code that runs here
    process = subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in (0, 3):  # 3: a heading that is not valid
        raise RuntimeError(f"gyronorth {' '.join(arguments)} ended with exit code {process.returncode}")
    return usage.ru_maxrss / 1024  # KiB on Linux


def write_long(path: Path) -> None:
    """A CSV of `DURATION` s, the same rows again and again."""
    rng = np.random.default_rng(SEED)
    rate = EARTH_RATE * np.array([0.6, -0.5, -0.62])
    samples = np.hstack(
        [rng.normal(rate, 1e-4, (REPEATED, 3)), rng.normal([0, 0, -STANDARD_GRAVITY], 1e-3, (REPEATED, 3))]
    )
    text = "".join(",".join(f"{value:.9g}" for value in row) + "\n" for row in samples.tolist())
    with path.open("w", encoding="utf-8") as file:
        file.write(f"# rate_hz: {RATE_HZ}\n# gyro_unit: rad/s\n# accel_unit: m/s2\n# axes: frd\n# latitude_deg: 38.6\n")
        file.write("w_x,w_y,w_z,f_x,f_y,f_z\n")
        for _ in range(round(RATE_HZ * DURATION) // REPEATED):
            file.write(text)
