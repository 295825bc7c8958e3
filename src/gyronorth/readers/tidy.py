"""Tidy tables: one number in each row, and words beside it that say of which sensor and axis.

`0.010,gyro,x,0.12` and the rows behind it, which have the same time and come in the same order again and again, are
written anew as one row for each time, with a column for each sensor and axis.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import partial

from gyronorth.readers.fields import is_number, lines_below_titles, split
from gyronorth.readers.sentences import Rewriting
from gyronorth.readers.times import time_text

#: Fewest and most numbers of one time, and how often they must come in the first lines.
FEWEST, MOST, AGAIN = 3, 9, 2
#: Names of the column that holds the number.
VALUES = ("value", "_value", "val", "reading", "measurement", "data")


def rewriting_of_tidy(lines: Sequence[bytes]) -> Rewriting | None:
    """What writes such a table with a row for each time; None of another.

    Parameters
    ----------
    lines : sequence of bytes
        The first lines, not blank: titles and rows.
    """
    delimiter = max((",", ";", "\t"), key=lines[0].decode(errors="replace").count)
    titles, *rows = (split(line.decode(errors="replace"), delimiter) for line in lines)
    values = [i for i, title in enumerate(titles) if title.lower() in VALUES]
    if len(values) != 1 or len({len(row) for row in (titles, *rows)}) != 1 or not all(
        is_number(row[values[0]]) for row in rows
    ):  # fmt: skip
        return None
    columns = list(zip(*rows, strict=True))
    words = [i for i, column in enumerate(columns) if i != values[0] and _is_text(column)]
    keys = [tuple(row[i] for i in words) for row in rows]
    order = list(dict.fromkeys(keys))
    size = len(order)
    in_turn = all(key == order[i % size] for i, key in enumerate(keys))
    if not (words and FEWEST <= size <= MOST and len(rows) >= AGAIN * size and in_turn):
        return None
    whole = range(0, len(rows) - len(rows) % size, size)
    same = [i for i, column in enumerate(columns) if all(len(set(column[k : k + size])) == 1 for k in whole)]
    kept = [i for i in same if i not in words and i != values[0]]
    return partial(_wide, titles=titles, order=order, words=words, kept=kept, value=values[0], delimiter=delimiter)


def _is_text(column: Sequence[str]) -> bool:
    return not any(is_number(cell) for cell in column) and time_text(list(column)) is None


def _wide(
    pieces: Iterable[bytes], *, titles: Sequence[str], order: Sequence[tuple[str, ...]], words: Sequence[int],
    kept: Sequence[int], value: int, delimiter: str,
) -> Iterator[bytes]:  # fmt: skip
    """The rows of one time as one; those that are not whole become a row that says so."""
    named = [*(titles[i] for i in kept), *(" ".join(key) for key in order)]
    yield (",".join(f'"{title}"' for title in named) + "\n").encode()
    cells: list[str] = []
    for lines in lines_below_titles(pieces):
        out = []
        for line in lines:
            row = split(line, delimiter)
            key = tuple(row[i] for i in words) if len(row) == len(titles) else ()
            time = [row[i] for i in kept] if key else []
            if cells and (key != order[len(cells) - len(kept)] or cells[: len(kept)] != time):
                out.append("'rows of one time are not whole'")
                cells = []
            if cells or key == order[0]:
                cells = [*(cells or time), row[value]]
            if len(cells) == len(named):
                out.append(",".join(cells))
                cells = []
        if out:
            yield ("\n".join(out) + "\n").encode()
