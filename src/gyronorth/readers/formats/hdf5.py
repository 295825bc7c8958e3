"""HDF5 files (.h5, .hdf5), and MATLAB files of version 7.3, which are HDF5.

Ours: datasets `t` (n,), `gyro` (n, 3) and `accel` (n, 3), attributes of the file with the keys and
texts of the CSV's comment lines. Other files: as `gyronorth.readers.arrays` says. MATLAB stores its
matrices transposed; they are turned back.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.readers.array_groups import of_groups
from gyronorth.readers.arrays import Column, choose, columns_of, told_of
from gyronorth.readers.facts import KEYS, read_facts
from gyronorth.readers.format import Format, format_info
from gyronorth.readers.library import errors_translated, library
from gyronorth.readers.mat5 import DEFLATE_RATIO, objects_refused
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.outgoing import RecordingStream
from gyronorth.readers.source import TIME, Block, Parts, Source, blocks_of, rows_block

#: Where the signature may stand: at the start, or behind a block of the user's (MATLAB's text).
SIGNATURE_OFFSETS = (0, 512, 1024, 2048)
SIGNATURE = b"\x89HDF\r\n\x1a\n"
#: Rows per block that is read, and per chunk that is written.
BLOCK_ROWS, CHUNK_ROWS = 1 << 14, 1 << 12
_GYRO, _ACCEL = "gyro", "accel"
#: Attributes of a dataset that state its unit, as NetCDF has them and as people write them.
UNIT_ATTRIBUTES = ("units", "unit", "Units", "Unit", "UNITS", "UNIT")
#: Objects looked at, single numbers among them, and bytes of one chunk: more is no recording.
MOST_OBJECTS, MOST_SINGLE, LARGEST_CHUNK = 10_000, 100, 1 << 28


def is_hdf5(path: Path) -> bool:
    """Whether a file has HDF5's signature."""
    with path.open("rb") as file:
        head = file.read(SIGNATURE_OFFSETS[-1] + len(SIGNATURE))
    return any(head[offset : offset + len(SIGNATURE)] == SIGNATURE for offset in SIGNATURE_OFFSETS)


def open_hdf5(path: Path, options: ReadOptions) -> Source:
    """Open an HDF5 file."""
    if not is_hdf5(path):
        raise InputError(f"{path.name} is no HDF5 file: it does not begin as one.")
    with _opened(path) as file:
        there, singles, matlab, objects = _columns(file)
        texts = {key: _text(file.attrs[key]) for key in KEYS if key in file.attrs}
    if objects and not there:
        raise InputError(objects_refused(path.name, objects))
    if not there:
        raise InputError(f"{path.name} holds no dataset of numbers with one or two dimensions; no recording is in it.")
    facts, ours = read_facts(texts, lambda key: f"Attribute {key} of {path.name}")
    if ours:
        options = replace(options, time_unit=options.time_unit or "s")
    if (pair := of_groups(there, options, "/", partial(open_hdf5, path))) is not None:
        return pair
    holds = ", ".join(list(dict.fromkeys(f"{column.array} ({column.rows} rows)" for column in there.values()))[:12])
    look = partial(_look, path)
    chosen = choose(there, singles, look, options, path.name, holds=holds, mark="/")
    columns = chosen.columns
    count = columns[options.needed[0]].rows
    found = chosen.stated
    facts = replace(
        facts,
        rate_hz=facts.rate_hz or found.rate_hz,
        gyro_unit=facts.gyro_unit or found.gyro_unit,
        accel_unit=facts.accel_unit or found.accel_unit,
        increments=found.increments,
    )
    _check_size(path, list(columns.values()), count)
    reading = partial(_rows, path, list(columns.values()))
    return Source(
        format="hdf5",
        name=path.name,
        columns=tuple(columns),
        blocks=partial(_blocks, reading, count),
        stated=facts,
        usual=chosen.usual,
        clock=chosen.clock,
        questions=chosen.questions,
        ours=ours,
        read_as=told_of(chosen, turned=not matlab),
        parts=Parts(count, exact=True, block=BLOCK_ROWS, read=partial(_part, reading, count)),
    )


def write_hdf5(outgoing: RecordingStream, path: Path) -> None:
    """Write a recording as an HDF5 file."""
    h5py = library("h5py", path.name, "HDF5")
    shapes = {TIME: (), _GYRO: (3,)} | ({_ACCEL: (3,)} if outgoing.has_accel else {})
    with _Written(path) as written, h5py.File(written, "w") as file:
        datasets = {
            name: file.create_dataset(
                name, (0, *shape), "f8", maxshape=(None, *shape), chunks=(CHUNK_ROWS, *shape), fletcher32=True
            )
            for name, shape in shapes.items()
        }
        for rows in outgoing.rows():
            if written.failed is not None:
                break
            values = {TIME: rows.numbers() / outgoing.rate_hz, _GYRO: rows.gyro_b, _ACCEL: rows.accel_b}
            for name, dataset in datasets.items():
                dataset.resize(rows.first + len(rows.gyro_b), axis=0)
                dataset[rows.first :] = values[name]
        for key, text in outgoing.texts().items():
            file.attrs[key] = text


class _Written(io.FileIO):
    """A file that takes what finds no room on the disk, and says so at its end.

    HDF5 does not bear that a write fails: it tries again when it closes the file, and at the end, and crashes there.
    So nothing that happens here reaches it, Ctrl-C neither.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path, "w+")
        self.failed: BaseException | None = None

    def write(self, content: Any, /) -> int:
        """Write all, or nothing any more."""
        with memoryview(content).cast("B") as rest:
            done, size = 0, rest.nbytes
            try:
                while self.failed is None and done < size:
                    done += super().write(rest[done:])
            except BaseException as error:
                self.failed = error
            return size

    def readinto(self, buffer: Any, /) -> int:
        """Read; what was not written is zero."""
        with memoryview(buffer).cast("B") as into:
            got = super().readinto(into)
            if self.failed is not None:
                into[got:] = bytes(into.nbytes - got)
                return into.nbytes
            return got

    def truncate(self, size: int | None = None, /) -> int:
        """Change the length."""
        try:
            return super().truncate(size)
        except BaseException as error:
            self.failed = self.failed or error
            return size or 0

    def __exit__(self, *_: object) -> None:
        self.close()
        if self.failed is not None:
            raise self.failed


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    h5py = library("h5py", path.name, "HDF5")
    with errors_translated(path.name, "HDF5 file"), h5py.File(path, "r") as file:
        yield file


def _columns(file: Any) -> tuple[dict[str, Column], dict[str, float], bool, dict[str, str]]:
    """Every column of numbers by its name, single numbers, whether MATLAB wrote the file, and its objects."""
    h5py = library("h5py", file.filename, "HDF5")
    columns: dict[str, Column] = {}
    singles: dict[str, float] = {}
    objects: dict[str, str] = {}
    seen, matlab = 0, False

    def visit(name: str, item: Any) -> bool | None:
        nonlocal seen, matlab
        seen += 1
        if name.startswith("#"):  # what MATLAB keeps of its objects and cells, without names
            return seen >= MOST_OBJECTS or None
        if "MATLAB_object_decode" in item.attrs:
            objects[name] = _text(item.attrs.get("MATLAB_class", "object"))
            return None
        if isinstance(item, h5py.Dataset) and item.shape is not None and not _is_odd(item):
            matlab |= "MATLAB_class" in item.attrs
            if item.size == 1 and item.dtype.kind in "fiu" and len(singles) < MOST_SINGLE:
                singles[name] = float(np.asarray(item[()]).reshape(-1)[0])
            elif item.size != 1:
                columns.update(_of_dataset(name, item))
        return seen >= MOST_OBJECTS or None  # anything but None ends the visit

    file.visititems(visit)
    return columns, singles, matlab, objects


def _is_odd(dataset: Any) -> bool:
    return dataset.is_virtual or dataset.external or (dataset.chunks and _chunk_bytes(dataset) > LARGEST_CHUNK)


def _of_dataset(name: str, dataset: Any) -> dict[str, Column]:
    fields = dataset.dtype.names
    if fields and len(dataset.shape) == 1:
        return columns_of(name, dataset.shape, [field for field in fields if dataset.dtype[field].kind in "fiu"])
    if dataset.dtype.kind not in "fiu":
        return {}
    stated = next((_text(dataset.attrs[key]) for key in UNIT_ATTRIBUTES if key in dataset.attrs), "")
    unit = stated.split(" since ")[0].strip()  # of times in NetCDF: seconds since 1970-01-01
    found = columns_of(name, dataset.shape, turned="MATLAB_class" in dataset.attrs)
    return {title: replace(column, unit=unit) for title, column in found.items()} if unit else found


def _chunk_bytes(dataset: Any) -> int:
    return int(np.prod(dataset.chunks, dtype=float)) * dataset.dtype.itemsize


def _check_size(path: Path, columns: list[Column], rows: int) -> None:
    """No more rows than the file can hold: a damaged length would go on for ever."""
    if rows * len(columns) > DEFLATE_RATIO * path.stat().st_size:
        raise InputError(f"{path.name} claims {rows} rows, which it cannot hold: it is damaged.")


def _rows(path: Path, columns: list[Column], start: int, stop: int) -> Iterator[NDArray[np.float64]]:
    """Numbers of rows [start, stop), block after block, shape (m, k)."""
    with _opened(path) as file:
        for first in range(start, stop, BLOCK_ROWS):
            last = min(first + BLOCK_ROWS, stop)
            read = {name: _read(file[name], first, last, columns) for name in {column.array for column in columns}}
            yield np.stack([_picked(read[column.array], column) for column in columns], axis=1)


def _look(path: Path, column: Column) -> NDArray[np.float64]:
    """The first rows of a column."""
    with _opened(path) as file:
        return _picked(_read(file[column.array], 0, min(column.rows, BLOCK_ROWS), [column]), column)


def _read(dataset: Any, first: int, last: int, columns: list[Column]) -> NDArray[Any]:
    transposed = any(column.transposed for column in columns if column.array == dataset.name.strip("/"))
    return dataset[:, first:last].T if transposed else dataset[first:last]


def _picked(read: NDArray[Any], column: Column) -> NDArray[np.float64]:
    if column.part is None:
        return read.astype(np.float64, copy=False)
    picked = read[column.part] if isinstance(column.part, str) else read[:, column.part]
    return picked.astype(np.float64, copy=False)


def _blocks(reading: partial[Iterator[NDArray[np.float64]]], rows: int) -> Iterator[Block]:
    return blocks_of(reading(0, rows), rows)


def _part(reading: partial[Iterator[NDArray[np.float64]]], rows: int, share: float) -> Block:
    """A block of rows at a share of the file; 1: the last ones."""
    start = round(share * max(0, rows - BLOCK_ROWS))
    return rows_block(next(reading(start, min(rows, start + BLOCK_ROWS))), start)


def _text(value: Any) -> str:
    """An attribute as text: texts and numbers, alone or in an array of one; whatever else as it is shown."""
    value = np.asarray(value).item() if np.size(value) == 1 else value
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


FORMAT = Format(
    format_info("hdf5"),
    open_hdf5,
    recognises=lambda head: head.startswith(SIGNATURE),
    write=write_hdf5,
    foreign=("h5py",),
)
