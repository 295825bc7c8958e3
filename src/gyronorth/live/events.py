"""What a source of bytes tells: its data, and what happens to the connection."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from threading import Event
from typing import Protocol

#: Bytes taken at a time.
CHUNK = 1 << 16


@dataclass(frozen=True)
class Bytes:
    """Bytes, in order."""

    bytes: bytes
    whole: bool = False  # a datagram: what it holds of lines is whole


@dataclass(frozen=True)
class Connected:
    """The source is there."""

    midway: bool = False  # what comes first may be the rest of a line


@dataclass(frozen=True)
class Lost:
    """The source is gone, and why; it is tried again."""

    why: str


@dataclass(frozen=True)
class Ended:
    """Nothing more will come."""


SourceEvent = Bytes | Connected | Lost | Ended
Emit = Callable[[SourceEvent], None]


class ByteSource(Protocol):
    """A source of bytes."""

    name: str  # as the user wrote it
    live: bool  # whether its bytes come as they are measured, so that the clock of the system dates them

    def run(self, emit: Emit, stop: Event) -> None:
        """Hand over everything that comes, until `stop` is set or nothing more can come."""
        ...
