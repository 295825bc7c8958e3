"""Recordings in: one reader per format, one registry, units and axes declared at this edge.

What a file does not say and its format does not imply is declared in `ReadOptions`; nothing
is guessed. `read` gives a whole recording, `read_chunks` a stream of bounded memory,
`describe` a summary, `write` and `write_chunks` a file that reads back bit for bit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gyronorth.readers.bag_folder import is_bag_folder, is_recording_folder
from gyronorth.readers.options import ReadOptions, parse_columns
from gyronorth.readers.reading import RecordingInfo, read, read_chunks
from gyronorth.readers.registry import FORMATS, recordings_in, recordings_inside

if TYPE_CHECKING:
    from gyronorth.readers.describing import Description, describe
    from gyronorth.readers.writing import write, write_chunks

__all__ = [
    "FORMATS",
    "Description",
    "ReadOptions",
    "RecordingInfo",
    "describe",
    "is_bag_folder",
    "is_recording_folder",
    "parse_columns",
    "read",
    "read_chunks",
    "recordings_in",
    "recordings_inside",
    "write",
    "write_chunks",
]

#: Names that a heading has no need of -> the module that they come from, imported when they are first asked for.
_HOMES = {"Description": "describing", "describe": "describing", "write": "writing", "write_chunks": "writing"}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
