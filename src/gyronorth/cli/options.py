"""Options shared by the commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from gyronorth.catalogue import METHODS
from gyronorth.cli import completion
from gyronorth.cli.parsers import angles, degrees, method_name, number

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


def latitude_option(help_text: str) -> Any:
    """The option --latitude, with what this command says of it."""
    return typer.Option(
        "--latitude",
        metavar="DEG",
        parser=degrees("a latitude of -90 to 90 degrees", "32.11", low=-90, high=90),
        help=help_text,
        rich_help_panel=SITE,
    )


Latitude = Annotated[Any, latitude_option("Geodetic latitude, north positive; by default as the file states it.")]
RequiredLatitude = Annotated[Any, latitude_option("Geodetic latitude, north positive.")]
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
Model = Annotated[
    Path | None,
    typer.Option("--model", metavar="BUNDLE", help="Trained bundle for --method learned, paper or baseline."),
]
TurnAngles = Annotated[
    Any,
    typer.Option(
        metavar="A,B,..",
        parser=angles,
        help="Angles of the turns between poses, degrees, positive clockwise; by default the gyro measures them.",
        rich_help_panel=SITE,
    ),
]
TurnAngleSigma = Annotated[
    Any,
    typer.Option(
        metavar="DEG",
        parser=degrees("a positive angle in degrees", "0.1", low=1e-6),
        help="Sigma of one of --turn-angles; else it is inferred from what the gyro measures.",
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


def plot_option(drawn: str) -> Any:
    """The option --plot of a command that draws this."""
    return typer.Option("--plot", metavar="OUT.png", help=f"Draw {drawn} (.png, .svg or .pdf).", rich_help_panel=OUTPUT)


def attitude_given(roll: float | None, pitch: float | None) -> tuple[float, float] | None:
    """Roll and pitch of --roll and --pitch, rad, which go together; None where neither is given."""
    if roll is None and pitch is None:
        return None
    if roll is None or pitch is None:
        from gyronorth.errors import InputError

        raise InputError("--roll and --pitch belong together; give both, for example --roll 0 --pitch 0.")
    return roll, pitch
