"""From the name of a protocol to its functions, imported when asked for."""

from __future__ import annotations

from importlib import import_module

from gyronorth.errors import InputError, did_you_mean
from gyronorth.frames.catalogue import NAMES, protocol_info
from gyronorth.frames.protocol import Protocol


def protocol_of(name: str) -> Protocol:
    """The protocol of a name.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    if name not in NAMES:
        near = did_you_mean(name, NAMES)
        raise InputError(f"The protocol is {name!r}; one of {', '.join(NAMES)} is expected.{near}")
    return import_module(f"gyronorth.frames.protocols.{protocol_info(name).module}").PROTOCOL
