"""Titles and units above the rows of a text file: the line of titles, its groups above, a row of units below it."""

from __future__ import annotations

import re
from collections.abc import Sequence

from gyronorth.readers.fields import is_number, split
from gyronorth.readers.spellings import ACCEL_SPELLINGS, GYRO_SPELLINGS, is_unit, spelled

#: Fewest numbers in a row: three rates.
FEWEST = 3
DELIMITERS: tuple[str | None, ...] = ("\t", ";", ",", "|", None)
_ORDER = re.compile(r"\(([xyz]),\s*([xyz]),\s*([xyz])\)")
#: How a line begins that is no row.
COMMENT_MARKS = ("#", "%", "//")


def titles_above(
    lines: Sequence[str], first: int, delimiter: str | None, decimal: str, width: int
) -> tuple[int | None, tuple[str, ...], int | None]:
    """Row of the titles, the titles, and the row of the units, above the first row of numbers."""
    unit_row = None
    for row in range(first - 1, -1, -1):
        line = lines[row]
        if not line.strip("-=_+| \t"):  # blank, or a rule
            continue
        marked = line.startswith(COMMENT_MARKS)
        bare = line.lstrip("#%/ \t") if marked else line
        fields = _as_titles(bare, delimiter, width, marked)
        if fields is None:
            if marked:
                continue
            return None, (), None
        if all(is_number(cell, decimal) for cell in fields if cell):
            if len(fields) == width and not all(fields):  # a row with empty fields
                continue
            return None, (), None
        if unit_row is None and len(fields) == width and _are_units(fields):
            unit_row = row
            continue
        if len(fields) == width > 1 and len({cell for cell in fields if cell}) == 1:  # "Smp" of each column
            continue
        return row, _with_order(_with_groups(lines, row, fields, delimiter)), unit_row
    return None, (), None


def _are_units(fields: Sequence[str]) -> bool:
    """Whether these cells, below the titles, are units: all of them, or most, and what names a sensor among them."""
    filled = [cell for cell in fields if cell]
    known = [cell for cell in filled if is_unit(cell)]
    sensors = [cell for cell in known if spelled(cell, GYRO_SPELLINGS) or spelled(cell, ACCEL_SPELLINGS)]
    return bool(filled) and (len(known) == len(filled) or (len(known) > len(filled) / 2 and len(sensors) >= FEWEST))


def units_stated(comments: dict[str, tuple[str, int]], delimiter: str | None, width: int) -> tuple[str, ...]:
    """The units that a comment states, one for each column, as `# field_unit:` of GeoCSV."""
    for key, (text, _) in comments.items():
        cells = split(text, delimiter)
        if "unit" in key.lower() and len(cells) == width and _are_units(cells):
            return tuple(cells)
    return ()


def _with_groups(lines: Sequence[str], row: int, fields: list[str], delimiter: str | None) -> tuple[str, ...]:
    """Titles that are there twice, with the words of the row above; a word holds for the empty cells behind it."""
    named = [cell for cell in fields if cell]
    if len(set(named)) == len(named) or delimiter is None:
        return tuple(fields)
    groups = next((split(line, delimiter) for line in reversed(lines[:row]) if line.strip()), [])
    if len(groups) != len(fields) or not any(groups):
        return tuple(fields)
    filled, last = [], ""
    for cell in groups:
        last = cell or last
        filled.append(last)
    return tuple(f"{group} {cell}".strip() for group, cell in zip(filled, fields, strict=True))


def _with_order(titles: tuple[str, ...]) -> tuple[str, ...]:
    """The axes in three titles of which the first one states their order: Gyroscope (z,x,y) [rad/s], (1), (2)."""
    named = list(titles)
    for i, title in enumerate(titles[:-2]):
        order = _ORDER.search(title)
        behind = [re.match(r"\(?(\d)\)?(?!\d)", cell) for cell in titles[i + 1 : i + 3]]
        if order and sorted(order.groups()) == ["x", "y", "z"] and [each and each[1] for each in behind] == ["1", "2"]:
            named[i : i + 3] = [title.replace(order[0], f" {axis} ") for axis in order.groups()]
    return tuple(named)


def _as_titles(line: str, delimiter: str | None, width: int, marked: bool) -> list[str] | None:
    """The fields of a line of titles, or None if it is none."""
    candidates: list[list[str]] = [split(line, delimiter)]
    candidates += [split(line, other) for other in DELIMITERS if other != delimiter and (other or not marked)]
    candidates.append([part.strip() for part in re.split(r"\s{2,}", line)])
    for fields in candidates:
        if len(fields) == width and sum(bool(cell) for cell in fields) >= min(FEWEST, width):
            return fields
    fields = candidates[0]
    near = abs(len(fields) - width) <= 1
    if len(fields) >= FEWEST and (near if marked else True):
        prose = delimiter is None and not near
        return None if prose else fields
    return None
