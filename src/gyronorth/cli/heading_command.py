"""gyronorth heading: one recording, or many of them, to headings with a verdict."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gyronorth.cli.app import app
from gyronorth.cli.correction import AnySession, Deviation, GyroBias, check_bias, curve_and_method
from gyronorth.cli.heading_drawing import draw
from gyronorth.cli.many_options import (
    Place,
    Resume,
    Scheduler,
    Sources,
    Windows,
    Workers,
    without_table,
)
from gyronorth.cli.many_run import TABLE_SUFFIXES, run_many, several
from gyronorth.cli.options import (
    OUTPUT,
    SITE,
    Json,
    MethodName,
    Model,
    Pitch,
    RequireSigma,
    Roll,
    SensorName,
    TurnAngles,
    TurnAngleSigma,
    attitude_given,
    plot_option,
)
from gyronorth.cli.outputs import PLOT_SUFFIXES, check_outputs, print_json, written
from gyronorth.cli.progress import reading_file, working
from gyronorth.cli.reading_options import with_reading

if TYPE_CHECKING:
    from gyronorth.many import Request
    from gyronorth.readers import ReadOptions
    from gyronorth.report.tables import Outcome
    from gyronorth.sensor import Sensor

#: Exit codes.
VALID, REFUSED = 0, 3
PAGE_SUFFIXES = (".html", ".htm")


@app.command()
@with_reading
def heading(
    sources: Sources,
    sensor: SensorName = None,
    method: MethodName = "auto",
    as_json: Json = False,
    posterior: Annotated[
        bool,
        typer.Option("--posterior", help="Put the density of the heading into the JSON.", rich_help_panel=OUTPUT),
    ] = False,
    csv: Annotated[
        Path | None,
        typer.Option(metavar="OUT.csv", help="Write a table, one row per recording.", rich_help_panel=OUTPUT),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="OUT.csv|.parquet", help="The same as CSV or Parquet.", rich_help_panel=OUTPUT),
    ] = None,
    resume: Resume = False,
    workers: Workers = None,
    scheduler: Scheduler = None,
    windows: Windows = None,
    plot: Annotated[Path | None, plot_option("heading against time and the Allan deviation")] = None,
    report: Annotated[
        Path | None,
        typer.Option(metavar="OUT.html", help="Write a report: one self-contained HTML page.", rich_help_panel=OUTPUT),
    ] = None,
    nmea: Annotated[
        bool,
        typer.Option(
            "--nmea", help="Print HETHS, HEHDT and a status sentence and nothing else.", rich_help_panel=OUTPUT
        ),
    ] = False,
    gyro_bias: GyroBias = None,
    roll: Roll = None,
    pitch: Pitch = None,
    model: Model = None,
    turn_angles: TurnAngles = None,
    turn_angle_sigma_deg: TurnAngleSigma = None,
    poses: Annotated[
        bool,
        typer.Option(
            "--poses",
            help="The files are poses of one unit, in order of time; give --turn-angles too.",
            rich_help_panel=SITE,
        ),
    ] = False,
    deviation: Deviation = None,
    any_session: AnySession = False,
    require_sigma: RequireSigma = None,
    *,
    reading: ReadOptions,
) -> int:
    """Find the heading of a recording, or of each of many.

    Exit code 0: a valid heading. 2: bad input. 3: no valid heading; the reasons are printed.
    For many: 2 if any could not be read, else 3 if any heading is not valid, else 0.
    """
    from gyronorth.errors import InputError
    from gyronorth.many import Request
    from gyronorth.sources.listing import recordings

    if as_json and nmea:
        raise InputError("--json and --nmea both print to standard output; give one of them.")
    if posterior and not as_json:
        raise InputError("--posterior puts the density of the heading into the JSON; add --json.")
    attitude = attitude_given(roll, pitch)
    outputs: dict[str, tuple[Path | None, tuple[str, ...]]]
    outputs = {"--csv": (csv, ()), "--out": (out, TABLE_SUFFIXES), "--plot": (plot, PLOT_SUFFIXES)}
    many = poses or windows is not None or several(sources, resume=resume)
    check_outputs(outputs | {"--report": (report, PAGE_SUFFIXES)}, source=None if many else Path(sources[0]))
    kept = _table_to_keep(csv, out, resume=resume, as_json=as_json)
    if many:
        of_one = (("--nmea", nmea), ("--posterior", posterior)) if not poses else ()
        single = [name for name, given in (("--plot", plot), ("--report", report), *of_one) if given]
        if single and poses:
            raise InputError(f"{single[0]} takes one recording, and --poses takes several; leave it out.")
        if single:
            what = f"{sources[0]} is a folder" if Path(sources[0]).is_dir() else "these are many"
            raise InputError(f"{single[0]} takes one recording, and {what}; --csv writes its table.")
    elif kept is not None:
        without_table(kept, recordings(sources))
    biased = gyro_bias is not None
    curve, method = curve_and_method(deviation, method, reading, any_session=any_session, biased=biased)
    if biased and model is not None:
        check_bias(model)
    request = Request(
        reading,
        _sensor(sensor),
        method,
        gyro_bias,
        attitude,
        model,
        turn_angles,
        curve,
        require_sigma,
        turn_angle_sigma_deg,
    )
    if poses:
        return _as_poses(sources, request, as_json=as_json, posterior=posterior, nmea=nmea, kept=kept)
    if many:
        place = Place(scheduler, workers)
        return _many(sources, request, place, as_json=as_json, kept=kept, resume=resume, windows=windows)
    given = {"as_json": as_json, "posterior": posterior, "nmea": nmea}
    return _file(sources[0], request, **given, kept=kept, plot=plot, report=report)


def _table_to_keep(csv: Path | None, out: Path | None, *, resume: bool, as_json: bool) -> Path | None:
    """The table that is asked for, by either name."""
    from gyronorth.errors import InputError

    if csv is not None and out is not None:
        raise InputError("--csv and --out both write the table; give one of them.")
    if resume and csv is None and out is None:
        raise InputError("--resume goes on with a table, and none is given: add --out FILE.")
    if resume and as_json:
        raise InputError("--resume finds only what is missing, and --json prints all; give one of them.")
    return out if csv is None else csv


def _file(
    address: str,
    request: Request,
    *,
    as_json: bool,
    posterior: bool,
    nmea: bool,
    kept: Path | None,
    plot: Path | None,
    report: Path | None,
) -> int:
    """One recording: its heading to standard output and the files asked for."""
    from gyronorth.report.tables import Outcome
    from gyronorth.sources.remote import at_hand, checksum_of

    with at_hand(address) as path:
        with reading_file(path) as progress:
            recording = request.read(path, progress)
        with working("finding north"):
            estimate = request.heading(recording)
        outcome = Outcome(address, estimate, heading_true=recording.heading_true, read_as=recording.read_as)
        if plot is not None or report is not None:
            with working("drawing"):
                draw(outcome, recording, request, plot=plot, report=report)
        if kept is not None:
            from gyronorth.many.table import write_table

            settings = request.settings()
            write_table(kept, settings, [outcome.stamped(checksum_of(path), settings)])
    _print(outcome, as_json=as_json, posterior=posterior, nmea=nmea)
    _tell_written(plot, report, kept)
    return VALID if estimate.valid else REFUSED


def _print(outcome: Outcome, *, as_json: bool, posterior: bool, nmea: bool) -> None:
    """The heading of one outcome to standard output."""
    estimate = outcome.estimate
    assert estimate is not None
    if as_json:
        print_json(estimate.to_json(posterior=posterior))
    elif nmea:
        from gyronorth.report.nmea import sentences

        sys.stdout.writelines(sentences(estimate))
    else:
        from gyronorth.report.terminal import print_heading

        print_heading(outcome, sys.stdout)


def _as_poses(
    sources: list[str], request: Request, *, as_json: bool, posterior: bool, nmea: bool, kept: Path | None
) -> int:
    """One heading of several files, each a pose of the same unit."""
    from gyronorth.errors import InputError
    from gyronorth.report.tables import Outcome
    from gyronorth.sources.listing import recordings
    from gyronorth.sources.remote import at_hand

    if kept is not None:
        raise InputError("--poses makes one heading of all files, and a table has a row for each; give --json instead.")
    items, read = recordings(sources), list[Any]()
    for item in items:
        with at_hand(item.address) as path, reading_file(path) as progress:
            read.append(request.read(path, progress))
    with working("finding north"):
        estimate = request.heading(read)
    name = " + ".join(item.name for item in items)
    outcome = Outcome(name, estimate, heading_true=read[-1].heading_true)
    _print(outcome, as_json=as_json, posterior=posterior, nmea=nmea)
    return VALID if estimate.valid else REFUSED


def _many(
    sources: list[str],
    request: Request,
    place: Place,
    *,
    as_json: bool,
    kept: Path | None,
    resume: bool,
    windows: tuple[float, float] | None,
) -> int:
    """Many recordings: one row each, an unreadable one with its error."""
    from gyronorth.many.headings import HeadingTask
    from gyronorth.many.table import HEADINGS, WINDOWS
    from gyronorth.many.tally import Tally
    from gyronorth.report.terminal import print_folder
    from gyronorth.sources.listing import recordings

    return run_many(
        recordings(sources),
        HeadingTask(request, windows),
        place,
        columns=HEADINGS if windows is None else WINDOWS,
        tally=Tally(),
        show=print_folder,
        as_json=as_json,
        kept=kept,
        resume=resume,
    )


def _tell_written(*paths: Path | None) -> None:
    for path in paths:
        if path is not None:
            written(path)


def _sensor(name_or_file: str | None) -> Sensor | None:
    if name_or_file is None:
        return None
    from gyronorth.sensor import read_sensor

    return read_sensor(name_or_file)
