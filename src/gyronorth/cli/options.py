"""Options shared by the commands, and the parsers that turn their text into numbers.

Every parser names the value it received and an example; the command line adds the option.
Degrees of the command line become radians here.

Longer than 400 lines: one table of options, of which most lines are their help.
"""

from __future__ import annotations

import inspect
import json
import os
from collections.abc import Callable, Collection
from functools import wraps
from math import inf, isfinite, radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gyronorth.catalogue import METHODS
from gyronorth.cli import completion

if TYPE_CHECKING:
    from gyronorth.readers import ReadOptions

#: Samples that a command holds of a file that it reads piece by piece: 48 bytes with both triads, so 13 MB.
CHUNK_SAMPLES = 1 << 18

DEG_PER_HOUR = radians(1) / 3600  # rad/s; the same as angles.DEG_PER_HOUR, which would load numpy for --help


def method_name(text: str) -> str:
    """The name of a method of the catalogue, or of one that is registered from outside."""
    if text in (info.name for info in METHODS):
        return text
    from gyronorth.alignment import registry
    from gyronorth.errors import InputError

    try:
        return registry.METHODS[text].info.name
    except InputError as error:
        raise typer.BadParameter(str(error)) from None


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


def number(
    what: str, example: str, *, low: float = -inf, high: float = inf, above: float = -inf
) -> Callable[[str], float]:
    """A parser of one finite number in [low, high], and above `above`."""

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = inf
        if not (isfinite(value) and low <= value <= high and value > above):
            raise typer.BadParameter(f"{text!r} is not {what}; example: {example}")
        return value

    return parse


def degrees(what: str, example: str, *, low: float = -inf, high: float = inf) -> Callable[[str], float]:
    """A parser of an angle in degrees that returns radians."""
    parse_degrees = number(what, example, low=low, high=high)
    return lambda text: radians(parse_degrees(text))


def triple(what: str, example: str, *, scale: float) -> Callable[[str], tuple[float, float, float]]:
    """A parser of three numbers with commas between, times `scale`."""

    def parse(text: str) -> tuple[float, float, float]:
        try:
            first, second, third = (float(part) * scale for part in text.split(","))
        except ValueError:
            first = second = third = inf
        if not all(map(isfinite, (first, second, third))):
            raise typer.BadParameter(f"{text!r} is not {what}; example: {example}")
        return first, second, third

    return parse


def angles(text: str) -> tuple[float, ...]:
    """A,B,.. in degrees as radians."""
    try:
        values = tuple(radians(float(part)) for part in text.split(","))
    except ValueError:
        values = (inf,)
    if not all(map(isfinite, values)):
        raise typer.BadParameter(f"{text!r} is not a list of angles in degrees; example: 180,-180")
    return values


def window(text: str) -> tuple[float, float]:
    """START:END in seconds from the start of the recording."""
    start_text, _, end_text = text.partition(":")
    try:
        start, end = float(start_text), float(end_text)
    except ValueError:
        start = end = inf
    if not 0 <= start < end < inf:
        raise typer.BadParameter(f"{text!r} is not START:END in seconds with 0 <= START < END; example: 600:950")
    return start, end


def columns(text: str) -> dict[str, str]:
    """Our column names mapped to those of the file: t=time,w_x=gx,..."""
    from gyronorth.errors import InputError
    from gyronorth.readers import parse_columns

    try:
        return parse_columns(text)
    except InputError as error:
        raise typer.BadParameter(f"{error} Example: t=time,w_x=gx,w_y=gy,w_z=gz,f_x=ax,f_y=ay,f_z=az") from None


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
PLOT_SUFFIXES = (".png", ".svg", ".pdf")

_per_count = number("a number of units in one count", "6.1e-5")


def _declares(metavar: str, text: str, parser: Callable[[str], Any] | None = None) -> tuple[Any, None]:
    """Annotation and default of an option that declares something about the file."""
    option = typer.Option(metavar=metavar, parser=parser, help=text, rich_help_panel=FILE)
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
    "gyro_unit": _declares("UNIT", "deg/s, rad/s, deg/h, mdeg/s, mrad/s, arcsec/s, urad/s, deg/min or rpm."),
    "accel_unit": _declares("UNIT", "m/s2, g, mg, ug, cm/s2, mm/s2 or ft/s2."),
    "gyro_scale": _declares("UNITS", "Gyro units per count of the file.", _per_count),
    "accel_scale": _declares("UNITS", "Accelerometer units per count of the file.", _per_count),
    "increments": _declares(
        "[gyro|accel|both|none]", "The file holds increments per sample, not rates; of both sensors if none is named."
    ),
    "increment_interval": _declares(
        "SECONDS",
        "Time that an increment covers, where it is not the sample interval.",
        number("a positive time in seconds", "0.005", above=0),
    ),
    "time_unit": _declares("UNIT", "Unit of the time column: s, ms, us or ns."),
    "preset": _declares("NAME|FILE", "Declarations for a program's files: a name, or a file saved by `import`."),
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
                metavar="NAME", help="IMU type of NovAtel RAWIMU and RAWIMUS, as STIM300.", rich_help_panel=FILE
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


def check_outputs(
    outputs: dict[str, tuple[Path | None, tuple[str, ...]]],
    *,
    source: Path | None = None,
    kept: Collection[str] = (),
) -> None:
    """Refuse, before any work, outputs that could not be written or would overwrite the input, each other or a work.

    Parameters
    ----------
    outputs : dict
        Option name -> (path or None, the suffixes it may have; none given: any).
    source : Path, optional
        The recording that is read.
    kept : collection of str
        Options whose file is not overwritten: recordings, profiles, bundles, where `--force` is not given.
    """
    from gyronorth.errors import InputError

    taken = {} if source is None else {os.path.realpath(source): "the recording that is read"}
    for option, (path, suffixes) in outputs.items():
        if path is None:
            continue
        if option in ("--plot", "--report"):
            check_drawing(option)
        if suffixes and path.suffix.lower() not in suffixes:
            raise InputError(f"{option} {path}: the name must end in {' or '.join(suffixes)}.")
        if path.is_dir():
            raise InputError(f"{option} {path} is a folder; give the name of a file in it.")
        if not path.parent.is_dir():
            raise InputError(f"{option} {path}: the folder {path.parent} does not exist; make it first.")
        real = os.path.realpath(path)  # which takes links in a circle
        if real in taken:
            raise InputError(f"{option} {path} is {taken[real]}; choose another name.")
        if option in kept and path.is_file():
            raise InputError(f"{option} {path} exists. Give another name, or --force to overwrite it.")
        taken[real] = f"also what {option} writes"


def written(path: Path) -> None:
    """Say on standard error what was written, devices and pipes left out."""
    from gyronorth.report.wording import printable

    if path.is_file() or path.is_dir():
        typer.echo(f"wrote {printable(str(path))}", err=True)


def check_drawing(what: str) -> None:
    """Refuse what draws if the libraries of the extra `report` are not installed."""
    from importlib.util import find_spec

    from gyronorth.errors import InputError

    missing = [module for module in ("matplotlib", "jinja2") if find_spec(module) is None]
    if missing:
        raise InputError(
            f"{what} needs {' and '.join(missing)}, which the small installation leaves out. "
            "Install it with: pip install 'gyronorth[report]'."
        )


def print_json(document: Any) -> None:
    """Print one JSON value; a NaN would be a fault of ours and raises."""
    typer.echo(json.dumps(document, allow_nan=False))
