"""What a format is: its row of the catalogue, how it is recognised, opened and written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from gyronorth.catalogue import FORMATS, FormatInfo
from gyronorth.frozen import frozen
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.outgoing import RecordingStream
from gyronorth.readers.source import Source

#: Bytes at the start of a file by which its format is recognised.
LOOK = 1 << 16


@frozen
class Format:
    """One format of recordings."""

    info: FormatInfo
    open: Callable[[Path, ReadOptions], Source]
    recognises: Callable[[bytes], bool] = lambda _head: False  # by the first `LOOK` bytes of a file
    write: Callable[[RecordingStream, Path], None] | None = None
    #: Modules of foreign code that decode it: they are imported here, and used in a process of its own.
    foreign: tuple[str, ...] = ()


def format_info(name: str) -> FormatInfo:
    """The row of a shipped format; KeyError for a name that is none."""
    for info in FORMATS:
        if info.name == name:
            return info
    raise KeyError(name)
