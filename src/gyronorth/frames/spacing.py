"""How many samples the bytes between two frames show: for units that send neither a counter nor a time."""

from __future__ import annotations

import numpy as np

from gyronorth.arrays import Index, Mask
from gyronorth.frames.framing import Frames

#: Samples come at even distances, with other frames between them or not, where this share of the first ones does; some
#: of them may be damaged.
_EVEN = 0.75


class Spacing:
    """Keeps the place of the last sample between the pieces of a stream."""

    def __init__(self) -> None:
        self._length = 1.0  # usual bytes of a frame
        self._distance: float | None = None  # usual bytes from sample to sample, where it is even
        self._others: Index = np.empty(0, np.int64)  # bytes of the frames of other kinds
        self._behind = 0  # bytes of no frame since the last sample
        self._start: int | None = None  # of the last sample, in the stream
        self._restarted = False  # a configuration has come since

    def settle(self, frames: Frames, index: Index) -> None:
        """Learn from the frames `index`, among those at the start, how far samples are apart."""
        self._length = float(frames.length[index].mean())
        lengths = np.unique(np.delete(frames.length, index))
        self._others = lengths[lengths % self._length != 0]
        distances = np.diff(frames.start[index])
        usual = float(np.median(distances)) if len(distances) else 0.0
        whole = distances % usual == 0 if usual else distances < 0  # twice as far: one between was damaged
        even = len(distances) > 1 and float(whole.mean()) > _EVEN
        self._distance = usual if even and usual > self._length + 2 else None  # a line's end is no other frame

    def shown(self, frames: Frames, index: Index) -> tuple[Index, Mask]:
        """Of the frames `index`: by how many samples each follows the one before, and whether the unit started between.

        Damaged frames of other kinds are told from damaged samples where samples come at even distances, or where the
        bytes are as many as in a frame of another kind, with or without samples.
        """
        bytes_ = np.cumsum(np.append(self._behind, frames.skipped))
        started = np.cumsum(np.append(int(self._restarted), frames.layout < -1))
        at = index + 1
        skipped = np.diff(bytes_[at], prepend=0)
        restarted = np.diff(started[at], prepend=0) > 0
        start = frames.start[index]
        if len(index):
            self._behind, self._restarted = int(bytes_[-1] - bytes_[at[-1]]), bool(started[-1] > started[at[-1]])
        else:
            self._behind, self._restarted = int(bytes_[-1]), bool(started[-1])
        steps = 1 + np.round(skipped / self._length)
        for length in self._others.tolist():
            samples, rest = np.divmod(skipped - length, self._length)
            steps = np.where((samples >= 0) & (rest == 0), 1 + samples, steps)
        if self._distance is not None and len(index):
            before = start[0] - self._distance if self._start is None else self._start
            distances = np.diff(start, prepend=before)
            steps = np.where(skipped > 0, np.maximum(np.round(distances / self._distance), 1), steps)
        if len(index):
            self._start = int(start[-1])
        return steps.astype(np.int64), restarted
