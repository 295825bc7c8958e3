"""MATLAB files (.mat): arrays with names, alone or in structs; or a text with that suffix (`save -ascii`).

Versions 5 to 7 are read here; version 7.3 is HDF5 and goes to its reader, a text to that of texts.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.readers.budget import check_claim, open_apart
from gyronorth.readers.format import LOOK, Format, format_info
from gyronorth.readers.formats.csv import open_csv
from gyronorth.readers.formats.hdf5 import is_hdf5, open_hdf5
from gyronorth.readers.held import held_source
from gyronorth.readers.mat5 import OBJECT, MatError, Variable, fields, is_level5, matrix, objects_refused, variables
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.source import Source

#: Largest file and largest array read, bytes: an 8 h recording at 200 Hz with 16 columns has 0.7e9.
LARGEST = 1 << 30


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
        if _is_text(content[:LOOK]):
            return open_csv(path, options)
        raise InputError(
            f"{path.name} is not a MATLAB file of version 5 to 7.3: another version, damaged or cut off. Save it in "
            "MATLAB with: save(FILE, '-v7')."
        )
    try:
        return _source(content, options, path.name)
    except MatError as error:
        raise InputError(f"{path.name} cannot be read, {error}: it is damaged or cut off.") from None


def _source(content: bytes, options: ReadOptions, name: str) -> Source:
    found = variables(content)
    for variable in list(found.values()):
        if variable.kind == "struct" and _wanted(variable.name, options.variable):
            found |= fields(content, variable, most=LARGEST)
    listed = ", ".join(f"{title} ({_size(variable)} {variable.kind})" for title, variable in list(found.items())[:12])
    if options.variable is not None:
        _check_variable(found, options.variable, name, listed)
    shapes = {title: each.shape for title, each in found.items() if each.numeric and len(each.shape) == 2}
    objects = {title: each.kind.removeprefix(OBJECT).strip() for title, each in found.items() if OBJECT in each.kind}
    if objects and not any(math.prod(shape) > 1 for shape in shapes.values()):
        raise InputError(objects_refused(name, objects))
    arrays = [title for title, each in found.items() if each.kind == "struct" and math.prod(each.shape) > 1]
    if arrays and not any(math.prod(shape) > 1 for shape in shapes.values()):
        raise InputError(
            f"{name} holds {listed}: {arrays[0]} is a struct for each sample, which is not read. In MATLAB: "
            f"load('{name}'); writetable(struct2table({arrays[0]}), 'imu.csv'); then read imu.csv."
        )
    return held_source("mat", name, _Matrices(content, found, name), shapes, options, holds=listed)


class _Matrices(dict[str, NDArray[np.float64]]):
    """The arrays of a file by name, each decoded when it is first asked for."""

    def __init__(self, content: bytes, found: dict[str, Variable], name: str) -> None:
        super().__init__()
        self._content, self._found, self._name = content, found, name

    def __missing__(self, title: str) -> NDArray[np.float64]:
        variable = self._found[title]
        check_claim(self._name, f"variable {title}", 8 * math.prod(variable.shape), len(self._content))
        if 8 * math.prod(variable.shape) > LARGEST:
            raise InputError(
                f"Variable {title} of {self._name} is {_size(variable)}, more than {LARGEST >> 20} MiB; split it."
            )
        try:
            self[title] = matrix(self._content, variable)
        except MatError as error:
            raise InputError(f"Variable {title} of {self._name} cannot be read: {error}.") from None
        return self[title]


def _wanted(name: str, variable: str | None) -> bool:
    """Whether a struct may hold what is declared: a large one that does not is left packed."""
    return variable is None or variable.split(".")[0] == name


def _check_variable(found: dict[str, Variable], wanted: str, name: str, listed: str) -> None:
    inside = any(title.startswith(f"{wanted}.") for title in found)
    if wanted not in found and not inside:
        raise InputError(f"{name} has no variable {wanted!r}; it holds {listed or 'no variable'}.")
    variable = found.get(wanted)
    if variable is not None and not inside and not (variable.numeric and len(variable.shape) == 2):
        raise InputError(
            f"Variable {wanted} of {name} is a {_size(variable)} {variable.kind}; a matrix of numbers, samples x "
            "columns, is expected."
        )


def _size(variable: Variable) -> str:
    return "x".join(map(str, variable.shape))


def _is_text(head: bytes) -> bool:
    """Whether a file of this suffix is one of numbers as text: digits, signs and white space, mostly."""
    numbers = sum(byte in b"0123456789+-.eE \t\r\n,;" for byte in head)
    return bool(head.strip()) and b"\x00" not in head and numbers > 0.9 * len(head)


FORMAT = Format(format_info("mat"), open_mat, recognises=lambda head: head.startswith(b"MATLAB "))
