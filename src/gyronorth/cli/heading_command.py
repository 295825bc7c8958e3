"""gyronorth heading: one recording, or a folder of them, to headings with a verdict."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gyronorth.cli.app import app
from gyronorth.cli.correction import AnySession, Deviation, GyroBias, check_bias, curve_and_method
from gyronorth.cli.options import (
    DEG_PER_HOUR,
    OUTPUT,
    PLOT_SUFFIXES,
    SITE,
    Json,
    MethodName,
    Pitch,
    Plot,
    RequireSigma,
    Roll,
    SensorName,
    angles,
    check_outputs,
    print_json,
    with_reading,
    written,
)
from gyronorth.cli.progress import files_done, reading_file, working

if TYPE_CHECKING:
    from gyronorth.allan import AllanDeviation
    from gyronorth.deviation import DeviationModel
    from gyronorth.estimate import HeadingEstimate
    from gyronorth.readers import ReadOptions
    from gyronorth.recording import Recording
    from gyronorth.report.tables import Outcome
    from gyronorth.sensor import Sensor

#: Fewest samples of which an Allan deviation is drawn.
SHORTEST_ALLAN = 100

#: Exit codes.
VALID, BAD_INPUT, REFUSED = 0, 2, 3


@dataclass(frozen=True)
class Request:
    """What is asked of every recording; SI units and radians."""

    reading: ReadOptions
    sensor: Sensor | None
    method: str
    gyro_bias: tuple[float, float, float] | None  # rad/s, body axes
    attitude: tuple[float, float] | None  # roll, pitch, rad
    model: Path | None = None  # bundle
    turn_angles: tuple[float, ...] | None = None  # rad
    deviation: DeviationModel | None = None
    require_sigma: float | None = None  # rad

    def read(self, path: Path, progress: Callable[[float], None] | None = None) -> Recording:
        """The recording, less its known bias."""
        from gyronorth import readers

        recording = readers.read(path, self.reading, progress=progress)
        return recording if self.gyro_bias is None else recording.without_bias(self.gyro_bias)

    def heading(self, recording: Recording) -> HeadingEstimate:
        """What the pipeline finds."""
        from gyronorth import pipeline

        return pipeline.heading(
            recording,
            latitude=self.reading.latitude,
            sensor=self.sensor,
            method=self.method,
            model=self.model,
            attitude=self.attitude,
            turn_angles=self.turn_angles,
            deviation=self.deviation,
            require_sigma=self.require_sigma,
        )


@app.command()
@with_reading
def heading(
    source: Annotated[Path, typer.Argument(metavar="FILE|FOLDER", help="A recording, or a folder of recordings.")],
    sensor: SensorName = None,
    method: MethodName = "auto",
    as_json: Json = False,
    csv: Annotated[
        Path | None, typer.Option(metavar="OUT.csv", help="Write a table, one row per file.", rich_help_panel=OUTPUT)
    ] = None,
    plot: Plot = None,
    report: Annotated[
        Path | None, typer.Option(metavar="OUT.html", help="Write one self-contained page.", rich_help_panel=OUTPUT)
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
    model: Annotated[
        Path | None, typer.Option(metavar="BUNDLE", help="Trained bundle for --method learned, paper or baseline.")
    ] = None,
    turn_angles: Annotated[
        Any,
        typer.Option(
            metavar="A,B,..",
            parser=angles,
            help="Angles of the turns between poses, degrees, positive clockwise; else the gyro measures them.",
            rich_help_panel=SITE,
        ),
    ] = None,
    deviation: Deviation = None,
    any_session: AnySession = False,
    require_sigma: RequireSigma = None,
    *,
    reading: ReadOptions,
) -> int:
    """Find the heading of a recording, or of every recording in a folder.

    Exit code 0: a valid heading. 2: bad input. 3: no valid heading; the reasons are printed.
    For a folder: 2 if any file could not be read, else 3 if any heading is not valid, else 0.
    """
    from gyronorth.errors import InputError
    from gyronorth.readers import is_bag_folder

    if as_json and nmea:
        raise InputError("--json and --nmea both print to standard output; give one of them.")
    if (roll is None) != (pitch is None):
        raise InputError("--roll and --pitch belong together; give both, for example --roll 0 --pitch 0.")
    suffixes = (".html", ".htm")
    check_outputs({"--csv": (csv, ()), "--plot": (plot, PLOT_SUFFIXES), "--report": (report, suffixes)}, source=source)
    folder = source.is_dir() and not is_bag_folder(source)
    if folder:
        single = [name for name, given in (("--plot", plot), ("--report", report), ("--nmea", nmea)) if given]
        if single:
            raise InputError(f"{single[0]} takes one recording, and {source} is a folder; --csv writes its table.")
    attitude = None if roll is None else (roll, pitch)
    biased = gyro_bias is not None
    curve, method = curve_and_method(deviation, method, reading, any_session=any_session, biased=biased)
    if biased and method == "learned" and model is not None:
        check_bias(model)
    request = Request(reading, _sensor(sensor), method, gyro_bias, attitude, model, turn_angles, curve, require_sigma)
    if folder:
        return _folder(source, request, as_json=as_json, csv=csv)
    return _file(source, request, as_json=as_json, nmea=nmea, csv=csv, plot=plot, report=report)


def _file(
    path: Path, request: Request, *, as_json: bool, nmea: bool, csv: Path | None, plot: Path | None, report: Path | None
) -> int:
    """One recording: its heading to standard output and the files asked for."""
    from gyronorth.report.tables import Outcome, write_csv

    with reading_file(path) as progress:
        recording = request.read(path, progress)
    with working("finding north"):
        estimate = request.heading(recording)
    outcome = Outcome(str(path), estimate, heading_true=recording.heading_true)
    if plot is not None or report is not None:
        with working("drawing"):
            _draw(outcome, recording, request, plot=plot, report=report)
    if csv is not None:
        write_csv([outcome], csv)
    if as_json:
        print_json(estimate.to_json())
    elif nmea:
        from gyronorth.report.nmea import sentences

        sys.stdout.writelines(sentences(estimate))
    else:
        from gyronorth.report.terminal import print_heading

        print_heading(outcome, sys.stdout)
    _tell_written(plot, report, csv)
    return VALID if estimate.valid else REFUSED


def _draw(outcome: Outcome, recording: Recording, request: Request, *, plot: Path | None, report: Path | None) -> None:
    from gyronorth import pipeline
    from gyronorth.files import write_text
    from gyronorth.report import figures

    estimate = outcome.estimate
    if estimate is None:
        return
    convergence = pipeline.convergence(
        recording,
        latitude=estimate.latitude,
        sensor=request.sensor,
        method=_along_time(estimate),
        attitude=request.attitude,
    )
    deviation = _deviation(recording, estimate)
    if plot is not None:
        truth = recording.heading_true
        figure = figures.heading_figure(convergence, estimate, heading_true=truth, deviation=deviation)
        figures.write(figure, plot)
    if report is not None:
        from gyronorth.report.html import heading_page

        page = heading_page(outcome, convergence, deviation=deviation, inputs=_inputs(outcome.file, recording, request))
        write_text(report, page, errors="backslashreplace")  # a file name may be no UTF-8


def _along_time(estimate: HeadingEstimate) -> str:
    """The method whose convergence is drawn: one that takes records of any length."""
    from gyronorth.alignment.registry import METHODS

    return METHODS.info(estimate.method).along_time


def _folder(folder: Path, request: Request, *, as_json: bool, csv: Path | None) -> int:
    """Every recording of a folder: one row each, an unreadable file with its error."""
    from gyronorth.errors import InputError
    from gyronorth.readers import recordings_in
    from gyronorth.report.tables import Outcome, write_csv

    outcomes: list[Outcome] = []
    for path in files_done(recordings_in(folder)):
        name = str(path.relative_to(folder))
        try:
            recording = request.read(path)
            estimate = request.heading(recording)
        except (InputError, OSError) as error:
            outcomes.append(Outcome(name, message=str(error)))
        except Exception as error:  # a fault of ours, in one file of many
            fault = f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
            fault = f"a fault of gyronorth, please report it: {fault}"
            outcomes.append(Outcome(name, message=fault))
        else:
            outcomes.append(Outcome(name, estimate, heading_true=recording.heading_true))
    if csv is not None:
        write_csv(outcomes, csv)
    if as_json:
        print_json([outcome.document() for outcome in outcomes])
    else:
        from gyronorth.report.terminal import print_folder

        print_folder(outcomes, sys.stdout)
    _tell_written(csv)
    if any(outcome.estimate is None for outcome in outcomes):
        return BAD_INPUT
    return VALID if all(outcome.estimate and outcome.estimate.valid for outcome in outcomes) else REFUSED


def _tell_written(*paths: Path | None) -> None:
    for path in paths:
        if path is not None:
            written(path)


def _sensor(name_or_file: str | None) -> Sensor | None:
    if name_or_file is None:
        return None
    from gyronorth.sensor import read_sensor

    return read_sensor(name_or_file)


def _deviation(recording: Recording, estimate: HeadingEstimate) -> AllanDeviation | None:
    """Allan deviation of the gyro, of turned recordings in the longest pose; None where that is too short to draw."""
    from gyronorth.allan import allan_deviation

    gyro_b = recording.gyro_b
    if len(estimate.poses) > 1:
        pose = max(estimate.poses, key=lambda pose: pose.end - pose.start)
        gyro_b = gyro_b[round(pose.start * recording.rate_hz) : round(pose.end * recording.rate_hz)]
    if len(gyro_b) < SHORTEST_ALLAN:
        return None
    return allan_deviation(gyro_b, rate_hz=recording.rate_hz)


def _inputs(file: str, recording: Recording, request: Request) -> list[tuple[str, str]]:
    """What the user declared and what the file says, for the report."""
    reading = request.reading
    inputs = [("file", file), ("method asked for", request.method)]
    if reading.window is not None:
        inputs.append(("window", "{:g} to {:g} s".format(*reading.window)))
    names = ("axes", "gyro_unit", "accel_unit", "variable", "topic", "protocol")
    declared = [(name, getattr(reading, name)) for name in names]
    inputs += [(name.replace("_", " "), value) for name, value in declared if value is not None]
    if reading.rate_hz is not None:
        inputs.append(("declared rate", f"{reading.rate_hz:g} Hz"))
    if any(reading.boresight):
        inputs.append(("boresight", ", ".join(f"{degrees(angle):g}°" for angle in reading.boresight)))
    if reading.increments:
        inputs.append(("values", "increments per sample"))
    if reading.columns:
        inputs.append(("columns", ", ".join(f"{ours} = {theirs}" for ours, theirs in reading.columns.items())))
    if request.gyro_bias is not None:
        bias = ", ".join(f"{value / DEG_PER_HOUR:g}" for value in request.gyro_bias)
        inputs.append(("gyro bias subtracted", f"{bias} deg/h"))
    if request.require_sigma is not None:
        inputs.append(("sigma required", f"{degrees(request.require_sigma):g}°"))
    if request.attitude is not None:
        inputs.append(("roll and pitch given", ", ".join(f"{degrees(angle):g}°" for angle in request.attitude)))
    if recording.session is not None:
        inputs.append(("session", recording.session))
    return inputs
