"""A body at rest for tests of the readers: its samples and its files as text."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY

LATITUDE = radians(32.11)
HEADING = radians(40.0)
TITLES = ("t", "w_x", "w_y", "w_z", "f_x", "f_y", "f_z")
#: Comment lines of a file in SI and body axes, without its rate.
SI = ("# gyro_unit: rad/s", "# accel_unit: m/s2", "# axes: frd")


def still(rows: int, *, seed: int = 1) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Angular rate, rad/s, and specific force, m/s^2, level at `LATITUDE`, heading `HEADING`, body axes."""
    rng = np.random.default_rng(seed)
    north, down = EARTH_RATE * np.cos(LATITUDE), -EARTH_RATE * np.sin(LATITUDE)
    rate = [north * np.cos(HEADING), -north * np.sin(HEADING), down]
    return rng.normal(rate, 1e-5, (rows, 3)), rng.normal([0.0, 0.0, -STANDARD_GRAVITY], 1e-3, (rows, 3))


def rows_of(columns: Sequence[NDArray[np.float64]], delimiter: str = ",", end: str = "\n") -> list[str]:
    """Rows of text that read back to the same numbers."""
    return [delimiter.join(map(repr, row)) + end for row in np.column_stack(columns).tolist()]


def csv_rows(rows: int, *, rate_hz: float = 100.0) -> list[str]:
    """Rows of a CSV in SI and body axes, with time."""
    return rows_of([np.arange(rows) / rate_hz, *still(rows)])


def csv_file(
    folder: Path,
    rows: Sequence[str],
    *,
    comments: Sequence[str] = SI,
    header: str = ",".join(TITLES),
    name: str = "rec.csv",
    end: str = "\n",
) -> Path:
    """Write a CSV from its parts and return its path."""
    path = folder / name
    path.write_text("".join(line + end for line in comments) + header + end + "".join(rows), newline="")
    return path
