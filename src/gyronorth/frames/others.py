"""Streams of a known protocol that hold no inertial data: what they hold, and what the unit must be set to send."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import numpy as np

from gyronorth.frames.catalogue import NAMES, protocol_info
from gyronorth.frames.framing import Framer, Frames
from gyronorth.frames.protocol import OTHER, Protocol
from gyronorth.frames.registry import protocol_of

#: Frames of one message whose checksums must hold, and the share of the bytes that frames must explain.
NEEDED, SHARE = 4, 0.3
#: Frames that are named, and names that are told.
_NAMED, _TOLD = 200, 5


def names_of(protocol: Protocol, frames: Frames) -> Counter[str]:
    """How often which messages without inertial data are among the first frames."""
    places = np.flatnonzero(frames.layout == OTHER)[:_NAMED]
    return Counter(protocol.message(frames.rows(places[i : i + 1])[0]) for i in range(len(places)))


def others_of(data: bytes) -> tuple[str, Counter[str]] | None:
    """The protocol whose whole frames these bytes are, and how often which messages come; None for none."""
    best, most = None, SHARE * len(data)
    for name in NAMES:
        protocol = protocol_of(name)
        frames = Framer(protocol).feed(data, last=True)
        size = int(frames.length.sum())
        if size <= most:
            continue
        names = names_of(protocol, frames)
        if names and max(names.values()) >= NEEDED:
            best, most = (name, names), size
    return best


def no_inertial_data(source: str, name: str, messages: Iterable[str]) -> str:
    """What to say of a source whose frames hold none."""
    info, told = protocol_info(name), list(messages)
    more = " and others" if len(told) > _TOLD else ""
    what = f": {', '.join(told[:_TOLD])}{more}" if told else ""
    return (
        f"{source} holds frames of the protocol {name}{what}. They carry no raw rates of the gyros, by which north is "
        f"found. Set the unit to send {info.output}."
    )
