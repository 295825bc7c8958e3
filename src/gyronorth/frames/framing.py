"""From pieces of a byte stream to whole frames: find a start, check the sum, resynchronise.

Frames are taken from left to right: a frame is accepted where its checksum holds and it begins after the end of the
one before, so that bytes inside a good frame are never taken for another. Nothing hangs on how the stream was cut
into pieces: a start is judged once all bytes of its frame are there, and not before those to its left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyronorth.arrays import Index
from gyronorth.frames.protocol import Bytes, Protocol


def windows(data: Bytes, starts: Index, size: int) -> Bytes:
    """Copies of `size` bytes from each of `starts`, (k, size)."""
    if not len(starts):
        return np.empty((0, size), np.uint8)
    return np.lib.stride_tricks.as_strided(data, (len(data) - size + 1, size), (1, 1))[starts]


@dataclass(frozen=True)
class Frames:
    """Whole frames in their order."""

    data: Bytes  # the bytes of all frames, one after the other
    length: Index  # (n,)
    start: Index  # (n,) byte offset in the stream
    layout: Index  # (n,)
    skipped: Index  # (n,) bytes since the frame before that belong to no frame

    def __len__(self) -> int:
        return len(self.length)

    def rows(self, index: Index) -> Bytes:
        """The frames `index`, all of one length, shape (k, length)."""
        first = np.cumsum(self.length) - self.length
        size = int(self.length[index[0]]) if len(index) else 0
        return windows(self.data, first[index], size)

    def lines(self, index: Index) -> Bytes:
        """The frames `index`, of any lengths, with commas in front where they are shorter than the longest."""
        length = self.length[index]
        size = int(length.max(initial=0))
        end = np.cumsum(self.length)[index]
        rows = windows(np.concatenate((np.full(size, ord(","), np.uint8), self.data)), end, size)
        rows[np.arange(size) < (size - length)[:, None]] = ord(",")
        return rows


def joined(parts: list[Frames]) -> Frames:
    """One after the other."""
    return Frames(*(np.concatenate([getattr(part, name) for part in parts]) for name in _NAMES))


def split(frames: Frames, count: int) -> tuple[Frames, Frames]:
    """The first `count` frames, and the others."""
    at = int(frames.length[:count].sum())
    names = _NAMES[1:]
    first = Frames(frames.data[:at], *(getattr(frames, name)[:count] for name in names))
    return first, Frames(frames.data[at:], *(getattr(frames, name)[count:] for name in names))


def without(frames: Frames, places: Index) -> tuple[Frames, int]:
    """The frames but for some, whose bytes belong to no frame then; and how many of these are behind the last one."""
    kept = np.ones(len(frames), bool)
    kept[places] = False
    of_none = np.cumsum(frames.skipped + np.where(kept, 0, frames.length))
    skipped = np.diff(of_none[kept], prepend=0)
    data = frames.data[np.repeat(kept, frames.length)]
    left = Frames(data, frames.length[kept], frames.start[kept], frames.layout[kept], skipped)
    return left, int(of_none[-1] - skipped.sum()) if len(frames) else 0


#: Which bytes begin a line.
_LINE_MARK = np.isin(np.arange(256), np.frombuffer(b"$#%", np.uint8))
_NAMES = ("data", "length", "start", "layout", "skipped")
_NONE = Frames(np.empty(0, np.uint8), *(np.empty(0, np.int64) for _ in _NAMES[1:]))


class Framer:
    """Cuts a byte stream into the frames of one protocol; it keeps the tail that is not decided yet."""

    def __init__(self, protocol: Protocol) -> None:
        self._protocol = protocol
        self._tail: Bytes = np.empty(0, np.uint8)
        self._offset = 0  # of the tail, in the stream
        self._needed = 0  # bytes that must be in the tail before more can be decided
        self._usual = 0  # length of the last frame
        self._since_frame = 0  # bytes of no frame since the last one
        self.skipped = 0  # bytes of no frame, in all

    @property
    def tail(self) -> bytes:
        """What is not decided yet."""
        return self._tail.tobytes()

    @property
    def end(self) -> int:
        """Bytes that came."""
        return self._offset + len(self._tail)

    def feed(self, piece: bytes | Bytes, *, last: bool = False) -> Frames:
        """The frames that `piece` completes; with `last`, what is incomplete is given up."""
        new = np.frombuffer(piece, np.uint8) if isinstance(piece, (bytes, bytearray, memoryview)) else piece
        data = np.concatenate((self._tail, new)) if len(self._tail) else new
        if len(data) < self._needed and not last:
            self._tail = data
            return _NONE
        start, length = self._protocol.starts(data)
        complete = start + length <= len(data)
        whole, layout = self._judge(data, start, length, complete)
        taken, decided = self._walk(data, start, length, complete, whole, last)
        frames = self._frames(data, start[taken], length[taken], layout[taken], decided)
        if len(taken):
            self._usual = int(length[taken[-1]])
        self._tail, self._offset = data[decided:].copy(), self._offset + decided
        open_ = length[(start == decided) & ~complete]
        self._needed = int(open_[0]) if len(open_) else 0
        return frames

    def _judge(self, data: Bytes, start: Index, length: Index, complete: np.ndarray) -> tuple[np.ndarray, Index]:
        whole, layout = np.zeros(len(start), bool), np.full(len(start), -1, np.int64)
        open_ = complete.copy()
        if self._protocol.judge_lines is not None:
            lines = np.flatnonzero(complete & _LINE_MARK[data[start]])
            whole[lines], layout[lines] = self._protocol.judge_lines(data, start[lines], length[lines])
            open_[lines] = False
        sizes = np.unique(length[open_]).tolist()
        for size in sorted(sizes, key=lambda size: size != self._usual):  # the usual one first
            index = np.flatnonzero(open_ & (length == size))
            if not len(index):
                continue
            rows = windows(data, start[index], size)
            good = self._protocol.whole(rows)
            whole[index] = good
            if good.any():
                layout[index[good]] = self._protocol.layouts(rows[good])
                if size == self._usual and not self._protocol.weak:  # what begins inside such a frame is none
                    first = start[index[good]]
                    last = first[np.maximum(np.searchsorted(first, start, side="right") - 1, 0)]
                    open_ &= (start < last) | (start >= last + size)
        return whole, layout

    def _walk(
        self, data: Bytes, start: Index, length: Index, complete: np.ndarray, whole: np.ndarray, last: bool
    ) -> tuple[Index, int]:
        """Indices of the accepted frames, and up to which byte all is decided."""
        matters = np.flatnonzero(whole | ~complete)
        ends = start[matters] + length[matters]
        inside = np.flatnonzero(start[matters[1:]] < ends[:-1])
        if not len(inside):  # as nearly always
            return self._apart(data, start[matters], ends, whole[matters], matters, last)
        apart = int(inside[0])  # before the first one in which another begins all are whole
        taken, end = matters[:apart].tolist(), int(ends[apart - 1]) if apart else 0
        matters, ends = matters[apart:], ends[apart:].tolist()
        first, good = start[matters].tolist(), whole[matters].tolist()
        for i, place in enumerate(matters.tolist()):
            if first[i] < end:
                continue
            rival = self._rival(i, first, ends) if self._protocol.weak and good[i] else None
            if not good[i] or (rival is not None and not good[rival]):
                if last and not good[i]:
                    continue
                if not last:
                    return np.array(taken, np.int64), first[i]
            elif rival is not None:
                continue
            taken.append(place)
            end = ends[i]
        decided = len(data) if last else max(end, len(data) - self._protocol.head + 1)
        return np.array(taken, np.int64), decided

    def _apart(
        self, data: Bytes, start: Index, end: Index, whole: np.ndarray, places: Index, last: bool
    ) -> tuple[Index, int]:
        """The same where none begins in another one: all that are whole, up to one that is not complete."""
        if last:
            return places[whole], len(data)
        count = int(np.argmin(whole)) if not whole.all() else len(whole)
        undecided = max(int(end[count - 1]) if count else 0, len(data) - self._protocol.head + 1)
        return places[:count], undecided if count == len(whole) else int(start[count])

    @staticmethod
    def _rival(i: int, first: list[int], ends: list[int]) -> int | None:
        """The first frame that begins in the frame i, by two bytes at least, and ends behind it."""
        for k in range(i + 1, len(first)):
            if first[k] > ends[i] - 2:
                return None
            if ends[k] > ends[i]:
                return k
        return None

    def _frames(self, data: Bytes, start: Index, length: Index, layout: Index, decided: int) -> Frames:
        end = start + length
        before = start - np.append(0, end[:-1]) if len(start) else start
        behind = decided - int(end[-1]) if len(start) else decided
        if self._protocol.line_ends:
            ends = np.flatnonzero((data[:decided] == 13) | (data[:decided] == 10))
            count = np.searchsorted(ends, np.append(start, decided)) - np.searchsorted(ends, np.append(0, end))
            before, behind = before - count[:-1], behind - int(count[-1])
        self.skipped += int(before.sum()) + behind
        if len(start):
            before[0] += self._since_frame
            self._since_frame = behind
        else:
            self._since_frame += behind
        return Frames(_cut(data, start, end), length, start + self._offset, layout, before)


def _cut(data: Bytes, start: Index, end: Index) -> Bytes:
    """The bytes from places to others, which do not overlap."""
    first = np.flatnonzero(np.append(True, start[1:] != end[:-1])[: len(start)])  # of frames without bytes between
    last, whole = np.append(first[1:], len(start))[: len(first)] - 1, data.tobytes()
    runs = [whole[a:b] for a, b in zip(start[first].tolist(), end[last].tolist(), strict=True)]
    return np.frombuffer(b"".join(runs), np.uint8)
