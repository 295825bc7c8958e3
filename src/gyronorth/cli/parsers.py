"""Parsers that turn the text of options into numbers; degrees of the command line become radians here.

Every parser names the value it received and an example; the command line adds the option.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, isfinite, radians

import typer

from gyronorth.catalogue import METHODS

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
