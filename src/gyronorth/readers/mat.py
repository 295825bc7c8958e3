"""MATLAB files (.mat up to version 7): one named array of samples x columns, and a map of its columns."""

from __future__ import annotations

import struct
import warnings
import zlib
from collections.abc import Iterator
from functools import partial
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gyronorth.readers.options import ReadOptions, choose_columns
from gyronorth.readers.source import NAMES, TIME, Bad, Block, Clock, Facts, Source
from gyronorth.recording import InputError

#: Largest file and largest array read, bytes: an 8 h recording at 200 Hz with 16 columns has 0.7e9.
LARGEST_FILE = LARGEST_ARRAY = 1 << 30
#: Deflate packs at most 1032 bytes into one (zlib's technical details); more is a damaged size field.
DEFLATE_RATIO = 1032
_NUMERIC = {"double", "single", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"}
_BLOCK_ROWS = 1 << 14
#: What scipy.io and zlib raise on damaged files, found by feeding them 100,000 of them.
_DAMAGE = (
    ValueError, TypeError, KeyError, IndexError, OverflowError, AttributeError, EOFError, OSError, MemoryError,
    AssertionError, struct.error, zlib.error,
)  # fmt: skip


def open_mat(path: Path, options: ReadOptions) -> Source:
    """Open a MATLAB file."""
    if path.stat().st_size > LARGEST_FILE:
        raise InputError(f"{path.name} is larger than {LARGEST_FILE >> 20} MiB; split it.")
    content = path.read_bytes()
    shapes = _shapes(content, path.name)
    variable = options.variable or _only_matrix(shapes, path.name)
    if variable not in shapes:
        raise InputError(f"{path.name} has no variable {variable!r}; it holds {_listed(shapes)}.")
    shape, kind = shapes[variable]
    _check_shape(path.name, variable, shape, kind, len(content))
    if not options.columns:
        raise InputError(
            f"Variable {variable} of {path.name} has {shape[1]} columns without names. Say which one is which by "
            "its number from 0, as in --columns w_x=4,w_y=5,w_z=6,f_x=8,f_y=9,f_z=10."
        )
    where = f"variable {variable} of {path.name}"
    found = choose_columns(shape[1], options.columns, {}, where)
    data = _load(content, variable, path.name)
    if data.shape != shape or data.dtype.kind not in "fiu":
        raise InputError(
            f"Variable {variable} of {path.name} is not the {shape} array of numbers that it claims to be."
        )
    columns = tuple(name for name in NAMES if name in found)
    return Source(
        format="mat",
        name=path.name,
        columns=columns,
        blocks=partial(_blocks, data, [found[name] for name in columns]),
        stated=Facts(),
        clock=Clock(unit=1.0, name=f"column {found[TIME]}") if TIME in found else None,
    )


def _shapes(content: bytes, name: str) -> dict[str, tuple[tuple[int, ...], str]]:
    """Shape and class of every variable, without loading any."""
    from scipy.io import whosmat

    if content[:8] == b"\x89HDF\r\n\x1a\n" or content[:20] == b"MATLAB 7.3 MAT-file ":
        raise InputError(f"{name} is a MATLAB 7.3 file (HDF5). Save it in MATLAB with: save(FILE, '-v7').")
    try:
        with warnings.catch_warnings(action="ignore"):
            return {title: (tuple(shape), kind) for title, shape, kind in whosmat(BytesIO(content))}
    except NotImplementedError:
        raise InputError(f"{name} is a MATLAB 7.3 file (HDF5). Save it in MATLAB with: save(FILE, '-v7').") from None
    except _DAMAGE as error:
        raise _damaged(name, error) from None


def _load(content: bytes, variable: str, name: str) -> NDArray[np.float64]:
    from scipy.io import loadmat

    try:
        with warnings.catch_warnings(action="ignore"):  # what is unreadable comes as a string: checked by the caller
            return np.asarray(loadmat(BytesIO(content), variable_names=[variable])[variable])
    except (*_DAMAGE, NotImplementedError) as error:
        raise _damaged(name, error) from None


def _damaged(name: str, error: Exception) -> InputError:
    detail = " ".join(str(error).split())[:100] or type(error).__name__
    return InputError(f"{name} cannot be read as a MATLAB file ({detail}): it is damaged, cut off, or another format.")


def _only_matrix(shapes: dict[str, tuple[tuple[int, ...], str]], name: str) -> str:
    matrices = [
        title for title, (shape, kind) in shapes.items() if kind in _NUMERIC and len(shape) == 2 and min(shape) > 1
    ]
    if len(matrices) != 1:
        raise InputError(f"{name} holds {_listed(shapes)}; say which one with --variable NAME.")
    return matrices[0]


def _listed(shapes: dict[str, tuple[tuple[int, ...], str]]) -> str:
    titles = [f"{title} ({'x'.join(map(str, shape))} {kind})" for title, (shape, kind) in shapes.items()]
    return ", ".join(titles[:8]) + (", ..." if len(titles) > 8 else "") if titles else "no variable"


def _check_shape(name: str, variable: str, shape: tuple[int, ...], kind: str, file_bytes: int) -> None:
    if kind not in _NUMERIC or len(shape) != 2:
        raise InputError(
            f"Variable {variable} of {name} is a {'x'.join(map(str, shape))} {kind}; "
            "a matrix of numbers, samples x columns, is expected."
        )
    if shape[0] < shape[1]:
        raise InputError(
            f"Variable {variable} of {name} has {shape[0]} rows and {shape[1]} columns; "
            "samples are expected to be its rows: transpose it."
        )
    claimed = shape[0] * shape[1] * 8
    if claimed > min(LARGEST_ARRAY, 8 * DEFLATE_RATIO * file_bytes):
        raise InputError(
            f"Variable {variable} of {name} claims {shape[0]} x {shape[1]} numbers, which a file of {file_bytes} bytes "
            f"cannot hold or which exceed {LARGEST_ARRAY >> 20} MiB: the file is damaged, or split it."
        )


def _blocks(data: NDArray[np.float64], positions: list[int]) -> Iterator[Block]:
    for start in range(0, len(data), _BLOCK_ROWS):
        values = data[start : start + _BLOCK_ROWS, positions].astype(float)
        yield Block(values, np.arange(start + 1, start + 1 + len(values)), Bad.none())
