"""From the rows of a file to samples in SI on a uniform time grid, every row checked."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gyronorth.arrays import Array, Index, Mask
from gyronorth.errors import InputError
from gyronorth.readers.asking import OpenQuestion, ask
from gyronorth.readers.clock import Envelope, measure, width_of
from gyronorth.readers.declared import Declared
from gyronorth.readers.gaps import LONGEST_GAP, LONGEST_KEPT, MOST_MISSING, straight_lines, too_long, too_many
from gyronorth.readers.no_clock import NO_CLOCK, coarse, no_rate, timeless, unclear, whole_numbers
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.order import RESTART_ROWS, ClockCounts, TimeOrder
from gyronorth.readers.source import DESCRIBED, FLAGS, Block, Clock, Question, Source
from gyronorth.readers.usable import mostly_unusable, usable_rows, why_unusable
from gyronorth.readers.waiting import WaitingRows, repeats
from gyronorth.recording import Gap

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
#: Largest share of rows that repeat a stamp with other values: beyond pairs, the clock is too coarse.
MOST_REPEATED = 0.6
#: A part before a gap or a restart that is shorter than this, s, is no use.
LEAST_PART = 1.0
#: More bad rows than this end the reading at once.
PATIENCE = 1000


class GridBuilder:
    """Takes the blocks of a file one after the other and returns uniform samples.

    `rate_hz` is None until the first usable block when it comes from the time column. Rows whose
    stamps are late, or which follow a loss, wait up to `clock.LONGEST_LATE` s for those behind them:
    `flush` returns what waits at the end.
    """

    def __init__(self, source: Source, declared: Declared, options: ReadOptions) -> None:
        self.rate_hz = declared.rate_hz
        self.gaps: list[Gap] = []
        self._longest, self._most = LONGEST_GAP, MOST_MISSING  # s, and share that may be missing
        self.rows_dropped = 0
        self.leading = 0  # rows dropped before the first sample
        self.samples = 0  # samples returned so far
        self.missing = 0  # of these, bridged
        self.jitter = 0.0  # largest root mean square of some hundred steps about the interval, in intervals
        self.flagged = np.zeros(len(FLAGS), dtype=np.int64)  # rows that the unit itself marks, as `FLAGS`
        self._marks: list[tuple[Index, Mask]] = []  # numbers and flags of rows not placed yet
        self._source, self._declared, self._options = source, declared, options
        self._window: tuple[float, float] = (0, np.inf)  # in samples, once the rate is known
        self._settled = False  # whether rate, interval and window are known
        self._order = TimeOrder(source)
        self.counts: ClockCounts = self._order.counts
        self._envelope: Envelope | None = None  # None without a time column
        self.rows = 0  # rows seen, good and bad
        self._position = -1  # of the last sample on the grid
        self._last_row = 0
        self._last_values: Array | None = None  # of the last row on the grid
        self._last_stamp = 0.0  # of the last row on the grid
        self._waiting = WaitingRows.none(len(declared.scale(1.0)))
        self._scatter = (0, 0.0)  # steps since `jitter` was taken, sum of their squares about the interval
        self._described: list[tuple[int, str]] = []

    @property
    def done(self) -> bool:
        """Whether the window lies behind, so that the rest of the file is not needed."""
        return self._position + 1 >= self._window[1]

    def keep_gaps(self) -> None:
        """Bridge gaps of up to a day, any number of them: the caller decides by `gaps` whether they are too many."""
        self._longest, self._most = LONGEST_KEPT, 1.0

    def push(self, block: Block) -> Array:
        """Uniform samples, shape (m, 3) or (m, 6), SI in file axes, that `block` adds."""
        return np.concatenate(list(self.pushed(block)))

    def pushed(self, block: Block) -> Iterator[Array]:
        """The same in pieces."""
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
                ordered, stamps, restart = self._order.take(values[:, 0], data, rows, reasons)
                end = len(rows) if restart is None else restart[0]
                bad.append(rows[:end][~ordered[:end]])
                data, rows, stamps = data[:end][ordered[:end]], rows[:end][ordered[:end]], stamps[:end][ordered[:end]]
        if block.flags is not None and block.flags.any():
            self._marks.append((block.rows, block.flags))
        self._waiting = self._waiting.followed_by(WaitingRows(data, rows, stamps, np.concatenate(bad), tuple(reasons)))
        yield from self._placed(stamps, last=restart is not None)
        if restart is not None and not self.done:
            self.raise_bad()
            raise self._restarted(restart[1])
        if self.rows_dropped > PATIENCE and self.rows_dropped > self.rows / 2:
            self.finish()

    def flush(self) -> Array:
        """The samples of rows that waited for the stamps behind them; to be called behind the last block."""
        return np.concatenate(list(self.flushed()))

    def flushed(self) -> Iterator[Array]:
        """The same in pieces."""
        yield from self._placed(np.zeros(0), last=True)
        self._end_scatter()

    def _placed(self, stamps: Array, *, last: bool) -> Iterator[Array]:
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
            yield now.data
            return
        self._count_flags(now.numbers, positions)
        self._note_jitter(now.stamps, steps)
        for samples in self._bridged(now.data, positions, steps):
            self.samples += len(samples)
            yield samples
        self._position, self._last_row = int(positions[-1]), int(now.numbers[-1])
        self._last_values, self._last_stamp = now.data[-1], float(now.stamps[-1])
        self._check_span()

    def _count_flags(self, numbers: Index, positions: Index) -> None:
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
                    f"Window {self._options.window[0]:g}:{self._options.window[1]:g} s is beyond the end of {name}, "
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
            finite = np.isfinite(block.values[:, 0])
            time, data = block.values[finite, 0], block.values[finite, 1:]
            step = self._order.differences(time)
            twice = np.zeros(len(step), dtype=bool) if (step != 0).all() else repeats(step, data)
            interval = clock.step or measure(step[~twice], unit=clock.unit)
            if interval is None and (self.rate_hz is None or len(time) > 1):
                raise self._cured(*timeless(time, self._order.differences(time), clock, self._source.name))
            unknown = interval is not None and np.isnan(interval)
            if unknown and (self.rate_hz is None or clock.unit is None):
                raise self._cured(*unclear(time, clock, self._source.name))
            if interval is None or unknown:
                self._order.interval = 1 / ((self.rate_hz or 1.0) * (clock.unit or 1.0))
            else:
                self._order.interval = interval
                self._check_whole(time, clock)
                self._check_coarse(step[~twice], clock)
            if interval is not None and not unknown and clock.unit is not None:
                self._agree(float(f"{1 / (interval * clock.unit):.7g}"), clock.name)
            seconds = self._order.interval * (clock.unit or 1.0)
            self._envelope = Envelope(self._order.interval, 1 if clock.unit is None else width_of(seconds))
        self._settled = True
        if self._options.window and self.rate_hz:
            self._window = tuple(round(limit * self.rate_hz) for limit in self._options.window)  # type: ignore[assignment]

    def _check_whole(self, time: Array, clock: Clock) -> None:
        """Whole numbers that nobody called seconds are a row counter or milliseconds."""
        if clock.unit != 1.0 or clock.known or self.rate_hz is not None or len(time) < 3:
            return
        if self._order.interval >= 0.5 and (time == np.rint(time)).all():
            raise self._cured(*whole_numbers(time, self._order.interval, clock, self._source.name))

    def _check_coarse(self, step: Array, clock: Clock) -> None:
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
                raise self._cured(*no_rate(timed, TIMED_RATES, title, name))
            self.rate_hz = timed
        elif abs(timed / self.rate_hz - 1) > RATE_TIMED_TOLERANCE:
            raise self._cured(
                f"{title} of {name} gives a rate of {timed:.6g} Hz, but {self.rate_hz:.6g} Hz is declared. Correct the "
                "rate, or leave that column out: --columns t=-.",
                *NO_CLOCK[:2],
            )

    def _scaled(self, values: Array) -> Array:
        data = values if self._source.clock is None else values[:, 1:]
        scale = self._declared.scale(self.rate_hz or 1.0)
        return data if (scale == 1).all() else data * scale

    def _usable(self, data: Array, block: Block, reasons: list[tuple[int, str]]) -> Mask | None:
        """Which rows can be used; None for all."""
        usable = usable_rows(data)
        if self._source.clock is not None:
            usable &= np.isfinite(block.values[:, 0])
        if usable.all():
            return None
        wrong = np.flatnonzero(~usable)
        # In a window the first ones may lie before it.
        shown = wrong if self._options.window and self._position < self._window[1] else wrong[:DESCRIBED]
        numbers = block.rows[shown].tolist()
        whys = why_unusable(block.values[shown], data[shown], self._source, self._declared)
        if len(wrong) > len(data) / 2:
            lead = f"Row {numbers[0]} of {self._source.name}: {whys[0]}. {len(wrong)} of {len(data)} rows are like it"
            values = block.values[:, block.values.shape[1] - data.shape[1] :]
            raise mostly_unusable(values, lead, self._source, self._declared, self._options)
        reasons += zip(numbers, whys, strict=True)
        return usable

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

    def _count(self, late: Array) -> None:
        """Late stamps; `late` in sample intervals."""
        if len(late):
            self.counts.late += int(np.count_nonzero(late > LATE))
            self.counts.latest = max(self.counts.latest, float(late.max()) / (self.rate_hz or 1.0))
        if self._envelope is not None:
            self.counts.given_back = self._envelope.lost - max(self._envelope.level, 0)

    def _note_jitter(self, stamps: Array, steps: Array) -> None:
        if self._envelope is None:
            return
        before = self._last_stamp if self._last_values is not None else stamps[0] - self._order.interval
        usual = np.diff(stamps, prepend=before)[steps == 1] / self._order.interval
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

    def _check_gaps(self, steps: Array, rows: Index) -> None:
        """No gap inside the window is longer than what a straight line may bridge."""
        rate_hz = self.rate_hz or 1.0
        limit = max(2.0, self._longest * rate_hz + 1)
        for i in np.flatnonzero(steps > limit):
            before = self._position + float(steps[:i].sum())
            if steps[i] > 1e12 or (before + 1 < self._window[1] and before + steps[i] > self._window[0]):
                row = f"Row {rows[i]} of {self._source.name}"
                says = too_long(row, steps[i] / rate_hz, (before + 1) / rate_hz, longest=self._longest)
                start, end = self._window[0] / rate_hz, np.floor(100 * (before + 1) / rate_hz) / 100
                if end - start < LEAST_PART:
                    raise InputError(says)
                raise self._cured(says, "--window", f"{start:g}:{end:g}")

    def _bridged(self, data: Array, positions: Index, steps: Array) -> Iterator[Array]:
        """The samples inside the window, straight lines across gaps."""
        first, last = self._window
        gap = np.flatnonzero(steps > 1)
        if len(gap) and self._last_values is None:
            gap = gap[gap > 0]
        if len(gap) == 0:
            whole = positions[0] >= first and positions[-1] < last
            yield data if whole else data[(positions >= first) & (positions < last)]
            return
        rate_hz = self.rate_hz or 1.0
        for i in gap:
            low, high = max(positions[i] - int(steps[i]) + 1, first), min(positions[i], last)
            if low < high:
                self.gaps.append(Gap(float(low - first) / rate_hz, int(high - low)))
                self.missing += int(high - low)
        self._check_missing(self.samples + len(data), slack=LONGEST_GAP * rate_hz)
        yield data[:0]
        yield from straight_lines(self._position, self._last_values, positions, data, (first, last))

    def _check_missing(self, samples: int | None = None, slack: float = 0.0) -> None:
        total = self.samples if samples is None else samples + self.missing
        if self.missing > self._most * total + slack:
            raise InputError(too_many(self.missing, total, self._source.name))

    def _note_bad(self, bad: Index, reasons: list[tuple[int, str]], rows: Index, positions: Index) -> None:
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
