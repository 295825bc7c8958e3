"""Parquet files: columns as in a CSV, facts in the key-value metadata of the schema; row groups stream."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.readers.budget import check_claim
from gyronorth.readers.facts import KEYS, read_facts
from gyronorth.readers.format import Format, format_info
from gyronorth.readers.library import check_whole, errors_translated, library
from gyronorth.readers.options import OUR_TITLES, ReadOptions, choose_columns
from gyronorth.readers.source import (
    FORCES,
    NAMES,
    RATES,
    TIME,
    Block,
    Clock,
    Facts,
    Parts,
    Source,
    blocks_of,
    rows_block,
)

if TYPE_CHECKING:
    from gyronorth.readers.columns import Chosen
    from gyronorth.readers.layout import TextLayout
    from gyronorth.readers.outgoing import RecordingStream
    from gyronorth.readers.times import ClockColumns

#: Rows per block that is read, and per row group that is written.
BLOCK_ROWS, GROUP_ROWS = 1 << 14, 1 << 17
_MAGIC = b"PAR1"


def open_parquet(path: Path, options: ReadOptions) -> Source:
    """Open a Parquet file."""
    check_whole(
        path,
        _MAGIC,
        what="Parquet",
        cut_off="a Parquet file ends in its index, which is missing. Write or copy it again.",
    )
    with _opened(path) as file:
        schema = file.schema_arrow
        starts = np.cumsum([0] + [file.metadata.row_group(i).num_rows for i in range(file.metadata.num_row_groups)])
        stored = file.metadata.metadata or {}
        texts = {key: stored[key.encode()].decode("utf-8", "replace") for key in KEYS if key.encode() in stored}
        if not texts:
            from gyronorth.readers.formats.tables import is_nested, table_source

            if is_nested(schema, path.name):
                claimed = sum(file.metadata.row_group(i).total_byte_size for i in range(file.metadata.num_row_groups))
                check_claim(path.name, "its row groups", claimed, path.stat().st_size)
                return table_source("parquet", path.name, file.read(use_threads=False), options)
    facts, ours = read_facts(texts, lambda key: f"Metadata {key} of {path.name}")
    titles = tuple(schema.names)
    named = None if ours else _by_titles(path, schema, options)
    wanted = ({} if named is None else named[0].columns) | dict(options.columns or {})
    found = choose_columns(list(titles), wanted, OUR_TITLES if ours else {}, path.name, needed=options.needed)
    columns = {name: found[name] for name in NAMES if name in found}
    units = {name: _unit(schema.field(position).type, name, path.name) for name, position in columns.items()}
    zero = _first_count(path, columns[TIME]) if units.get(TIME) is not None else 0
    reading = partial(_batches, path, list(columns.values()), list(units.values()), zero)
    clock = Clock(unit=1.0, name=titles[columns[TIME]]) if TIME in columns else None
    told: dict[str, Any] = {"stated": facts, "clock": clock, "ours": ours}
    if named is not None:
        typed = clock if units.get(TIME) is not None else None
        told, parts = _told_by_titles(path.name, named, columns, titles, facts, typed, options)
        reading = reading if parts is None else _put_together(path, columns, parts)
    return Source(
        format="parquet",
        name=path.name,
        columns=tuple(columns),
        blocks=partial(_blocks, reading, int(starts[-1])),
        parts=Parts(int(starts[-1]), exact=True, block=BLOCK_ROWS, read=partial(_part, reading, starts)),
        **told,
    )


def _by_titles(path: Path, schema: Any, options: ReadOptions) -> tuple[Chosen, TextLayout]:
    """The columns by the table of titles that texts have, and the first rows."""
    from gyronorth.readers.arrays import COMPARED, first_rows
    from gyronorth.readers.columns import by_numbers_of_titles, by_titles, without_sign
    from gyronorth.readers.titles import take_apart

    with _opened(path) as file:
        batch = next(file.iter_batches(batch_size=COMPARED), None)
        values = [
            _numbers(batch.column(i), seconds, 0)
            if batch is not None and (seconds := _seconds(field.type, path.name)) != 0
            else np.full(1, np.nan)
            for i, field in enumerate(schema)
        ]
    first = first_rows(tuple(schema.names), values)
    types = library("pyarrow.types", path.name, "Parquet")
    # Dates and times are read as seconds, whatever their titles say.
    parts = [take_apart(field.name, "s" if types.is_timestamp(field.type) else "") for field in schema]
    chosen = without_sign(by_titles(first, parts, options, None), path.name)
    open_ = not any(ours in chosen.columns or ours in (options.columns or ()) for ours in options.needed)
    return (by_numbers_of_titles(first, options, path.name) or chosen) if open_ else chosen, first


def _told_by_titles(
    name: str,
    named: tuple[Chosen, TextLayout],
    columns: dict[str, int],
    titles: tuple[str, ...],
    facts: Facts,
    typed: Clock | None,
    options: ReadOptions,
) -> tuple[dict[str, Any], ClockColumns | None]:
    """What titles and steps say of the recording, and of which columns its time consists; None for one column.

    `typed` is the clock where the type of its column says that it holds times.
    """
    from gyronorth.readers.columns import told
    from gyronorth.readers.formats.csv import with_titles
    from gyronorth.readers.text_clock import FoundClock, find_clock
    from gyronorth.readers.titles import take_apart

    (chosen, first), clock = named, None
    if typed is not None:
        clock = FoundClock(typed, None, columns[TIME], f"{typed.name} (by its type)")
    elif TIME in columns:
        parts = [take_apart(title) for title in titles]
        clock = find_clock(first, parts, columns[TIME], options.time_unit, options.rate_hz or facts.rate_hz)
    facts = with_titles(facts, chosen, first, clock, name)
    units = {"gyro": options.gyro_unit or facts.gyro_unit or "unit open",
             "accel": options.accel_unit or facts.accel_unit or "unit open"}  # fmt: skip
    found = {
        "stated": facts,
        "clock": None if clock is None else clock.clock,
        "questions": (*chosen.questions, *([clock.question] if clock is not None and clock.question else [])),
        "read_as": told(columns, titles, units, clock.told if clock else ""),
    }
    return found, None if clock is None else clock.columns


def write_parquet(outgoing: RecordingStream, path: Path) -> None:
    """Write a recording as a Parquet file."""
    arrow, parquet = library("pyarrow", path.name, "Parquet"), library("pyarrow.parquet", path.name, "Parquet")
    names = (TIME, *RATES, *(FORCES if outgoing.has_accel else ()))
    schema = arrow.schema([(name, arrow.float64()) for name in names])
    # Random numbers: a dictionary or a codec finds nothing in them.
    how = {"compression": "none", "use_dictionary": False, "write_page_checksum": True}
    with parquet.ParquetWriter(str(path), schema, **how) as writer:
        held: list[NDArray[np.float64]] = []
        for rows in outgoing.rows():
            parts = [(rows.numbers() / outgoing.rate_hz)[:, None], rows.gyro_b]
            held.append(np.hstack(parts + ([] if rows.accel_b is None else [rows.accel_b])))
            if sum(map(len, held)) >= GROUP_ROWS:
                _write_group(arrow, writer, schema, held)
        if held:
            _write_group(arrow, writer, schema, held)
        writer.add_key_value_metadata(outgoing.texts())


def _write_group(arrow: Any, writer: Any, schema: Any, held: list[NDArray[np.float64]]) -> None:
    table = np.concatenate(held)
    held.clear()
    columns = [arrow.array(np.ascontiguousarray(column)) for column in table.T]
    writer.write_table(arrow.Table.from_arrays(columns, schema=schema), row_group_size=len(table))


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    parquet = library("pyarrow.parquet", path.name, "Parquet")
    with (
        errors_translated(path.name, "Parquet file"),
        parquet.ParquetFile(str(path), page_checksum_verification=True) as file,
    ):
        yield file


def _unit(kind: Any, name: str, file: str) -> float | None:
    """Seconds in one unit of a column of dates or times; None for plain numbers."""
    seconds = _seconds(kind, file)
    if seconds is None or (seconds and name == TIME):
        return seconds
    cure = " Leave it out and declare the rate: --columns t=- --rate HZ." if name == TIME else ""
    raise InputError(f"Column {name} of {file} holds {kind}; numbers are expected.{cure}")


def _seconds(kind: Any, file: str) -> float | None:
    """None for plain numbers, seconds in one unit of dates or times, 0 for what is neither."""
    types = library("pyarrow.types", file, "Parquet")
    if types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind):
        return None
    if types.is_timestamp(kind) or types.is_duration(kind):
        return {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[kind.unit]
    return 0.0


def _first_count(path: Path, position: int) -> int:
    """The first value of a column of dates or times, in its unit."""
    with _opened(path) as file:
        batch = next(file.iter_batches(batch_size=1, columns=[file.schema_arrow.names[position]]), None)
        first = None if batch is None or len(batch) == 0 else batch.column(0).cast("int64")[0].as_py()
    if first is None:
        raise InputError(f"{path.name} holds no rows, or its first time is empty.")
    return int(first)


def _batches(
    path: Path, positions: list[int], units: list[float | None], zero: int, groups: list[int] | None
) -> Iterator[NDArray[np.float64]]:
    """Numbers of the chosen columns, shape (m, k), of all row groups or of some."""
    with _opened(path) as file:
        names = [file.schema_arrow.names[position] for position in positions]
        how = {"batch_size": BLOCK_ROWS, "columns": names, "use_threads": False}
        # Group by group: all at once, the library keeps the bytes of the whole file until the last row.
        numbers = range(file.metadata.num_row_groups) if groups is None else groups
        for batch in (batch for number in numbers for batch in file.iter_batches(row_groups=[number], **how)):
            columns = [_numbers(batch.column(name), unit, zero) for name, unit in zip(names, units, strict=True)]
            yield np.stack(columns, axis=1)


def _put_together(path: Path, columns: dict[str, int], parts: ClockColumns) -> partial[Iterator[NDArray[np.float64]]]:
    """Reads numbers whose first columns are one time: seconds and nanoseconds, week and seconds of it."""
    positions = [*parts.positions, *(position for name, position in columns.items() if name != TIME)]
    return partial(_summed, partial(_batches, path, positions, [None] * len(positions), 0), parts.factors)


def _summed(
    reading: Callable[[list[int] | None], Iterator[NDArray[np.float64]]],
    factors: tuple[float, ...],
    groups: list[int] | None,
) -> Iterator[NDArray[np.float64]]:
    count = len(factors)
    for values in reading(groups):
        yield np.column_stack([values[:, :count] @ np.array(factors), values[:, count:]])


def _numbers(column: Any, unit: float | None, zero: int) -> NDArray[np.float64]:
    """A column as doubles, a null as NaN; dates and times in seconds from the count `zero` on.

    By DLPack: `to_numpy` of the library loads pandas where that is installed, half a second.
    """
    wanted = "double" if unit is None else "int64"
    # A cast, even one to the same type, loads the compute functions of the library: as long as all else of it.
    stored = column if str(column.type) == wanted else column.cast(wanted, safe=False)
    counts: NDArray[Any] = np.from_dlpack(stored.fill_null(0) if column.null_count else stored)
    numbers = counts if unit is None else (counts - zero) * unit
    if column.null_count == 0:
        return numbers
    return np.where(np.from_dlpack(column.is_null().cast("uint8")) == 1, np.nan, numbers)


def _blocks(reading: partial[Iterator[NDArray[np.float64]]], rows: int) -> Iterator[Block]:
    return blocks_of(reading(None), rows)


def _part(reading: partial[Iterator[NDArray[np.float64]]], starts: NDArray[np.int64], share: float) -> Block:
    """A block of rows from the row group at a share of the file; 1: the last rows."""
    group = min(int(np.searchsorted(starts, share * starts[-1], side="right")) - 1, len(starts) - 2)
    row, last = int(starts[group]), None
    for values in reading([group]):
        if share < 1:
            return rows_block(values, row)
        row, last = row + len(values), values
    if last is None:
        raise InputError("an empty row group")
    return rows_block(last, row - len(last))


FORMAT = Format(
    format_info("parquet"),
    open_parquet,
    recognises=lambda head: head.startswith(b"PAR1"),
    write=write_parquet,
    foreign=("pyarrow.parquet", "pyarrow.types"),
)
