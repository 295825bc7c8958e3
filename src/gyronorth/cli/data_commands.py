"""gyronorth simulate, info and convert: recordings made, described and rewritten."""

from __future__ import annotations

from math import inf, isfinite, radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gyronorth.cli.app import app
from gyronorth.cli.options import (
    Json,
    Latitude,
    Pitch,
    Roll,
    check_outputs,
    degrees,
    number,
    print_json,
    with_reading,
)
from gyronorth.cli.progress import working

if TYPE_CHECKING:
    from gyronorth.readers import ReadOptions

OutputRecording = Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="Recording to write.")]


def parse_turn(text: str) -> tuple[float, float, float]:
    """START:DURATION:ANGLE in seconds and degrees as (s, s, rad)."""
    try:
        start, duration, angle_deg = map(float, text.split(":"))
    except ValueError:
        start = duration = angle_deg = inf
    if not (isfinite(start + angle_deg) and start >= 0 and 0 < duration < inf):
        raise typer.BadParameter(f"{text!r} is not START:DURATION:ANGLE in seconds and degrees; example: 60:5:90")
    return start, duration, radians(angle_deg)


@app.command()
def simulate(
    sensor: Annotated[str, typer.Option(metavar="NAME|FILE", help="Sensor profile; `gyronorth sensors` lists them.")],
    latitude: Latitude,
    heading: Annotated[
        Any,
        typer.Option(
            metavar="DEG",
            parser=degrees("a heading of -360 to 360 degrees", "40", low=-360, high=360),
            help="Heading at the start, clockwise from true north.",
        ),
    ],
    duration: Annotated[
        Any,
        typer.Option(metavar="S", parser=number("a positive length in seconds", "100", above=0), help="Length, s."),
    ],
    rate: Annotated[
        Any, typer.Option(metavar="HZ", parser=number("a positive rate in Hz", "100", above=0), help="Sample rate, Hz.")
    ],
    seed: Annotated[int, typer.Option(min=0, help="The same seed gives the same recording.")],
    output: OutputRecording,
    roll: Roll = None,
    pitch: Pitch = None,
    turn: Annotated[
        list[Any] | None,
        typer.Option(
            metavar="START:DURATION:ANGLE",
            parser=parse_turn,
            help="Turn about the vertical, s, s and degrees, positive clockwise seen from above; repeatable.",
        ),
    ] = None,
    disturbance: Annotated[str, typer.Option(metavar="KIND", help="quiet or sway.")] = "quiet",
    no_accel: Annotated[bool, typer.Option("--no-accel", help="Leave the accelerometer out.")] = False,
) -> None:
    """Write a simulated recording of a sensor, with its true heading."""
    import numpy as np

    from gyronorth import readers, simulation

    check_outputs({"-o": (output, ())})
    motion = simulation.Motion(turns=tuple(turn or ()), disturbance=disturbance)
    with working("simulating"):
        recording = simulation.simulate(
            sensor,
            latitude=latitude,
            heading=heading,
            duration=duration,
            rate_hz=rate,
            rng=np.random.default_rng(seed),
            roll=roll or 0.0,
            pitch=pitch or 0.0,
            motion=motion,
            accel=not no_accel,
        )
        readers.write(recording, output)
