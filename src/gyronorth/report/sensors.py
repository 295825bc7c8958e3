"""The built-in sensors as a table in data-sheet units, their sources below it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, TextIO

from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.report.terminal import print_table

if TYPE_CHECKING:
    from gyronorth.sensor import Sensor

MILLI_G, MICRO_G = 1e-3 * STANDARD_GRAVITY, 1e-6 * STANDARD_GRAVITY
#: Column title -> (triad, field of TriadErrors, one unit of the column in SI).
FIGURES = {
    "angle random walk deg/sqrt(h)": ("gyro", "white", DEG_PER_SQRT_HOUR),
    "bias instability B deg/h": ("gyro", "flicker", DEG_PER_HOUR),
    "rate random walk deg/h/sqrt(h)": ("gyro", "random_walk", DEG_PER_HOUR / 60),
    "gyro turn-on deg/h": ("gyro", "turn_on_bias", DEG_PER_HOUR),
    "accel noise ug/sqrt(Hz)": ("accel", "white", MICRO_G),
    "accel B mg": ("accel", "flicker", MILLI_G),
    "accel turn-on mg": ("accel", "turn_on_bias", MILLI_G),
}


def print_sensors(sensors: Sequence[Sensor], stream: TextIO) -> None:
    """Print one row of figures per sensor (one standard deviation of one axis), then the sources."""
    rows = []
    for sensor in sensors:
        values = (getattr(getattr(sensor, triad), field) / unit for triad, field, unit in FIGURES.values())
        rows.append([sensor.name, *(f"{value:.3g}" for value in values)])
    print_table(("sensor", *FIGURES), rows, stream)
    stream.write("\nOne standard deviation of one axis. B is the flicker coefficient: the Allan minimum / 0.664.\n\n")
    for sensor in sensors:
        stream.write(f"{sensor.name}: {sensor.source}\n")
