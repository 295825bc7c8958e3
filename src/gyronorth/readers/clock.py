"""The sample interval behind a column of time stamps, and the samples missing between them.

Three kinds of columns occur. *Regular*: most steps are alike, longer ones are gaps. *Even*:
steps differ (stamps rounded to coarse ticks, or jitter) but no stamp strays from a straight
line by more than a sample, so none is missing. *Irregular*: stamps come in bursts or late; only
steps well beyond the usual long ones are gaps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

#: A step within this share of the median step is usual.
USUAL = 0.25
#: Steps shorter than usual are no gaps: up to this share a column is still regular.
MOST_SHORT = 0.05
#: Share of usual steps that a regular column has at least, and of time that samples at such steps fill: 10 % of
#: samples may be missing, with a margin. Bursts fill little.
LEAST_USUAL = 0.6
#: Unusual steps needed to tell even stamps from gaps: 20 gaps at random stray further than a sample
#: from a line but once in a million (Kolmogorov's D = 1 / 20 for 20 events).
ENOUGH_UNUSUAL = 20


@dataclass(frozen=True)
class Ticks:
    """How time stamps advance; all in units of the clock."""

    interval: float  # mean step between neighbouring samples
    longest: float  # a longer step holds a gap
    expected: float  # length of the longest steps that hold none: what lies beyond is missing

    def missing(self, step: NDArray[np.float64]) -> NDArray[np.float64]:
        """Whole number of samples missing in each step, shape (n,)."""
        missing = np.zeros(len(step))
        for i in np.flatnonzero(step > self.longest):
            # A late stamp makes its step long and the next one short, an early one the one before.
            neighbours = step[max(i - 1, 0) : i + 2] if self.expected == self.interval else []
            lent = sum(self.interval - other for other in neighbours if other < (1 - USUAL) * self.interval)
            missing[i] = max(0.0, np.rint((step[i] - lent - self.expected) / self.interval))
        return missing


def measure(step: NDArray[np.float64]) -> Ticks | None:
    """What the steps between time stamps, shape (n,), show; None if none is positive."""
    step = step[step > 0]
    if len(step) == 0:
        return None
    middle, mean = float(np.median(step)), float(step.mean())
    unusual = np.abs(step - middle) > USUAL * middle
    if np.count_nonzero(unusual) >= ENOUGH_UNUSUAL:
        stray = np.cumsum(step) / mean - np.arange(1, len(step) + 1)
        if np.ptp(stray) <= 2.0:
            return Ticks(mean, longest=1.5 * max(float(step.max()), mean), expected=mean)
    interval = middle if unusual.all() else float(step[~unusual].mean())
    filled = len(step) * interval / float(step.sum())
    if np.mean(step < (1 - USUAL) * middle) <= MOST_SHORT and min(1 - np.mean(unusual), filled) >= LEAST_USUAL:
        return Ticks(interval, longest=1.5 * interval, expected=interval)
    usual_long = float(np.quantile(step, 0.95))
    interval = float(step[step <= 1.4 * usual_long].mean())
    return Ticks(interval, longest=max(1.4 * usual_long, 1.5 * interval), expected=max(usual_long, interval))
