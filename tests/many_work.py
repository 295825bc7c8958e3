"""Functions that the tests of many recordings give to workers: they must be importable there."""

from __future__ import annotations

import os
import time
from pathlib import Path


def doubled(value: int) -> int:
    """A result at once; an exception for 3."""
    if value == 3:
        raise ValueError("three")
    return 2 * value


def deadly(value: int) -> int:
    """Kill the worker for 5, each time."""
    if value == 5:
        os.kill(os.getpid(), 9)
    return 2 * value


def written_after(folder: Path, seconds: float) -> None:
    """Say that it has begun, and after a while that it is done."""
    (folder / "begun").write_text(str(os.getpid()))
    time.sleep(seconds)
    (folder / "done").touch()
