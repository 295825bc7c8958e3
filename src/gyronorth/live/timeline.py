"""Rows in order of time: repeats and misplaced stamps are left out, a jump of the clock begins a new stretch.

A row whose stamp does not follow the one before is held until the next rows tell what it was: a
gap, a stray stamp, a late packet, or a clock that was set.
"""

from __future__ import annotations

import numpy as np

from gyronorth.live.rows import LiveRows
from gyronorth.readers.grid import LONGEST_GAP

#: Rows from which the usual step is taken where no rate is declared.
FEWEST = 5
#: A clock has jumped when so many rows, over so many seconds, follow each other on the far side.
JUMP_ROWS, JUMP_TIME = 3, 0.5
#: A step longer than this many usual ones is a gap.
GAP = 1.5


class Timeline:
    """Takes the rows of one clock and returns them in stretches of rising time."""

    def __init__(self, rate_hz: float | None) -> None:
        self.strays = 0  # rows left out: repeated, late, or with a stamp that fits nowhere
        self.jumps = 0
        self._interval = None if rate_hz is None else 1 / rate_hz
        self._last: float | None = None
        self._held: LiveRows | None = None

    def push(self, rows: LiveRows) -> list[LiveRows]:
        """Rows that go on where the last ones ended, then one entry for each stretch behind a jump."""
        if self._held is not None:
            rows, self._held = self._held + rows, None
        if len(rows) == 0:
            return [rows]
        time = rows.values[:, 0]
        step = np.diff(time)
        if self._interval is None:
            rising = step[step > 0]
            if len(rising) < FEWEST:
                self._held = rows
                return [rows.take([])]
            self._interval = float(np.median(rising))
        first = self._interval if self._last is None else time[0] - self._last
        step = np.concatenate([[first], step])
        if (step > 0).all() and (step <= LONGEST_GAP).all():
            if step[-1] > GAP * self._interval:
                self._held, rows = rows.take([len(rows) - 1]), rows.take(range(len(rows) - 1))
            if len(rows):
                self._last = float(rows.values[-1, 0])
            return [rows]
        stretches, held = self._sorted(time.tolist())
        if held:
            self._held = rows.take(held)
        return [rows.take(places) for places in stretches]

    def end(self) -> LiveRows | None:
        """The rows still held, if they lie ahead of the others."""
        rows, self._held = self._held, None
        if rows is None:
            return None
        time = rows.values[:, 0]
        steps = np.diff(time, prepend=time[0] - 1 if self._last is None else self._last)
        if (steps > 0).all() and (steps <= LONGEST_GAP).all():
            self._last = float(time[-1])
            return rows
        self.strays += len(rows)
        return None

    def _sorted(self, time: list[float]) -> tuple[list[list[int]], list[int]]:
        """Places of the rows of each stretch, and of those that only the next rows can explain."""
        usual = GAP * (self._interval or 0.0)
        stretches: list[list[int]] = [[]]
        held: list[int] = []
        for place, now in enumerate(time):
            ahead = usual if self._last is None else now - self._last
            if held:
                first, before = time[held[0]], time[held[-1]]
                goes_on = 0 < ahead <= LONGEST_GAP and (now < first or first <= (self._last or 0.0))
                if not goes_on and 0 < now - before <= LONGEST_GAP:
                    held.append(place)
                    gap = self._last is None or 0 < first - self._last <= LONGEST_GAP
                    if gap or (len(held) >= JUMP_ROWS and now - first >= JUMP_TIME):
                        if gap:
                            stretches[-1] += held
                        else:
                            stretches.append(held)
                            self.jumps += 1
                        self._last, held = now, []
                    continue
                self.strays += len(held)
                held = []
            if 0 < ahead <= usual:
                stretches[-1].append(place)
                self._last = now
            else:
                held = [place]
        return stretches, held
