"""A recording in named arrays that are in memory, or mapped into it, as a `Source`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.readers.array_groups import of_groups
from gyronorth.readers.arrays import Column, choose, columns_of, told_of
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.source import Block, Parts, Source, blocks_of, rows_block

#: Rows per block.
BLOCK_ROWS = 1 << 14
#: Kinds of numpy's types that are numbers, and those that are dates and times.
NUMBERS, TIMES = "fiu", "Mm"


def held_source(
    format: str,
    name: str,
    arrays: Mapping[str, NDArray[Any]],
    shapes: Mapping[str, tuple[int, ...]],
    options: ReadOptions,
    *,
    holds: str = "",
    looked_into: bool = False,
    mark: str = ".",
) -> Source:
    """The recording in named arrays.

    Parameters
    ----------
    format : str
        Name of the format.
    name : str
        File name, for messages.
    arrays : mapping
        The arrays, each asked for when it is needed.
    shapes : mapping
        Shape of each array that may be read, without asking for it; a table of samples is (n,), (n, k) or (k, n).
    options : ReadOptions
        Declarations.
    holds : str, optional
        What the file holds, for messages; by default the shapes.
    looked_into : bool, optional
        Whether a part of an array costs no more than that part: then a long file is described from places of it.
    mark : str, optional
        What stands between a group and what is in it.

    Raises
    ------
    InputError
        If no recording is found in them.
    """
    listed = holds or ", ".join(f"{title} ({_size(shape)})" for title, shape in list(shapes.items())[:12])
    there: dict[str, Column] = {}
    singles = {title for title, shape in shapes.items() if all(size == 1 for size in shape)}
    for title, shape in shapes.items():
        if title not in singles:
            dated = arrays.get(title)  # None where it is not yet decoded: those are numbers
            unit = "s" if dated is not None and dated.dtype.kind == "M" else ""  # as it is read, whatever its title
            there |= {name: replace(column, unit=unit) for name, column in columns_of(title, shape).items()}
    if not there:
        raise InputError(f"{name} holds {listed or 'no array'}; an array of numbers, samples x columns, is expected.")
    again = partial(held_source, format, name, arrays, shapes, holds=holds, looked_into=looked_into, mark=mark)
    if (pair := of_groups(there, options, mark, again)) is not None:
        return pair
    scalars = {title: float(np.asarray(arrays[title]).reshape(-1)[0]) for title in singles if np.size(arrays[title])}

    def numbers(column: Column, part: slice = slice(None)) -> NDArray[np.float64]:
        values = arrays[column.array]
        if values.ndim == 2 and isinstance(column.part, int):
            values = (values.T if column.transposed else values)[:, column.part]
        if values.dtype.kind in TIMES:
            return _seconds(values, part)
        with np.errstate(invalid="ignore", over="ignore"):  # a damaged file holds signalling NaN too
            return values[part].astype(np.float64, copy=False)

    chosen = choose(there, scalars, partial(numbers, part=slice(0, BLOCK_ROWS)), options, name, holds=listed, mark=mark)
    columns = list(chosen.columns.values())
    rows = columns[0].rows

    def read(start: int, stop: int) -> NDArray[np.float64]:
        return np.stack([numbers(column, slice(start, stop)) for column in columns], axis=1)

    def place(share: float) -> Block:
        start = round(share * max(0, rows - BLOCK_ROWS))
        return rows_block(read(start, min(rows, start + BLOCK_ROWS)), start)

    return Source(
        format=format,
        name=name,
        columns=tuple(chosen.columns),
        blocks=lambda: _blocks(read, rows),
        stated=chosen.stated,
        usual=chosen.usual,
        clock=chosen.clock,
        questions=chosen.questions,
        parts=Parts(rows, exact=True, block=BLOCK_ROWS, read=place) if looked_into else None,
        read_as=told_of(chosen),
    )


def _blocks(read: Any, rows: int) -> Iterator[Block]:
    return blocks_of((read(start, start + BLOCK_ROWS) for start in range(0, rows, BLOCK_ROWS)), rows)


def _seconds(values: NDArray[Any], part: slice) -> NDArray[np.float64]:
    """Dates or times as seconds from the first one; NaN where there is none."""
    return (values[part] - values[0]) / np.timedelta64(1, "s")


def _size(shape: tuple[int, ...]) -> str:
    return "x".join(map(str, shape)) or "one number"
