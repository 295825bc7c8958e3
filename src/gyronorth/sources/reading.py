"""The samples of many recordings, one after the other, for training and for studies."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from gyronorth.sources.listing import Item
from gyronorth.sources.remote import at_hand

if TYPE_CHECKING:
    from gyronorth.readers import ReadOptions
    from gyronorth.recording import Recording


def read_each(items: Iterable[Item], reading: ReadOptions | None = None) -> Iterator[Recording]:
    """Each recording, in order; the first that cannot be read ends it.

    Parameters
    ----------
    items : iterable of Item
        Of `gyronorth.sources.listing.recordings`.
    reading : ReadOptions, optional
        What the files do not say about themselves.

    Raises
    ------
    InputError
        If a recording cannot be fetched or read.
    """
    from gyronorth.readers import ReadOptions, read

    for item in items:
        with at_hand(item.address) as path:
            recording = read(path, reading or ReadOptions())
        yield recording
