"""Which columns of a text file tell the time, and in which unit."""

from __future__ import annotations

from calendar import isleap
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gyronorth.arrays import median
from gyronorth.errors import InputError
from gyronorth.frozen import frozen
from gyronorth.readers.layout import TextLayout
from gyronorth.readers.options import TIME_UNITS
from gyronorth.readers.source import Clock, Question
from gyronorth.readers.times import DAY, WEEK, ClockColumns, digits_of_day, is_compact, time_text
from gyronorth.readers.titles import COUNTER_WORDS, TIME_WORDS, Title

#: Sample rates, Hz, by which the unit of a time is told where no title states it, no two units share one, and those by
#: which one is proposed. Ticks of 10 us or of watch crystals, 32768 a second, taken for microseconds, give higher ones.
TOLD_RATES, LIKELY_RATES = (25.0, 550.0), (25.0, 1100.0)
#: The same for seconds, which have a point.
SECONDS_RATES = (0.5, 20000.0)
#: Largest relative difference of a rate that a time unit gives from the one that is known.
SAME_RATE = 0.05
#: The time since 1970 in seconds, from 2001 to 2039; larger by a thousand for each smaller unit.
EPOCH_S = (1.0e9, 2.2e9)
#: Steps of 100 ns since the year 1 (.NET) and since 1601 (files of Windows), from 2001 to 2039.
TICK = 1e-7
TICK_NUMBERS = ((6.311e17, 6.434e17), (1.262e17, 1.384e17))
#: The time of Xsens' units, in 0.1 ms of MTi, up to 2 kHz, and in us of DOT, up to 120 Hz; the longest step of an MTi.
SAMPLE_TIME_FINE, LONGEST_FINE = ("sample", "time", "fine"), 400.0
#: Days since 1900 of spreadsheets, since year 0 of MATLAB, Julian days: from about 1990 to 2070.
DAY_NUMBERS = ((32000.0, 62500.0), (726000.0, 757000.0), (2447000.0, 2478000.0))
#: Words of decimal years and of days of the year; years that are likely.
YEAR_WORDS, DAY_WORDS, YEARS = frozenset(("year", "decyear")), frozenset(("doy", "day", "days")), (1980.0, 2100.0)
#: Words of a title that is seconds of the GPS week.
OF_THE_WEEK = frozenset(("sow", "tow", "towms", "gpstow", "itow"))
#: Seconds in one unit of the parts of a second that stand beside whole seconds.
PARTS_OF_A_SECOND = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}

_PLAIN_TIMES = (("time",), ("t",), ("timestamp",), SAMPLE_TIME_FINE)


@frozen
class FoundClock:
    """The time of a text file."""

    clock: Clock
    columns: ClockColumns | None  # None: the column at `position`, as it is
    position: int
    told: str  # for people
    question: Question | None = None


def find_clock(
    layout: TextLayout, parts: Sequence[Title], position: int, time_unit: str | None, rate_hz: float | None
) -> FoundClock:
    """How the column at `position` tells the time, perhaps together with others.

    Parameters
    ----------
    layout : TextLayout
        The file.
    parts : sequence of Title
        Its titles taken apart; none without a header.
    position : int
        The column that was found or declared to be the time.
    time_unit : str or None
        A declared unit.
    rate_hz : float or None
        A stated or declared rate, Hz, which tells the unit too.
    """
    title = layout.titles[position] if layout.titles else f"column {position}"
    part = parts[position] if parts else Title("time", ())
    if not layout.rows:
        return FoundClock(Clock(1.0, name=title), None, position, title)
    if time_unit and part.unit and (time_unit, 1.0) != (part.unit, part.scale):
        raise InputError(f"{title} states {part.unit}; {time_unit} is declared. Leave --time-unit out, or correct it.")
    if position in layout.texts or ":" in layout.rows[0][position] or is_compact(layout.rows[0][position]):
        return _written(layout, position, title, rate_hz)
    if time_unit is None and (text := digits_of_day([row[position] for row in layout.rows], part.words)) is not None:
        columns = ClockColumns((position,), text=text)
        return FoundClock(Clock(1.0, text.wrap, title, known=True), columns, position, f"{title} (hours, minutes, s)")
    of_day = {kind: [i for i, each in enumerate(parts) if each.kind == kind] for kind in ("hour", "minute")}
    if all(len(found) == 1 for found in of_day.values()):
        hour, minute = of_day["hour"][0], of_day["minute"][0]
        parts_of = [i for i, each in enumerate(parts) if each.kind == "time" and each.unit in PARTS_OF_A_SECOND]
        behind = [i for i in parts_of if i != position and _is_part(layout, position, i, parts[i].unit or "ns")][:1]
        factors = (3600.0, 60.0, 1.0, *(PARTS_OF_A_SECOND[parts[i].unit or "ns"] for i in behind))
        columns = ClockColumns((hour, minute, position, *behind), factors)
        return FoundClock(Clock(1.0, DAY, title, known=True), columns, position, f"hours, minutes and {title}")
    partner = _partner(layout, parts, position)
    if partner is not None and parts and parts[partner].kind == "week":
        unit = TIME_UNITS[time_unit or part.unit or "s"] * part.scale
        columns = ClockColumns((partner, position), (WEEK, unit))
        return FoundClock(
            Clock(1.0, name=title, known=True), columns, position, f"{layout.titles[partner]} and {title}"
        )
    part_unit = None if partner is None else (parts[partner].unit or "ns") if parts else "ns"
    if partner is not None and part_unit and _is_part(layout, position, partner, part_unit):
        columns = ClockColumns((position, partner), (1.0, PARTS_OF_A_SECOND[part_unit]))
        beside = layout.titles[partner] if layout.titles else f"column {partner}"
        return FoundClock(Clock(1.0, name=title, known=True), columns, position, f"{title} and {beside}")
    if part.kind == "counter" and time_unit is None:
        return FoundClock(Clock(None, name=title), None, position, f"{title} (a counter)")
    unit, question, why = _unit(numbers(layout, position), time_unit, part, title, rate_hz)
    stated_unit = bool(time_unit or part.unit)
    wrap = WEEK / unit if set(part.words) & OF_THE_WEEK else None
    name = {scale: text for text, scale in TIME_UNITS.items()}.get(unit, f"{unit:g} s")
    stated = "" if f"({name})" in title or f"[{name}]" in title else f" ({name}{why})"
    return FoundClock(Clock(unit, wrap, name=title, known=stated_unit), None, position, f"{title}{stated}", question)


def choose_clock(layout: TextLayout, parts: Sequence[Title]) -> int | None:
    """The column of a file with titles that tells the time best; None without one."""
    best: tuple[float, int] | None = None
    for position, part in enumerate(parts):
        if not layout.rows:
            continue
        text = position in layout.texts or ":" in layout.rows[0][position]
        if part.kind not in ("time", "counter", "" if text else "time"):
            continue
        if text and time_text([row[position] for row in layout.rows if row[position]][:20]) is None:
            continue
        if not text and not _runs(numbers(layout, position)):
            continue
        score = {"time": 0.0, "": 5.0, "counter": 10.0}[part.kind] + 0.01 * position
        score += 0.0 if part.unit or text or part.words in _PLAIN_TIMES else 1.0
        score += 5.0 if part.words and not set(part.words) & (TIME_WORDS | COUNTER_WORDS) else 0.0  # by its unit alone
        score += 2.0 if _belongs_to_seconds(layout, parts, position) else 0.0
        if best is None or score < best[0]:
            best = (score, position)
    return None if best is None else best[1]


def numbers(layout: TextLayout, position: int) -> NDArray[np.float64]:
    """A column of the first rows, NaN where it holds no number."""
    column = np.full(len(layout.rows), np.nan)
    for row, fields in enumerate(layout.rows):
        try:
            column[row] = float(fields[position].replace(",", ".") if layout.decimal == "," else fields[position])
        except ValueError:
            continue
    return column


def _runs(time: NDArray[np.float64]) -> bool:
    """Whether most values are later than the one before."""
    step = np.diff(time[np.isfinite(time)])
    return len(step) == 0 or (float(np.mean(step >= 0)) > 0.8 and bool((step > 0).any()))


def _written(layout: TextLayout, position: int, title: str, rate_hz: float | None) -> FoundClock:
    """A column of dates or times of day, with a column of dates before it if there is one."""
    fields = [row[position] for row in layout.rows if row[position]][:50]
    positions = (position,)
    text = time_text(fields)
    if text is not None and text.form == "time of day" and position > 0:
        both = time_text([f"{row[position - 1]} {row[position]}" for row in layout.rows if row[position]][:50])
        if both is not None:
            text, positions = both, (position - 1, position)
    if text is None:
        rate = () if rate_hz else ("--rate", "HZ")
        says = f"{title} is {fields[0][:40] if fields else ''!r}, which is no time that is known here."
        question = Question(says, ("--columns", "t=-", *rate), certain=False)
        return FoundClock(Clock(1.0, name=title), None, position, title, question)
    return FoundClock(
        Clock(1.0, text.wrap, title, known=True), ClockColumns(positions, text=text), position, f"{title} ({text.form})"
    )


def _belongs_to_seconds(layout: TextLayout, parts: Sequence[Title], position: int) -> bool:
    """Whether a column holds parts of a second, beside one of whole seconds."""
    part = parts[position]
    if part.unit not in PARTS_OF_A_SECOND:
        return False
    same = any(other.words == part.words and other.unit == "s" for other in parts)
    before = parts[position - 1] if position else part
    bare = not part.words and before.kind == "time" and before.unit in (None, "s") and _since_1970(layout, position - 1)
    return same or (bare and _is_part(layout, position - 1, position, part.unit))


def _partner(layout: TextLayout, parts: Sequence[Title], position: int) -> int | None:
    """A column that belongs to a time: weeks beside seconds of the week, nanoseconds beside seconds."""
    if not parts:
        return position + 1 if is_whole_second(layout, position) else None
    part = parts[position]
    weeks = [i for i, other in enumerate(parts) if other.kind == "week"]
    if len(weeks) == 1 and part.kind == "time":
        return weeks[0]
    for i, other in enumerate(parts):
        beside = other.words == part.words and i != position and part.unit == "s"
        bare = i == position + 1 and not other.words and part.unit in (None, "s") and _since_1970(layout, position)
        if (beside or bare) and other.kind == "time" and other.unit in PARTS_OF_A_SECOND:
            return i
    return None


def is_whole_second(layout: TextLayout, position: int) -> bool:
    """Whether a column without a title holds whole seconds since 1970, and the one behind it nanoseconds."""
    if position + 1 >= layout.width or len(layout.rows) < 3:
        return False
    nanoseconds = bool((numbers(layout, position + 1) > 1e6).any())
    return nanoseconds and _since_1970(layout, position) and _is_part(layout, position, position + 1, "ns")


def _since_1970(layout: TextLayout, position: int) -> bool:
    """Whether a column holds seconds since 1970."""
    seconds = numbers(layout, position)
    return bool(np.isfinite(seconds).all() and (EPOCH_S[0] < seconds).all() and (seconds < EPOCH_S[1]).all())


def _is_part(layout: TextLayout, seconds: int, part: int, unit: str) -> bool:
    """Whether a column holds the parts of the whole seconds in another, and not the same time once more."""
    whole, parts = numbers(layout, seconds), numbers(layout, part) * PARTS_OF_A_SECOND[unit]
    whole, parts = whole[np.isfinite(whole)], parts[np.isfinite(parts)]
    return bool((whole == np.rint(whole)).all() and (parts >= 0).all() and (parts < 1).all())


def _unit(
    time: NDArray[np.float64], declared: str | None, part: Title, title: str, rate_hz: float | None
) -> tuple[float, Question | None, str]:
    """Seconds in one unit of a time, a question where that is open, and why for people."""
    if declared or part.unit:
        return TIME_UNITS[declared or part.unit or "s"] * part.scale, None, ""
    time = time[np.isfinite(time)]
    step = np.diff(time)
    step = step[step > 0]
    if len(step) == 0:
        return 1.0, None, ""
    mean = float((time[-1] - time[0]) / (len(time) - 1))
    mean = max(mean if mean > 0 else float(median(step)), 1e-200)  # whose reciprocal is finite
    for power, (name, unit) in enumerate(TIME_UNITS.items()):
        low, high = (bound * 1000.0**power for bound in EPOCH_S)
        if low <= float(median(time)) <= high and SECONDS_RATES[0] <= 1 / (mean * unit) <= SECONDS_RATES[1]:
            return unit, None, f", since 1970: {time[0]:.10g}" if name != "s" else ""
    if (ticks := _calendar(time, part) or _known_ticks(time, mean, part)) is not None:
        return ticks[0], None, ticks[1]
    if 1 / mean > SECONDS_RATES[1] and any(low < time[0] < high for low, high in DAY_NUMBERS):
        return DAY, None, ", days"
    whole = bool(np.allclose(time, np.rint(time), rtol=0, atol=1e-6))
    if not whole and SECONDS_RATES[0] <= 1 / mean <= SECONDS_RATES[1]:
        return 1.0, None, ""
    by_rate = [unit for unit in TIME_UNITS.values() if rate_hz and abs(1 / (mean * unit) / rate_hz - 1) < SAME_RATE]
    if by_rate:
        return by_rate[0], None, f", {rate_hz:g} Hz"
    if whole and np.allclose(step, 1, rtol=0, atol=1e-6) and len(step) > 0.9 * (len(time) - 1):
        says = f"{title} counts in whole numbers, each 1 more than the last: milliseconds (1000 Hz), or seconds?"
        return 1.0, Question(says, ("--time-unit", "ms"), certain=False), ""
    told = [(name, unit) for name, unit in TIME_UNITS.items() if TOLD_RATES[0] <= 1 / (mean * unit) <= TOLD_RATES[1]]
    if len(told) == 1:
        return told[0][1], None, f" by its steps of {mean:.4g}"
    possible = [name for name, unit in TIME_UNITS.items() if SECONDS_RATES[0] <= 1 / (mean * unit) <= SECONDS_RATES[1]]
    if not possible:
        return 1.0, None, ""
    rates = [f"{name} ({1 / (mean * TIME_UNITS[name]):.4g} Hz)" for name in possible]
    says = (
        f"{title} advances by {mean:.4g} in each row, in a unit that is not known: {' or '.join(rates)}? For steps of "
        "another length declare the rate: --columns t=- --rate HZ."
    )
    likely = [name for name in possible if LIKELY_RATES[0] <= 1 / (mean * TIME_UNITS[name]) <= LIKELY_RATES[1]]
    options = ("--time-unit", likely[0]) if likely else ("--columns", "t=-", "--rate", "HZ")
    return 1.0, Question(says, options, certain=False), ""


def _calendar(time: NDArray[np.float64], part: Title) -> tuple[float, str] | None:
    """Seconds in a decimal year, or in a day of the year, where the title says so."""
    if YEAR_WORDS & set(part.words) and YEARS[0] < time[0] < YEARS[1]:
        return DAY * (365 + isleap(int(time[0]))), ", years"
    return (DAY, ", days") if DAY_WORDS & set(part.words) and 0 < time[0] < 367 else None


def _known_ticks(time: NDArray[np.float64], mean: float, part: Title) -> tuple[float, str] | None:
    """Seconds in a tick that is known by its title or by the size of its numbers, and whose it is."""
    if part.words == SAMPLE_TIME_FINE:
        return (1e-4, " of Xsens MTi") if mean <= LONGEST_FINE else (1e-6, " of Xsens DOT")
    known = any(low < time[0] < high for low, high in TICK_NUMBERS)
    return (TICK, ", steps of 100 ns") if known else None
