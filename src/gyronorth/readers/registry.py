"""Which reader opens which file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from gyronorth.readers.delimited import open_csv
from gyronorth.readers.mat import open_mat
from gyronorth.readers.mt_manager import open_mt_manager
from gyronorth.readers.npz import open_npz
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.psins import open_psins
from gyronorth.readers.source import Source
from gyronorth.recording import InputError

#: Every format by name: what opens it.
FORMATS: dict[str, Callable[[Path, ReadOptions], Source]] = {
    "csv": open_csv,
    "psins": open_psins,
    "mt-manager": open_mt_manager,
    "mat": open_mat,
    "npz": open_npz,
}
#: Suffixes that say the format; .txt and others are looked into.
SUFFIXES = {".csv": "csv", ".imu": "psins", ".mat": "mat", ".npz": "npz"}


def open_source(path: str | Path, options: ReadOptions) -> Source:
    """Open a recording with the reader of its format.

    Raises
    ------
    InputError
        If there is no such file, or its content is not what its format promises.
    """
    path = Path(path)
    try:
        if path.is_dir():
            raise InputError(f"{path} is a folder; a file is expected.")
        if path.stat().st_size == 0:
            raise InputError(f"{path.name} is empty.")
        name = options.format or SUFFIXES.get(path.suffix.lower()) or _sniffed(path)
        if name not in FORMATS:
            raise InputError(f"format is {name!r}; one of {', '.join(FORMATS)} is expected.")
        if options.variable is not None and name != "mat":
            raise InputError(f"variable {options.variable!r} is declared, but {path.name} is no .mat file.")
        return FORMATS[name](path, options)
    except FileNotFoundError:
        raise InputError(f"There is no file {path}.") from None
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path} cannot be read: {error}.") from None


def recordings_in(folder: str | Path) -> list[Path]:
    """The recordings in a folder and the folders below it, by name.

    Everything with a known suffix counts, and each .txt that is an export of MT Manager;
    hidden files and folders do not.

    Raises
    ------
    InputError
        If it is no folder, or holds no recording.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder.")
    found = []
    for path in folder.rglob("*"):
        hidden = any(part.startswith(".") for part in path.relative_to(folder).parts)
        if hidden or not path.is_file():
            continue
        known = path.suffix.lower() in SUFFIXES
        if known or (path.suffix.lower() == ".txt" and _head(path).startswith(b"//")):
            found.append(path)
    if not found:
        raise InputError(f"{folder} holds no recordings (files in {', '.join(SUFFIXES)} or MT Manager .txt).")
    return sorted(found, key=_natural)


def _natural(path: Path) -> tuple[object, ...]:
    """x_8.0.csv before x_15.0.csv: runs of digits count as numbers."""
    import re

    return tuple((int(part), part) if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", str(path)) if part)


def _sniffed(path: Path) -> str:
    """The format that the content of a file shows; CSV if it shows none."""
    head = _head(path)
    if head.startswith(b"PK\x03\x04"):
        return "npz"
    if head.startswith((b"MATLAB ", b"\x89HDF")):
        return "mat"
    if b"PSINS" in head:
        return "psins"
    if head.startswith(b"//") or b"PacketCounter\t" in head:
        return "mt-manager"
    return "csv"


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(4096)
