"""Outputs appear whole or not at all: written beside their place, then renamed into it; no empty folder is left."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def written_beside(path: Path) -> Iterator[Path]:
    """A temporary path in the folder of `path`, renamed to it when the block ends well.

    If the block fails, the temporary file goes and whatever stood at `path` stays. Devices
    and pipes (/dev/stdout) cannot be renamed over and are written directly.
    """
    if path.exists() and not path.is_file():
        yield path
        return
    path = path.resolve()  # a symbolic link keeps pointing where it did
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield part
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def no_empty_folder(folder: Path) -> Iterator[None]:
    """If the block fails and `folder` was made within it and is still empty, it goes, with its parents made for it."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        yield
    except BaseException:
        with suppress(OSError):  # the first that holds something, or was not made, ends it
            for path in missing:
                path.rmdir()
        raise
