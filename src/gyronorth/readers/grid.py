"""From the rows of a file to samples in SI on a uniform time grid, every row checked.

Longer than 400 lines: rows, their order in time and their places on the grid are one pass with one state.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.errors import InputError
from gyronorth.readers.asking import OpenQuestion, ask
from gyronorth.readers.clock import Envelope, measure, width_of
from gyronorth.readers.declared import Declared
from gyronorth.readers.evidence import COUNTS_PER_G, NEAR_GRAVITY, is_whole, norm_of_parts
from gyronorth.readers.no_clock import NO_CLOCK, coarse, timeless, unclear
from gyronorth.readers.options import ACCEL_UNITS, GYRO_UNITS, ReadOptions
from gyronorth.readers.source import DESCRIBED, FLAGS, Block, Clock, Question, Source
from gyronorth.readers.waiting import Rows, first_run, repeats
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
#: Largest difference between the length of the samples and the span of the time column: share, and s.
SPAN_TOLERANCE, SPAN_SLACK = 0.01, 0.5
#: Root mean square of time steps against the interval, in intervals, above which stamps jitter: stamps
#: rounded to ticks of up to an interval show sqrt(1/8) = 0.354 at most.
JITTER = 0.36
#: ... over so many steps at least.
SCATTER_ROWS = 500
#: A stamp is late beyond this, in intervals.
LATE = 0.5
#: Where a clock starts again from 0, s, and its name.
WRAPS = (
    (604800.0, "the GPS week ends"),
    (86400.0, "the day ends"),
    (2.0**32 * 1e-6, "a 32-bit counter of microseconds overflows"),
    (2.0**32 * 1e-3, "a 32-bit counter of milliseconds overflows"),
)
#: Where counters of samples start again from 0.
COUNTER_WRAPS = tuple((2.0**bits, f"a counter of {bits} bits overflows") for bits in (8, 16, 32))
#: Longest time before and after such a place, s; of a counter, samples.
AROUND_WRAP = 10.0
#: So many rows in order behind one that runs backwards are a clock that started again, not rows out of order.
RESTART_ROWS = 20
#: Largest share of rows that repeat a stamp with other values: beyond pairs, the clock is too coarse.
MOST_REPEATED = 0.6
#: A part before a gap or a restart that is shorter than this, s, is no use.
LEAST_PART = 1.0
#: More bad rows than this end the reading at once.
PATIENCE = 1000


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


class GridBuilder:
    """Takes the blocks of a file one after the other and returns uniform samples.

    `rate_hz` is None until the first usable block when it comes from the time column. Rows whose
    stamps are late, or which follow a loss, wait up to `clock.LONGEST_LATE` s for those behind them:
    `flush` returns what waits at the end.
    """

    def __init__(self, source: Source, declared: Declared, options: ReadOptions) -> None:
        self.rate_hz = declared.rate_hz
        self.gaps: list[Gap] = []
        self.rows_dropped = 0
        self.leading = 0  # rows dropped before the first sample
        self.samples = 0  # samples returned so far
        self.missing = 0  # of these, bridged
        self.jitter = 0.0  # largest root mean square of some hundred steps about the interval, in intervals
        self.counts = ClockCounts()
        self.flagged = np.zeros(len(FLAGS), dtype=np.int64)  # rows that the unit itself marks, as `FLAGS`
        self._marks: list[tuple[NDArray[np.int64], NDArray[np.bool_]]] = []  # numbers and flags of rows not placed yet
        self._source, self._declared, self._options = source, declared, options
        self._window: tuple[float, float] = (0, np.inf)  # in samples, once the rate is known
        self._settled = False  # whether rate, interval and window are known
        self._interval = 1.0  # of the time column, in its unit
        self._envelope: Envelope | None = None  # None without a time column
        self.rows = 0  # rows seen, good and bad
        self._position = -1  # of the last sample on the grid
        self._last_row = 0
        self._last_time: float | None = None  # of the last row in order, as it stands in the file
        self._stamp = 0.0  # the same, without wraps
        self._last_seen: NDArray[np.float64] | None = None  # values of the last row in order
        self._last_values: NDArray[np.float64] | None = None  # of the last row on the grid
        self._last_stamp = 0.0  # of the last row on the grid
        self._waiting = Rows.none(len(declared.scale(1.0)))
        self._scatter = (0, 0.0)  # steps since `jitter` was taken, sum of their squares about the interval
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
        bad, reasons, restart = [block.bad.rows], list(block.bad.reasons), None
        with np.errstate(over="ignore", invalid="ignore"):
            data = self._scaled(block.values)
            usable = self._usable(data, block, reasons)
            if usable is not None:
                bad.append(block.rows[~usable])
                data, rows, values = data[usable], block.rows[usable], block.values[usable]
            else:
                rows, values = block.rows, block.values
            stamps = np.zeros(len(rows))
            if self._source.clock is not None and len(rows):
                ordered, stamps, restart = self._in_order(values[:, 0], data, rows, reasons)
                end = len(rows) if restart is None else restart[0]
                bad.append(rows[:end][~ordered[:end]])
                data, rows, stamps = data[:end][ordered[:end]], rows[:end][ordered[:end]], stamps[:end][ordered[:end]]
        if block.flags is not None and block.flags.any():
            self._marks.append((block.rows, block.flags))
        self._waiting = self._waiting.followed_by(Rows(data, rows, stamps, np.concatenate(bad), tuple(reasons)))
        samples = self._placed(stamps, last=restart is not None)
        if restart is not None and not self.done:
            self.raise_bad()
            raise self._restarted(restart[1])
        if self.rows_dropped > PATIENCE and self.rows_dropped > self.rows / 2:
            self.finish()
        return samples

    def flush(self) -> NDArray[np.float64]:
        """The samples of rows that waited for the stamps behind them; to be called behind the last block."""
        samples = self._placed(np.zeros(0), last=True)
        self._end_scatter()
        return samples

    def _placed(self, stamps: NDArray[np.float64], *, last: bool) -> NDArray[np.float64]:
        """Samples of the waiting rows, of which `stamps` are the new ones, as far as their places are settled."""
        rows = self._waiting
        if self._envelope is None:
            before = self._last_row if self._position >= 0 else rows.numbers[:1] - 1
            steps = np.asarray(np.diff(rows.numbers, prepend=before), dtype=np.float64)
        else:
            settled = self._envelope.take(stamps, last=last)
            steps = np.asarray(1.0 + settled.lost, dtype=np.float64)
            self._count(settled.late)
        now, self._waiting = rows.split(len(steps), last=last or len(steps) == len(rows.numbers))
        self._check_gaps(steps, now.numbers)
        positions = self._position + np.cumsum(steps.astype(np.int64))
        self._note_bad(now.bad, list(now.reasons), now.numbers, positions)
        if len(now.numbers) == 0:
            return now.data
        self._count_flags(now.numbers, positions)
        self._note_jitter(now.stamps, steps)
        samples = self._bridged(now.data, positions, steps)
        self._position, self._last_row = int(positions[-1]), int(now.numbers[-1])
        self._last_values, self._last_stamp = now.data[-1], float(now.stamps[-1])
        self.samples += len(samples)
        self._check_span()
        return samples

    def _count_flags(self, numbers: NDArray[np.int64], positions: NDArray[np.int64]) -> None:
        """Rows inside the window that the unit marks."""
        if not self._marks:
            return
        inside = numbers[(positions >= self._window[0]) & (positions < self._window[1])]
        for rows, flags in self._marks:
            self.flagged += flags[np.isin(rows, inside)].sum(axis=0)
        self._marks = [mark for mark in self._marks if mark[0][-1] > numbers[-1]]

    def raise_bad(self) -> None:
        """Complain of bad rows, unless they may be dropped."""
        if self._options.drop_bad_rows or not self.rows_dropped:
            return
        first, *others = sorted(self._described)
        more = ""
        if others:
            more = f" Bad rows in all: {self.rows_dropped}; " + "; ".join(f"row {row}: {why}" for row, why in others)
            more += "; ..." if self.rows_dropped > len(self._described) else "."
        says = (
            f"Row {first[0]} of {self._source.name}: {first[1]}.{more} Repair the file, or pass --drop-bad-rows to "
            "leave such rows out (they will be counted in the result)."
        )
        if self.rows_dropped > MOST_MISSING * self.rows:
            raise InputError(says)
        raise self._cured(says, "--drop-bad-rows")

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
            time, data = block.values[:, 0], block.values[:, 1:]
            finite = np.isfinite(time)
            time, data = time[finite], data[finite]
            step = self._differences(time)
            twice = np.zeros(len(step), dtype=bool) if (step != 0).all() else repeats(step, data)
            interval = measure(step[~twice], unit=clock.unit)
            if interval is None and (self.rate_hz is None or len(time) > 1):
                raise self._cured(*timeless(time, self._differences(time), clock, self._source.name))
            if interval is not None and np.isnan(interval):
                raise self._cured(*unclear(time, clock, self._source.name))
            if interval is None:
                self._interval = 1 / ((self.rate_hz or 1.0) * (clock.unit or 1.0))
            else:
                self._interval = interval
                self._check_whole(time, clock)
                self._check_coarse(step[~twice], clock)
            if interval is not None and clock.unit is not None:
                self._agree(float(f"{1 / (interval * clock.unit):.7g}"), clock.name)
            seconds = self._interval * (clock.unit or 1.0)
            self._envelope = Envelope(self._interval, 1 if clock.unit is None else width_of(seconds))
        self._settled = True
        if self._options.window and self.rate_hz:
            self._window = tuple(round(limit * self.rate_hz) for limit in self._options.window)  # type: ignore[assignment]

    def _check_whole(self, time: NDArray[np.float64], clock: Clock) -> None:
        """Whole numbers that nobody called seconds are a row counter or milliseconds."""
        if clock.unit != 1.0 or clock.known or self.rate_hz is not None or len(time) < 3:
            return
        if self._interval >= 0.5 and (time == np.rint(time)).all():
            raise self._cured(
                f"{clock.name} of {self._source.name} counts in whole numbers, by {self._interval:.4g} a row "
                f"({time[0]:.10g}, {time[1]:.10g}, {time[2]:.10g}, ...): seconds are not likely. If it counts rows, "
                "leave it out and declare the rate: --columns t=- --rate HZ. If it counts milliseconds, the rate is "
                f"{1e3 / self._interval:.6g} Hz: --columns t=- --rate {1e3 / self._interval:.6g}. If these really are "
                f"seconds: --rate {1 / self._interval:.6g}.",
                *NO_CLOCK,
            )

    def _check_coarse(self, step: NDArray[np.float64], clock: Clock) -> None:
        if clock.unit is not None and len(step) >= RESTART_ROWS and np.mean(step == 0) > MOST_REPEATED:
            raise self._cured(*coarse(step, clock, self._source.name))

    def _cured(self, says: str, *options: str) -> OpenQuestion:
        """A message with the options that cure what it tells, which are likely and not certain."""
        return ask(self._source.name, self._options, [Question(says, options, certain=False)])

    def _agree(self, timed: float, title: str) -> None:
        """Rate of the time column, Hz: against the declared one, or in its place."""
        name = self._source.name
        if self.rate_hz is None:
            if not TIMED_RATES[0] <= timed <= TIMED_RATES[1]:
                raise self._cured(
                    f"{title} of {name} steps by {1 / timed:.4g}, a rate of {timed:.4g} Hz if it is in seconds; "
                    f"{TIMED_RATES[0]:g} to {TIMED_RATES[1]:g} Hz are expected. If it is in another unit, leave it out "
                    "and declare the rate: --columns t=- --rate HZ.",
                    *NO_CLOCK,
                )
            self.rate_hz = timed
        elif abs(timed / self.rate_hz - 1) > RATE_TIMED_TOLERANCE:
            raise self._cured(
                f"{title} of {name} gives a rate of {timed:.6g} Hz, but {self.rate_hz:.6g} Hz is declared. Correct the "
                "rate, or leave that column out: --columns t=-.",
                *NO_CLOCK[:2],
            )

    def _differences(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        step = np.diff(time)
        wrap = self._source.clock.wrap if self._source.clock else None
        return step if wrap is None else (step + wrap / 2) % wrap - wrap / 2

    def _scaled(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        data = values if self._source.clock is None else values[:, 1:]
        scale = self._declared.scale(self.rate_hz or 1.0)
        return data if (scale == 1).all() else data * scale

    def _usable(
        self, data: NDArray[np.float64], block: Block, reasons: list[tuple[int, str]]
    ) -> NDArray[np.bool_] | None:
        """Which rows are finite, plausible and not zero; None for all."""
        limit = np.array([LARGEST_RATE] * 3 + [LARGEST_FORCE] * (data.shape[1] - 3))
        fits = np.abs(data) <= limit  # False for nan
        usable = np.ones(len(data), dtype=bool) if fits.all() else np.asarray(fits.all(axis=1))
        if data.shape[1] == 6:
            usable &= (data[:, 3] != 0) | (data[:, 4] != 0) | (data[:, 5] != 0)
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
            lead = f"Row {row} of {self._source.name}: {why}. {len(wrong)} of {len(data)} rows are like it"
            values = block.values[:, block.values.shape[1] - data.shape[1] :]
            if is_whole(values) and np.abs(values).max() > 1:
                raise self._cured(
                    f"{lead}, and all are whole numbers, as counts are: the data sheet says how much one is. Declare "
                    "it: --gyro-scale and --accel-scale, each in the unit of the file.",
                    *("--gyro-scale", f"{self._declared.gyro_unit.upper().replace('/', '_PER_')}_IN_ONE_COUNT"),
                    *self._scale_by_gravity(values[:, 3:]),
                )
            raise InputError(
                f"{lead}: are columns and units declared right? (A sensor that is absent can be left out: --columns "
                "f_x=-,f_y=-,f_z=-.)"
            )
        reasons += described
        return usable

    def _scale_by_gravity(self, counts: NDArray[np.float64]) -> tuple[str, ...]:
        """The scale of an accelerometer's counts, (n, 3), that makes gravity of them; none without an accelerometer."""
        size = norm_of_parts(counts) if counts.shape[1] else 0.0
        if size == 0:
            return ()
        size = next((each for each in COUNTS_PER_G if abs(size / each - 1) < NEAR_GRAVITY / 2), size)
        return "--accel-scale", f"{STANDARD_GRAVITY / ACCEL_UNITS[self._declared.accel_unit] / size:.6g}"

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

    def _in_order(
        self,
        time: NDArray[np.float64],
        data: NDArray[np.float64],
        rows: NDArray[np.int64],
        reasons: list[tuple[int, str]],
    ) -> tuple[NDArray[np.bool_], NDArray[np.float64], tuple[int, str] | None]:
        """Which rows are in order of time, their stamps without wraps, and where and how the clock started again."""
        interval = self._interval
        start = time[:1] - interval if self._last_time is None else np.array([self._last_time])
        raw = np.concatenate([start, time])
        step = self._differences(raw)
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

    def _over_wraps(self, raw: NDArray[np.float64], step: NDArray[np.float64]) -> NDArray[np.float64]:
        """Steps across the places where clocks start again from 0: a GPS week, a day, a counter's end."""
        clock = self._source.clock
        if clock is None or clock.wrap is not None:
            return step
        unit = 1.0 if clock.unit is None else clock.unit
        around = AROUND_WRAP / unit
        for whole, words in COUNTER_WRAPS if clock.unit is None else WRAPS:
            wrap = whole / unit
            at = (step < 0) & (raw[:-1] > wrap - around) & (raw[:-1] < wrap + 2 * self._interval) & (raw[1:] < around)
            at &= (raw[1:] >= 0) & (step + wrap > 0)
            if at.any():
                step = np.where(at, step + wrap, step)
                self.counts.wraps += (words,) * int(at.sum())
        return step

    def _restarted(self, where: str) -> OpenQuestion:
        """What to do about a clock that started again; `where` says at which row, and from what to what."""
        rate_hz, lasts = self.rate_hz or 1.0, (self._position + 1) / (self.rate_hz or 1.0)
        window = f"0:{np.floor(100 * lasts) / 100:g}"
        before = f"Take the part before it: --window {window}; or, if" if lasts > LEAST_PART else "If"
        rate = f"{rate_hz:.7g}"
        return self._cured(
            f"{where}, and the rows behind it go on from there: the clock was set back or started again, and how much "
            f"time passed is not known. {before} no sample was lost there, leave the time column out: --columns t=- "
            f"--rate {rate}.",
            *(("--window", window) if lasts > LEAST_PART else (*NO_CLOCK[:-1], rate)),
        )

    def _count(self, late: NDArray[np.float64]) -> None:
        """Late stamps; `late` in sample intervals."""
        if len(late):
            self.counts.late += int(np.count_nonzero(late > LATE))
            self.counts.latest = max(self.counts.latest, float(late.max()) / (self.rate_hz or 1.0))
        if self._envelope is not None:
            self.counts.given_back = self._envelope.lost - max(self._envelope.level, 0)

    def _note_jitter(self, stamps: NDArray[np.float64], steps: NDArray[np.float64]) -> None:
        if self._envelope is None:
            return
        before = self._last_stamp if self._last_values is not None else stamps[0] - self._interval
        usual = np.diff(stamps, prepend=before)[steps == 1] / self._interval
        self._scatter = self._scatter[0] + len(usual), self._scatter[1] + float(np.sum((usual - 1) ** 2))
        if self._scatter[0] >= SCATTER_ROWS:
            self._end_scatter()

    def _end_scatter(self) -> None:
        """The root mean square of the steps since the last time."""
        rows, squares = self._scatter
        if rows >= SCATTER_ROWS or (rows and self.jitter == 0):
            self.jitter = max(self.jitter, float(np.sqrt(squares / rows)))
        self._scatter = (0, 0.0)

    def _check_span(self) -> None:
        """Samples over rate against the span of the time column."""
        envelope, rate_hz = self._envelope, self.rate_hz
        if envelope is None or rate_hz is None or self._source.clock is None or self._source.clock.unit is None:
            return
        samples = self._position + 1
        over = envelope.lost - envelope.level - envelope.drift
        if abs(over) > SPAN_TOLERANCE * samples + SPAN_SLACK * rate_hz + RESTART_ROWS:
            raise InputError(
                f"Up to row {self._last_row} of {self._source.name}, {samples} samples at {rate_hz:.6g} Hz last "
                f"{samples / rate_hz:.6g} s, but {self._source.clock.name} spans {(samples - over) / rate_hz:.6g} s: "
                "the rate changes within the file, or its clock does. Take a part at one rate: --window START:END, or "
                "split the file."
            )

    def _check_gaps(self, steps: NDArray[np.float64], rows: NDArray[np.int64]) -> None:
        """No gap inside the window is longer than what a straight line may bridge."""
        rate_hz = self.rate_hz or 1.0
        limit = max(2.0, LONGEST_GAP * rate_hz + 1)
        for i in np.flatnonzero(steps > limit):
            before = self._position + float(steps[:i].sum())
            if steps[i] > 1e12 or (before + 1 < self._window[1] and before + steps[i] > self._window[0]):
                says = (
                    f"Row {rows[i]} of {self._source.name}: {steps[i] / rate_hz:.6g} s lie between this row and the "
                    f"one before, which ends {(before + 1) / rate_hz:.6g} s of data; gaps of up to {LONGEST_GAP:g} s "
                    "are bridged. Take a part without the gap: --window START:END, or split the file."
                )
                start, end = self._window[0] / rate_hz, np.floor(100 * (before + 1) / rate_hz) / 100
                if end - start < LEAST_PART:
                    raise InputError(says)
                raise self._cured(says, "--window", f"{start:g}:{end:g}")

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
