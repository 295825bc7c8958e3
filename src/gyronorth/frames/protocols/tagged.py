"""Frames that list their contents: the same blocks, at the same places, in most frames of a stream."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator

import numpy as np

from gyronorth.arrays import Index
from gyronorth.frames.protocol import OTHER, Bytes

#: Blocks of a frame: number of the content -> (offset in the frame, bytes).
Blocks = dict[int, tuple[int, int]]
#: Structures of one length that are told apart; further ones are taken for other data.
_MOST = 32
#: Low bits of a layout that say what it holds.
FLAG_BITS = 12
FLAGS = (1 << FLAG_BITS) - 1


def groups_of(
    rows: Bytes, parse: Callable[[Bytes], tuple[Blocks, Index] | None]
) -> Iterator[tuple[Index, Blocks, Index]]:
    """Frames (k, length) that list the same contents: their places, the blocks, and the bytes that list them.

    `parse` gives the blocks of one frame and the positions of the bytes that list them; None if they do not fit the
    frame.
    """
    open_ = np.ones(len(rows), bool)
    for _ in range(_MOST):
        index = np.flatnonzero(open_)
        if not len(index):
            return
        model = rows[index[0]]
        parsed = parse(model)
        if parsed is None:
            open_[index[0]] = False
            continue
        blocks, listing = parsed
        alike = index[(rows[index][:, listing] == model[listing]).all(axis=1)]
        open_[alike] = False
        yield alike, blocks, listing


def layouts_of(
    rows: Bytes, parse: Callable[[Bytes], tuple[Blocks, Index] | None], flags: Callable[[Blocks], int | None]
) -> Index:
    """The layout of each frame (k,): a number for the bytes that list the contents, with `flags` in the low bits.

    `parse` is as for `groups_of`; `flags` gives a number of `FLAG_BITS` bits, or None where no inertial data are in it.
    """
    layout = np.full(len(rows), OTHER, np.int64)
    for alike, blocks, listing in groups_of(rows, parse):
        flag = flags(blocks)
        if flag is not None:
            layout[alike] = (zlib.crc32(rows[alike[0]][listing].tobytes()) << FLAG_BITS) | flag
    return layout
