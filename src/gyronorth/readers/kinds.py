"""Text files whose rows are of several kinds: those of a gyroscope and those of an accelerometer in turn."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gyronorth.errors import InputError
from gyronorth.readers.columns import bare_triple, is_gravity
from gyronorth.readers.layout import TextLayout
from gyronorth.readers.source import FORCES, RATES
from gyronorth.readers.text_clock import numbers
from gyronorth.readers.titles import Title, take_apart, triples

#: Rows of several sensors: most of these, share of rows at which they turn, fewest rows of each, and how many times the
#: spread of one their middles lie apart.
MOST_KINDS, MANY_TURNS, FEWEST_OF_A_KIND, APART = 8, 0.2, 10, 30.0
#: Standard errors by which means of two units differ.
DIFFERENT = 8.0
#: Words of a title that says which unit a row is of.
UNIT_WORDS = frozenset(("i", "inst", "instance", "imu", "id", "unit", "device", "sensor", "number", "no", "index"))
#: What stands in a cell without a value, in lower case.
EMPTY = ("", "nan")


def kinds_of(layout: TextLayout, name: str) -> tuple[int, str, str] | None:
    """Rows of a gyroscope and of an accelerometer in turn, told apart by a word: its column and the two words.

    Raises
    ------
    InputError
        If there is more than one of either, or no titles x, y, z say which columns hold their values.
    """
    bare = None if not layout.titles else bare_triple([take_apart(title) for title in layout.titles])
    named = bool(layout.titles) and bare is None
    for column in layout.texts:
        kinds = sorted({row[column] for row in layout.rows})
        gyro, accel = ([kind for kind in kinds if word in kind.lower()] for word in ("gyr", "acc"))
        if not (gyro and accel):
            continue
        if len(gyro) == len(accel) == 1 and not named:
            return column, gyro[0], accel[0]
        raise InputError(
            f"{name} has rows of several kinds, told apart by column {column}: {', '.join(kinds[:8])}. Write those "
            f"of {gyro[0]} and those of {accel[0]} into a file each, without that word and with titles, and give "
            "the second one by --accel."
        )
    return None if named else _numbered_kinds(layout, bare)


def _numbered_kinds(layout: TextLayout, bare: tuple[int, int, int] | None) -> tuple[int, str, str] | None:
    """Two kinds of rows in turn, told apart by a whole number, of which one feels gravity and the other does not."""
    for column in range(layout.width):
        texts = [row[column] for row in layout.rows]
        kinds = sorted(set(texts))
        turns = _turns(np.unique(texts, return_inverse=True)[1])
        if len(kinds) != 2 or column in (bare or ()) or turns < MANY_TURNS * len(texts):
            continue
        if not all(kind.isdigit() for kind in kinds):
            continue
        feels = []
        for kind in kinds:
            rows = replace(layout, rows=tuple(row for row in layout.rows if row[column] == kind))
            values = [numbers(rows, i) for i in (bare or [i for i in range(layout.width) if i != column])]
            triples = [np.column_stack(values[i : i + 3]) for i in range(len(values) - 2)]
            feels.append(any(is_gravity(each) for each in triples if len(each) >= FEWEST_OF_A_KIND))
        if sum(feels) == 1:
            return column, kinds[feels.index(False)], kinds[feels.index(True)]
    return None


def first_unit(layout: TextLayout, parts: Sequence[Title]) -> tuple[int, str, str] | None:
    """The first of several whole units whose rows come in turn, as a column says that is titled so; None of one.

    Its column and its text, and "" for the rows of forces, which are the same rows.
    """
    force = [each.positions for each in triples(layout.titles, parts) if each.kind == "accel"]
    rates = [each.positions for each in triples(layout.titles, parts) if each.kind == "gyro"]
    if len(force) != 1 or len(rates) != 1:
        return None
    for column, title in enumerate(layout.titles):
        texts = [row[column] for row in layout.rows]
        units = sorted(set(texts))
        titled = {word.lower() for word in re.findall("[A-Z]?[a-z]+|[A-Z]+", title)}
        if not titled or not titled <= UNIT_WORDS or not 2 <= len(units) <= MOST_KINDS:
            continue
        groups = [replace(layout, rows=tuple(row for row in layout.rows if row[column] == each)) for each in units]
        feels = [is_gravity(np.column_stack([numbers(group, i) for i in force[0]])) for group in groups]
        in_turn = _turns(np.unique(texts, return_inverse=True)[1]) >= MANY_TURNS * len(texts)
        if in_turn and all(feels) and _differ(groups, (*rates[0], *force[0])):
            return column, units[0], ""
    return None


def _differ(groups: Sequence[TextLayout], positions: Sequence[int]) -> bool:
    """Whether means of the rows differ by far more than their noise, as biases of two units do."""
    values = [np.column_stack([numbers(group, i) for i in positions]) for group in groups]
    if min(map(len, values)) < FEWEST_OF_A_KIND:
        return False
    mean = np.array([np.nanmean(each, axis=0) for each in values])
    error = np.max([np.nanstd(each, axis=0) / np.sqrt(len(each)) for each in values], axis=0)
    return bool((np.ptp(mean, axis=0) > DIFFERENT * error).any())


def reject_kinds(layout: TextLayout, positions: Mapping[str, int], name: str) -> None:
    """Refuse rows of two sensors in turn, told apart by a whole number or word: what is read as rate differs."""
    used = [positions[ours] for ours in (*RATES, *FORCES) if ours in positions]
    rates = np.column_stack([numbers(layout, position) for position in used[:3]])
    for column in range(layout.width):
        if column in positions.values():
            continue
        if column in layout.texts:
            words, kinds = np.unique([row[column] for row in layout.rows], return_inverse=True)
            kept: list[Any] = words.tolist()
            each = np.arange(len(words))
        else:
            kinds = numbers(layout, column)
            each = np.unique(kinds[np.isfinite(kinds)])
            whole = bool(((each == np.rint(each)) & (np.abs(each) < 2**53)).all())
            kept = each.astype(int).tolist() if whole else each.tolist()
        if not 2 <= len(each) <= MOST_KINDS or (each != np.rint(each)).any() or _turns(kinds) < MANY_TURNS * len(kinds):
            continue
        groups = [rates[kinds == kind] for kind in each]
        if min(map(len, groups)) < FEWEST_OF_A_KIND:
            continue
        middle = np.array([np.nanmedian(group, axis=0) for group in groups])
        width = np.max(
            [np.nanmedian(abs(group - at), axis=0) for group, at in zip(groups, middle, strict=True)], axis=0
        )
        if (np.ptp(middle, axis=0) > APART * width).any():
            what = layout.titles[column] if layout.titles else f"column {column}"
            raise InputError(
                f"{name} has rows of {len(groups)} sensors in turn, told apart by {what}: {', '.join(map(str, kept))}. "
                "Write those of the gyroscope into a file of their own, and those of the accelerometer into another, "
                "which --accel takes."
            )


def rows_of(layout: TextLayout, only: tuple[int, str, str]) -> TextLayout:
    """The layout with the rows of rates alone, where there are some among the first."""
    at = only[0]
    rows = tuple((*row[:at], "", *row[at + 1 :]) for row in layout.rows if row[at] == only[1])
    return replace(layout, rows=rows) if rows else layout


def _turns(kinds: np.ndarray) -> int:
    return int((np.diff(kinds) != 0).sum())


def is_uneven(layout: TextLayout, positions: Mapping[str, int]) -> bool:
    """Whether rows that hold a rate have no force, or the other way round: the sensors are sampled at other times."""
    groups = [[positions[ours] for ours in names if ours in positions] for names in (RATES, FORCES)]
    if not all(groups):
        return False
    gyro, accel = ([all(row[i].lower() not in EMPTY for i in group) for row in layout.rows] for group in groups)
    alone = sum(one != other for one, other in zip(gyro, accel, strict=True))
    return alone > MANY_TURNS * len(layout.rows) and any(gyro) and any(accel)
