"""Sensors as tables in data-sheet units: the built-in profiles, and what a recording shows of its own."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TextIO

from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.errors import printable
from gyronorth.report.terminal import print_table
from gyronorth.sensor.terms import TERMS

if TYPE_CHECKING:
    from gyronorth.allan import Characterisation
    from gyronorth.sensor import Sensor

MILLI_G, MICRO_G = 1e-3 * STANDARD_GRAVITY, 1e-6 * STANDARD_GRAVITY
#: Column title and unit -> (triad, field of TriadErrors, one unit of the column in SI).
FIGURES = {
    ("gyro noise", "deg/sqrt(h)"): ("gyro", "white", DEG_PER_SQRT_HOUR),
    ("gyro B", "deg/h"): ("gyro", "flicker", DEG_PER_HOUR),
    ("gyro bias", "deg/h"): ("gyro", "turn_on_bias", DEG_PER_HOUR),
    ("accel noise", "ug/sqrt(Hz)"): ("accel", "white", MICRO_G),
    ("accel B", "mg"): ("accel", "flicker", MILLI_G),
    ("accel bias", "mg"): ("accel", "turn_on_bias", MILLI_G),
}
LEGEND = """
One standard deviation of one axis. Noise: angle (velocity) random walk. B: bias instability as flicker
coefficient, the Allan minimum / 0.664. Bias: from power-up to power-up. --json prints all terms.

"""


def figure_texts(sensor: Sensor) -> list[tuple[str, str]]:
    """The figures of a profile as (name, value with unit); one standard deviation of one axis each."""
    return [
        (title.replace(" B", " bias instability"), f"{_plain(getattr(getattr(sensor, triad), field) / one)} {unit}")
        for (title, unit), (triad, field, one) in FIGURES.items()
    ]


def _plain(value: float) -> str:
    """Three digits, and never a power of ten for a thousand or more."""
    return f"{value:.3g}" if value < 1000 else f"{value:.0f}"


def print_sensors(sensors: Sequence[Sensor], stream: TextIO) -> None:
    """Print one row of figures per sensor (one standard deviation of one axis), then the sources."""
    titles, units = zip(*FIGURES, strict=True)
    rows = [("", *units)]
    for sensor in sensors:
        values = (getattr(getattr(sensor, triad), field) / unit for triad, field, unit in FIGURES.values())
        rows.append((sensor.name, *(_plain(value) for value in values)))
    print_table(("sensor", *titles), rows, stream)
    stream.write(LEGEND)
    for sensor in sensors:
        stream.write(
            textwrap.fill(printable(f"{sensor.name}: {sensor.source}"), width=100, subsequent_indent="  ") + "\n"
        )


def print_characterisation(found: Characterisation, stream: TextIO) -> None:
    """Print the identified terms of each axis and of the triad, with 95 % intervals, then the remarks."""
    doc = found.to_json()
    stream.write(f"{printable(doc['source'])}: {doc['duration_s']:.6g} s at {doc['rate_hz']:.6g} Hz\n\n")
    for what in ("gyro", "accel"):
        if doc[what] is None:
            continue
        axes, triad = doc[what]["axes"], doc[what]["triad"]
        rows = [
            (name, unit, *(_value_text(axis[key]) for axis in axes), _term_text(triad[key]))
            for key, name, unit in _rows(what)
        ]
        print_table((what, "unit", "body x", "body y", "body z", "all three"), rows, stream, unwrapped=())
        stream.write("\n")
    stream.write("In brackets the 95 % interval (--json has those of each axis); < is an upper bound where the\n")
    stream.write("recording cannot tell the term from zero, ? where the curve does not follow the model.\n")
    stream.writelines(f"- {note}\n" for note in doc["notes"])


def _rows(what: str) -> list[tuple[str, str, str]]:
    """Key, name and unit of each term of a triad: what a heading hardly sees last."""
    terms = sorted(TERMS, key=lambda term: term.bounded_integral)
    units = (term.gyro if what == "gyro" else term.accel for term in terms)
    return [(unit.key, unit.words, unit.unit) for unit in units]


def _value_text(term: dict[str, Any]) -> str:
    if term["status"] == "not identified":
        return f"? < {term['high']:.3g}"
    return f"< {term['high']:.3g}" if term["value"] is None else f"{term['value']:#.3g}"


def _term_text(term: dict[str, Any]) -> str:
    interval = "" if term["value"] is None else f" ({term['low']:#.3g} to {term['high']:#.3g})"
    return _value_text(term) + interval
