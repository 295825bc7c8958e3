"""Output files appear whole or not at all: written beside their place, then renamed into it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
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
