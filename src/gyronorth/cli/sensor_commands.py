"""gyronorth sensors, allan and plan: what a sensor is, what it shows of itself, what it can reach."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gyronorth.cli.app import app
from gyronorth.cli.options import PLOT_SUFFIXES, Json, Plot, check_outputs, print_json, with_reading
from gyronorth.cli.progress import working

if TYPE_CHECKING:
    from gyronorth.readers import ReadOptions


@app.command()
def sensors(as_json: Json = False) -> None:
    """List the built-in sensor profiles with their figures and where these come from."""
    from gyronorth import profiles
    from gyronorth.report.sensors import print_sensors
    from gyronorth.sensor import read_sensor

    if as_json:
        print_json([json.loads(profiles.builtin_text(name)) for name in profiles.names()])
    else:
        print_sensors([read_sensor(name) for name in profiles.names()], sys.stdout)
