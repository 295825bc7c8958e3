"""Fields of several kinds of frames as one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gyronorth.arrays import Index, Mask
from gyronorth.frames.framing import Frames
from gyronorth.frames.protocol import Fields, Protocol

_ARRAYS = ("gyro", "accel", "ticks", "span", "counter", "saturated", "fault", "temperature", "usable")
#: What a frame says that has no such field.
_SILENT = {"saturated": False, "fault": False, "usable": True}


def merged(parts: Sequence[Fields], order: Index) -> Fields:
    """Fields of several groups of frames, whose members stood at `order`; what one of them lacks is left out.

    A group without status bits says nothing against its samples.
    """
    back = np.argsort(order)

    def merge(name: str) -> np.ndarray | None:
        arrays = [getattr(part, name) for part in parts]
        if all(array is None for array in arrays) or (name not in _SILENT and any(array is None for array in arrays)):
            return None
        filled = [
            np.full(len(part.gyro), _SILENT[name]) if array is None else array
            for part, array in zip(parts, arrays, strict=True)
        ]
        return np.concatenate(filled)[back]

    return replace(parts[0], **{name: merge(name) for name in _ARRAYS})


def some_of(fields: Fields, which: slice | Mask) -> Fields:
    """Those of some of the frames."""
    arrays = {name: getattr(fields, name) for name in _ARRAYS}
    return replace(fields, **{name: None if array is None else array[which] for name, array in arrays.items()})


def fields_of(protocol: Protocol, layout: int, frames: Frames, index: Index) -> Fields:
    """Fields of the frames `index`, which may be of several lengths and, where these are read alike, layouts."""
    with np.errstate(invalid="ignore"):  # what is no number is none of a usable sample
        return _fields_of(protocol, layout, frames, index)


def _fields_of(protocol: Protocol, layout: int, frames: Frames, index: Index) -> Fields:
    if protocol.lines(layout):
        return protocol.fields(frames.lines(index), layout)
    kinds = frames.length[index]
    if protocol.reads is not None:
        _, which = np.unique(frames.layout[index], return_inverse=True)
        kinds = kinds + (int(kinds.max()) + 1) * which
    groups = [np.flatnonzero(kinds == value) for value in np.unique(kinds).tolist()]
    parts = [protocol.fields(frames.rows(index[group]), layout) for group in groups]
    return merged(parts, np.concatenate(groups)) if len(parts) > 1 else parts[0]


def covered(protocol: Protocol, layouts: Index, count: Index) -> list[float]:
    """Of the frames with data, `count` of each of `layouts`, the share that holds what is read of each."""
    if protocol.reads is None:
        return [1.0] * len(layouts)
    reads = [protocol.reads(layout) for layout in layouts.tolist()]
    return [float(count[(layouts & read) == read].sum() / count.sum()) for read in reads]
