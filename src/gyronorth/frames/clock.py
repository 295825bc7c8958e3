"""The place of each sample in time: the unit's clock, its sequence counter, or the bytes between the frames."""

from __future__ import annotations

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


def clock_steps(ticks: Index, tick: float, wrap: int | None) -> Array:
    """Steps of a unit's clock between neighbours, s, shape (n - 1,); NaN where it was set anew."""
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
    steps = steps[np.isfinite(steps)]
    if not (steps > 0).any():
        return None
    usual = float(np.median(steps[steps > 0]))
    if usual < 3 * fields.tick:  # a coarse clock: the fewest samples that a step may count
        usual = float(steps.mean())
        counted = np.maximum(np.ceil((steps - 1.01 * fields.tick) / usual), 1)
    else:
        counted = np.maximum(np.round(steps / usual), 1)
        usual = float(steps.sum() / counted.sum())
        counted = np.maximum(np.round(steps / usual), 1)
    rate, residual = counted.sum() / steps.sum(), np.abs(steps - usual * counted).max()
    spread = 2 * (residual + fields.tick) / steps.sum() + 1e-6
    nominal = min(NOMINAL_HZ, key=lambda value: abs(value / rate - 1))
    return float(nominal) if abs(nominal / rate - 1) <= spread else float(rate)


def stride_of(fields: Fields) -> int | None:
    """By how much the sequence counter usually moves from frame to frame; None where it tells nothing."""
    if fields.counter is None or len(fields.counter) < 3:
        return None
    moves, count = np.unique(np.diff(fields.counter) % fields.counter_wrap, return_counts=True)
    stride = int(moves[np.argmax(count)])
    return stride if stride > 0 and stride * 2 <= fields.counter_wrap else None


class Numbering:
    """Numbers the samples of a stream, the lost ones too, and keeps the state between its pieces."""

    def __init__(self, interval: float | None, stride: int | None, frame_length: float, *, clock: bool) -> None:
        self._interval, self._stride, self._frame_length = interval, stride, frame_length
        self._clock = clock
        self._ticks: int | None = None
        self._counter = 0
        self._number = -1
        self._elapsed = 0  # ticks since the first sample
        self.jumps = 0
        self.lost = 0

    @property
    def lost_from(self) -> str:
        """How lost samples are known."""
        if self._stride is not None:
            return "counter"
        return "clock" if self._clock and self._interval is not None else "bytes"

    def number(self, fields: Fields, skipped: Index) -> tuple[Index, Array | None, Mask]:
        """Numbers (n,), times (n,), s from the first sample, and where the clock was set anew.

        `skipped` bytes lie before each frame.
        """
        n, first = len(fields.gyro), self._number < 0
        expected = 1 + skipped // self._frame_length
        seconds, jumped = np.full(n, np.nan), np.zeros(n, bool)
        if self._clock and fields.ticks is not None:
            before = int(fields.ticks[0]) if self._ticks is None else self._ticks
            seconds = clock_steps(np.concatenate(([before], fields.ticks)), fields.tick, fields.tick_wrap)
            self._ticks = int(fields.ticks[-1])
            jumped = np.isnan(seconds)
            self.jumps += int(jumped.sum())
            if self._interval is not None:
                by_clock = np.round(seconds / self._interval)
                expected = np.where(np.isnan(seconds), expected, by_clock)
        steps = np.maximum(expected, 1)
        if self._stride is not None and fields.counter is not None:
            moves = np.diff(fields.counter, prepend=self._counter) % fields.counter_wrap
            turn = fields.counter_wrap / self._stride
            base = moves / self._stride
            base = np.where(base == 0, np.where(expected < turn / 2, 1, turn), base)  # the same number: sent twice
            steps = np.round(base + turn * np.maximum(np.round((expected - base) / turn), 0))
            self._counter = int(fields.counter[-1])
        steps = steps.astype(np.int64)
        if first:
            steps[0] = 1
        numbers = self._number + np.cumsum(steps)
        self.lost += int(steps.sum()) - n
        self._number = int(numbers[-1])
        return numbers, self._times(fields, seconds, steps, first), jumped

    def _times(self, fields: Fields, seconds: Array, steps: Index, first: bool) -> Array | None:
        if not self._clock:
            return None
        jumped = np.isnan(seconds)
        spans = np.where(jumped, steps * (self._interval or 0.0), seconds)
        ticks = np.round(spans / fields.tick).astype(np.int64)
        if first:
            ticks[0] = 0
        elapsed = self._elapsed + np.cumsum(ticks)
        self._elapsed = int(elapsed[-1])
        return elapsed.astype(float) * fields.tick
