"""The sample interval behind stamps that stand on the ticks of a coarse clock, while samples are lost at random.

How many rows stand on each tick repeats with the rate: tick m holds floor((m + 1) r) - floor(m r) of them, r being
ticks over intervals, a sequence whose spectrum has its first line at r itself (modulo 1). Samples lost at random lower
the line and leave it where it is, while the mean of the rows tells no more than that r is not smaller.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Steps so close to whole ticks, in ticks, and all but this share of them; parts of the shortest step that are tried.
ON_TICK, ASTRAY, PARTS = 0.02, 0.02, (1, 2, 3, 4, 5)
#: Rows on a tick for which the line is looked for, fewest rows, and most ticks.
ROWS, FEWEST, MOST_TICKS = (0.18, 6.0), 200, 1 << 21
#: The share of samples that may be lost; what stamps that are late at the end take from the mean.
MOST_LOST, SLACK = 0.12, 0.004
#: Stamps of which none is lost stray from a line by no more than this, in ticks.
NONE_LOST = 1.2
#: Power of a line over that of noise: exp(-LINE) times some thousands of frequencies is once in 1000 files.
LINE = 15.0
#: Power of four lines together, which noise has as seldom; a lower sum is as good, and a line its least share.
COMB, NEARLY, LEAST = 25.0, 0.7, 0.08
#: A step that is this many times the median one is a gap.
GAP = 20
#: Most ticks that hold more rows than stamps on whole ticks have, and ticks in which late rows catch up.
BEYOND, LATE = 0.003, 10
#: The highest line may be so many times the first one, whose power is at least this share of it; how far the number of
#: ticks with more rows may be from what a rate gives, as a logarithm.
MOST_PARTS, ALIKE, FITS = 8, 0.15, 0.35


def of_ticks(step: NDArray[np.float64], *, one_each: bool = False) -> float | None:
    """The sample interval by the line of the rows on ticks, in the unit of `step`, (n,), from stamp to stamp.

    With `one_each` also where no tick holds more than one row: ticks are a little shorter than the interval, or they
    are the interval and every tick without a row is a loss, which only the line tells.

    None where stamps stand on no ticks, or none is lost, or no line stands out: then the stamps tell by other means.
    """
    tick = _tick(step[step > 0]) if len(step) >= FEWEST else None
    if tick is None:
        return None
    whole = np.rint(step / tick).astype(np.int64)
    if not whole.any():
        return None
    usual = float(np.median(whole[whole > 0]))
    gap = whole > GAP * usual
    if (
        not one_each and np.mean((whole == 0) | (whole % usual != 0)) < BEYOND
    ):  # an interval of so many ticks, and losses
        return None
    at = np.concatenate([[0], np.cumsum(whole)])
    rows = len(step) / max(float(at[-1]) - float(whole[gap].sum()), 1.0)
    if not ROWS[0] <= rows <= ROWS[1] or at[-1] >= MOST_TICKS or _is_straight(at):
        return None
    counts = np.bincount(at).astype(float)
    for begin in np.flatnonzero(gap):
        counts[at[begin] + 1 : at[begin + 1]] = rows
    found = _line(counts, rows * (1 - SLACK), rows / (1 - MOST_LOST))
    return None if found is None else tick / found


def _tick(step: NDArray[np.float64]) -> float | None:
    """The longest tick of which nearly all steps are whole multiples; None without one."""
    if len(step) == 0:
        return None
    shortest = float(np.sort(step)[len(step) // 100])  # np.quantile would load numpy.ma
    if float(step.max()) / max(shortest, np.finfo(float).tiny) > MOST_TICKS:
        return None
    for part in PARTS:
        whole = step * part / shortest
        near = np.abs(whole - np.rint(whole)) < ON_TICK * np.maximum(1.0, np.rint(whole) * ON_TICK)
        if near.mean() > 1 - ASTRAY:
            return float(step[near].sum() / np.rint(whole[near]).sum())
    return None


def _is_straight(at: NDArray[np.int64]) -> bool:
    """Whether all stamps, in ticks, lie as near to one line as rounding leaves them: none is lost."""
    number = np.arange(len(at))
    stray = at - np.polyval(np.polyfit(number, at, 1), number)
    return float(np.ptp(stray)) <= NONE_LOST


def _line(counts: NDArray[np.float64], low: float, high: float) -> float | None:
    """Rows on a tick, between `low` and `high`, by the first line in the spectrum of `counts`, (m,).

    None without a line, or with one of a rate at which more samples were lost; NaN where rows come together that no
    rate between has come together, or two rates have the line.
    """
    size = 1 << int(np.ceil(np.log2(4 * len(counts))))
    rest = counts - counts.mean()
    power = np.abs(np.fft.rfft(rest, size)) ** 2 / max(float((rest**2).sum()), 1e-300)
    power[: int(np.ceil(1.5 * size / len(counts)))] = 0.0
    first = int(np.argmax(power))
    comb = _comb(power)
    if power[first] < LINE and comb is None:
        whole = float(np.ceil(low))
        unlike = whole <= high and counts.mean() < whole * (1 - SLACK) and _together(counts, whole) > BEYOND
        return np.nan if unlike else None
    lines = []
    for part in range(1, MOST_PARTS + 1):  # of a rate near whole rows on a tick, lines of whole multiples stand as high
        near = np.arange(max(0, round(first / part) - 3), min(len(power), round(first / part) + 4))
        line = int(near[np.argmax(power[near])])
        lines += [line] if power[line] >= ALIKE * power[first] else []
    possible = _possible(lines, size, low, high) or _possible([] if comb is None else [comb], size, low, high)
    fits = sorted((abs(np.log(_more(counts, rows))), rows) for rows in possible)
    if not fits:
        return None
    if fits[0][0] > FITS or any(off < FITS and abs(rows - fits[0][1]) * len(counts) > 8 for off, rows in fits[1:]):
        return np.nan
    return _sharpened(rest, fits[0][1])


def _possible(lines: list[int], size: int, low: float, high: float) -> list[float]:
    """Rows on a tick between `low` and `high` whose spectrum has its first line at one of `lines`."""
    all_ = [whole + sign * line / size for line in lines for whole in range(int(high) + 2) for sign in (1, -1)]
    return [rows for rows in all_ if low <= rows <= high]


def _comb(power: NDArray[np.float64]) -> int | None:
    """The first of four lines at whole multiples that stand out together, though none does alone."""
    lines = np.stack([power[: len(power) // 4 * part : part] for part in (1, 2, 3, 4)])
    together = np.where(lines.min(axis=0) > LEAST * lines.sum(axis=0), lines.sum(axis=0), 0.0)
    if together.size == 0 or together.max() < COMB:
        return None
    return int(np.flatnonzero(together > NEARLY * together.max())[0])


def _together(counts: NDArray[np.float64], whole: float) -> float:
    """The share of ticks with more than `whole` rows though none before, for as long as `LATE`, had fewer."""
    fewer = np.concatenate([[0.0], np.cumsum(counts < whole)])
    number = np.arange(len(counts))
    before = fewer[number] - fewer[np.maximum(number - LATE, 0)]
    return float(np.mean((counts > whole) & (before == 0)))


def _more(counts: NDArray[np.float64], rows: float) -> float:
    """How many ticks hold more than the whole part of `rows`, over how many would: 1 where this is the rate."""
    whole = int(np.floor(rows))
    kept = min(1.0, counts.mean() / rows)
    there = float(np.mean(counts > whole))
    return max(there, 1e-9) / max((rows - whole) * kept ** (whole + 1), 1e-9)


def _sharpened(rest: NDArray[np.float64], rows: float) -> float:
    """The top of the line, to a hundredth of its width."""
    number = np.arange(len(rest))
    for width in (0.25, 0.02):
        near = rows + np.linspace(-width, width, 25) / len(rest)
        power = [abs(np.dot(rest, np.exp(-2j * np.pi * each * number))) for each in near]
        rows = float(near[int(np.argmax(power))])
    return rows
