"""Captures of units against real time: `python -m benchmarks frames [NAME ...] [--json FILE]`.

Every form of every protocol at 1 kHz, a unit at rest, through `gyronorth heading FILE` and through `gyronorth live -`,
one process each; CPU time of the process and its children. Start-up is no part of what a second costs: this is the
slope over two lengths. The plain time of the longer capture, with start-up, is told beside it. Exit code 1 where a
slope is less than promised.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from dataclasses import dataclass
from math import degrees
from pathlib import Path
from typing import Any

import pytest

from benchmarks.samples import measured
from gyronorth.readers import ReadOptions
from gyronorth.readers.asking import declared_options

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from frames.encoders import CASES
from unit_at_rest import unit

#: The rate of all captures, Hz, and their lengths, s.
RATE_HZ, LENGTHS = 1000.0, (60, 300)
#: A second is to cost this many times less.
REAL_TIME = 100.0


@dataclass(frozen=True)
class Capture:
    """One length of one form."""

    path: Path
    seconds: int
    declared: list[str]  # options

    def by_heading(self) -> float:
        """CPU time, s, of `heading FILE`."""
        return measured([*COMMAND, "heading", str(self.path), *self.declared])["cpu_s"]

    def by_live(self) -> float:
        """CPU time, s, of `live -`."""
        return measured([*COMMAND, "live", "-", "--no-page", *self.declared], stdin=self.path)["cpu_s"]


COMMAND = (sys.executable, "-m", "gyronorth.cli")


def main(arguments: list[str]) -> int:
    """Measure, print a line for each form, and write the figures where they are asked for."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks frames")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"which forms, of {', '.join(CASES)}; default all")
    parser.add_argument("--json", type=Path, help="write the figures here")
    given = parser.parse_args(arguments)
    found = []
    for name in given.names or CASES:
        with tempfile.TemporaryDirectory() as folder:
            found.append({"form": name} | figures(*captures(name, Path(folder))))
        print(json.dumps(found[-1]), flush=True)
    if given.json:
        given.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    return 1 if min(min(each["heading"]["times"], each["live"]["times"]) for each in found) < REAL_TIME else 0


def captures(name: str, folder: Path) -> tuple[Capture, Capture]:
    """A short and a long capture of one form, the short one the begin of the other."""
    with pytest.MonkeyPatch.context() as patch:
        case, options = unit(name, patch, seconds=LENGTHS[1], rate_hz=RATE_HZ)
    made = []
    for seconds in LENGTHS:
        path = folder / f"{seconds}.bin"
        path.write_bytes(case.preamble + b"".join(case.frames[: round(seconds * RATE_HZ)]))
        made.append(Capture(path, seconds, words(options)))
    return made[0], made[1]


def words(options: ReadOptions) -> list[str]:
    """What must be declared, as the command line takes it."""
    assert options.latitude is not None
    named = {"--latitude": repr(degrees(options.latitude)), "--protocol": options.protocol, "--imu": options.imu}
    given = [word for pair in named.items() if pair[1] is not None for word in pair if word]
    return [*given, *declared_options(options), *(["--increments", "none"] if options.increments is False else [])]


def figures(short: Capture, long: Capture) -> dict[str, Any]:
    """How many times faster than real time, by the slope and as a whole."""
    found: dict[str, Any] = {"seconds": [short.seconds, long.seconds]}
    for name in ("heading", "live"):
        of_short, of_long = (getattr(capture, f"by_{name}")() for capture in (short, long))
        slope = (of_long - of_short) / (long.seconds - short.seconds)
        found[name] = {"cpu_s": [round(of_short, 2), round(of_long, 2)], "times": round(1 / slope, 1)}
        found[name]["whole_times"] = round(long.seconds / of_long, 1)
    return found
