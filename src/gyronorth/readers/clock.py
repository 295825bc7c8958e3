"""The sample interval behind a column of time stamps, and the samples lost between them.

A stamp is the time of its sample, or later: the host was busy, and read its queue afterwards. So
the lower envelope of t - i dt, i counting rows, stays where it is while stamps are late, and rises
for good by dt for each sample that was lost. It is taken over the rows of the next two seconds;
stamps that come late for longer than that look like a loss until they catch up.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gyronorth.arrays import median
from gyronorth.frozen import frozen
from gyronorth.readers.ticks import of_ticks

#: Intervals from one stamp to the next beyond which it is absurd: no recording has so many samples.
ABSURD = 1e12
#: Stamps may be late for so long, s, and for so many rows, before a loss is believed.
LONGEST_LATE = 2.0
FEWEST_ROWS = 20
#: A step within this share of the median step is usual, and so large a share of them makes the median the interval.
USUAL, LEAST_USUAL = 0.25, 0.4
#: The envelope moves by more than this, in intervals, where a sample is lost: slow drift moves it less in one row.
MOVE = 0.2
#: Rows at the end that each gain more than this on the one before, in intervals, are read from a queue, if so many do.
CATCHES_UP, FEWEST_CAUGHT = 0.5, 3
#: Moves that are no more than so many rows apart are judged together.
TOGETHER = 16
#: So many moves make a doubt: 20 losses at random stray further than two samples from a straight line but
#: once in a million (Kolmogorov's D = 1 / 10 and less for 20 events); stamps rounded to ticks never do.
ENOUGH_MOVES, STRAIGHT = 20, 2.0
#: An interval by which more than this share of samples would be lost is none.
MOST_LOST = 0.5
#: Losses of up to so large a share are told from ticks where they can be: beyond, a recording is not read anyway.
OFTEN_LOST = 0.095
#: Stamps that stray from whole intervals by more than this, in intervals, are not rounded to ticks of one.
OFF_TICK = 2e-3
#: Ticks of clocks and of times as they are printed, s; an interval further from them than this, relative, is none.
BINARY_TICKS = tuple(2.0**-power for power in range(4, 11))
TICKS, TICK_TOLERANCE = (1.0, 0.1, 1e-2, *BINARY_TICKS, 8e-3, 1e-3, 1e-4, 1e-5, 1e-6), 2e-6
#: A tick so long, s, is less likely than losses that follow each other by the same number of rows, but for those above.
RARE_TICK = 5e-3
#: Share of the rows over which the interval of late stamps is taken, and the least share of bursts that are alike.
LAG, ALIKE = 0.125, 0.5
#: Fractions of an interval at random have a median size of 0.25; below this they show a phase.
CLEAR = 0.2
#: Steps so close to whole ticks, in ticks, and all but this share of them, are rounded; ticks that hold several rows
#: leave fewer steps than the second share, and more rows than most are in a larger share of ticks than the third.
ON_TICK, ALIKE_ROWS, BEYOND = 0.02, 0.8, 0.004
#: What a good interval leaves of the envelope, in intervals, once the losses are taken out; what the best may leave.
FLAT, UNSTEADY = 1.0, 3.5


@frozen
class Settled:
    """What is known of the first `len(lost)` rows that had not been settled before."""

    lost: NDArray[np.int64]  # (m,) samples lost before each row
    late: NDArray[np.float64]  # (m,) how far its stamp lies above the envelope, in intervals
    moved: NDArray[np.int64]  # (m,) whole samples by which the envelope moves there: `lost`, and what stamps give back


class Envelope:
    """Takes time stamps in order, batch by batch, and counts the samples lost before each.

    Rows are settled at once unless the envelope has risen in the last `width` rows: then they wait for
    stamps that bring it back. However the rows are cut into batches, the result is the same.

    Parameters
    ----------
    interval : float
        Time between samples, in units of the stamps.
    width : int
        Rows over which the envelope is taken.
    """

    def __init__(self, interval: float, width: int) -> None:
        self.interval, self.width = interval, width
        self.lost = 0  # samples in all rows settled
        self.level = 0  # by which the envelope has moved, in whole samples; below `lost`: stamps came back
        self.drift = 0.0  # by which it has moved besides, in samples
        self.moves = 0
        self._rows = 0  # settled
        self._origin: float | None = None
        self._waiting = np.zeros(0)  # stamps minus grid, in intervals, of rows that are not settled
        self._last: tuple[float, float] | None = None  # of the last settled row: as it came, and without early stamps
        self._first = 0.0  # envelope at the first row
        self._group = (0, 0.0, -TOGETHER - 1)  # level and envelope before the open group of moves, its last row

    def take(self, time: NDArray[np.float64], *, last: bool = False) -> Settled:
        """Settle what can be settled, or with `last` all rows; `time`, shape (n,), is not decreasing."""
        if self._origin is None and len(time):
            self._origin = float(time[0])
        number = self._rows + len(self._waiting)
        with np.errstate(over="ignore"):
            counted = np.minimum((time - (self._origin or 0.0)) / self.interval, 1e3 * ABSURD)
        stray: NDArray[np.float64] = counted - np.arange(number, number + len(time), dtype=float)
        stray = np.concatenate([self._waiting, stray])
        rows = len(stray)
        if rows > 1 and not last and stray[-1] < stray[-2] - MOVE:
            rows -= 1  # early itself, or the envelope? The next one tells.
        if rows == 0:
            self._waiting = stray
            return Settled(np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0, dtype=np.int64))
        raised = _without_early(stray, self._last[0] if self._last else None)
        if last:
            raised = _without_queue(raised, self._last[1] if self._last else None)
        floor = forward_minimum(raised[:rows], self.width)
        before = floor[0] if self._last is None else min(self._last[1], floor[0])
        move = np.diff(floor, prepend=before)
        moved = np.flatnonzero(np.abs(move) > MOVE)
        if not last:
            # Stamps that fall behind by far more than the width do not come back within it.
            open_ = moved[(move[moved] > 0) & (move[moved] <= 5 * self.width) & (moved > rows - self.width)]
            if len(open_):
                rows = int(open_[0])
                moved = moved[moved < rows]
        lost, whole = np.zeros((2, rows), dtype=np.int64)
        if len(moved):
            lost[moved], whole[moved] = self._judge(np.concatenate([[before], floor]), moved)
        if rows:
            if self._last is None:
                self._first = float(floor[0])
            self.drift = float(floor[rows - 1]) - self._first - self.level
            self._last = float(stray[rows - 1]), float(raised[rows - 1])
        self._rows += rows
        self._waiting = stray[rows:]
        return Settled(lost, stray[:rows] - floor[:rows], whole)

    def _judge(
        self, floor: NDArray[np.float64], moved: NDArray[np.intp]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Samples lost at the rows `moved`, and whole samples moved; `floor` begins with the row before the first."""
        self.moves += len(moved)
        level, base, at = self._group
        number = moved + self._rows
        begins = np.diff(number, prepend=at) > TOGETHER
        # The envelope before the group that each move belongs to, and the whole samples by which it has moved since.
        group = np.cumsum(begins)
        bases = np.concatenate([[base], floor[moved[begins]]])
        moves = np.rint(np.clip(np.nan_to_num(floor[moved + 1] - bases[group]), -ABSURD, ABSURD)).astype(np.int64)
        ends = np.append(begins[1:], True)
        nets = np.zeros(len(bases), dtype=np.int64)
        nets[group[ends]] = moves[ends]
        if begins[0]:
            level = self.level
        levels = level + np.concatenate([[0], np.cumsum(nets)[:-1]])
        path = levels[group] + moves
        highest = np.maximum.accumulate(np.concatenate([[self.lost], path]))
        whole = np.diff(path, prepend=self.level)
        self._group = int(levels[-1]), float(bases[-1]), int(number[-1])
        self.level, self.lost = int(path[-1]), int(highest[-1])
        return np.diff(highest), whole


def forward_minimum(values: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """The least of each value and the `width` - 1 that follow it, shape (n,)."""
    count = len(values)
    width = max(1, min(width, count))
    blocks = np.full(-(-(count + width) // width) * width, np.inf)
    blocks[:count] = values
    blocks = blocks.reshape(-1, width)
    ahead = np.minimum.accumulate(blocks, axis=1).ravel()
    rest = np.minimum.accumulate(blocks[:, ::-1], axis=1)[:, ::-1].ravel()
    return np.minimum(rest[:count], ahead[width - 1 : width - 1 + count])


def width_of(seconds: float) -> int:
    """Rows over which the envelope is taken at a sample interval in s."""
    return max(FEWEST_ROWS, round(LONGEST_LATE / max(seconds, 1e-7)))  # of a clock that is none: finite


def measure(step: NDArray[np.float64], *, unit: float | None) -> float | None:
    """The sample interval that steps between time stamps, shape (n,), show; None if none is positive, NaN if unclear.

    `unit` is in s; None for a counter. Three kinds of columns occur. Most steps are alike: the
    interval is theirs, longer ones are late or hold a loss. Steps differ (stamps rounded to coarse
    ticks, bursts, pairs) and stamps keep to a straight line: the interval is the mean. Neither:
    bursts of which some are lost, or stamps late by intervals, and gaps. Where many samples are lost
    between stamps that are late by as much, nothing tells the one from the other.
    """
    step = step[step >= 0]
    positive = step[step > 0]
    if len(positive) == 0:
        return None
    middle = float(median(positive))
    step = step[step <= ABSURD * middle]
    usual = np.abs(step - middle) <= USUAL * middle
    interval, clear = _in_phase(step, float(step[usual].mean()) if usual.any() else middle)
    found = _refined(step, interval, unit)
    ticked = of_ticks(step)
    if ticked is not None:
        return ticked
    common, width = usual.mean() >= LEAST_USUAL, len(step)
    if common:
        if clear and found.flat:
            if found.moves < ENOUGH_MOVES or _is_lossy(step, found, unit):
                return found.interval
            if (slower := of_ticks(step, one_each=True)) is not None:
                return slower
        width = found.longest_late + 1
    mean = _straight(step, unit, width)
    if mean is not None or (common and found.flat and found.lost <= MOST_LOST * len(step)):
        return mean or found.interval
    if _beyond_ticks(step):
        return np.nan
    bursts = _of_bursts(step)
    if bursts is not None and np.isnan(bursts):
        return np.nan
    fits = [found, _refined(step, _of_lags(step) if bursts is None else bursts, unit)]
    best = min(fits, key=lambda fit: fit.spread if fit.lost <= MOST_LOST * len(step) else np.inf)
    return best.interval if best.spread <= UNSTEADY else np.nan


@frozen
class _Fit:
    """How well an interval fits."""

    interval: float
    moves: int  # of the envelope
    lost: int  # samples, by the envelope
    spread: float  # of the envelope without the losses, in intervals
    longest_late: int  # rows that are late one after the other, at most

    @property
    def flat(self) -> bool:
        """Whether nothing but losses moves the envelope."""
        return self.spread <= FLAT


def _refined(step: NDArray[np.float64], interval: float, unit: float | None) -> _Fit:
    """An interval made better by the rows that lie on its envelope."""
    time = np.concatenate([[0.0], np.cumsum(step)])
    for turn in range(3):
        if not 0 < interval < np.inf:
            return _Fit(np.nan, 0, 0, np.inf, 0)
        # An interval that is a little off tilts the envelope: the first look is over few rows.
        envelope = Envelope(interval, FEWEST_ROWS if turn == 0 else _width(interval, unit))
        settled = envelope.take(time, last=True)
        level = np.cumsum(settled.moved)
        if turn < 2:
            interval = _on_line(time, interval, level)
    stray = _without_early(time / interval - np.arange(len(time)) - level, None)
    left = forward_minimum(_without_queue(stray, None), envelope.width)
    spread = float(np.ptp(left[: max(1, len(left) - FEWEST_ROWS)]))
    in_time = np.flatnonzero(settled.late <= MOVE)
    longest = int(np.diff(in_time, prepend=-1, append=len(time)).max()) - 1
    return _Fit(interval, envelope.moves, envelope.lost, spread, longest)


def _in_phase(step: NDArray[np.float64], interval: float) -> tuple[float, bool]:
    """An interval made better by what 2, 4, ... 16 steps last beyond whole intervals, and whether this is clear.

    Losses do not matter to it, being whole intervals.
    """
    time = np.concatenate([[0.0], np.cumsum(step)])
    for lag in (2, 4, 8, 16):
        if len(time) > 2 * lag:
            beyond = (time[lag:] - time[:-lag]) / interval
            beyond -= np.rint(beyond)
            if median(np.abs(beyond)) > CLEAR:
                return interval, False
            interval *= 1 + float(median(beyond)) / lag
    return interval, True


def _is_lossy(step: NDArray[np.float64], found: _Fit, unit: float | None) -> bool:
    """Whether many long steps are losses, not the ticks of a coarse clock.

    Either would do where stamps stand at whole multiples of a tick. They are losses where the stamps stray from
    these, where no clock ticks so, and where each follows the last by the same number of rows at a tick that is rare.
    """
    if found.lost > OFTEN_LOST * (len(step) + found.lost):
        return False
    whole = step / found.interval
    astray = float(median(np.abs(whole - np.rint(whole))))
    seconds = found.interval * (unit or 0.0)
    if astray > OFF_TICK or not any(abs(seconds / tick - 1) < TICK_TOLERANCE for tick in TICKS):
        return unit is not None
    apart = np.diff(np.flatnonzero(step > 1.5 * found.interval))
    regular = float(np.mean(apart == median(apart))) > 1 - 1 / ENOUGH_MOVES
    binary = any(abs(seconds / tick - 1) < TICK_TOLERANCE for tick in BINARY_TICKS)
    return regular and seconds > RARE_TICK and not binary


def _of_bursts(step: NDArray[np.float64]) -> float | None:
    """The usual time from burst to burst over the usual number of rows in one.

    None where bursts are not alike; NaN where so many rows are lost that nothing tells how many a burst has.
    """
    begins = np.flatnonzero(step > 0.5 * np.quantile(step[step > 0], 0.95))
    if len(begins) < 3:
        return None
    rows = np.diff(begins)
    periods = np.diff(np.cumsum(step)[begins])
    alike = np.abs(rows - median(rows)) <= max(1.0, USUAL * median(rows))
    alike &= np.abs(periods - median(periods)) <= USUAL * median(periods)
    if alike.mean() < ALIKE:
        return None
    rows, periods = rows[alike], periods[alike]
    if float(np.ptp(np.cumsum(rows - rows.mean()))) > STRAIGHT:  # some are lost
        counts = np.bincount(rows)
        usual = int(np.argmax(counts))
        if counts[usual] < ALIKE_ROWS * len(rows) or counts[usual + 1 :].sum() > BEYOND * len(rows):
            return np.nan
        rows, periods = rows[rows == usual], periods[rows == usual]
    return float(periods.mean() / rows.mean())


def _beyond_ticks(step: NDArray[np.float64]) -> bool:
    """Whether stamps stand on ticks, and some ticks hold more rows than most do, while samples are lost at random.

    A tick that holds two rows, and now and then three, is more than two intervals long; how much more, the losses hide.
    """
    positive = step[step > 0]
    tick = float(median(positive))
    whole = positive / tick
    if float(np.mean(abs(whole - np.rint(whole)) < ON_TICK)) < 1 - ON_TICK or (step > 0).mean() > ALIKE_ROWS:
        return False
    rows = np.diff(np.flatnonzero(step > 0))
    return len(rows) > 0 and float(np.mean(rows > (1 + USUAL) * median(rows))) > BEYOND


def _of_lags(step: NDArray[np.float64]) -> float:
    """The median of what an eighth of the rows lasts, over their number: late stamps and a few losses leave it."""
    time = np.concatenate([[0.0], np.cumsum(step)])
    lag = max(1, int(LAG * len(time)))
    return float(median(time[lag:] - time[:-lag])) / lag


def _straight(step: NDArray[np.float64], unit: float | None, late: int) -> float | None:
    """The mean interval, if the lower envelope of the stamps keeps to a straight line.

    The envelope is taken over `late` rows at most: a wider one would pass losses at random for a line.
    """
    time = np.concatenate([[0.0], np.cumsum(step)])
    mean = _on_line(time, float(step.mean()), np.zeros(len(time)))
    width = min(_width(mean, unit), max(FEWEST_ROWS, len(time) // 4), late)
    floor = forward_minimum(_without_early(time / mean - np.arange(len(time)), None), width)
    return mean if float(np.ptp(floor[: max(1, len(floor) - width)])) <= STRAIGHT else None


def _on_line(time: NDArray[np.float64], interval: float, lost: NDArray[np.float64] | NDArray[np.int64]) -> float:
    """The interval by the medians of the first and the last third of the rows."""
    third = len(time) // 3
    if third < 2:
        return float(time[-1] / (len(time) - 1 + lost[-1])) if len(time) > 1 else interval
    number = np.arange(len(time)) + lost
    stray = interval * _without_early(time / interval - number, None)
    slope = (median(stray[-third:]) - median(stray[:third])) / (number[-third:].mean() - number[:third].mean())
    return interval + float(slope)


def _width(interval: float, unit: float | None) -> int:
    return FEWEST_ROWS if unit is None else width_of(interval * unit)


def _without_queue(stray: NDArray[np.float64], before: float | None) -> NDArray[np.float64]:
    """The last rows taken to be in time where they are read from a queue that the recording ends within.

    Their stamps come so fast one behind the other that they were catching up: late, not lost.
    """
    falls = np.diff(stray) < -CATCHES_UP
    begin = len(stray) - 1 - (len(falls) if falls.all() else int(np.argmin(falls[::-1])))
    level = stray[begin - 1] if begin > 0 else before
    if len(stray) - 1 - begin < FEWEST_CAUGHT or level is None:
        return stray
    return np.concatenate([stray[:begin], np.minimum(stray[begin:], level)])


def _without_early(stray: NDArray[np.float64], before: float | None) -> NDArray[np.float64]:
    """Single stamps that lie below both neighbours raised to the lower of these."""
    if len(stray) < 2:
        return stray
    previous = np.concatenate([[stray[0] if before is None else before], stray[:-1]])
    following = np.concatenate([stray[1:], [-np.inf]])
    return np.maximum(stray, np.minimum(previous, following))
