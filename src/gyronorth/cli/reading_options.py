"""Options that say how the file of a recording is read."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gyronorth.cli import completion
from gyronorth.cli.options import FILE, Latitude, Rate
from gyronorth.cli.parsers import columns, number, triple, window

if TYPE_CHECKING:
    from gyronorth.readers import ReadOptions

#: Samples that a command holds of a file that it reads piece by piece: 48 bytes with both triads, so 13 MB.
CHUNK_SAMPLES = 1 << 18

_per_count = number("a number of units in one count", "6.1e-5")


def _declares(
    metavar: str,
    text: str,
    parser: Callable[[str], Any] | None = None,
    offers: Callable[[str], list[str]] | None = None,
) -> tuple[Any, None]:
    """Annotation and default of an option that declares something about the file."""
    option = typer.Option(metavar=metavar, parser=parser, autocompletion=offers, help=text, rich_help_panel=FILE)
    return Annotated[str | None if parser is None else Any, option], None


#: What `with_reading` adds to a command: option name -> (annotation, default).
READING: dict[str, tuple[Any, Any]] = {
    "latitude": (Latitude, None),
    "window": (
        Annotated[
            Any,
            typer.Option(
                metavar="START:END",
                parser=window,
                help="Use only this part of the recording, seconds.",
                rich_help_panel=FILE,
            ),
        ],
        None,
    ),
    "rate": (Rate, None),
    "axes": (
        Annotated[
            str | None,
            typer.Option(
                metavar="AXES",
                autocompletion=completion.axes,
                help="Axes of the file: frd, flu, rfu, ... or as +y+x-z.",
                rich_help_panel=FILE,
            ),
        ],
        None,
    ),
    "boresight": (
        Annotated[
            Any,
            typer.Option(
                metavar="R,P,Y",
                parser=triple("ROLL,PITCH,YAW in degrees", "0,0,90", scale=radians(1)),
                help="Mounting of the sensor in the vehicle, degrees: turns its heading into the vehicle's.",
                rich_help_panel=FILE,
            ),
        ],
        None,
    ),
    "gyro_unit": _declares(
        "UNIT",
        "deg/s, rad/s, deg/h, mdeg/s, mrad/s, arcsec/s, urad/s, deg/min or rpm.",
        offers=completion.gyro_unit,
    ),
    "accel_unit": _declares("UNIT", "m/s2, g, mg, ug, cm/s2, mm/s2 or ft/s2.", offers=completion.accel_unit),
    "gyro_scale": _declares("UNITS", "Gyro units per count of the file.", _per_count),
    "accel_scale": _declares("UNITS", "Accelerometer units per count of the file.", _per_count),
    "increments": _declares(
        "[gyro|accel|both|none]",
        "The file holds increments per sample, not rates; of both sensors if none is named.",
        offers=completion.offered(lambda: ("gyro", "accel", "both", "none")),
    ),
    "increment_interval": _declares(
        "SECONDS",
        "Time that an increment covers, where it is not the sample interval.",
        number("a positive time in seconds", "0.005", above=0),
    ),
    "time_unit": _declares("UNIT", "Unit of the time column: s, ms, us or ns.", offers=completion.time_unit),
    "preset": _declares(
        "NAME|FILE",
        "Declarations for a program's files: a name, or a file saved by `import`.",
        offers=completion.preset,
    ),
    "columns": (
        Annotated[
            Any,
            typer.Option(
                metavar="MAP",
                parser=columns,
                help="Columns of the file: t=time,w_x=gx,..,f_z=az.",
                rich_help_panel=FILE,
            ),
        ],
        None,
    ),
    "variable": (
        Annotated[
            str | None,
            typer.Option(
                metavar="NAME",
                help="Variable to read from a .mat or HDF5 file, or group of the latter.",
                rich_help_panel=FILE,
            ),
        ],
        None,
    ),
    "topic": (
        Annotated[
            str | None,
            typer.Option(
                metavar="NAME", help="Topic of sensor_msgs/Imu in a bag or an MCAP file.", rich_help_panel=FILE
            ),
        ],
        None,
    ),
    "accel": (
        Annotated[
            Path | None,
            typer.Option(
                metavar="FILE",
                help="Separate file of the accelerometer; joined on time.",
                rich_help_panel=FILE,
            ),
        ],
        None,
    ),
    "accel_topic": (
        Annotated[
            str | None,
            typer.Option(
                metavar="NAME",
                help="Separate topic of the accelerometer.",
                rich_help_panel=FILE,
            ),
        ],
        None,
    ),
    "protocol": (
        Annotated[
            str | None,
            typer.Option(
                metavar="NAME",
                autocompletion=completion.protocol,
                help="Protocol of a capture of frames; by default recognised by checksums.",
                rich_help_panel=FILE,
            ),
        ],
        None,
    ),
    "imu": (
        Annotated[
            str | None,
            typer.Option(
                metavar="NAME",
                autocompletion=completion.imu,
                help="IMU type of NovAtel RAWIMU and RAWIMUS, as STIM300.",
                rich_help_panel=FILE,
            ),
        ],
        None,
    ),
    "accel_range": (
        Annotated[
            Any,
            typer.Option(
                metavar="G",
                parser=number("a range of 5, 10, 30 or 80 g", "10", low=5, high=80),
                help="Accelerometer range of STIM datagrams, g.",
                rich_help_panel=FILE,
            ),
        ],
        None,
    ),
    "drop_bad_rows": (
        Annotated[
            bool,
            typer.Option(
                "--drop-bad-rows", help="Omit rows that cannot be read, and report them.", rich_help_panel=FILE
            ),
        ],
        False,
    ),
}


def with_reading(
    command: Callable[..., int | None], *, only: tuple[str, ...] = tuple(READING)
) -> Callable[..., int | None]:
    """Give a command with a parameter `reading` the options that say how its file is read.

    The command sees one `ReadOptions`; the command line sees the options of `READING`, or those of them that
    `only` names, in its place.
    """
    del command.__annotations__["reading"]  # known to the type checker only: it is not imported at start-up
    own = dict(inspect.signature(command, eval_str=True).parameters)
    del own["reading"]

    @wraps(command)
    def run(**values: Any) -> int | None:
        return command(
            reading=_read_options({name: values[name] for name in only}), **{name: values[name] for name in own}
        )

    added = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
        for name, (annotation, default) in READING.items()
        if name in only
    ]
    parameters = [*own.values(), *added]
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return run


def _read_options(values: dict[str, Any]) -> ReadOptions:
    """The declarations about a file; a bad one is named as the option it came from."""
    from gyronorth.errors import InputError
    from gyronorth.readers import ReadOptions

    given = {name: value for name, value in values.items() if value is not None}
    named = {"rate": "rate_hz", "accel": "accel_file", "accel_range": "accel_range_g"}
    fields = {named.get(name, name): value for name, value in given.items()}
    for option, (field, value) in zip(given, fields.items(), strict=True):
        with_it: dict[str, Any] = (
            {"increments": True} if field == "increment_interval" and fields.get("increments") else {}
        )
        try:
            ReadOptions(**{field: value}, **with_it)
        except InputError as error:
            raise typer.BadParameter(str(error), param_hint=f"'--{option.replace('_', '-')}'") from None
    return ReadOptions(**fields)
