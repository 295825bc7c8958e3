"""gyronorth explain: every check of a heading, with its value, its limit and the formula of both."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gyronorth.cli.app import app
from gyronorth.cli.options import Json, MethodName, SensorName
from gyronorth.cli.outputs import print_json
from gyronorth.cli.progress import reading_file, working
from gyronorth.cli.reading_options import with_reading

if TYPE_CHECKING:
    from gyronorth.readers import ReadOptions


@app.command()
@with_reading
def explain(
    source: Annotated[Path, typer.Argument(metavar="FILE", help="A recording.")],
    sensor: SensorName = None,
    method: MethodName = "auto",
    as_json: Json = False,
    *,
    reading: ReadOptions,
) -> int:
    """Show why a heading is valid or refused: each check with its value, its limit and its formula.

    Exit code 0: a valid heading. 2: bad input. 3: a heading that is refused.
    """
    from gyronorth import pipeline, readers
    from gyronorth.report.checks import print_checks

    with reading_file(source) as progress:
        recording = readers.read(source, reading, progress=progress)
    with working("finding north"):
        estimate = pipeline.heading(recording, latitude=reading.latitude, sensor=sensor, method=method)
    if as_json:
        print_json(
            {"valid": estimate.valid, "method": estimate.method, "checks": [c.to_json() for c in estimate.checks]}
        )
    else:
        print_checks(estimate, sys.stdout)
    return 0 if estimate.valid else 3
