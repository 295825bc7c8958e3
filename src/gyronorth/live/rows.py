"""Rows of numbers as they come from a source, whatever it sends: lines or frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyronorth.readers.source import FLAGS, TIME, Facts
from gyronorth.readers.text import Layout


@dataclass(frozen=True)
class Form:
    """How the rows of a source are laid out."""

    titles: tuple[str, ...]  # of all fields, as the recording names them
    columns: tuple[str, ...]  # of `NAMES`, those that are used
    use: tuple[int, ...]  # their positions
    decoded: Facts | None = None  # of frames, whose rows are in SI: what is usual for their protocol

    @property
    def time(self) -> bool:
        """Whether the rows carry time stamps."""
        return TIME in self.columns

    @property
    def layout(self) -> Layout:
        """The same for the text reader."""
        return Layout(self.titles, self.use, ",")


@dataclass(frozen=True)
class LiveRows:
    """Rows of numbers, in step with the lines they were or, of frames, with what else these hold."""

    values: NDArray[np.float64]  # (n, k), columns as in `Form.columns`
    lines: Sequence[bytes] | None = None  # n lines without their ends; None: they were no lines
    extra: NDArray[np.float64] | None = None  # (n, m) of frames: `Form.titles` behind the columns

    def __len__(self) -> int:
        return len(self.values)

    def take(self, keep: NDArray[np.bool_] | Sequence[int]) -> LiveRows:
        """Those that a mask keeps, or at the given places."""
        keep = np.asarray(keep)
        places = np.flatnonzero(keep) if keep.dtype == bool else keep.astype(np.int64)
        lines = None if self.lines is None else [self.lines[i] for i in places.tolist()]
        return LiveRows(self.values[places], lines, None if self.extra is None else self.extra[places])

    def __add__(self, other: LiveRows) -> LiveRows:
        lines = None if self.lines is None or other.lines is None else [*self.lines, *other.lines]
        extra = None if self.extra is None or other.extra is None else np.concatenate([self.extra, other.extra])
        return LiveRows(np.concatenate([self.values, other.values]), lines, extra)

    @staticmethod
    def joined(parts: Sequence[LiveRows]) -> LiveRows:
        """The numbers of several, without their lines."""
        extra = [part.extra for part in parts if part.extra is not None]
        return LiveRows(np.concatenate([part.values for part in parts]), None, np.concatenate(extra) if extra else None)

    @property
    def flags(self) -> NDArray[np.bool_] | None:
        """What the unit says of the rows, (n, 2), as `FLAGS`; None of lines."""
        return None if self.extra is None else self.extra[:, -len(FLAGS) :] != 0

    def text(self) -> bytes:
        """The lines with their ends; numbers of frames as they read back exactly."""
        if self.lines is not None:
            return b"\n".join(self.lines) + b"\n"
        table = self.values if self.extra is None else np.hstack([self.values, self.extra])
        row = ",".join(["%r"] * table.shape[1]) + "\n"
        return (row * len(table) % tuple(table.ravel().tolist())).encode()


@dataclass(frozen=True)
class RowBatch:
    """Rows of one form."""

    form: Form
    rows: LiveRows
    why: str = ""  # they do not go on from those before, and why


@dataclass(frozen=True)
class StreamTally:
    """Counts of the input, and of what could not be used."""

    lines: int = 0  # lines or frames that should have been rows, good and bad
    garbage: int = 0  # of these, bad
    last_garbage: str = ""  # the last bad line, shortened
    skipped_bytes: int = 0  # of no whole frame: checksums that do not hold, cut frames
    other_frames: int = 0  # whole ones without inertial data
