"""Why no rate can be had from a time column: the message, and the options that are likely to cure it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gyronorth.readers.source import Clock

#: The options of a file whose times tell nothing.
NO_CLOCK = ("--columns", "t=-", "--rate", "HZ")


def timeless(time: NDArray[np.float64], step: NDArray[np.float64], clock: Clock, name: str) -> tuple[str, ...]:
    """Of times, shape (n,), of which none is later than the one before; `step`, (n - 1,), between them."""
    if len(time) < 2:
        return (f"{name} has a single time, so its rate is unknown. Declare it: --rate HZ.", *NO_CLOCK[2:])
    cure = "leave that column out and declare the rate: --columns t=- --rate HZ."
    if (step == 0).all():
        says = f"{clock.name} of {name} is {time[0]:.10g} in every row: no clock, or one too coarse. Then {cure}"
        return (says, *NO_CLOCK)
    says = (
        f"{clock.name} of {name} runs backwards, from {time[0]:.10g} to {time[-1]:.10g}: rows in reverse order, or "
        f"another column taken for time, are likely. Put them in order; or {cure}"
    )
    return (says, *NO_CLOCK)


def whole_numbers(time: NDArray[np.float64], interval: float, clock: Clock, name: str) -> tuple[str, ...]:
    """Of times, shape (n,), that step by whole numbers and that nobody called seconds."""
    says = (
        f"{clock.name} of {name} counts in whole numbers, by {interval:.4g} a row "
        f"({time[0]:.10g}, {time[1]:.10g}, {time[2]:.10g}, ...): seconds are not likely. If it counts rows, "
        "leave it out and declare the rate: --columns t=- --rate HZ. If it counts milliseconds, the rate is "
        f"{1e3 / interval:.6g} Hz: --columns t=- --rate {1e3 / interval:.6g}. If these really are "
        f"seconds: --rate {1 / interval:.6g}."
    )
    return (says, *NO_CLOCK)


def no_rate(rate_hz: float, bounds: tuple[float, float], title: str, name: str) -> tuple[str, ...]:
    """Of a time column that gives a rate, Hz, which no sensor has."""
    says = (
        f"{title} of {name} steps by {1 / rate_hz:.4g}, a rate of {rate_hz:.4g} Hz if it is in seconds; "
        f"{bounds[0]:g} to {bounds[1]:g} Hz are expected. If it is in another unit, leave it out "
        "and declare the rate: --columns t=- --rate HZ."
    )
    return (says, *NO_CLOCK)


def unclear(time: NDArray[np.float64], clock: Clock, name: str) -> tuple[str, ...]:
    """Of stamps that are late by more than the samples lost between them; with the rate, they show the losses."""
    rate_hz = (len(time) - 1) / float(time[-1] - time[0]) / (clock.unit or 1.0)
    cure = ("Leave that column out and declare", *NO_CLOCK) if clock.unit is None else ("Declare", *NO_CLOCK[2:])
    says = (
        f"{clock.name} of {name} is late by more than a sample interval in most rows, and not all rows are "
        f"there: on average {rate_hz:.4g} come in a second, the rate is higher. {cure[0]} "
        f"the rate: {' '.join(cure[1:])}."
    )
    return (says, *cure[1:])


def coarse(step: NDArray[np.float64], clock: Clock, name: str) -> tuple[str, ...]:
    """Of more than pairs of rows with one stamp: the clock tells the rate by its ticks, but no single sample."""
    share = float(np.mean(step == 0))
    step = step[step >= 0]
    ticks = np.flatnonzero(step)
    rows = ticks[-1] - ticks[0]
    spans = float(step[ticks[0] + 1 : ticks[-1] + 1].sum()) if rows else float(step.mean())
    rate = f"{max(1, rows) / (spans * (clock.unit or 1.0)):.5g}"
    says = (
        f"{clock.name} of {name} repeats the stamp before it in {share:.0%} of the rows, with "
        f"other values: it is too coarse. By its ticks the rate is about {rate} Hz. Leave it out, "
        f"and declare the rate: --columns t=- --rate {rate}."
    )
    return (says, *NO_CLOCK[:-1], rate)
