"""Sensors as tables in data-sheet units: the built-in profiles, and what a recording shows of its own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TextIO

from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.report.terminal import print_table

if TYPE_CHECKING:
    from gyronorth.allan import Characterisation
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

#: Key of an identified term in JSON -> its name and unit for people.
TERMS = {
    "angle_random_walk_deg_sqrt_h": ("angle random walk", "deg/sqrt(h)"),
    "velocity_random_walk_m_s_sqrt_h": ("velocity random walk", "m/s/sqrt(h)"),
    "bias_instability_deg_h": ("bias instability B", "deg/h"),
    "bias_instability_mg": ("bias instability B", "mg"),
    "rate_random_walk_deg_h_sqrt_h": ("rate random walk", "deg/h/sqrt(h)"),
    "acceleration_random_walk_mg_sqrt_h": ("acceleration random walk", "mg/sqrt(h)"),
    "quantisation_arcsec": ("quantisation", "arcsec"),
    "quantisation_m_s": ("quantisation", "m/s"),
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


def print_characterisation(found: Characterisation, stream: TextIO) -> None:
    """Print the identified terms of each axis and of the triad, with 95 % intervals, then the remarks."""
    doc = found.to_json()
    stream.write(f"{doc['source']}: {doc['duration_s']:.6g} s at {doc['rate_hz']:.6g} Hz\n\n")
    rows = []
    for what in ("gyro", "accel"):
        if doc[what] is None:
            continue
        axes = [*doc[what]["axes"], doc[what]["triad"]]
        for key, (name, unit) in TERMS.items():
            if key in axes[0]:
                rows.append((f"{what} {name}", unit, *(_term_text(axis[key]) for axis in axes)))
    print_table(("error term", "unit", "body x", "body y", "body z", "all three"), rows, stream)
    stream.write("\nValue and 95 % interval; < is an upper bound where the recording cannot tell the term from zero.\n")
    stream.writelines(f"- {note}\n" for note in doc["notes"])


def _term_text(term: dict[str, Any]) -> str:
    if term["status"] == "not identified":
        return f"not identified, < {term['high']:.3g}"
    if term["value"] is None:
        return f"< {term['high']:.3g}"
    return f"{term['value']:.3g} ({term['low']:.3g} to {term['high']:.3g})"
