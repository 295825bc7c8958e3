"""From the rows of a file to samples in SI on a uniform time grid, every row checked."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.readers.clock import Ticks, measure
from gyronorth.readers.declared import Declared
from gyronorth.readers.options import ACCEL_UNITS, GYRO_UNITS, ReadOptions
from gyronorth.readers.source import DESCRIBED, FLAGS, Block, Source
from gyronorth.recording import Gap

#: Largest plausible angular rate, rad/s (2005 deg/s, the range of the fastest gyros), and specific force, m/s^2.
LARGEST_RATE = 35.0
LARGEST_FORCE = 400.0
#: Longest gap that is bridged, s, and largest share of samples that may be missing or dropped.
LONGEST_GAP = 10.0
MOST_MISSING = 0.1
#: A rate that comes from a time column is expected within these bounds, Hz.
TIMED_RATES = (0.5, 20000.0)
#: Largest relative difference between a declared rate and that of the time column.
RATE_TIMED_TOLERANCE = 0.01
#: Root mean square of time steps against the interval, in intervals, above which stamps jitter: stamps
#: rounded to ticks of up to an interval show sqrt(1/8) = 0.354 at most.
JITTER = 0.36
#: More bad rows than this end the reading at once.
PATIENCE = 1000


class GridBuilder:
    """Takes the blocks of a file one after the other and returns uniform samples.

    `rate_hz` is None until the first usable block when it comes from the time column.
    """

    def __init__(self, source: Source, declared: Declared, options: ReadOptions) -> None:
        self.rate_hz = declared.rate_hz
        self.gaps: list[Gap] = []
        self.rows_dropped = 0
        self.leading = 0  # rows dropped before the first sample
        self.samples = 0  # samples returned so far
        self.missing = 0  # of these, bridged
        self.jitter = 0.0  # largest root mean square of a block, in sample intervals
        self.flagged = np.zeros(len(FLAGS), dtype=np.int64)  # rows that the unit itself marks, as `FLAGS`
        self._source, self._declared, self._options = source, declared, options
        self._window: tuple[float, float] = (0, np.inf)  # in samples, once the rate is known
        self._settled = False  # whether rate, ticks and window are known
        self._ticks: Ticks | None = None  # of the time column
        self.rows = 0  # rows seen, good and bad
        self._position = -1  # of the last sample on the grid
        self._last_row = 0
        self._last_time = 0.0
        self._last_values: NDArray[np.float64] | None = None
        self._described: list[tuple[int, str]] = []

    @property
    def done(self) -> bool:
        """Whether the window lies behind, so that the rest of the file is not needed."""
        return self._position + 1 >= self._window[1]

    def push(self, block: Block) -> NDArray[np.float64]:
        """Uniform samples, shape (m, 3) or (m, 6), SI in file axes, that `block` adds."""
        self.rows += len(block.rows) + len(block.bad.rows)
        if not self._settled and len(block.values):
            self._settle(block)
        bad, reasons = [block.bad.rows], list(block.bad.reasons)
        with np.errstate(over="ignore", invalid="ignore"):
            data = self._scaled(block.values)
            usable = self._usable(data, block, reasons)
            if usable is not None:
                bad.append(block.rows[~usable])
                data, rows, values = data[usable], block.rows[usable], block.values[usable]
            else:
                rows, values = block.rows, block.values
            if self._source.clock is None:
                steps = np.diff(rows, prepend=self._last_row if self._position >= 0 else rows[:1] - 1)
            else:
                ordered, steps = self._steps(values[:, 0], rows, reasons)
                bad.append(rows[~ordered])
                data, rows = data[ordered], rows[ordered]
        self._check_gaps(steps, rows)
        positions = self._position + np.cumsum(steps.astype(np.int64))
        self._note_bad(np.concatenate(bad), reasons, rows, positions)
        if len(rows) == 0:
            return data
        if block.flags is not None:
            inside = rows[(positions >= self._window[0]) & (positions < self._window[1])]
            self.flagged += block.flags[np.isin(block.rows, inside)].sum(axis=0)
        samples = self._bridged(data, positions, steps)
        self._position, self._last_row, self._last_values = int(positions[-1]), int(rows[-1]), data[-1]
        self.samples += len(samples)
        if self.rows_dropped > PATIENCE and self.rows_dropped > self.rows / 2:
            self.finish()
        return samples

    def raise_bad(self) -> None:
        """Complain of bad rows, unless they may be dropped."""
        if self._options.drop_bad_rows or not self.rows_dropped:
            return
        first, *others = sorted(self._described)
        more = ""
        if others:
            more = f" Bad rows in all: {self.rows_dropped}; " + "; ".join(f"row {row}: {why}" for row, why in others)
            more += "; ..." if self.rows_dropped > len(self._described) else "."
        raise InputError(
            f"Row {first[0]} of {self._source.name}: {first[1]}.{more} Repair the file, or pass --drop-bad-rows to "
            "leave such rows out (they will be counted in the result)."
        )

    def finish(self) -> None:
        """The checks that need the whole file."""
        name = self._source.name
        self.raise_bad()
        if self.rows_dropped > MOST_MISSING * self.rows:
            row, why = min(self._described)
            raise InputError(
                f"{self.rows_dropped} of {self.rows} rows of {name} are bad, beginning with row {row}: {why}. More "
                f"than {MOST_MISSING:.0%} cannot be dropped: the file is damaged, or not what was declared."
            )
        if self.samples == 0:
            if self._options.window and self._position >= 0:
                duration = (self._position + 1) / (self.rate_hz or 1)
                raise InputError(
                    f"Window {self._options.window[0]:g}:{self._options.window[1]:g} s lies behind the end of {name}, "
                    f"which lasts {duration:g} s."
                )
            raise InputError(f"{name} holds no rows of data.")
        if self._position == 0:
            raise InputError(f"{name} holds a single row of data; a recording needs seconds of them.")
        if self._options.window and self._position + 1.5 < self._window[1]:
            raise InputError(
                f"Window {self._options.window[0]:g}:{self._options.window[1]:g} s does not fit {name}, which lasts "
                f"{(self._position + 1) / (self.rate_hz or 1):g} s."
            )
        self._check_missing()

    def forget_gaps(self, *, before: float) -> None:
        """Drop the gaps that end at or before a time, s from the first sample returned."""
        rate_hz = self.rate_hz or 1.0
        self.gaps = [gap for gap in self.gaps if gap.start + gap.samples / rate_hz > before + 0.5 / rate_hz]

    def _settle(self, block: Block) -> None:
        """Sample interval and rate from the first usable block."""
        clock = self._source.clock
        if clock is not None:
            time = block.values[:, 0]
            self._ticks = measure(self._differences(time[np.isfinite(time)]))
            if self._ticks is None and self.rate_hz is None:
                raise InputError(self._timeless(time[np.isfinite(time)], clock.name))
            if self._ticks is not None and clock.unit is not None:
                self._agree(float(f"{1 / (self._ticks.interval * clock.unit):.7g}"), clock.name)
        self._settled = True
        if self._options.window and self.rate_hz:
            self._window = tuple(round(limit * self.rate_hz) for limit in self._options.window)  # type: ignore[assignment]

    def _timeless(self, time: NDArray[np.float64], title: str) -> str:
        """Why no rate can be had from these times, of which none is later than the one before."""
        name = self._source.name
        if len(time) < 2:
            return f"{name} has a single time, so its rate is unknown. Declare it: --rate HZ."
        cure = "leave that column out and declare the rate: --columns t=- --rate HZ."
        if (self._differences(time) == 0).all():
            return f"{title} of {name} is {time[0]:.10g} in every row: no clock, or one too coarse. Then {cure}"
        return (
            f"{title} of {name} runs backwards, from {time[0]:.10g} to {time[-1]:.10g}: rows in reverse order, or "
            f"another column taken for time, are likely. Put them in order; or {cure}"
        )

    def _agree(self, timed: float, title: str) -> None:
        """Rate of the time column, Hz: against the declared one, or in its place."""
        name = self._source.name
        if self.rate_hz is None:
            if not TIMED_RATES[0] <= timed <= TIMED_RATES[1]:
                raise InputError(
                    f"{title} of {name} steps by {1 / timed:.4g}, a rate of {timed:.4g} Hz if it is in seconds; "
                    f"{TIMED_RATES[0]:g} to {TIMED_RATES[1]:g} Hz are expected. If it is in another unit, leave it out "
                    "and declare the rate: --columns t=- --rate HZ."
                )
            self.rate_hz = timed
        elif abs(timed / self.rate_hz - 1) > RATE_TIMED_TOLERANCE:
            raise InputError(
                f"{title} of {name} gives a rate of {timed:.6g} Hz, but {self.rate_hz:.6g} Hz is declared. Correct the "
                "rate, or leave that column out: --columns t=-."
            )

    def _differences(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        step = np.diff(time)
        wrap = self._source.clock.wrap if self._source.clock else None
        return step if wrap is None else (step + wrap / 2) % wrap - wrap / 2

    def _scaled(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        data = values if self._source.clock is None else values[:, 1:]
        scale = self._declared.scale * (self.rate_hz or 1.0 if self._declared.increments else 1.0)
        return data if (scale == 1).all() else data * scale

    def _usable(
        self, data: NDArray[np.float64], block: Block, reasons: list[tuple[int, str]]
    ) -> NDArray[np.bool_] | None:
        """Which rows are finite, plausible and not zero; None for all."""
        limit = np.array([LARGEST_RATE] * 3 + [LARGEST_FORCE] * (data.shape[1] - 3))
        fits = np.abs(data) <= limit  # False for nan
        usable: NDArray[np.bool_] = np.asarray(fits.all(axis=1))
        if data.shape[1] == 6:
            usable &= (data[:, 3:] != 0).any(axis=1)
        if self._source.clock is not None:
            usable &= np.isfinite(block.values[:, 0])
        if usable.all():
            return None
        wrong = np.flatnonzero(~usable)
        # In a window the first ones may lie before it.
        shown = wrong if self._options.window and self._position < self._window[1] else wrong[:DESCRIBED]
        described = [(int(block.rows[i]), self._why(block.values[i], data[i])) for i in shown]
        if len(wrong) > len(data) / 2:
            row, why = described[0]
            raise InputError(
                f"Row {row} of {self._source.name}: {why}. {len(wrong)} of {len(data)} rows are like it: are columns "
                "and units declared right? (A sensor that is absent can be left out: --columns f_x=-,f_y=-,f_z=-.)"
            )
        reasons += described
        return usable

    def _why(self, raw: NDArray[np.float64], data: NDArray[np.float64]) -> str:
        """What is wrong with one row, in the units of the file."""
        for position, column in enumerate(self._source.columns):
            if not np.isfinite(raw[position]):
                return f"{column} is {raw[position]}; a finite number is expected"
        names = self._source.columns[len(raw) - len(data) :]
        for position, column in enumerate(names):
            gyro = position < 3
            unit = self._declared.gyro_unit if gyro else self._declared.accel_unit
            limit = LARGEST_RATE if gyro else LARGEST_FORCE
            if abs(data[position]) > limit:
                scale = (GYRO_UNITS if gyro else ACCEL_UNITS)[unit]
                return (
                    f"{column} is {data[position] / scale:.4g} {unit}; the largest plausible "
                    f"{'rate' if gyro else 'specific force'} is {limit / scale:.4g} {unit}"
                )
        return "f_x, f_y and f_z are all exactly 0, which no body at rest can feel"

    def _steps(
        self, time: NDArray[np.float64], rows: NDArray[np.int64], reasons: list[tuple[int, str]]
    ) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        """Which rows are in order of time, and the steps on the grid between these."""
        ticks = self._ticks or Ticks(1.0, longest=np.inf, expected=1.0)
        first, interval = self._position < 0, ticks.interval
        start = time[:1] - interval if first else np.array([self._last_time])
        step = self._differences(np.concatenate([start, time]))
        ordered = np.ones(len(time), dtype=bool)
        if not (step > 0).all():
            unwrapped = start + np.cumsum(step)
            before = np.concatenate([start, unwrapped[:-1]])
            # A stamp that leaps ahead, and from which the next one falls back, is wrong itself.
            falls_back = (unwrapped[:-1] >= unwrapped[1:]) & (before[:-1] < unwrapped[1:])
            ordered[:-1] &= ~(falls_back & (step[:-1] > 1.5 * interval))
            latest = np.maximum.accumulate(np.concatenate([start, np.where(ordered, unwrapped, -np.inf)]))[:-1]
            ordered &= unwrapped > latest
            disordered = np.flatnonzero(~ordered)
            for i in disordered if self._options.window else disordered[:DESCRIBED]:
                way = "repeats" if step[i] == 0 else "runs backwards" if step[i] < 0 else "leaps"
                title = self._source.clock.name if self._source.clock else ""
                reasons.append((int(rows[i]), f"time {way}: {title} is {time[i]:.10g} after {time[i] - step[i]:.10g}"))
            kept = unwrapped[ordered]
            step = np.diff(np.concatenate([start, kept]))
            time = time[ordered]
        if len(step) == 0:
            return ordered, step
        self._last_time = float(time[-1])
        missing = ticks.missing(step)
        usual = step[missing == 0] / ticks.interval
        self.jitter = max(self.jitter, float(np.sqrt(np.mean((usual - 1) ** 2))) if len(usual) else 0.0)
        return ordered, 1 + missing

    def _check_gaps(self, steps: NDArray[np.float64], rows: NDArray[np.int64]) -> None:
        """No gap inside the window is longer than what a straight line may bridge."""
        rate_hz = self.rate_hz or 1.0
        limit = max(2.0, LONGEST_GAP * rate_hz + 1)
        for i in np.flatnonzero(steps > limit):
            before = self._position + float(steps[:i].sum())
            if steps[i] > 1e12 or (before + 1 < self._window[1] and before + steps[i] > self._window[0]):
                raise InputError(
                    f"Row {rows[i]} of {self._source.name}: {steps[i] / rate_hz:.6g} s lie between this row and the "
                    f"one before, which ends {(before + 1) / rate_hz:.6g} s of data; gaps of up to {LONGEST_GAP:g} s "
                    "are bridged. Take a part without the gap: --window START:END, or split the file."
                )

    def _bridged(
        self, data: NDArray[np.float64], positions: NDArray[np.int64], steps: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """The samples inside the window, straight lines across gaps."""
        first, last = self._window
        gap = np.flatnonzero(steps > 1)
        if len(gap) and self._last_values is None:
            gap = gap[gap > 0]
        if len(gap) == 0:
            if positions[0] >= first and positions[-1] < last:
                return data
            return data[(positions >= first) & (positions < last)]
        rate_hz = self.rate_hz or 1.0
        for i in gap:
            low, high = max(positions[i] - int(steps[i]) + 1, first), min(positions[i], last)
            if low < high:
                self.gaps.append(Gap(float(low - first) / rate_hz, int(high - low)))
                self.missing += int(high - low)
        self._check_missing(self.samples + len(data), slack=LONGEST_GAP * rate_hz)
        knots, values = positions, data
        if self._last_values is not None:
            knots = np.concatenate([[self._position], positions])
            values = np.vstack([self._last_values, data])
        grid = np.arange(max(first, self._position + 1), min(last, positions[-1] + 1))
        return np.stack([np.interp(grid, knots, column) for column in values.T], axis=1)

    def _check_missing(self, samples: int | None = None, slack: float = 0.0) -> None:
        total = self.samples if samples is None else samples + self.missing
        if self.missing > MOST_MISSING * total + slack:
            raise InputError(
                f"{self.missing} of {total} samples of {self._source.name} are missing; up to {MOST_MISSING:.0%} are "
                "bridged. Take a better part: --window START:END, or split the file."
            )

    def _note_bad(
        self,
        bad: NDArray[np.int64],
        reasons: list[tuple[int, str]],
        rows: NDArray[np.int64],
        positions: NDArray[np.int64],
    ) -> None:
        """Count the bad rows that fall into the window."""
        if len(bad) == 0:
            return
        # A bad row is taken to stand one sample behind the last good one before it.
        places = np.concatenate([[self._position], positions])[np.searchsorted(rows, bad)] + 1
        inside = (places >= self._window[0]) & (places < self._window[1])
        self.rows_dropped += int(inside.sum())
        if self._last_values is None:
            self.leading += int((places == 0).sum())
        known = dict(sorted(reasons, reverse=True))  # of two reasons of a row the first one
        counted = np.sort(bad[inside])[: DESCRIBED - len(self._described)].tolist()
        self._described += [(row, known.get(row, "it does not hold a usable number in each column")) for row in counted]
        if not self._options.drop_bad_rows and self.rows_dropped > PATIENCE:
            self.raise_bad()
