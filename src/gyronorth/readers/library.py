"""Libraries of the extras for files: imported by the reader that needs one, their errors turned into one message."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gyronorth.errors import InputError


def library(module: str, file: str, format: str, extra: str = "io") -> Any:
    """A module of an extra.

    Raises
    ------
    InputError
        If it is not installed, with the extra that brings it; or cannot be loaded.
    """
    package = module.partition(".")[0]
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError:
        raise InputError(
            f"{file}: {format} needs {package}, which is not installed. Install it with: pip install "
            f"'gyronorth[{extra}]'."
        ) from None
    except ImportError as error:
        raise InputError(
            f"{file}: {package} is installed but cannot be loaded ({' '.join(str(error).split())[:160]}): there is too "
            "little memory, or its installation is damaged."
        ) from None


@contextmanager
def errors_translated(name: str, what: str, cure: str = "") -> Iterator[None]:
    """Turn whatever a library raises on a damaged file, almost any exception, into one message."""
    try:
        yield
    except InputError:
        raise
    except MemoryError:
        raise InputError(
            f"{name} asks for more memory than there is for it: it is damaged, or made to exhaust its reader. Or this "
            "process may use too little (`ulimit -v`, a container): then allow it more."
        ) from None
    except Exception as error:
        detail = " ".join(str(error).split())[:160] or type(error).__name__
        raise InputError(
            f"{name} cannot be read ({detail}): it is damaged, cut off, or no {what}.{f' {cure}' if cure else ''}"
        ) from None


def check_whole(path: Path, magic: bytes, *, what: str, cut_off: str) -> None:
    """Tell a cut file of a format that begins and ends with the same bytes from a foreign one.

    Raises
    ------
    InputError
        If it does not begin with `magic`, or does not end with it: then with `cut_off`, which says what is missing.
    """
    with path.open("rb") as file:
        head = file.read(len(magic))
        file.seek(max(0, path.stat().st_size - len(magic)))
        tail = file.read()
    if head != magic:
        raise InputError(f"{path.name} is no {what} file: it does not begin as one.")
    if tail != magic or path.stat().st_size < 2 * len(magic):
        raise InputError(f"{path.name} is cut off: {cut_off}")


def pickled(name: str) -> str:
    """What there is to say of pickled objects."""
    return (
        f"{name} holds pickled Python objects, which may run any program when they are loaded; they are never loaded "
        "here. Save the numbers alone, in Python: numpy.savez('out.npz', t=t, gyro=gyro, accel=accel)."
    )
