"""Options of `gyronorth live` that take more than a number or a name."""

from __future__ import annotations

import typer

from gyronorth.catalogue import NMEA_SETS
from gyronorth.cli.parsers import degrees

#: How much is told on standard error.
LEVELS = ("debug", "info", "warning", "error")


def latitude_or_receiver(text: str) -> float | str:
    """A latitude, rad, or the stream that tells it."""
    from gyronorth.errors import InputError
    from gyronorth.live.position import check_kind

    try:
        float(text)
    except ValueError:
        try:
            check_kind(text)
        except InputError as error:
            raise typer.BadParameter(str(error)) from None
        return text
    return degrees("a latitude of -90 to 90 degrees", "32.11", low=-90, high=90)(text)


def log_level_name(text: str) -> str:
    """A level of logging by its name."""
    if text not in LEVELS:
        raise typer.BadParameter(f"{text!r} is not one of {', '.join(LEVELS)}")
    return text


def nmea_set_name(text: str) -> str:
    """A set of sentences by its name."""
    if text not in NMEA_SETS:
        raise typer.BadParameter(f"{text!r} is not one of {', '.join(NMEA_SETS)}")
    return text
