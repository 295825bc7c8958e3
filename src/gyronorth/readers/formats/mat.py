"""MATLAB files (.mat): one named array of samples x columns, and a map of its columns.

Versions 5 to 7 are read here; version 7.3 is HDF5 and goes to its reader.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.readers.budget import check_claim, open_apart
from gyronorth.readers.format import Format, format_info
from gyronorth.readers.formats.hdf5 import is_hdf5, open_hdf5
from gyronorth.readers.mat5 import MatError, Variable, is_level5, matrix, variables
from gyronorth.readers.options import ReadOptions, choose_columns
from gyronorth.readers.source import NAMES, TIME, Block, Clock, Facts, Source, blocks_of

#: Largest file and largest array read, bytes: an 8 h recording at 200 Hz with 16 columns has 0.7e9.
LARGEST = 1 << 30
_BLOCK_ROWS = 1 << 14


def open_mat(path: Path, options: ReadOptions) -> Source:
    """Open a MATLAB file."""
    if is_hdf5(path):
        with suppress(ImportError):  # the reader says that it is missing
            import_module("h5py")  # once, not in each child
        source = open_apart(lambda: open_hdf5(path, options), name=path.name, size=path.stat().st_size)
        return replace(source, format="mat")
    if path.stat().st_size > LARGEST:
        raise InputError(f"{path.name} is larger than {LARGEST >> 20} MiB; split it.")
    content = path.read_bytes()
    if not is_level5(content):
        raise InputError(
            f"{path.name} is not a MATLAB file of version 5 to 7.3: another version, damaged or cut off. Save it in "
            "MATLAB with: save(FILE, '-v7')."
        )
    try:
        found = variables(content)
        variable = _chosen(found, options.variable, path.name)
        positions = _positions(variable, options, path.name, len(content))
        data = matrix(content, variable)
    except MatError as error:
        raise InputError(f"{path.name} cannot be read, {error}: it is damaged or cut off.") from None
    columns = tuple(name for name in NAMES if name in positions)
    return Source(
        format="mat",
        name=path.name,
        columns=columns,
        blocks=partial(_blocks, data, [positions[name] for name in columns]),
        stated=Facts(),
        clock=Clock(unit=1.0, name=f"column {positions[TIME]}") if TIME in positions else None,
    )


def _chosen(found: dict[str, Variable], wanted: str | None, name: str) -> Variable:
    """The named array, or the only matrix of numbers that there is."""
    listed = ", ".join(f"{title} ({_size(variable)} {variable.kind})" for title, variable in list(found.items())[:8])
    if wanted is None:
        matrices = [variable for variable in found.values() if variable.numeric and min(variable.shape) > 1]
        if len(matrices) != 1:
            raise InputError(f"{name} holds {listed or 'no variable'}; say which one with --variable NAME.")
        return matrices[0]
    if wanted not in found:
        raise InputError(f"{name} has no variable {wanted!r}; it holds {listed or 'no variable'}.")
    return found[wanted]


def _positions(variable: Variable, options: ReadOptions, name: str, size: int) -> dict[str, int]:
    """Our columns by number, once the array in a file of `size` bytes is known to be samples x columns."""
    what = f"Variable {variable.name} of {name}"
    if not variable.numeric or len(variable.shape) != 2:
        raise InputError(
            f"{what} is a {_size(variable)} {variable.kind}; a matrix of numbers, samples x columns, is expected."
        )
    rows, columns = variable.shape
    if rows < columns:
        raise InputError(
            f"{what} has {rows} rows and {columns} columns; samples are expected to be its rows: transpose it."
        )
    check_claim(name, f"variable {variable.name}", 8 * rows * columns, size)
    if 8 * rows * columns > LARGEST:
        raise InputError(f"{what} has {rows} x {columns} numbers, more than {LARGEST >> 20} MiB; split it.")
    if not options.columns:
        raise InputError(
            f"{what} has {columns} columns without names. Say which one is which by its number from 0, as in "
            "--columns w_x=4,w_y=5,w_z=6,f_x=8,f_y=9,f_z=10."
        )
    return choose_columns(columns, options.columns, {}, f"variable {variable.name} of {name}")


def _size(variable: Variable) -> str:
    return "x".join(map(str, variable.shape))


def _blocks(data: NDArray[np.float64], positions: list[int]) -> Iterator[Block]:
    starts = range(0, len(data), _BLOCK_ROWS)
    return blocks_of((data[start : start + _BLOCK_ROWS, positions] for start in starts), len(data))


FORMAT = Format(format_info("mat"), open_mat, recognises=lambda head: head.startswith(b"MATLAB "))
