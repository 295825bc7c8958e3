"""gyronorth simulate, info and convert: recordings made, described and rewritten."""

from __future__ import annotations

import sys
from math import inf, isfinite, radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gyronorth.catalogue import HELD_OUT, KINDS, PLATFORM, SLOW, WRITTEN_SUFFIXES
from gyronorth.cli import completion
from gyronorth.cli.app import app
from gyronorth.cli.many_options import Out, Place, Resume, Scheduler, Sources, Workers
from gyronorth.cli.many_run import run_files, several
from gyronorth.cli.options import Force, Json, Pitch, RequiredLatitude, RequiredSensor, Roll
from gyronorth.cli.outputs import check_outputs, print_json, written
from gyronorth.cli.parsers import degrees, number
from gyronorth.cli.progress import reading_file, working
from gyronorth.cli.reading_options import CHUNK_SAMPLES, with_reading

if TYPE_CHECKING:
    from gyronorth.readers import ReadOptions

#: What `readers.write` writes (a test compares; it is not imported for --help).
RECORDING_SUFFIXES = WRITTEN_SUFFIXES
OutputRecording = Annotated[
    Path,
    typer.Option("-o", "--output", metavar="FILE", help=f"Recording to write: {', '.join(RECORDING_SUFFIXES)}."),
]


def parse_turn(text: str) -> tuple[float, float, float]:
    """START:DURATION:ANGLE in seconds and degrees as (s, s, rad)."""
    try:
        start, duration, angle_deg = map(float, text.split(":"))
    except ValueError:
        start = duration = angle_deg = inf
    if not (isfinite(start + angle_deg) and start >= 0 and 0 < duration < inf):
        raise typer.BadParameter(f"{text!r} is not START:DURATION:ANGLE in seconds and degrees; example: 60:5:90")
    return start, duration, radians(angle_deg)


def parse_seed(text: str) -> int:
    """A whole number that is not negative."""
    if not (text.isascii() and text.isdigit()):
        raise typer.BadParameter(f"{text!r} is not a whole number of at least 0; example: 1")
    return int(text)


@app.command()
def simulate(
    sensor: RequiredSensor,
    latitude: RequiredLatitude,
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
    seed: Annotated[Any, typer.Option(metavar="N", parser=parse_seed, help="The same seed gives the same recording.")],
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
    disturbance: Annotated[
        str,
        typer.Option(
            metavar="KIND",
            autocompletion=completion.disturbance,
            help=f"{', '.join((*KINDS, *SLOW, *PLATFORM))}; not known to any method: {', '.join(HELD_OUT)}.",
        ),
    ] = "quiet",
    no_accel: Annotated[bool, typer.Option("--no-accel", help="Simulate no accelerometer.")] = False,
    force: Force = False,
) -> None:
    """Write a simulated recording of a sensor, with its true heading."""
    import numpy as np

    from gyronorth import readers, simulation

    check_outputs({"-o": (output, RECORDING_SUFFIXES)}, kept=() if force else ("-o",))
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
    written(output)


@app.command()
@with_reading
def info(
    sources: Sources,
    as_json: Json = False,
    out: Out = None,
    resume: Resume = False,
    workers: Workers = None,
    scheduler: Scheduler = None,
    *,
    reading: ReadOptions,
) -> int:
    """Show what a recording, or each of many, holds: format, units, axes, rate, length, reference, gaps, mean.

    Exit code 2 if any could not be read, else 0.
    """
    from gyronorth import readers
    from gyronorth.report.recordings import print_description
    from gyronorth.sources.remote import at_hand

    if out is not None or several(sources, resume=resume):
        from gyronorth.many.tasks import INFO_COLUMNS, InfoTask

        return run_files(
            sources,
            InfoTask(reading),
            Place(scheduler, workers),
            columns=INFO_COLUMNS,
            shown=("format", "rate_hz", "samples", "duration_s", "axes", "gaps", "notes"),
            what="read",
            as_json=as_json,
            out=out,
            resume=resume,
        )
    with at_hand(sources[0]) as path, reading_file(path) as progress:
        description = readers.describe(path, reading, progress=progress)
    if as_json:
        print_json(description.to_json())
    else:
        print_description(description, sys.stdout)
    return 0


@app.command()
@with_reading
def convert(
    sources: Sources,
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help=f"Recording to write: {', '.join(RECORDING_SUFFIXES)}. Of many, with a star for the name of each: "
            "'converted/*.h5'.",
        ),
    ],
    decimate_to: Annotated[
        Any,
        typer.Option(
            metavar="HZ",
            parser=number("a positive rate in Hz", "3", above=0),
            help="Average down to this rate, any ratio; keeps the mean exactly.",
        ),
    ] = None,
    force: Force = False,
    out: Out = None,
    resume: Resume = False,
    workers: Workers = None,
    scheduler: Scheduler = None,
    *,
    reading: ReadOptions,
) -> int:
    """Rewrite recordings in SI and body axes in the format of the output's suffix, at a lower rate if asked.

    Exit code 2 if any could not be read or written, else 0.
    """
    from gyronorth.errors import InputError
    from gyronorth.sources.remote import at_hand

    star = "*" in output.name
    if star or out is not None or several(sources, resume=resume):
        from gyronorth.many.tasks import CONVERT_COLUMNS, ConvertTask

        if not star or output.suffix.lower() not in RECORDING_SUFFIXES:
            raise InputError(
                f"-o {output}: many recordings are written to one file each. Put a star in the place of their names, "
                f"and a suffix of {', '.join(RECORDING_SUFFIXES)}, as in -o 'converted/*.h5'."
            )
        return run_files(
            sources,
            ConvertTask(reading, str(output), decimate_to, force or resume),
            Place(scheduler, workers),
            columns=CONVERT_COLUMNS,
            shown=CONVERT_COLUMNS[1:-1],
            what="written",
            as_json=False,
            out=out,
            resume=resume,
        )
    with at_hand(sources[0]) as source:
        return _convert_one(source, reading, output, decimate_to, force=force)


def _convert_one(source: Path, reading: ReadOptions, output: Path, decimate_to: float | None, *, force: bool) -> int:
    from gyronorth import readers
    from gyronorth.conditioning import decimated_chunks

    check_outputs({"-o": (output, RECORDING_SUFFIXES)}, source=source, kept=() if force else ("-o",))
    with reading_file(source, doing="converting") as progress:
        _, chunks = readers.read_chunks(source, reading, chunk_samples=CHUNK_SAMPLES, progress=progress)
        readers.write_chunks(chunks if decimate_to is None else decimated_chunks(chunks, decimate_to), output)
    written(output)
    return 0
