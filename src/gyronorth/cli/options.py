"""Options shared by the commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from gyronorth.catalogue import METHODS
from gyronorth.cli import completion
from gyronorth.cli.parsers import degrees, method_name, number

MethodName = Annotated[
    Any,
    typer.Option(
        "--method",
        metavar="METHOD",
        parser=method_name,
        autocompletion=completion.method,
        help="How the heading is computed.\n\n" + "\n\n".join(f"{info.name}: {info.summary}." for info in METHODS),
    ),
]

#: Panels of the help text.
FILE, SITE, OUTPUT = "How the file is read", "What is known", "Output"

Latitude = Annotated[
    Any,
    typer.Option(
        metavar="DEG",
        parser=degrees("a latitude of -90 to 90 degrees", "32.11", low=-90, high=90),
        help="Geodetic latitude, north positive; may come from the file.",
        rich_help_panel=SITE,
    ),
]
Roll = Annotated[
    Any,
    typer.Option(
        metavar="DEG",
        parser=degrees("a roll of -180 to 180 degrees", "1.5", low=-180, high=180),
        help="Roll, right side down positive.",
        rich_help_panel=SITE,
    ),
]
Pitch = Annotated[
    Any,
    typer.Option(
        metavar="DEG",
        parser=degrees("a pitch of -90 to 90 degrees", "-0.5", low=-90, high=90),
        help="Pitch, nose up positive.",
        rich_help_panel=SITE,
    ),
]
Rate = Annotated[
    Any,
    typer.Option(
        metavar="HZ",
        parser=number("a positive sample rate in Hz", "100", above=0),
        help="Sample rate of the file where it has no time column; it never resamples.",
        rich_help_panel=FILE,
    ),
]
SensorName = Annotated[
    str | None,
    typer.Option(
        "--sensor",
        metavar="NAME|FILE",
        autocompletion=completion.sensor,
        help="Sensor profile; `gyronorth sensors` lists them.",
        rich_help_panel=SITE,
    ),
]
RequiredSensor = Annotated[
    str,
    typer.Option(
        "--sensor",
        metavar="NAME|FILE",
        autocompletion=completion.sensor,
        help="Sensor profile; `gyronorth sensors` lists them.",
    ),
]
RequireSigma = Annotated[
    Any,
    typer.Option(
        metavar="DEG",
        parser=degrees("a positive angle in degrees", "1.5", low=1e-6),
        help="Refuse a heading with a larger sigma.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON and nothing else.", rich_help_panel=OUTPUT)]
Force = Annotated[bool, typer.Option("--force", help="Overwrite existing files.", rich_help_panel=OUTPUT)]
Plot = Annotated[
    Path | None,
    typer.Option(
        metavar="OUT.png",
        help="Draw heading against time and Allan deviation (.png, .svg or .pdf).",
        rich_help_panel=OUTPUT,
    ),
]
