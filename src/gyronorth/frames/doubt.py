"""Frames whose checksum is a sum, or short: what the frames on both sides say against one.

Two errors can undo each other in a sum: of frames with two wrong bits, one in eight passes an exclusive or of bytes,
and one in sixteen a sum of bytes. A frame that does not go on from the one before waits for the next. It is damaged
where the next goes on from the one before as if it were not there: by the clock, by the counter, or in the numbers; not
long behind bytes of no frame, also by its status bits: of one sample alone they are an error of the line. Where the
next goes on from it, or from neither, the unit itself has changed, and nothing is left out. What is wrong by less than
the noise cannot be told.

A CRC-16 finds two wrong bits, and lets one damaged frame of 65,536 pass: one is doubted only where others were found to
be damaged not long before. There two wrong ones in a row, which do not go on from each other, are found too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyronorth.arrays import Array, Index, Mask
from gyronorth.frames.clock import clock_steps
from gyronorth.frames.protocol import Fields

#: The clock goes on where its step is no further from that which the bytes show, in samples.
CLOCK_OFF = 1.5
#: The counter goes on where it is this far from what the bytes show, in samples, if some of them are of no frame.
COUNTER_OFF = 1
#: Numbers go on where their step is within these, rad/s and m/s^2, and this many times the usual step.
RATE_STEP, FORCE_STEP, STEPS = 3e-5, 3e-3, 9.0
#: The next number goes on from the one before where it is this share of the way to the one between, at most.
BACK = 0.25
#: One sample alone is this many times as far away as the last step was.
ALONE = 4.0
#: Samples over which the usual step is taken.
BLOCK = 64
#: Samples behind a damaged frame in which others are likely.
BESIDE = 4096


@dataclass(frozen=True)
class _Line:
    """Samples in their order."""

    values: Array  # (n, k) rate and specific force
    steps: Array  # (n, k) of the values
    usable: Mask  # (n,)
    ticks: Index | None  # (n,)
    counter: Index | None  # (n,)
    count: Index  # (n,) number of the sample as the bytes show it
    loose: Index  # (n,) up to it, how often there were bytes of no frame
    flags: Index  # (n,) what the unit says of each, where that is doubted

    def behind(self, before: _Line) -> _Line:
        """The same behind another."""
        ticks = None if self.ticks is None or before.ticks is None else np.append(before.ticks, self.ticks)
        counter = None if self.counter is None or before.counter is None else np.append(before.counter, self.counter)
        values, steps = np.concatenate((before.values, self.values)), np.concatenate((before.steps, self.steps))
        usable = np.append(before.usable, self.usable)
        flags = np.append(before.flags, self.flags)
        return _Line(values, steps, usable, ticks, counter, np.append(0, self.count), np.append(0, self.loose), flags)

    def at(self, place: int) -> _Line:
        """One of them."""
        part = slice(place, place + 1)
        return _Line(
            self.values[part],
            self.steps[part],
            self.usable[part],
            None if self.ticks is None else self.ticks[part],
            None if self.counter is None else self.counter[part],
            np.zeros(1, np.int64),
            np.zeros(1, np.int64),
            self.flags[part],
        )


class Doubt:
    """Finds damaged samples by their neighbours, and keeps the state between the pieces of a stream.

    Parameters
    ----------
    interval : float or None
        Between samples, s.
    stride : int or None
        By how much the sequence counter usually moves.
    always : bool
        Whether all frames are doubted, not only those at most `BESIDE` samples behind a damaged one.
    """

    def __init__(self, interval: float | None, stride: int | None, *, always: bool) -> None:
        self._interval, self._stride, self._always = interval, stride, always
        self._since = BESIDE  # samples since one behind bytes of no frame
        self._last: _Line | None = None  # the last sample that was taken
        self._value: Array | None = None  # of the last sample, taken or not, (1, k)
        self._steps = np.empty((0, 0))  # steps since the usual one was taken, (m, k)
        self._usual = np.empty(0)  # (k,)

    def sift(
        self, fields: Fields, values: Array, usable: Mask, shown: Index, loose: Mask, *, last: bool
    ) -> tuple[Mask, int]:
        """Which samples are damaged, (n,), and how many are decided; those behind are to be given again, with more.

        Parameters
        ----------
        fields : Fields
            Clock and counter of n samples.
        values : ndarray, shape (n, k)
            Rate, rad/s, and specific force, m/s^2.
        usable : ndarray, shape (n,)
            Which of them are numbers that a sensor can give.
        shown : ndarray, shape (n,)
            By how many samples the bytes show each to follow the one before.
        loose : ndarray, shape (n,)
            Before which of them there are bytes of no frame: what is shown is not certain.
        last : bool
            Whether no more come.
        """
        values = np.where(usable[:, None], values, 0.0)
        steps = np.abs(np.diff(values, axis=0, prepend=values[:1] if self._value is None else self._value))
        since = self._since_damage(loose)
        flags = _flags(fields) * (since < BESIDE) * self._always
        count, tears = np.cumsum(shown), np.cumsum(loose, dtype=int)
        line = _Line(values, steps, usable, fields.ticks, fields.counter, count, tears, flags)
        usual = self._blocks(steps)
        limit = self._limits(steps, usual)
        doubt = np.where(since < BESIDE, 2, int(self._always))
        known = self._last is not None
        doubt = np.append(0, doubt) if known else doubt
        line = line if self._last is None else line.behind(self._last)
        damaged = np.zeros(len(line.usable), bool)
        limit = np.concatenate((limit[:1], limit)) if known else limit
        end = self._walk(line, fields, limit, doubt, damaged, last) - known
        damaged = damaged[known:]
        good = np.flatnonzero(~damaged[:end])
        if len(good):
            self._last = line.at(int(good[-1]) + known)
        self._keep(values[:end], steps[:end], usual)
        self._since = int(since[end - 1]) if end else self._since
        return damaged[:end], end

    def _since_damage(self, loose: Mask) -> Index:
        """Of each sample, how many ago bytes of no frame came, (n,)."""
        places = np.arange(len(loose))
        if self._last is None and len(loose):
            loose = np.append(False, loose[1:])  # a stream that begins in the middle of a frame is not damaged
        latest = np.maximum.accumulate(np.where(loose, places, -1 - self._since))
        return np.minimum(places - latest, BESIDE)

    def _walk(self, line: _Line, fields: Fields, limit: Array, doubt: Index, damaged: Mask, last: bool) -> int:
        """Mark the damaged ones of those in doubt (2: of pairs too), and return up to where it is decided."""
        n = len(line.usable)
        odd = ~self._goes_on(line, fields, np.arange(n - 1), np.arange(1, n), limit[1:])
        odd |= ~line.usable[:-1] | ~line.usable[1:]
        odd = np.append(not line.usable[0] or (self._last is None and n > 1 and odd[0]), odd)
        odd &= (doubt > 0) | ~line.usable
        usable_at = np.flatnonzero(line.usable)
        before = -1  # the last one that is not damaged
        for place in np.flatnonzero(odd).tolist():
            before = place - 1 if place and not damaged[place - 1] else before
            if not line.usable[place]:
                damaged[place] = True
                continue
            if before < 0:
                damaged[place] = self._first_is_odd(line, fields, limit, place)
                continue
            one = (line, fields, np.array([before]), np.array([place]), limit[place : place + 1])
            if self._goes_on_at(line, fields, limit, before, place):
                continue
            next_ = np.searchsorted(usable_at, place, side="right")
            if next_ == len(usable_at):
                if not last:
                    return place
                damaged[place] = True
                continue
            damaged[place] = self._returns(*one, usable_at[next_ : next_ + 1])
            if damaged[place] or doubt[place] < 2 or self._goes_on_at(line, fields, limit, place, usable_at[next_]):
                continue
            if next_ + 1 == len(usable_at):
                if not last:
                    return place
                continue
            if not self._goes_on_at(line, fields, limit, before, usable_at[next_]):
                damaged[place] = self._returns(*one, usable_at[next_ + 1 : next_ + 2])
        return n

    def _first_is_odd(self, line: _Line, fields: Fields, limit: Array, place: int) -> bool:
        """Whether the second goes not on from the first, but the third from the second."""
        if place + 2 >= len(line.usable):
            return False
        from_, to = np.array([place, place + 1]), np.array([place + 1, place + 2])
        return self._goes_on(line, fields, from_, to, limit[to]).tolist() == [False, True]

    def _goes_on_at(self, line: _Line, fields: Fields, limit: Array, from_: int, to: int) -> bool:
        return bool(self._goes_on(line, fields, np.array([from_]), np.array([to]), limit[to : to + 1])[0])

    def _goes_on(self, line: _Line, fields: Fields, from_: Index, to: Index, limit: Array) -> Mask:
        """Whether the samples `to` go on from the samples `from_`, (m,)."""
        near = (np.abs(line.values[to] - line.values[from_]) <= limit).all(axis=1)
        fits = self._in_time(line, fields, from_, to) & self._in_count(line, fields, from_, to)
        return near & fits & self._in_flags(line, fields, from_, to)

    def _in_flags(self, line: _Line, _fields: Fields, from_: Index, to: Index) -> Mask:
        return np.asarray(line.flags[from_] == line.flags[to])

    def _in_time(self, line: _Line, fields: Fields, from_: Index, to: Index) -> Mask:
        if line.ticks is None or self._interval is None:
            return np.ones(len(to), bool)
        off = self._by_clock(line, fields, from_, to) - (line.count[to] - line.count[from_])
        return np.asarray(np.abs(off) <= CLOCK_OFF + fields.tick / self._interval)

    def _by_clock(self, line: _Line, fields: Fields, from_: Index, to: Index) -> Array:
        """Steps of the clock, in samples."""
        assert line.ticks is not None
        assert self._interval is not None
        pairs = np.column_stack((line.ticks[from_], line.ticks[to])).ravel()
        return clock_steps(pairs, fields.tick, fields.tick_wrap)[::2] / self._interval

    def _in_count(self, line: _Line, fields: Fields, from_: Index, to: Index) -> Mask:
        """Whether the counter agrees with the bytes, or with a clock that does."""
        if line.counter is None or self._stride is None:
            return np.ones(len(to), bool)
        moves, count = line.counter[to] - line.counter[from_], line.count[to] - line.count[from_]
        near = COUNTER_OFF * self._stride * (line.loose[to] > line.loose[from_])
        agrees = (moves - self._stride * count + near) % fields.counter_wrap <= 2 * near
        if line.ticks is not None and self._interval is not None:
            by_clock = np.where(self._in_time(line, fields, from_, to), self._by_clock(line, fields, from_, to), count)
            agrees |= (moves - self._stride * np.round(by_clock).astype(np.int64)) % fields.counter_wrap == 0
        return np.asarray(agrees)

    def _returns(self, line: _Line, fields: Fields, before: Index, at: Index, limit: Array, behind: Index) -> bool:
        """Whether the sample `behind` goes on from that `before`, where the one `at` does not."""
        for rule in (self._in_time, self._in_count, self._in_flags):
            if not rule(line, fields, before, at)[0] and rule(line, fields, before, behind)[0]:
                return True
        away = np.abs(line.values[at] - line.values[before])
        limit = np.maximum(limit, ALONE * line.steps[before])
        far = (away > limit) & (np.abs(line.values[at] - line.values[behind]) > limit)
        return bool((far & (np.abs(line.values[behind] - line.values[before]) <= BACK * away)).any())

    def _limits(self, steps: Array, of_blocks: Array) -> Array:
        """The largest step of each sample, (n, k), by the usual one of the block before."""
        k = steps.shape[1]
        floor = np.where(np.arange(k) < 3, RATE_STEP, FORCE_STEP)
        if not len(self._usual):
            self._usual = _usual(steps[None, :BLOCK])[0]
        open_ = len(self._steps)
        usual = np.concatenate((self._usual[None], of_blocks))
        return floor + STEPS * usual[(open_ + np.arange(len(steps))) // BLOCK]

    def _blocks(self, steps: Array) -> Array:
        """The usual step of each block that is full, (m, k)."""
        steps = np.concatenate((self._steps, steps)) if len(self._steps) else steps
        full = len(steps) // BLOCK
        return _usual(steps[: full * BLOCK].reshape(full, BLOCK, steps.shape[1]))

    def _keep(self, values: Array, steps: Array, of_blocks: Array) -> None:
        """Go on behind these; `of_blocks` is what is usual in each full block, perhaps in some behind them too."""
        before = len(self._steps)
        full = (before + len(steps)) // BLOCK
        self._usual = of_blocks[full - 1] if full else self._usual
        self._steps = np.concatenate((self._steps, steps))[full * BLOCK :] if before else steps[full * BLOCK :]
        self._value = values[-1:] if len(values) else self._value


def _flags(fields: Fields) -> Index:
    """What the unit says of each sample, as bits, (n,)."""
    said = (np.zeros(len(fields.gyro), bool) if flag is None else flag for flag in (fields.saturated, fields.fault))
    return np.array([1, 2]) @ np.array([*said], np.int64)


def _usual(steps: Array) -> Array:
    """The usual step in each block of (m, n, k): the median, but the smallest one where numbers mostly repeat."""
    smallest = np.where(steps > 0, steps, np.inf).min(axis=1)
    return np.maximum(np.median(steps, axis=1), np.where(np.isfinite(smallest), smallest, 0.0))
