"""The plot and the report of one recording's heading."""

from __future__ import annotations

import shlex
import sys
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING

from gyronorth.cli.parsers import DEG_PER_HOUR

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from gyronorth.allan import AllanDeviation
    from gyronorth.estimate import HeadingEstimate
    from gyronorth.many import Request
    from gyronorth.recording import Recording
    from gyronorth.report.tables import Outcome

#: Fewest samples of which an Allan deviation is drawn.
SHORTEST_ALLAN = 100


def draw(outcome: Outcome, recording: Recording, request: Request, *, plot: Path | None, report: Path | None) -> None:
    """Write the files that are asked for; none where there is no heading."""
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
        truth, name = recording.heading_true, Path(outcome.file).name
        figure = figures.heading_figure(convergence, estimate, heading_true=truth, deviation=deviation, name=name)
        figures.write(figure, plot)
    if report is not None:
        from gyronorth.report.comparison import opinions
        from gyronorth.report.html import heading_page
        from gyronorth.report.residual import residual
        from gyronorth.report.spectrum import SHORTEST, spectrum

        gyro_b = _longest_pose(recording, estimate)
        page = heading_page(
            outcome,
            convergence,
            deviation=deviation,
            inputs=_inputs(outcome.file, recording, request),
            sensor=request.sensor,
            spectrum=spectrum(gyro_b, rate_hz=recording.rate_hz) if len(gyro_b) >= SHORTEST else None,
            residual=residual(gyro_b, rate_hz=recording.rate_hz) if len(gyro_b) >= SHORTEST else None,
            opinions=opinions(recording, estimate, sensor=request.sensor, attitude=request.attitude),
        )
        write_text(report, page, errors="backslashreplace")  # a file name may be no UTF-8


def _along_time(estimate: HeadingEstimate) -> str:
    """The method whose convergence is drawn: one that takes records of any length."""
    from gyronorth.alignment.registry import METHODS

    return METHODS.info(estimate.method).along_time


def _deviation(recording: Recording, estimate: HeadingEstimate) -> AllanDeviation | None:
    """Allan deviation of the gyro in the longest pose; None where that is too short to draw."""
    from gyronorth.allan import allan_deviation

    gyro_b = _longest_pose(recording, estimate)
    return None if len(gyro_b) < SHORTEST_ALLAN else allan_deviation(gyro_b, rate_hz=recording.rate_hz)


def _longest_pose(recording: Recording, estimate: HeadingEstimate) -> NDArray[np.float64]:
    """The rate of the whole recording or, where it was turned, of its longest pose."""
    if len(estimate.poses) < 2:
        return recording.gyro_b
    pose = max(estimate.poses, key=lambda pose: pose.end - pose.start)
    return recording.gyro_b[round(pose.start * recording.rate_hz) : round(pose.end * recording.rate_hz)]


def _checksum(path: Path) -> str:
    import hashlib

    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _inputs(file: str, recording: Recording, request: Request) -> list[tuple[str, str]]:
    """What the user declared and what the file says, for the report."""
    from gyronorth.report.recordings import AXES_ORIGINS

    reading = request.reading
    inputs = [("command", shlex.join(["gyronorth", *sys.argv[1:]])), ("file", file)]
    if Path(file).is_file():  # a bag may be a folder
        inputs.append(("SHA-256 of the file", _checksum(Path(file))))
    if recording.start_time_utc is not None:
        inputs.append(("recorded from", recording.start_time_utc))
    inputs.append(("method asked for", request.method))
    if reading.window is not None:
        inputs.append(("window", "{:g} to {:g} s".format(*reading.window)))
    inputs.append(("axes of the file", f"{reading.axes or recording.axes}, {AXES_ORIGINS[recording.axes_origin]}"))
    if recording.units:
        told = "" if reading.gyro_unit is None and reading.accel_unit is None else ", declared"
        inputs.append(("units of the file", f"{recording.units}{told}"))
    names = ("variable", "topic", "protocol")
    declared = [(name, getattr(reading, name)) for name in names]
    inputs += [(name.replace("_", " "), value) for name, value in declared if value is not None]
    if reading.rate_hz is not None:
        inputs.append(("declared rate", f"{reading.rate_hz:g} Hz"))
    if any(reading.boresight):
        inputs.append(("boresight", ", ".join(f"{degrees(angle):g}°" for angle in reading.boresight)))
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
