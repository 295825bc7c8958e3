"""What `gyronorth heading` costs beyond its reading and its imports: ratios to scripts that do no more than these."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from functools import partial
from math import radians
from pathlib import Path

import numpy as np

from benchmarks.comparison import Comparison
from benchmarks.samples import LOADS
from gyronorth.readers import write
from gyronorth.simulation import simulate

RATE_HZ, LONG, SHORT, SEED = 600.0, 1800.0, 100.0, 1
#: pyarrow loads pandas where it can.
WITHOUT_PANDAS = """
import sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name == "pandas":
            raise ModuleNotFoundError("No module named 'pandas'", name=name)

sys.meta_path.insert(0, Absent())
"""
#: Most CPU time of ours over that of the script.
READING, IMPORTS = 1.6, 1.8


def comparisons() -> Iterator[Comparison]:
    """1.08 million rows of CSV and Parquet beside loading them, 60,000 rows beside the imports."""
    command = [sys.executable, "-m", "gyronorth.cli", "heading"]
    with tempfile.TemporaryDirectory() as folder:
        for suffix in ("csv", "parquet"):
            path = written(Path(folder, f"long.{suffix}"), LONG)
            of = [str(path), *([str(comments_of(path))] if suffix == "csv" else [])]
            loads, alone = ([sys.executable, "-c", code, *of] for code in (LOADS, WITHOUT_PANDAS + LOADS))
            yield Comparison(
                f"heading of {LONG * RATE_HZ:.0f} rows of {suffix}, six axes, the whole process",
                ours="gyronorth heading",
                candidates={
                    "gyronorth heading": partial(_run, [*command, str(path), "--sensor", "sdc500"]),
                    "pyarrow and means": partial(_run, loads),
                    "pyarrow and means, pandas not installed": partial(_run, alone),
                },
                targets={"pyarrow and means": 1 / READING},
            )
        for suffix in ("csv", "parquet"):
            path = written(Path(folder, f"short.{suffix}"), SHORT)
            yield Comparison(
                f"heading of {SHORT * RATE_HZ:.0f} rows of {suffix}, six axes, the whole process",
                ours="gyronorth heading",
                candidates={
                    "gyronorth heading": partial(_run, [*command, str(path), "--sensor", "sdc500", "--method", "mean"]),
                    "its imports": partial(_run, [sys.executable, "-c", "import typer, pydantic, numpy"]),
                },
                targets={"its imports": 1 / IMPORTS},
            )


def written(path: Path, duration: float) -> Path:
    """A simulated recording of so many seconds, in the file."""
    rng = np.random.default_rng(SEED)
    place = {"latitude": radians(32.11), "heading": radians(40)}
    write(simulate("sdc500", duration=duration, rate_hz=RATE_HZ, rng=rng, **place), path)
    return path


def comments_of(path: Path) -> int:
    """Lines of comments above the titles of a CSV."""
    with path.open() as file:
        return next(number for number, line in enumerate(file) if not line.startswith("#"))


def _run(command: list[str]) -> None:
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
