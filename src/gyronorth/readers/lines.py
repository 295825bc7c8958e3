"""Texts that are written anew as a table: their lines in pieces, and the file that takes the table."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from gyronorth.errors import InputError
from gyronorth.readers.budget import size_of
from gyronorth.readers.spool import Spooled, most_of

#: Bytes of whole lines, or characters of a JSON array, that are written anew at a time.
PIECE = 1 << 20
#: A number; a digit can be taken in one way only.
NUMBER = rb"[-+]?(?:\d++(?:\.\d*+)?|\.\d++)(?:[eE][-+]?\d++)?"
#: Colours of terminals (ECMA-48, SGR), and how they begin.
COLOUR, COLOURS = b"\x1b[", re.compile(rb"\x1b\[[\d;]*m")


def spooled(path: Path, pieces: Iterable[bytes]) -> Spooled:
    """The pieces in a file."""
    file = Spooled(path.name)
    source = (piece for piece in pieces if piece)  # an empty one is no end
    most = most_of(size_of(path))
    file.fill(
        lambda _: next(source, b""),
        most=most,
        too_large=f"{path.name} is more than {most >> 20} MiB as a table, which no recording of its size is.",
    )
    return file


def pieces_of(path: Path) -> Iterator[bytes]:
    """Whole lines, many at a time, with LF."""
    with path.open("rb") as file:
        rest = file.read(3).removeprefix(b"\xef\xbb\xbf")
        while data := file.read(PIECE):
            whole, mark, rest_ = (rest + data).rpartition(b"\n")
            rest = rest_
            if len(rest) > PIECE:
                raise InputError(f"{path.name} has a line of more than {PIECE} characters: it is damaged.")
            if mark:
                yield _plain(whole) + b"\n"
    if rest.strip():
        yield _plain(rest).rstrip(b"\n") + b"\n"


def _plain(lines: bytes) -> bytes:
    """Lines with LF, without the colours of terminals."""
    lines = lines.replace(b"\r\n", b"\n")
    return COLOURS.sub(b"", lines) if COLOUR in lines else lines
