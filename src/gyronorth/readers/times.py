"""Times that are written as dates and times of day: a column of texts to seconds."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from datetime import date

import numpy as np
from numpy.typing import NDArray

from gyronorth.frozen import frozen

DAY = 86400.0
#: Week of GPS time, s.
WEEK = 604800.0
#: Words of titles whose digits are hours, minutes and seconds.
_OF_DAY = frozenset(("hhmmss", "hms", "utc"))
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_CLOCK = r"(\d{1,2}):(\d{2}):(\d{2}(?:[.,:]\d+)?)"
_ZONE = r"[^\S\n]*(?:Z|UTC|[+-]\d{2}:?\d{2})?"
_HALVES = rf"{_CLOCK}[^\S\n]*+([AaPp][Mm])?{_ZONE}"
#: Name of a way to write times -> its pattern, a line at a time: date in up to three parts, hours, minutes, seconds.
_COMPACT = r"(\d{4})(\d{2})(\d{2})[T_ -]?(\d{2})(\d{2})(\d{2}\.?\d*)"
_FORMS = {
    "date and time": rf"^\"?(\d{{4}})[-/.](\d{{1,2}})[-/.](\d{{1,2}})[T ]\s*{_CLOCK}()?{_ZONE}\"?$",
    "date (day or month first) and time": rf"^\"?(\d{{1,2}})[-/.](\d{{1,2}})[-/.](\d{{4}})[T ,]\s*{_HALVES}\"?$",
    "date with the month in letters and time": (
        rf"^\"?(\d{{1,2}})[-/. ]([A-Za-z]{{3}})[-/. ](\d{{4}})[T ,]\s*{_HALVES}\"?$"
    ),
    "date (day or month first, year of two digits) and time": (
        rf"^\"?(\d{{1,2}})[-/.](\d{{1,2}})[-/.](\d{{2}})[T ,]\s*{_HALVES}\"?$"
    ),
    "date and time without signs": rf"^\"?{_COMPACT}()?{_ZONE}\"?$",
    "year, day of the year and time": rf"^\"?(\d{{4}})[-:/ ](\d{{3}})()[T: ]\s*{_CLOCK}()?{_ZONE}\"?$",
    "day of the year and time": rf"^\"?()(\d{{3}})()[:/T ]\s*{_CLOCK}()?{_ZONE}\"?$",
    "time of day without signs": r"^\"?()()()(\d{2})(\d{2})(\d{2}\.?\d*)()\"?$",
    "days and time": rf"^\"?(\d+)\s*days?,?\s+()(){_CLOCK}()\"?$",
    "time of day": rf"^\"?()()(){_HALVES}\"?$",
    "minutes and seconds": r"^\"?()()()()(\d{1,2}):(\d{2}[.,]\d+)()\"?$",
}


@frozen
class TimeText:
    """How a column of texts tells the time."""

    form: str  # a key of the ways to write times
    day_first: bool = False  # of a date that ends in its year
    origin: int = 0  # day from which seconds count, proleptic ordinal

    @property
    def wrap(self) -> float | None:
        """Value at which it starts again from 0, s; None for dates."""
        return {"time of day": DAY, "time of day without signs": DAY, "minutes and seconds": 3600.0}.get(self.form)

    def seconds(self, fields: list[str]) -> NDArray[np.float64] | None:
        """Seconds from the start of the day `origin`, shape (n,); None if a field is written otherwise."""
        found = re.findall(_FORMS[self.form], "\n".join(fields), re.M)
        if len(found) != len(fields) or not found:
            return None if fields else np.zeros(0)
        columns = list(zip(*found, strict=True))
        second = [re.sub(r":(\d+)$", r".\1", text).replace(",", ".") for text in columns[5]]
        if self.form == "date and time without signs":
            second = [text if "." in text else f"{text[:2]}.{text[2:]}" for text in second]
        time = np.array(second, dtype=float) + 60.0 * np.array(columns[4], dtype=float)
        if columns[3][0]:
            hour = np.array(columns[3], dtype=float)
            half = np.array([text.lower() for text in columns[6]])
            hour = np.where(half == "pm", hour % 12 + 12, np.where(half == "am", hour % 12, hour))
            time = time + 3600.0 * hour
        if columns[0][0] or columns[1][0]:
            dates = list(zip(*columns[:3], strict=True))
            days = {each: self._day(each) for each in set(dates)}
            if any(day is None for day in days.values()):
                return None
            time = time + DAY * np.array([(days[each] or 0) - self.origin for each in dates], dtype=float)
        return time

    def _day(self, parts: tuple[str, ...]) -> int | None:
        if self.form in ("days and time", "day of the year and time"):
            return int(parts[0] or parts[1])
        if self.form == "year, day of the year and time":
            year, day = int(parts[0]), int(parts[1])
            return date(year, 1, 1).toordinal() + day - 1 if year and 1 <= day <= 366 else None
        letters = parts[1].lower()
        if letters in _MONTHS:
            parts = (parts[0], str(_MONTHS.index(letters) + 1), parts[2])
        if not "".join(parts).isdigit():
            return None
        first, second, third = map(int, parts)
        if self.form.endswith("two digits) and time"):
            third += 2000
        year, month, day = (first, second, third) if first > 31 or third < 1000 else (third, first, second)
        if year == third and (self.day_first or letters in _MONTHS):
            month, day = day, month
        try:
            return date(year, month, day).toordinal()
        except ValueError:
            return None


@frozen
class ClockColumns:
    """A time that is made of several fields, or written as a date or a time of day."""

    positions: tuple[int, ...]  # of the fields, from 0
    factors: tuple[float, ...] = (1.0,)  # numbers: their sum with these factors
    text: TimeText | None = None  # texts: how they are read, joined by a blank

    def of_texts(self, fields: list[str]) -> NDArray[np.float64] | None:
        """Seconds of the joined texts, shape (n,); None if one of them is no time."""
        return None if self.text is None else self.text.seconds(fields)


def is_compact(text: str) -> bool:
    """Whether digits alone are a date and a time: 20240301T115800.000, 20240301115800000."""
    match = re.match(rf'"?{_COMPACT}', text)
    if match is None or not 1900 <= int(match[1]) < 2100:
        return False
    month, day, hour, minute, second = (int(match[i][:2]) for i in range(2, 7))
    return 1 <= month <= 12 and 1 <= day <= 31 and hour < 24 and minute < 60 and second < 60


def digits_of_day(fields: Sequence[str], words: Collection[str]) -> TimeText | None:
    """How six digits before a point tell the time, 115800.010: where a word of the title or a leading zero says so."""
    said = not _OF_DAY.isdisjoint(words) or any(re.match("0[1-9]", text) for text in fields)
    parts = [re.fullmatch(r"(\d\d)(\d\d)(\d\d)(?:\.\d*)?", text) for text in fields]
    if not said or not parts or None in parts:
        return None
    fits = all(int(part[1]) < 24 and int(part[2]) < 60 and int(part[3]) < 60 for part in parts if part)
    return TimeText("time of day without signs") if fits else None


def time_text(fields: list[str]) -> TimeText | None:
    """How these fields, the first ones of a column, tell the time; None if they are no times."""
    joined = "\n".join(fields)
    for form, pattern in _FORMS.items() if ":" in joined or (fields and is_compact(fields[0])) else ():
        found = re.findall(pattern, joined, re.M)
        if not fields or len(found) != len(fields):
            continue
        if not found[0][0]:
            return TimeText(form)
        # A day beyond 12 tells; dots are used where the day comes first.
        if len({parts[0] for parts in found}) > 1 and form == "date and time without signs":
            continue  # a number that counts
        day_first = any(int(parts[0]) > 12 for parts in found) or bool(re.match(r'"?\d{1,2}\.', fields[0]))
        text = TimeText(form, day_first)
        origin = text._day(found[0][:3])
        return None if origin is None else TimeText(form, day_first, origin)
    return None
