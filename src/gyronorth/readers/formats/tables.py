"""Tables of Arrow whose columns are no plain numbers: lists and structs of three, times as text; and Feather files.

A column of lists is a matrix, the fields of a struct are columns NAME.FIELD, and what they hold is then told as of any
other named arrays.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.readers.budget import check_claim
from gyronorth.readers.format import Format, format_info
from gyronorth.readers.held import held_source
from gyronorth.readers.library import check_whole, errors_translated, library
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.source import Source
from gyronorth.readers.titles import take_apart

MAGIC = b"ARROW1"
#: How a stream of Arrow begins (a continuation mark), and an ORC file.
STREAM, ORC = b"\xff\xff\xff\xff", b"ORC"
#: Columns have points and slashes in their names, which are no paths.
MARK = "$"
#: Most fields of a struct, and most values of a list: more is no triad.
MOST_PARTS = 16


def open_feather(path: Path, options: ReadOptions) -> Source:
    """Open a Feather file (version 2, an Arrow file), a stream of Arrow, or an ORC file."""
    with path.open("rb") as file:
        head = file.read(len(MAGIC))
    if head.startswith(ORC):
        orc = library("pyarrow.orc", path.name, "ORC")
        with errors_translated(path.name, "ORC file"):
            table = orc.read_table(str(path))
            check_claim(path.name, "its table", table.nbytes, path.stat().st_size)
        return table_source("feather", path.name, table, options)
    if head.startswith(STREAM):
        ipc = library("pyarrow.ipc", path.name, "Arrow")
        with errors_translated(path.name, "stream of Arrow"), ipc.open_stream(str(path)) as stream:
            table = stream.read_all()
            check_claim(path.name, "its table", table.nbytes, path.stat().st_size)
        return table_source("feather", path.name, table, options)
    check_whole(path, MAGIC, what="Feather", cut_off="its index, at the end, is missing.")
    feather = library("pyarrow.feather", path.name, "Feather")
    with errors_translated(path.name, "Feather file"):
        table = feather.read_table(str(path), memory_map=True, use_threads=False)
        check_claim(path.name, "its table", table.nbytes, path.stat().st_size)
    return table_source("feather", path.name, table, options)


def is_nested(schema: Any, name: str) -> bool:
    """Whether a table has columns of lists or structs, or a time that is text."""
    types = library("pyarrow.types", name, "Parquet")
    return any(
        types.is_nested(field.type) or (_is_text(types, field.type) and take_apart(field.name).kind == "time")
        for field in schema
    )


def table_source(format: str, name: str, table: Any, options: ReadOptions) -> Source:
    """The recording in a table that is in memory."""
    with errors_translated(name, "table"):
        arrays = dict(_arrays(table, name))
    shapes = {title: array.shape for title, array in arrays.items() if array.size}
    return held_source(format, name, arrays, shapes, options, mark=MARK)


def _arrays(table: Any, name: str) -> Iterator[tuple[str, NDArray[Any]]]:
    types = library("pyarrow.types", name, "Parquet")
    for title in table.column_names:
        column = table.column(title).combine_chunks()
        yield from _of_column(types, title, column, name)


def _of_column(types: Any, title: str, column: Any, name: str) -> Iterator[tuple[str, NDArray[Any]]]:
    """The arrays of numbers or times in a column; none of one of words."""
    kind = column.type
    if types.is_struct(kind) and kind.num_fields <= MOST_PARTS:
        for field in kind:
            yield from _of_column(types, f"{title}.{field.name}", column.field(field.name), name)
    elif types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind):
        parts = column.flatten()
        count = len(parts) // len(column) if len(column) else 0
        lengths = None if types.is_fixed_size_list(kind) else np.asarray(column.value_lengths())
        if column.null_count or (lengths is not None and not (lengths == count).all()):
            raise InputError(f"Column {title} of {name} holds lists of different lengths; three values are expected.")
        if 0 < count <= MOST_PARTS and _is_number(types, parts.type):
            yield title, np.asarray(parts.cast("float64")).reshape(-1, count)
    elif _is_number(types, kind):
        yield title, column.cast("float64", safe=False).to_numpy(zero_copy_only=False)
    elif types.is_timestamp(kind) or types.is_duration(kind):
        yield title, column.to_numpy(zero_copy_only=False)
    elif _is_text(types, kind) and take_apart(title).kind == "time":
        arrow = library("pyarrow", name, "Parquet")
        for target in (arrow.timestamp("ns"), arrow.timestamp("ns", "UTC")):
            with suppress(arrow.ArrowInvalid):
                yield title, column.cast(target).to_numpy(zero_copy_only=False)
                break


def _is_number(types: Any, kind: Any) -> bool:
    return types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind)


def _is_text(types: Any, kind: Any) -> bool:
    return types.is_string(kind) or types.is_large_string(kind)


FORMAT = Format(
    format_info("feather"),
    open_feather,
    recognises=lambda head: head.startswith((MAGIC, ORC)),
    foreign=("pyarrow.feather", "pyarrow.types"),
)
