"""NumPy arrays: .npy files of anybody, and the same in an .npz archive. Pickled objects are refused, never loaded.

A matrix has columns by number, an array of records has them by the names of its fields; a field may hold a triple.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.readers.format import Format, format_info
from gyronorth.readers.held import NUMBERS, TIMES, held_source
from gyronorth.readers.library import errors_translated, pickled
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.source import Source

MAGIC = b"\x93NUMPY"
#: Name of the array in a file that holds one.
ARRAY = "array"
_HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}


def open_npy(path: Path, options: ReadOptions) -> Source:
    """Open a .npy file; it is mapped, not loaded."""
    with errors_translated(path.name, ".npy file"), path.open("rb") as file:
        shape, fortran, dtype = npy_header(file)
        offset = file.tell()
    if dtype.hasobject:
        raise InputError(pickled(path.name))
    if dtype.itemsize == 0:  # any number of them is no byte, and NumPy would make each one byte
        raise InputError(
            f"{path.name} holds an array {shape} of {dtype.str}; an array of numbers, samples x columns, is expected."
        )
    size = path.stat().st_size - offset
    if math.prod(shape) * dtype.itemsize != size:
        raise InputError(
            f"{path.name} claims an array {shape} of {dtype.itemsize} bytes each but holds {size} bytes: it is cut off "
            "or damaged."
        )
    values: NDArray[Any] = np.zeros(shape, dtype)
    if size:
        values = np.memmap(path, dtype, "r", offset, shape, "F" if fortran else "C")
    arrays = tables({ARRAY: values}, alone=True)
    shapes = {title: array.shape for title, array in arrays.items()}
    holds = f"an array {shape} of {dtype if dtype.names is None else 'records'}"
    return held_source("npy", path.name, arrays, shapes, options, holds=holds, looked_into=True)


def npy_header(file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, order and type in the header of a .npy file, which is then passed.

    Raises
    ------
    ValueError
        If it is no such header.
    """
    version = np.lib.format.read_magic(file)
    if version not in _HEADERS:
        raise ValueError(f"npy version {version}")
    return _HEADERS[version](file)


def tables(arrays: Mapping[str, NDArray[Any]], *, alone: bool = False) -> dict[str, NDArray[Any]]:
    """Arrays of numbers and of times; records become one array for each field, NAME.FIELD or, `alone`, FIELD."""
    found: dict[str, NDArray[Any]] = {}
    for title, array in arrays.items():
        if array.dtype.names is None:
            found[title] = array
            continue
        for field in array.dtype.names:
            found[field if alone else f"{title}.{field}"] = array[field]
    return {
        title: array
        for title, array in found.items()
        if array.dtype.kind in NUMBERS or (array.dtype.kind in TIMES and array.ndim == 1 and len(array))
    }


# In a process of its own: the map of a file that is cut short meanwhile kills the process that reads it.
FORMAT = Format(format_info("npy"), open_npy, recognises=lambda head: head.startswith(MAGIC), foreign=("numpy",))
