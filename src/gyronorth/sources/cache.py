"""Where files from elsewhere lie while they are read: private folders, bounded, and gone when nobody reads them."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import IO, Any

from gyronorth.errors import InputError
from gyronorth.files import temporary_files_told
from gyronorth.readers.spool import MOST, RESERVE

#: How the names of the folders begin, and the file in each that its owner holds locked.
PREFIX, HELD = "gyronorth-url-", ".held"
#: Age, s, below which a folder is left alone.
NEW = 60.0


@contextmanager
def private_folder() -> Generator[Path]:
    """A folder for one file while the block runs; those that a killed process left go first."""
    with temporary_files_told():
        sweep()
        folder = tempfile.TemporaryDirectory(prefix=PREFIX)
    with folder as name, Path(name, HELD).open("w") as held:
        _lock(held)
        yield Path(name)


def room_for(size: int, folder: Path, what: str) -> None:
    """Refuse a file of `size` bytes, or of so many so far, that is too large for a recording or for the disk.

    Raises
    ------
    InputError
        If it is.
    """
    if size > MOST:
        raise InputError(f"{what} is larger than {MOST >> 30} GiB. Fetch it, and take a part of it with --window.")
    already = sum(file.stat().st_size for file in folder.iterdir())
    if shutil.disk_usage(folder).free + already - size < RESERVE:
        raise InputError(
            f"{what} does not fit on the disk: {size >> 20} MiB for {folder.parent}. Free some space there, or set "
            "TMPDIR to a folder on another disk."
        )


@cache
def sweep() -> None:
    """Remove the folders that nobody holds, where the system can tell; once in a process."""
    for folder in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
        with suppress(OSError):
            if time.time() - folder.stat().st_mtime < NEW:  # it may be about to be held
                continue
            with Path(folder, HELD).open("a") as held:
                if not _lock(held):
                    continue
            shutil.rmtree(folder, ignore_errors=True)


def _lock(file: IO[Any]) -> bool:
    """Hold a file until it is closed; False where another process does, or the system cannot tell."""
    try:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (ImportError, OSError):
        return False
    return True
