"""Tables of many recordings, known from the files that they were made of: they may lie among them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gyronorth.errors import InputError

#: Columns behind those of every table.
STAMPS = ("checksum", "settings")


def is_table(path: Path) -> bool:
    """Whether a file is a table of many, of headings or of another task."""
    ends = b"," + ",".join(STAMPS).encode()
    try:
        if is_parquet(path):
            names = arrow(path).read_schema(path).names
            return names[:1] == ["file"] and tuple(names[-2:]) == STAMPS
        with path.open("rb") as file:
            return file.read(5) == b"file," and file.readline(4096).rstrip().endswith(ends)
    except (OSError, ValueError, InputError):
        return False


def is_parquet(path: Path) -> bool:
    """Whether a table is, or shall be, Parquet and not CSV."""
    return path.suffix.lower() in (".parquet", ".pq")


def arrow(path: Path) -> Any:
    """The module `pyarrow.parquet`.

    Raises
    ------
    InputError
        If it is not installed; `path` is what it was wanted for.
    """
    from gyronorth.readers.library import library

    return library("pyarrow.parquet", path.name, "Parquet")
