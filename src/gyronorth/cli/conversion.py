"""Words of the command line to values, without a model of pydantic's for each option.

Some versions of typer build such a model for every option of a command, given or not: with the loading of pydantic
that takes longer than to read a short recording. Here what is not given stays None, a text stays a text, and our
parsers are called as they are. All else is typer's: numbers, switches, choices, and its messages.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any


def convert_directly(parameter: Any) -> None:
    """Let an option or argument of a command take the short way where it is one that has it."""
    described = getattr(parameter, "type_descriptor", None)  # versions of typer without it build no models
    if described is not None and not isinstance(parameter.process_value, partial):
        parameter.process_value = partial(_value, parameter, described, parameter.process_value)


def _value(parameter: Any, described: Any, by_typer: Any, context: Any, given: Any) -> Any:
    """The value of what was given, a text, a list of texts or a default."""
    if given is None and parameter.required:
        return by_typer(context, given)
    found = _short_way(parameter, described, given)
    if found is None and given is not None:
        return by_typer(context, given)
    return found if parameter.callback is None else parameter.callback(context, parameter, found)


def _short_way(parameter: Any, described: Any, given: Any) -> Any:
    """The value; None where nothing was given, or typer has to find it."""
    info, kind = described.parameter_info, described.annotation
    if parameter.multiple or parameter.nargs != 1:
        texts = kind == list[str] and info.parser is None and isinstance(given, list | tuple)
        return list(given) if texts and given else None
    if not isinstance(given, str):
        return None
    if info.parser is not None:
        try:
            return info.parser(given)
        except ValueError:  # ours raise none: typer words it
            return None
    asked = (info.exists, info.writable, info.resolve_path, info.allow_dash, info.path_type)
    if kind is Path and not any(asked) and info.file_okay and info.dir_okay:
        return Path(given)
    return given if kind is str else None
