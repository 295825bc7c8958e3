"""Headers of LabVIEW's text files (.lvm): lines of a name and a value a channel, above the titles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gyronorth.readers.fields import is_number, split

#: How the last line of the header begins, and the title of the time, which is in s.
END, TIME = "***End_of_Header***", "X_Value"


def lines_above(lines: Sequence[str]) -> int:
    """Lines down to the end of the last header; 0 where there is none."""
    return 1 + max((i for i, line in enumerate(lines) if line.startswith(END)), default=-1)


def stated_in(header: Sequence[str], delimiter: str | None) -> dict[str, list[str]]:
    """Name -> fields of its line, the name being the first."""
    return {fields[0]: fields for line in header if len(fields := split(line, delimiter)) > 1}


def units_of(stated: Mapping[str, Sequence[str]], titles: Sequence[str]) -> tuple[str, ...]:
    """The units of the channels that stand above the titles, the time's being ""."""
    units = stated.get("Y_Unit_Label", ())[1:]
    channels = [i for i, title in enumerate(titles) if title not in (TIME, "Comment")]
    if not any(units) or len(channels) > len(units):
        return ()
    found = dict(zip(channels, units, strict=False))
    return tuple(found.get(i, "") for i in range(len(titles)))


def rate_of(stated: Mapping[str, Sequence[str]], titles: Sequence[str], decimal: str) -> float | None:
    """The sample rate, Hz, of a file without a column of time; None where nothing is stated."""
    if "Delta_X" not in stated or TIME in titles or not is_number(stated["Delta_X"][1], decimal):
        return None
    step = float(stated["Delta_X"][1].replace(",", "."))
    return 1 / step if step > 0 else None
