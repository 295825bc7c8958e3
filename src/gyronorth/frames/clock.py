"""The place of each sample in time: the unit's clock, its sequence counter, or the bytes between the frames."""

from __future__ import annotations

from copy import copy

import numpy as np

from gyronorth.arrays import Array, Index, Mask
from gyronorth.frames.protocol import Fields

#: Rates that units are set to, Hz. A rate measured with a coarse clock that agrees with one of them is that one.
NOMINAL_HZ = (
    1, 2, 4, 5, 10, 20, 25, 50, 100, 125, 150, 200, 250, 300, 400, 500, 600, 800, 1000, 1200, 1500, 1600, 1800, 2000,
    2400, 2500, 3000, 3600, 4000, 5000, 8000,
)  # fmt: skip
#: A step of the clock that is longer than this, s, is a restart of the clock and no gap.
LONGEST_GAP_S = 60.0
#: Of the first steps of the clock, those longer than so many usual ones tell no rate, nor those so many times as far
#: off as others are: a damaged time stamp makes two.
FAR, STRAY = 20, 6
#: A step of the clock of more samples than this, between two neighbours by the counter and by the bytes, sets it anew.
CLOCK_SET = 20
#: A step of the clock agrees with the number of samples that the bytes show when it is not further off, in samples.
AGREES = 0.75
#: Steps of the clock between whole neighbours that show another rate, the share by which it must differ, and the share
#: of them that must agree on it.
WATCHED, OTHER_RATE, ALIKE = 64, 0.1, 0.8

#: A counter of so many numbers that goes on by more than half of them has gone back.
LONG_COUNTER = 1 << 16
#: Frames that show whether several units send in turn, the share of their steps that go back, and of moves of a counter
#: that are alike.
IN_TURN, BACK, MOVES_ALIKE = 16, 0.2, 0.7


def clock_steps(ticks: Index, tick: float, wrap: int | None) -> Array:
    """Steps of a unit's clock between neighbours, s, shape (n - 1,); NaN where it was reset."""
    steps = np.diff(ticks)
    if wrap is not None:
        steps %= wrap
    seconds = steps * tick
    return np.where((seconds < 0) | (seconds > LONGEST_GAP_S), np.nan, seconds)


def rate_of_clock(fields: Fields) -> float | None:
    """Sample rate, Hz, by the clock of the first frames; None where it does not tell.

    The shortest usual step counts one sample, longer ones several. The clock is known to its tick
    and its jitter, so that the rate is known to these over the time it spans; a nominal rate within this is taken.
    """
    if fields.ticks is None or len(fields.ticks) < 3:
        return None
    steps = clock_steps(fields.ticks, fields.tick, fields.tick_wrap)
    known = np.isfinite(steps)
    if not (steps[known] > 0).any():
        return None
    usual = float(np.median(steps[known & (steps > 0)]))
    whole = np.append(known[1:], False) & np.append(False, known[:-1])  # steps on both sides that do not go back
    steps = steps[known & (steps <= np.where(whole, FAR, 2) * usual)]
    if usual < 3 * fields.tick:  # a coarse clock: the fewest samples that a step may count
        usual = float(steps.mean())
        counted = np.maximum(np.ceil((steps - 1.01 * fields.tick) / usual), 1)
    else:
        counted = np.maximum(np.round(steps / usual), 1)
        usual = float(steps.sum() / counted.sum())
        residuals = np.abs(steps - usual * counted)
        steps, counted = (each[residuals <= STRAY * np.median(residuals) + fields.tick] for each in (steps, counted))
        usual = float(steps.sum() / counted.sum())
        counted = np.maximum(np.round(steps / usual), 1)
    rate, residual = counted.sum() / steps.sum(), np.abs(steps - usual * counted).max()
    spread = 2 * (residual + fields.tick) / steps.sum() + 1e-6
    return _nominal(rate, spread)


def rate_of_spans(fields: Fields) -> float | None:
    """Sample rate, Hz, by the times over which the increments of the first frames were taken; None for none."""
    if fields.span is None:
        return None
    good = fields.span[np.isfinite(fields.span) & (fields.span > 0)]
    return _nominal(float(1 / np.median(good)), 1e-3) if len(good) else None


def _nominal(rate: float, spread: float) -> float:
    """The nominal rate that is within a share of a measured one, else that."""
    nominal = min(NOMINAL_HZ, key=lambda value: abs(value / rate - 1))
    return float(nominal) if abs(nominal / rate - 1) <= spread else float(rate)


def stride_of(fields: Fields) -> int | None:
    """By how much the sequence counter usually moves from frame to frame; None where it tells nothing."""
    if fields.counter is None or len(fields.counter) < 3:
        return None
    moves, count = np.unique(np.diff(fields.counter) % fields.counter_wrap, return_counts=True)
    stride = int(moves[np.argmax(count)])
    return stride if stride > 0 and stride * 2 <= fields.counter_wrap else None


def of_several_units(fields: Fields) -> str:
    """What shows that the first frames come from several units in turn: "counter", "clock", or "" for nothing.

    The clock of one unit hardly ever goes back. Its counter moves alike from frame to frame; of units in turn it jumps
    to and fro, and moves alike from every second frame, or third or fourth, to the next.
    """
    if fields.ticks is not None and len(fields.ticks) >= IN_TURN:
        steps = np.diff(fields.ticks)
        if fields.tick_wrap is not None:
            steps = (steps + fields.tick_wrap // 2) % fields.tick_wrap - fields.tick_wrap // 2
        if (steps < 0).mean() > BACK:
            return "clock"
    if fields.counter is None or len(fields.counter) < IN_TURN:
        return ""
    moves = np.diff(fields.counter) % fields.counter_wrap
    if _usual(moves)[1] >= MOVES_ALIKE:
        return ""
    for units in (2, 3, 4):
        move, share = _usual((fields.counter[units:] - fields.counter[:-units]) % fields.counter_wrap)
        to_and_fro = (moves == 0) | (moves > move)  # a counter that skips some numbers moves further in two steps
        if share >= MOVES_ALIKE and to_and_fro.mean() > BACK:
            return "counter"
    return ""


def _usual(moves: Index) -> tuple[int, float]:
    """The most frequent one, and its share."""
    values, count = np.unique(moves, return_counts=True)
    return int(values[np.argmax(count)]), float(count.max() / len(moves))


class Numbering:
    """Numbers the samples of a stream, the lost ones too, and keeps the state between its pieces.

    Parameters
    ----------
    interval : float or None
        Between samples, s.
    stride : int or None
        By how much the sequence counter usually moves.
    clock : bool
        Whether the unit sends its time.
    """

    def __init__(self, interval: float | None, stride: int | None, *, clock: bool) -> None:
        self.stride = stride
        self.interval, self._clock = interval, clock
        self._ticks: int | None = None
        self._counter = 0
        self._number = -1
        self._elapsed = 0.0  # s since the first sample
        self._anew = False  # the next sample follows a jump
        self._steps = np.empty(0)  # the last steps of the clock between whole neighbours, in samples
        self.jumps = 0
        self.lost = 0

    def copy(self) -> Numbering:
        """Another one in the same state."""
        return copy(self)

    def go_on(self, before: Numbering) -> None:
        """Number on behind another one, after a jump: how long it was is not known."""
        self._number, self._elapsed = before._number, before._elapsed
        self.jumps, self.lost = before.jumps, before.lost
        self._anew = True

    @property
    def lost_from(self) -> str:
        """How lost samples are known."""
        if self.stride is not None:
            return "counter"
        return "clock" if self._clock and self.interval is not None else "bytes"

    def other_rate(self, fields: Fields, shown: Index) -> int | None:
        """The sample from which on the clock shows another rate; None for none. To be asked before they are numbered.

        Frames that the counter shows to be lost do not make a rate slower.
        """
        if self.interval is None or not self._clock or fields.ticks is None:
            return None
        before = self._ticks if self._ticks is not None else int(fields.ticks[0])
        seconds = clock_steps(np.concatenate(([before], fields.ticks)), fields.tick, fields.tick_wrap)
        whole = np.isfinite(seconds) & (shown == 1)
        if self._ticks is None:
            whole[0] = False
        if self.stride is not None and fields.counter is not None:
            whole &= np.diff(fields.counter, prepend=self._counter) % fields.counter_wrap == self.stride
        steps = np.concatenate((self._steps, seconds[whole] / self.interval))
        places = np.concatenate((np.full(len(self._steps), 0), np.flatnonzero(whole)))
        self._steps = steps[-WATCHED:]
        if len(steps) < WATCHED:
            return None
        blur = fields.tick / self.interval
        if blur >= 1:  # a tick or two for several samples: too coarse to tell loss from rate
            return None
        mean = np.convolve(steps, np.full(WATCHED, 1 / WATCHED), "valid")
        for window in np.flatnonzero(np.abs(mean - 1) > OTHER_RATE)[:: WATCHED // 4].tolist():
            seen = steps[window : window + WATCHED]
            near = np.abs(seen - np.median(seen)) <= OTHER_RATE * np.median(seen) + blur
            if near.mean() < ALIKE:
                continue
            usual = float(seen[near].mean())  # without those behind lost samples
            if abs(usual - 1) > OTHER_RATE + blur / WATCHED:
                self._steps = np.empty(0)
                off = np.abs(steps - 1) > np.abs(steps - usual)
                begin = window + int(np.argmax(off[window:]))
                before = np.flatnonzero(~off[:begin])
                place = int(places[before[-1] + 1 if len(before) else 0])
                return place - 1 if place > 0 and np.isnan(seconds[place - 1]) else place
        return None

    def number(self, fields: Fields, shown: Index, restarted: Mask | None = None) -> tuple[Index, Array | None, Mask]:
        """Numbers (n,), times (n,), s from the first sample, and where it is not known how long the step was.

        The bytes show each to follow the one before by `shown` samples; before `restarted` ones the unit told that it
        started.
        """
        n, first = len(fields.gyro), self._number < 0
        expected = shown.astype(float)
        seconds, jumped = np.full(n, np.nan), np.zeros(n, bool)
        if self._clock and fields.ticks is not None:
            before = int(fields.ticks[0]) if self._ticks is None else self._ticks
            seconds = clock_steps(np.concatenate(([before], fields.ticks)), fields.tick, fields.tick_wrap)
            self._ticks = int(fields.ticks[-1])
            if self._anew:
                seconds[0] = np.nan
            if self.stride is not None and fields.counter is not None and self.interval is not None:
                next_ = np.diff(fields.counter, prepend=self._counter) % fields.counter_wrap == self.stride
                with np.errstate(invalid="ignore"):
                    seconds[next_ & (shown == 1) & (seconds > CLOCK_SET * self.interval)] = np.nan
            jumped = np.isnan(seconds)
            if self.interval is not None:
                by_clock = seconds / self.interval
                with np.errstate(invalid="ignore"):
                    agrees = np.abs(by_clock - expected) <= AGREES + (
                        fields.tick / self.interval if fields.tick > self.interval / 4 else 0.0
                    )
                expected = np.where(jumped | agrees, expected, np.round(by_clock))
        elif self._anew:
            jumped[0] = True
        self.jumps += int(jumped.sum())
        steps = by_bytes = np.maximum(expected, 1)
        if self.stride is not None and fields.counter is not None:
            moves = np.diff(fields.counter, prepend=self._counter) % fields.counter_wrap
            turn = fields.counter_wrap / self.stride
            base = moves / self.stride
            base = np.where(base == 0, np.where(expected < turn / 2, 1, turn), base)  # the same number: sent twice
            steps = np.round(base + turn * np.maximum(np.round((expected - base) / turn), 0))
            broken = jumped if restarted is None else jumped | restarted
            if not self._clock and fields.counter_wrap >= LONG_COUNTER:  # so many are not lost: it goes back
                broken = broken | (moves > fields.counter_wrap // 2)
            goes_on = np.asarray(steps == by_bytes)  # a unit that started anew, or only its clock was set
            if self._anew:
                goes_on[0] = False
            if first:
                goes_on[0] = True
            jumped = broken & ~goes_on
            steps = np.where(jumped, by_bytes, steps)
            self._counter = int(fields.counter[-1])
        steps = steps.astype(np.int64)
        if first:
            steps[0] = 1
        numbers = self._number + np.cumsum(steps)
        self.lost += int(steps.sum()) - n
        self._number, self._anew = int(numbers[-1]), False
        return numbers, self._times(fields, seconds, steps, first), jumped

    def _times(self, fields: Fields, seconds: Array, steps: Index, first: bool) -> Array | None:
        if not self._clock:
            return None
        jumped = np.isnan(seconds)
        spans = np.where(jumped, steps * (self.interval or 0.0), seconds)
        ticks = np.round(spans / fields.tick).astype(np.int64)
        if first:
            ticks[0] = 0
        elapsed = np.cumsum(ticks) + round(self._elapsed / fields.tick)
        self._elapsed = float(elapsed[-1]) * fields.tick
        return elapsed.astype(float) * fields.tick
