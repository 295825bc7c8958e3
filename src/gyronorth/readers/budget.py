"""One budget for every recording that is read: bytes decoded, memory and time.

A file says how much it holds, and may lie: a megabyte of Parquet can claim gigabytes. What a file may
decode to grows with its size, from a floor that is far above any honest small recording. Foreign
decoders run in a process of their own (`gyronorth.apart`), which the system ends beyond its limits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from gyronorth.apart import Apart, Limits
from gyronorth.errors import InputError
from gyronorth.readers.library import errors_translated
from gyronorth.readers.source import Block, Parts, Source

#: Bytes that any file may decode to, and how many more for each of its own. Recordings pack to a third or a
#: tenth; only constant ones, that tell nothing, pack to less than a fiftieth.
DECODED_FLOOR, DECODED_RATIO = 64 << 20, 50
#: Memory of a foreign decoder: a floor, and more for each byte of the file (a chunk may be all of it).
MEMORY_FLOOR, MEMORY_RATIO = 768 << 20, 4
#: CPU time of a foreign decoder: a floor, s, and the slowest rate that is waited for, bytes per s.
TIME_FLOOR, SLOWEST = 10.0, 5e5


def largest_decoded(size: int) -> int:
    """Bytes to which a file of `size` bytes may decode."""
    return DECODED_FLOOR + DECODED_RATIO * size


def check_claim(name: str, what: str, claimed: int, size: int) -> None:
    """Refuse what a file claims to hold beyond the budget, before it is decoded.

    Parameters
    ----------
    name, what : str
        The file, and what in it claims so much.
    claimed, size : int
        Bytes decoded, and bytes of the file.

    Raises
    ------
    InputError
        If it is too much.
    """
    if claimed > largest_decoded(size):
        raise InputError(_too_much(name, f"{what} claims {claimed >> 20} MiB", size))


def size_of(path: Path) -> int:
    """Bytes of a file, or of all files in the folder of a bag."""
    if path.is_dir():
        return sum(file.stat().st_size for file in path.iterdir() if file.is_file())
    return path.stat().st_size


def counted(source: Source, size: int) -> Source:
    """The source, which ends in `InputError` where its rows exceed the budget of a file of `size` bytes."""
    return replace(source, blocks=partial(_counted, source, size))


def limits_of(size: int, packed: int | None = None) -> Limits:
    """Time and memory of what decodes a file of `size` bytes, which may have been unpacked from fewer."""
    honest = size if packed is None else min(size, DECODED_RATIO * packed)
    return Limits(seconds=TIME_FLOOR + honest / SLOWEST, memory=MEMORY_FLOOR + MEMORY_RATIO * size)


def open_apart(open_it: Callable[[], Source], *, name: str, size: int, packed: int | None = None) -> Source:
    """A source whose file is opened and decoded in a process of its own.

    Parameters
    ----------
    open_it : callable
        Opens the file; called in the child.
    name : str
        Of the file, for messages.
    size : int
        Bytes of the file.
    packed : int, optional
        Of the file that it was unpacked from: recordings pack to a fiftieth at most, and the time is bounded by that.

    Raises
    ------
    InputError
        What `open_it` raises; or if the limits are exceeded, here or while the blocks are read.
    """
    child = Apart(lambda: _Decoder(open_it()), limits=limits_of(size, packed), what=name)

    def ask(*request: Any) -> Any:
        with errors_translated(name, "file of its format"):  # a damaged one may hold anything in place of a number
            return child.ask(request)

    source: Source = ask("source")
    parts = source.parts
    return replace(
        source,
        blocks=partial(_blocks, ask),
        parts=None if parts is None else replace(parts, read=partial(ask, "part")),
    )


class _Decoder:
    """The child's side: an opened source that answers requests."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._running: list[Iterator[Block]] = []

    def __call__(self, request: tuple[Any, ...]) -> Any:
        match request:
            case ("source",):
                parts = self._source.parts
                bare = None if parts is None else Parts(parts.rows, parts.exact, parts.block, _elsewhere)
                return replace(self._source, blocks=_elsewhere, parts=bare)
            case ("blocks",):
                self._running.append(iter(self._source.blocks()))
                return len(self._running) - 1
            case ("next", number):
                return next(self._running[number], None)
            case ("part", share) if self._source.parts is not None:
                return self._source.parts.read(share)
        raise LookupError(request)


def _elsewhere(*_: Any) -> Any:
    """Stands for what reads, in what a child sends."""
    raise NotImplementedError


def _blocks(ask: Callable[..., Any]) -> Iterator[Block]:
    number = ask("blocks")
    while (block := ask("next", number)) is not None:
        yield block


def _counted(source: Source, size: int) -> Iterator[Block]:
    decoded = 0
    for block in source.blocks():
        decoded += block.values.nbytes
        if decoded > largest_decoded(size):
            raise InputError(_too_much(source.name, f"it decodes to more than {decoded >> 20} MiB", size))
        yield block


def _too_much(name: str, what: str, size: int) -> str:
    return (
        f"{name} has {size} bytes, and {what}; at most {largest_decoded(size) >> 20} MiB are decoded of so small a "
        "file: it is damaged, or made to exhaust its reader. If it is genuine, write it without compression, or as CSV."
    )
