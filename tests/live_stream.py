"""Streams for tests of the live instrument: rows of a body at rest, and a source that plays what it is given."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from math import degrees
from pathlib import Path
from threading import Event

import numpy as np
from still import LATITUDE, SI, TITLES, rows_of, still

from gyronorth.live.events import Bytes, Connected, Emit, Ended, SourceEvent
from gyronorth.live.session import LiveSettings, Session
from gyronorth.readers import ReadOptions

RATE_HZ = 100.0
#: What a stream says before its rows.
HEAD = "".join(f"{line}\n" for line in (*SI, f"# latitude_deg: {degrees(LATITUDE)!r}")) + ",".join(TITLES) + "\n"


def timed_rows(times: np.ndarray, *, seed: int = 1) -> list[str]:
    """One row for each time, s."""
    return rows_of([times, *still(len(times), seed=seed)])


def seconds(start: float, end: float) -> np.ndarray:
    """Times at `RATE_HZ`."""
    return np.arange(round(start * RATE_HZ), round(end * RATE_HZ)) / RATE_HZ


class Played:
    """A source that hands over events; a number among them is a pause in s, a function is called."""

    name, live = "played", True

    def __init__(self, *events: SourceEvent | str | Sequence[str] | float | Callable[[], object]) -> None:
        self._events = events

    def run(self, emit: Emit, stop: Event) -> None:
        emit(Connected())
        for event in self._events:
            if isinstance(event, (int, float)):
                time.sleep(event)
            elif callable(event):
                event()
            else:
                emit(event if isinstance(event, SourceEvent) else Bytes("".join(event).encode()))
        emit(Ended())


def session_of(*events, save: Path | None = None, **settings) -> Session:
    """A session that has come to the end of its source; by `mean`, the cheapest method, where none is named."""
    settings = {"reading": ReadOptions(), "method": "mean"} | settings
    session = Session(Played(*events), LiveSettings(save=save, **settings))
    session.start()
    assert session.ended.wait(300)
    session.close()
    return session


def rows_in(*paths: Path) -> list[str]:
    """The rows of recordings, one file behind the other."""
    text = "".join(path.read_text() for path in paths)
    return [line for line in text.splitlines(keepends=True) if line[0] in "-.0123456789"]
