"""Functions that the tests of the studies give to workers: they must be importable there."""

from __future__ import annotations

import os
import time
from pathlib import Path


def square(*, value: int, seed: int = 0) -> dict:
    """A result at once."""
    return {"square": value * value}


def total(*needs: dict) -> dict:
    """Of the results of other units."""
    return {"total": sum(need["square"] for need in needs)}


def logged(*, value: int, log: str) -> dict:
    """A result, and a line in a log each time it is computed."""
    with open(log, "a") as stream:
        stream.write(f"{value}\n")
    return {"square": value * value}


def failing(*, value: int) -> dict:
    """Never a result."""
    raise RuntimeError(f"unit {value} failed")


def dying_once(*, value: int, mark: str) -> dict:
    """Kill the worker the first time, then give a result."""
    if not Path(mark).exists():
        Path(mark).write_text("died here")
        os.kill(os.getpid(), 9)
    return {"square": value * value}


def dying(*, value: int) -> dict:
    """Kill the worker each time."""
    os.kill(os.getpid(), 9)
    return {"square": value * value}


def slow(*, value: int, seconds: float) -> dict:
    """A result after a while."""
    time.sleep(seconds)
    return {"square": value * value}
