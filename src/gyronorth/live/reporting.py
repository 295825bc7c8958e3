"""The report of a session: the page that `gyronorth heading --report` writes."""

from __future__ import annotations

import shlex
import sys
from itertools import count
from math import degrees
from pathlib import Path

from gyronorth.angles import DEG_PER_HOUR
from gyronorth.estimate import Convergence
from gyronorth.files import write_text
from gyronorth.live.session import LiveSettings
from gyronorth.live.status import Status
from gyronorth.report.html import heading_page
from gyronorth.report.tables import Outcome


def report_text(status: Status, settings: LiveSettings) -> str | None:
    """The report as one self-contained page; None before the first estimate."""
    estimate, found = status.measured, status.found
    if estimate is None or found is None:
        return None
    time, heading, half_width, valid = found.trace.T
    file = str(status.recording or status.source)
    outcome = Outcome(file, estimate, heading_true=status.heading_true)
    course = Convergence(time, heading, half_width, valid > 0)
    return heading_page(outcome, course, inputs=_inputs(status, settings), sensor=settings.sensor)


def report_path(recording: Path) -> Path:
    """Where the report of a recording is written: beside it, north.html, or where that exists north-2.html, ..."""
    paths = (recording.with_name(f"{recording.stem}{'' if n == 1 else f'-{n}'}.html") for n in count(1))
    return next(path for path in paths if not path.exists())


def write_report(status: Status, settings: LiveSettings) -> Path | None:
    """Write the report beside the recording, over no other file; None where there is no estimate or no recording."""
    text = report_text(status, settings)
    if text is None or status.recording is None:
        return None
    path = report_path(status.recording)
    write_text(path, text, errors="backslashreplace")
    return path


def _inputs(status: Status, settings: LiveSettings) -> list[tuple[str, str]]:
    """What was declared, what was counted and what was marked."""
    reading, counters = settings.reading, status.counters
    inputs = [("command", _command(sys.argv[1:])), ("source", status.source)]
    if status.recording is not None:
        inputs.append(("recording", str(status.recording)))
    inputs.append(("method asked for", settings.method))
    declared = [(name, getattr(reading, name)) for name in ("axes", "gyro_unit", "accel_unit")]
    inputs += [(name.replace("_", " "), value) for name, value in declared if value is not None]
    if reading.rate_hz is not None:
        inputs.append(("declared rate", f"{reading.rate_hz:g} Hz"))
    if any(reading.boresight):
        inputs.append(("boresight", ", ".join(f"{degrees(angle):g}°" for angle in reading.boresight)))
    if settings.gyro_bias is not None:
        bias = ", ".join(f"{value / DEG_PER_HOUR:g}" for value in settings.gyro_bias)
        inputs.append(("gyro bias subtracted", f"{bias} deg/h"))
    if settings.deviation is not None:
        curve = settings.deviation
        inputs.append(("deviation curve", f"{len(curve.heading)} recordings, session {curve.session or 'not stated'}"))
    inputs.append(("lines", f"{counters.lines}, of which {counters.good} good, {counters.garbage} garbage"))
    inputs.append(("samples lost", f"{counters.lost} in {counters.gaps} gaps"))
    inputs += [(f"mark at {mark.time:.1f} s", mark.text or "(no label)") for mark in status.marks]
    return inputs


def _command(words: list[str]) -> str:
    """The command that was given, without the access token: a report is passed on."""
    shown = ["HIDDEN" if before == "--token" else word for before, word in zip(["", *words], words, strict=False)]
    return shlex.join("--token=HIDDEN" if word.startswith("--token=") else word for word in ["gyronorth", *shown])
