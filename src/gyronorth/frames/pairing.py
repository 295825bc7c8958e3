"""Rate and specific force that come in frames of their own, at two rates: means of both over common intervals.

An interval holds as many samples of rate as come to one of specific force (one, where force is the faster). Each
sample is used once, so that the noise density of both stays what it is: no value is held or interpolated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyronorth.arrays import Array, Index, Mask
from gyronorth.frames.protocol import Force
from gyronorth.frames.samples import Samples, joined, taken

#: Distances between specific forces, in samples of rate, are even where this share of them is the usual one.
_EVEN = 0.6
#: A mean distance that is this close to a whole number is that.
_WHOLE = 0.1
#: An interval of which less than this share of the samples came is left out.
_LEAST = 0.5


@dataclass(frozen=True)
class Ratio:
    """How many samples of rate come to one of specific force."""

    mean: float
    per: int  # of an interval, so that each holds a specific force
    first: int  # number of the sample at which an interval begins: the force comes in its middle


def ratio_of(number: Index) -> Ratio | None:
    """By the numbers of the samples of rate behind which specific forces came, (m,); None where these are too few."""
    distances = np.diff(number)
    if len(distances) < 2:
        return None
    usual = float(np.median(distances))
    if usual >= 1 and float((distances == usual).mean()) >= _EVEN:
        mean, per = usual, int(usual)
    else:
        mean = float(np.minimum(distances, 1.5 * max(usual, 1.0)).mean())  # without those behind lost frames
        per = round(mean) if abs(mean - round(mean)) < _WHOLE else int(np.ceil(mean))
    per = max(per, 1)
    place = int(np.bincount(number % per).argmax())
    return Ratio(mean, per, (place - per // 2) % per)


class Pairing:
    """Makes samples with both out of samples of rate and the specific forces between them, piece by piece.

    Parameters
    ----------
    ratio : Ratio
        What was told from the start of the stream.
    interval : float or None
        Between samples of rate, s.
    number : int
        Of the first sample of rate.
    begin : int
        Number of the first sample with both.
    """

    def __init__(self, ratio: Ratio, interval: float | None, number: int, begin: int) -> None:
        self.ratio = ratio
        self._least = -((ratio.first - number) // ratio.per)  # the first interval that begins with that sample or later
        self._to_number = begin - self._least
        self._interval = interval or 0.0
        self._open: list[Samples] = []  # of intervals that are not full yet
        self._force: list[tuple[Index, Array, Mask]] = []
        self._latest = number - 1  # number of the last sample of rate
        self._jumped = False  # before an interval that was left out
        self.without = 0  # samples of rate since the last specific force

    @property
    def pending_from(self) -> int | None:
        """The byte at which the first sample of an interval that is not full yet began."""
        return int(self._open[0].start[0]) if self._open else None

    def feed(self, samples: Samples | None, start: Index, force: Force) -> Samples | None:
        """The intervals that are full; `start` are the bytes at which the frames of `force` began."""
        latest = self._latest
        if samples is not None:
            self._open.append(samples)
            self._latest = int(samples.number[-1])
        if force.here.any():
            numbers = np.array([latest]) if samples is None else np.append(latest, samples.number)
            places = np.zeros(len(start), np.int64)
            if samples is not None:
                places = np.searchsorted(samples.start, start, side="right")
            self._force.append((numbers[places][force.here], force.value[force.here], force.saturated[force.here]))
            self.without = self._latest - int(self._force[-1][0][-1])
        else:
            self.without += self._latest - latest
        return self._full(self._interval_of(np.array([self._latest]))[0])

    def finish(self) -> Samples | None:
        """What is left at the end."""
        return self._full(None)

    def _interval_of(self, number: Index) -> Index:
        return (number - self.ratio.first) // self.ratio.per

    def _full(self, end: int | None) -> Samples | None:
        """Samples of the intervals before `end`."""
        if not self._open:
            return None
        samples, interval = joined(self._open), self._interval_of(joined(self._open).number)
        count = len(interval) if end is None else int(np.searchsorted(interval, end))
        if not count:
            self._open = [samples]
            return None
        self._open = [taken(samples, slice(count, None))] if count < len(interval) else []
        number, value, saturated = (
            (np.concatenate(part) for part in zip(*self._force, strict=True))
            if self._force
            else (np.empty(0, np.int64), np.empty((0, 3)), np.empty(0, bool))
        )
        of_force = self._interval_of(number)
        now = of_force <= interval[count - 1]
        self._force = [(number[~now], value[~now], saturated[~now])] if not now.all() else []
        return self._means(taken(samples, slice(count)), interval[:count], of_force[now], value[now], saturated[now])

    def _means(
        self, samples: Samples, interval: Index, of_force: Index, value: Array, saturated: Mask
    ) -> Samples | None:
        which, at, count = np.unique(interval, return_index=True, return_counts=True)
        place = np.searchsorted(which, of_force)
        known = (place < len(which)) & (which[np.minimum(place, len(which) - 1)] == of_force)
        place, value, saturated = place[known], value[known], saturated[known]
        forces = np.bincount(place, minlength=len(which))
        total = np.zeros((len(which), 3))
        np.add.at(total, place, value)
        clipped = np.logical_or.reduceat(samples.saturated, at)
        clipped[place[saturated]] = True
        inside = samples.jumped.copy()
        inside[at] = False
        good = (which >= self._least) & (forces > 0) & (count >= _LEAST * self.ratio.per)
        good &= ~np.logical_or.reduceat(inside, at)
        jumped = self._after_left_out(np.logical_or.reduceat(samples.jumped, at), good)
        if not good.any():
            return None
        middle = self.ratio.first + which * self.ratio.per + (self.ratio.per - 1) / 2
        missing = (middle - np.add.reduceat(samples.number, at) / count) * self._interval

        def mean(values: Array) -> Array:
            summed = np.add.reduceat(values, at)
            return (summed.T / count).T[good]

        return Samples(
            gyro=mean(samples.gyro),
            accel=total[good] / forces[good, None],
            number=which[good] + self._to_number,
            t=None if samples.t is None else mean(samples.t) + missing[good],
            saturated=clipped[good],
            sensor_fault=np.logical_or.reduceat(samples.sensor_fault, at)[good],
            temperature=None if samples.temperature is None else mean(samples.temperature),
            start=samples.start[at][good],
            jumped=jumped[good],
        )

    def _after_left_out(self, jumped: Mask, good: Mask) -> Mask:
        """A jump in an interval that is left out is one before the next that is not."""
        moved = np.zeros(len(jumped), bool)
        for i in range(len(jumped)) if jumped.any() or self._jumped else ():
            self._jumped |= bool(jumped[i])
            if good[i]:
                moved[i], self._jumped = self._jumped, False
        return moved
