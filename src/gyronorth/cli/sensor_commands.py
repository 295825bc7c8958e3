"""gyronorth sensors, allan and plan: what a sensor is, what it shows of itself, what it can reach."""

from __future__ import annotations

import json
import sys
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gyronorth.catalogue import ALLAN_EXPORTS, METHODS
from gyronorth.cli import completion
from gyronorth.cli.app import app
from gyronorth.cli.many_options import Out, Place, Resume, Scheduler, Sources, Workers
from gyronorth.cli.many_run import run_files, several
from gyronorth.cli.options import OUTPUT, Force, Json, RequiredLatitude, RequiredSensor, plot_option
from gyronorth.cli.outputs import PLOT_SUFFIXES, check_outputs, print_json, written
from gyronorth.cli.progress import reading_file, share_done, working
from gyronorth.cli.reading_options import CHUNK_SAMPLES, with_reading

if TYPE_CHECKING:
    from gyronorth.readers import ReadOptions


#: Methods whose sigma can be predicted.
PLANNABLE = tuple(info.name for info in METHODS if info.plannable)


def plannable(text: str) -> str:
    """The name of a method that `plan` takes."""
    if text not in PLANNABLE:
        raise typer.BadParameter(f"{text!r} cannot be planned; one of {', '.join(PLANNABLE)} is expected")
    return text


def allan_export(text: str) -> str:
    """The name of an estimator that a profile is written for."""
    if text not in ALLAN_EXPORTS:
        raise typer.BadParameter(f"{text!r} is not one of {', '.join(ALLAN_EXPORTS)}")
    return text


@app.command()
def sensors(as_json: Json = False) -> None:
    """List the built-in sensor profiles with their figures and where these come from."""
    from gyronorth.report.sensors import print_sensors
    from gyronorth.sensor import profiles, read_sensor

    if as_json:
        print_json([json.loads(profiles.builtin_text(name)) for name in profiles.names()])
    else:
        print_sensors([read_sensor(name) for name in profiles.names()], sys.stdout)


@app.command()
@with_reading
def allan(
    sources: Sources,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="PROFILE", help="Write a profile for --sensor (JSON).")
    ] = None,
    sensor: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|FILE",
            autocompletion=completion.sensor,
            help="Profile that supplies what the recording cannot show, such as turn-on bias.",
        ),
    ] = None,
    export: Annotated[
        str | None,
        typer.Option(
            metavar="|".join(ALLAN_EXPORTS),
            parser=allan_export,
            autocompletion=completion.offered(lambda: ALLAN_EXPORTS),
            help="Print the profile for another estimator (YAML) and nothing else.",
            rich_help_panel=OUTPUT,
        ),
    ] = None,
    as_json: Json = False,
    plot: Annotated[Path | None, plot_option("the Allan deviation and the fitted error terms")] = None,
    force: Force = False,
    out: Out = None,
    resume: Resume = False,
    workers: Workers = None,
    scheduler: Scheduler = None,
    *,
    reading: ReadOptions,
) -> int:
    """Allan deviation of a recording at rest, and the error terms of its sensor with their intervals.

    Of many: the error terms of each. Exit code 2 if any could not be computed, else 0.
    """
    from gyronorth.errors import InputError
    from gyronorth.sources.remote import at_hand

    if out is not None or several(sources, resume=resume):
        from gyronorth.many.tasks import AllanTask, allan_columns
        from gyronorth.sensor import read_sensor

        single = [name for name, given in (("-o", output), ("--plot", plot), ("--export", export)) if given is not None]
        if single:
            raise InputError(f"{single[0]} takes one recording, and these are many; --out writes their table.")
        return run_files(
            sources,
            AllanTask(reading, None if sensor is None else read_sensor(sensor)),
            Place(scheduler, workers),
            columns=allan_columns(),
            shown=("gyro_angle_random_walk_deg_sqrt_h", "gyro_bias_instability_deg_h", "duration_s", "rate_hz"),
            what="read",
            as_json=as_json,
            out=out,
            resume=resume,
        )
    with at_hand(sources[0]) as path:
        return _allan_of(
            path, reading, output=output, sensor=sensor, export=export, as_json=as_json, plot=plot, force=force
        )


def _allan_of(
    source: Path,
    reading: ReadOptions,
    *,
    output: Path | None,
    sensor: str | None,
    export: str | None,
    as_json: bool,
    plot: Path | None,
    force: bool,
) -> int:
    """The Allan deviation of one recording, and what is written of it."""
    from gyronorth import readers
    from gyronorth.allan import axes_in_files, characterise
    from gyronorth.report.sensors import print_characterisation
    from gyronorth.sensor import read_sensor, write_sensor

    outputs = {"-o": (output, (".json",)), "--plot": (plot, PLOT_SUFFIXES)}
    check_outputs(outputs, source=source, kept=() if force else ("-o",))
    base = None if sensor is None else read_sensor(sensor)
    with ExitStack() as stack:
        with reading_file(source) as progress:
            _, chunks = readers.read_chunks(source, reading, chunk_samples=CHUNK_SAMPLES, progress=progress)
            recording = stack.enter_context(axes_in_files(chunks))
        source_name = recording.source.encode("utf-8", "backslashreplace").decode()  # a file name may be no UTF-8
        recording = replace(recording, source=source_name)
        with share_done("identifying error terms") as progress:
            found = characterise(recording, base=base, name=None if output is None else output.stem, progress=progress)
    if output is not None:
        write_sensor(found.sensor, output)
    if plot is not None:
        from gyronorth.report import figures

        with working("drawing"):
            figures.write(figures.characterisation_figure(found), plot)
    if export is not None:
        from gyronorth.allan.export import EXPORTS

        sys.stdout.write(EXPORTS[export](found.sensor, found.rate_hz))
    elif as_json:
        print_json(found.to_json())
    else:
        print_characterisation(found, sys.stdout)
    for path in (output, plot):
        if path is not None:
            written(path)
    return 0


@app.command()
def plan(
    sensor: RequiredSensor,
    latitude: RequiredLatitude,
    method: Annotated[
        Any,
        typer.Option(
            metavar="|".join(PLANNABLE),
            parser=plannable,
            autocompletion=completion.offered(lambda: PLANNABLE),
            help="Method to plan for.",
        ),
    ] = "mean",
    turns: Annotated[
        int | None,
        typer.Option(metavar="N", help="Also plan up to N turns, with 100 s of standing still shared by the poses."),
    ] = None,
    as_json: Json = False,
    plot: Annotated[Path | None, plot_option("sigma and its parts against time, and sigma at other latitudes")] = None,
) -> None:
    """Expected heading sigma of a sensor against time and latitude, and how long waiting helps."""
    from gyronorth import planning
    from gyronorth.report.plans import DURATIONS, print_plan, print_turns

    check_outputs({"--plot": (plot, PLOT_SUFFIXES)})
    planned = planning.plan(sensor, latitude=latitude, durations=DURATIONS, method=method)
    turned = None
    if turns is not None:
        with working("planning turns"):
            turned = planning.plan_turns(sensor, latitude=latitude, turns=turns)
    if plot is not None:
        from gyronorth.report import figures

        figures.write(figures.plan_figure(planned), plot)
    if as_json:
        print_json(planned.to_json() | ({} if turned is None else {"turns": turned.to_json()}))
    else:
        print_plan(planned, sys.stdout)
        if turned is not None:
            print_turns(turned, sys.stdout)
    if plot is not None:
        written(plot)
