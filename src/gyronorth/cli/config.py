"""A file of options (TOML), for a service: each key is the name of an option, and the command line beats the file."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import typer

from gyronorth.errors import InputError
from gyronorth.files import read_bounded

#: Bytes of a file of options.
LARGEST = 1_000_000


def take_config(context: typer.Context, path: Path | None) -> Path | None:
    """Make the values of a file the defaults of the command; the callback of an eager option.

    Raises
    ------
    typer.BadParameter
        If the file is no TOML, or a key of it is no option of the command.
    """
    if path is None:
        return None
    try:
        values = tomllib.loads(read_bounded(path, LARGEST).decode("utf-8"))
    except InputError as error:
        raise typer.BadParameter(str(error)) from None
    except (RecursionError, tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise typer.BadParameter(f"{path} is no TOML: {error}.") from None
    names = _names(context)
    unknown = [key for key in values if key.replace("_", "-") not in names]
    if unknown:
        raise typer.BadParameter(
            f"{path} has the key {unknown[0]}, which is no option; one of {', '.join(sorted(names))} is expected."
        )
    repeated = {parameter.name for parameter in context.command.params if parameter.nargs == 1 and parameter.multiple}
    defaults = {}
    for key, value in values.items():
        name = names[key.replace("_", "-")]
        if name in repeated:
            defaults[name] = [_text(key, each, path) for each in (value if isinstance(value, list) else [value])]
        else:
            defaults[name] = _text(key, value, path)
    context.default_map = {**(context.default_map or {}), **defaults}
    return path


def _names(context: typer.Context) -> dict[str, str]:
    """Name in the file -> name of the parameter: the long option without its dashes, and the arguments."""
    names = {}
    for parameter in context.command.params:
        if parameter.name in (None, "config", "help"):
            continue
        long = [option.removeprefix("--") for option in parameter.opts if option.startswith("--")]
        names[long[0] if long else parameter.name] = parameter.name
    return names


def _text(key: str, value: Any, path: Path) -> Any:
    """A value as it would stand on the command line; lists and tables as their commas and equal signs."""
    if isinstance(value, bool):
        return value
    if isinstance(value, list) and all(isinstance(item, (int, float, str)) for item in value):
        return ",".join(map(str, value))
    if isinstance(value, dict) and all(isinstance(item, (int, str)) for item in value.values()):
        return ",".join(f"{name}={item}" for name, item in value.items())
    if isinstance(value, (int, float, str)):
        return str(value)
    raise typer.BadParameter(f"{path}: {key} is {value!r}; a text, a number, true or false is expected.")
