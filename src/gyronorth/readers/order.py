"""Rows of a file in the order of its clock: steps back, leaps, repeats, and places where clocks start from 0."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyronorth.arrays import Array, Index, Mask
from gyronorth.readers.source import DESCRIBED, Source
from gyronorth.readers.waiting import first_run, repeats

#: Where a clock starts again from 0, s, and its name.
WRAPS = (
    (604800.0, "the GPS week ends"),
    (86400.0, "the day ends"),
    (2.0**32 * 1e-6, "a 32-bit counter of microseconds overflows"),
    (2.0**32 * 1e-3, "a 32-bit counter of milliseconds overflows"),
)
#: Where counters of samples start again from 0.
COUNTER_WRAPS = tuple((2.0**bits, f"a counter of {bits} bits overflows") for bits in (7, 8, 10, 12, 16, 24, 32))
#: Bits of shorter counters of ticks of a known length, which start again often: longest time before and after, and
#: shortest time from one to the next, in sample intervals.
TICK_BITS, AROUND_TICKS, LEAST_TICKS = (16, 24), 20, 100
#: Longest time before and after such a place, s; of a counter, samples.
AROUND_WRAP = 10.0
#: So many rows in order behind one that runs backwards are a clock that started again, not rows out of order.
RESTART_ROWS = 20


@dataclass
class ClockCounts:
    """What the time stamps of the samples so far show."""

    late: int = 0  # stamps that lie more than `LATE` intervals above the lower envelope
    latest: float = 0.0  # how far the latest of them does, s
    repeated: int = 0  # stamps that repeat the one before, with other values
    duplicated: int = 0  # rows left out: they repeat the one before, stamp and values
    backwards: int = 0  # rows left out: their stamp runs backwards or leaps ahead
    wraps: tuple[str, ...] = ()  # where the clock started again from 0 and was followed
    given_back: int = 0  # samples taken for lost, until later stamps came back


class TimeOrder:
    """Takes the times of rows, block after block, and tells which rows are in order."""

    def __init__(self, source: Source) -> None:
        self.counts = ClockCounts()
        self.interval = 1.0  # between samples, in units of the clock
        self._source = source
        self._last_time: float | None = None  # of the last row in order, as it stands in the file
        self._stamp = 0.0  # the same, without wraps
        self._last_seen: Array | None = None  # values of the last row in order

    def differences(self, time: Array) -> Array:
        """Steps, (n - 1,), between times, (n,), of a clock that may start again from 0 at a known value."""
        step = np.diff(time)
        wrap = self._source.clock.wrap if self._source.clock else None
        return step if wrap is None else (step + wrap / 2) % wrap - wrap / 2

    def take(
        self, time: Array, data: Array, rows: Index, reasons: list[tuple[int, str]]
    ) -> tuple[Mask, Array, tuple[int, str] | None]:
        """Which rows are in order of time.

        Parameters
        ----------
        time : ndarray, shape (n,)
            As it stands in the file.
        data : ndarray, shape (n, k)
            Values of the rows.
        rows : ndarray, shape (n,)
            Their numbers, as the user counts them.
        reasons : list of (int, str)
            Gets what is wrong with the first rows that are out of order.

        Returns
        -------
        ordered : ndarray of bool, shape (n,)
        stamps : ndarray, shape (n,)
            Times without wraps.
        restart : (int, str) or None
            Where the clock started again, and the words that say how.
        """
        interval = self.interval
        start = time[:1] - interval if self._last_time is None else np.array([self._last_time])
        raw = np.concatenate([start, time])
        step = self.differences(raw)
        if (step < 0).any():
            step = self._over_wraps(raw, step)
        stamps = self._stamp + np.cumsum(step)
        ordered, restart = np.ones(len(time), dtype=bool), None
        if not (step > 0).all():
            before = np.concatenate([[self._stamp], stamps[:-1]])
            # A stamp that leaps ahead, and from which the next one falls back, is wrong itself.
            falls_back = (stamps[:-1] > stamps[1:]) & (before[:-1] < stamps[1:])
            ordered[:-1] &= ~(falls_back & (step[:-1] > 1.5 * interval))
            latest = np.maximum.accumulate(np.concatenate([[self._stamp], np.where(ordered, stamps, -np.inf)]))[:-1]
            seen = data[:1] if self._last_seen is None else self._last_seen[None]
            twice = repeats(step, np.concatenate([seen, data])) & (step == 0)
            ordered &= (stamps >= latest) & ~twice
            at = first_run(stamps < latest, RESTART_ROWS)
            end = len(time) if at is None else at
            name = self._source.clock.name if self._source.clock else ""
            if at is not None:
                restart = at, f"Row {rows[at]} of {self._source.name}: {name} is {time[at]:.10g} after {raw[at]:.10g}"
            for i in np.flatnonzero(~ordered[:end])[:DESCRIBED]:
                way = "repeats" if step[i] == 0 else "runs backwards" if step[i] < 0 else "leaps"
                also = ", and so do its values" if twice[i] else ""
                reasons.append((int(rows[i]), f"time {way}: {name} is {time[i]:.10g} after {raw[i]:.10g}{also}"))
            self.counts.duplicated += int(twice[:end].sum())
            self.counts.backwards += int((~ordered[:end] & ~twice[:end]).sum())
            self.counts.repeated += int((ordered & (step == 0))[:end].sum())
        kept = np.flatnonzero(ordered[: None if restart is None else restart[0]])
        if len(kept):
            i = int(kept[-1])
            self._last_time, self._stamp, self._last_seen = float(time[i]), float(stamps[i]), data[i]
        return ordered, stamps, restart

    def _over_wraps(self, raw: Array, step: Array) -> Array:
        """Steps across the places where clocks start again from 0: a GPS week, a day, a counter's end."""
        clock = self._source.clock
        if clock is None or clock.wrap is not None:
            return step
        unit = 1.0 if clock.unit is None else clock.unit
        around = AROUND_WRAP / unit
        places = [(whole / unit, around, words) for whole, words in (COUNTER_WRAPS if clock.unit is None else WRAPS)]
        if clock.unit is not None and clock.known and (raw == np.rint(raw)).all():
            short = AROUND_TICKS * self.interval
            places += [(2.0**bits, short, f"a counter of {bits} bits overflows") for bits in TICK_BITS
                       if 2.0**bits >= LEAST_TICKS * self.interval]  # fmt: skip
        for wrap, near, words in places:
            at = (step < 0) & (raw[:-1] > wrap - near) & (raw[:-1] < wrap + 2 * self.interval) & (raw[1:] < near)
            at &= (raw[1:] >= 0) & (step + wrap > 0)
            if at.any():
                step = np.where(at, step + wrap, step)
                self.counts.wraps += (words,) * int(at.sum())
        return step
