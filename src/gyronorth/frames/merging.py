"""Fields of several kinds of frames as one, and how many samples the bytes between frames show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gyronorth.arrays import Index
from gyronorth.frames.protocol import Fields

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


def first_of(fields: Fields, count: int) -> Fields:
    """The first `count`."""
    arrays = {name: getattr(fields, name) for name in _ARRAYS}
    return replace(fields, **{name: None if array is None else array[:count] for name, array in arrays.items()})
