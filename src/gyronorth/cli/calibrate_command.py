"""gyronorth calibrate: a deviation curve from recordings at known headings (a compass swing)."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gyronorth.cli.app import app
from gyronorth.cli.many_options import Sources
from gyronorth.cli.options import Force, Json
from gyronorth.cli.outputs import check_outputs, print_json, written
from gyronorth.cli.progress import recordings_done, working
from gyronorth.cli.reading_options import with_reading

if TYPE_CHECKING:
    from gyronorth.readers import ReadOptions
    from gyronorth.recording import Recording


@app.command()
@with_reading
def calibrate(
    sources: Sources,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="PROFILE", help="Deviation curve to write (JSON).")],
    as_json: Json = False,
    force: Force = False,
    *,
    reading: ReadOptions,
) -> None:
    """Fit a deviation curve to recordings of one session at known headings, and cross-validate it.

    The curve holds for the unit and the power-up session it was measured in; `heading --deviation`
    applies it there.
    """
    from gyronorth import calibration, readers
    from gyronorth.deviation import FEWEST
    from gyronorth.errors import InputError
    from gyronorth.report.calibrations import print_calibration
    from gyronorth.sources.listing import recordings
    from gyronorth.sources.remote import at_hand

    check_outputs({"-o": (output, (".json",))}, kept=() if force else ("-o",))
    try:
        items = recordings(sources)
    except InputError as error:
        raise InputError(
            f"{error} A deviation curve is fitted to at least {FEWEST + 1} recordings at known headings."
        ) from None
    read: list[Recording] = []
    with recordings_done(len(items)) as done:
        for item in items:
            with at_hand(item.address) as path:
                read.append(readers.read(path, reading))
            done(item.name)
    with working("fitting the deviation curve"):
        found = calibration.calibrate(read, latitude=reading.latitude)
    replace(found.model, boresight=reading.boresight).write(output)
    if as_json:
        print_json(found.to_json())
    else:
        print_calibration(found, sys.stdout)
    written(output)
