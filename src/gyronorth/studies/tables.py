"""Tables of the studies: rows of figures with their intervals, as data and as Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gyronorth.evaluation import Interval

#: Columns of shares: readers see them in percent.
SHARES = frozenset(
    {
        "95 % interval holds",
        "inside the 95 % interval",
        "missed of valid",
        "refused",
        "folds won",
        "splits won",
        "folds better than learned + deviation",
    }
)
#: Columns that are in percent already.
PERCENT = frozenset({"2.5 % of splits below", "median", "2.5 % of splits above"})


@dataclass(frozen=True)
class Table:
    """A table under a heading; cells are text, numbers, intervals or None."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]
    note: str = ""

    def to_json(self) -> dict:
        """Plain data: an interval becomes {value, low, high}."""
        rows = [[vars(c) if isinstance(c, Interval) else c for c in row] for row in self.rows]
        return {"title": self.title, "columns": list(self.columns), "rows": rows, "note": self.note}

    def to_markdown(self) -> str:
        """A Markdown table under its title."""
        lines = [f"### {self.title}", "", rows_markdown(self.columns, self.rows), ""]
        return "\n".join([*lines, self.note, ""] if self.note else lines)


@dataclass(frozen=True)
class StudyReport:
    """What a study found."""

    text: str  # what was done, in plain words
    tables: tuple[Table, ...]
    curves: dict[str, Any] = field(default_factory=dict)  # data of the figure, if there is one
    title: str = ""  # in place of the study's


def degrees(interval: Interval) -> Interval:
    """An interval in rad as one in degrees."""
    return Interval(*(float(np.degrees(v)) for v in (interval.value, interval.low, interval.high)))


def rows_markdown(columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """Rows under their columns."""
    lines = [columns, ["---"] * len(columns), *(list(map(cell_text, row, columns)) for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def cell_text(cell: Any, column: str) -> str:
    """A cell of this column as a reader sees it."""
    if cell is None:
        return ""
    unit = " %" if column in SHARES else ""
    if isinstance(cell, Interval):
        value, low, high = (_figure(v, column) for v in (cell.value, cell.low, cell.high))
        return f"{value}{unit} ({low} to {high}{unit})"
    return f"{_figure(cell, column)}{unit}" if isinstance(cell, float) else str(cell)


def _figure(value: float, column: str) -> str:
    """Shares in percent, angles with three figures, all else with three decimals."""
    if column in SHARES or column in PERCENT:
        return f"{100 * value if column in SHARES else value:.1f}"
    if 0 < abs(value) < 1e-3 or abs(value) >= 1e4:
        return f"{value:.3g}"
    return f"{value:#.3g}".rstrip(".") if column.endswith(("deg", "°")) else f"{value:.3f}"


def verdict(found: Interval | float, *, low: float = -np.inf, high: float = np.inf) -> str:
    """Whether a figure is within its limits, in three words: the third where the interval reaches to both sides."""
    interval = found if isinstance(found, Interval) else Interval(found, found, found)
    if low <= interval.low and interval.high <= high:
        return "holds"
    if interval.high < low or interval.low > high:
        return "**does not hold**"
    ratio = low == -np.inf and interval.low < 1 < interval.high
    return f"cannot be told{' (the interval contains 1)' if ratio else ''}"
