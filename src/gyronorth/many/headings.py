"""The heading of each of many recordings: what is asked of them, and what became of one."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gyronorth.errors import InputError, is_of_memory
from gyronorth.frozen import frozen
from gyronorth.given import checked_path, numbers, of_kind
from gyronorth.report.tables import Outcome
from gyronorth.sources.listing import Item, recordings
from gyronorth.sources.remote import NotFetched, at_hand, checksum_of, state_of

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from gyronorth.deviation import DeviationModel
    from gyronorth.estimate import HeadingEstimate
    from gyronorth.readers import ReadOptions
    from gyronorth.recording import Recording
    from gyronorth.sensor import Sensor

#: Settings in rad, given in degrees in the table.
_ANGLES = ("latitude", "boresight", "attitude", "turn_angles", "turn_angle_sigma", "require_sigma")


@frozen
class Request:
    """What is asked of every recording; SI units and radians."""

    reading: ReadOptions
    sensor: Sensor | None = None
    method: str = "auto"
    gyro_bias: tuple[float, float, float] | None = None  # rad/s, body axes
    attitude: tuple[float, float] | None = None  # roll, pitch, rad
    model: Path | None = None  # bundle
    turn_angles: tuple[float, ...] | None = None  # rad
    deviation: DeviationModel | None = None
    require_sigma: float | None = None  # rad
    turn_angle_sigma: float | None = None  # rad

    def read(self, path: Path, progress: Callable[[float], None] | None = None) -> Recording:
        """The recording, less its known bias."""
        from gyronorth import readers

        return self.unbiased(readers.read(path, self.reading, progress=progress))

    def unbiased(self, recording: Recording) -> Recording:
        """A recording, less its known bias."""
        return recording if self.gyro_bias is None else recording.without_bias(self.gyro_bias)

    def heading(self, recording: Recording | list[Recording]) -> HeadingEstimate:
        """What the pipeline finds."""
        from gyronorth import pipeline

        return pipeline.heading(
            recording,
            latitude=self.reading.latitude,
            sensor=self.sensor,
            method=self.method,
            model=self.model,
            attitude=self.attitude,
            turn_angles=self.turn_angles,
            turn_angle_sigma=self.turn_angle_sigma,
            deviation=self.deviation,
            require_sigma=self.require_sigma,
        )

    def settings(self, **more: Any) -> str:
        """All that decides the headings of given files, as one JSON object: what is not as by default.

        A profile, a curve and a bundle stand there with a checksum of their content.
        """
        from importlib.metadata import version

        found = (
            {"gyronorth": version("gyronorth"), "method": self.method} | given_of(self) | given_of(self.reading) | more
        )
        return json.dumps({name: found[name] for name in sorted(found)})


@frozen
class HeadingTask:
    """The heading of each recording, or of each of its windows."""

    request: Request
    windows: tuple[float, float] | None = None  # length and step, s: a heading for every window

    def found(self, name: str, path: Path) -> list[Outcome]:
        """The outcomes of a file."""
        if self.windows is not None:
            from gyronorth.many.windows import window_outcomes

            return window_outcomes(self.request, name, path, self.windows)
        recording = self.request.read(path)
        return [Outcome(name, self.request.heading(recording), heading_true=recording.heading_true)]

    def failed(self, name: str, message: str) -> Outcome:
        """What stands for a file of which nothing could be had."""
        return Outcome(name, message=message)

    def settings(self) -> str:
        """All that decides the headings, see `Request.settings`."""
        return self.request.settings(**({} if self.windows is None else {"windows_s": self.windows}))


@frozen
class Work:
    """What a worker does with each recording."""

    task: Any  # `HeadingTask`, or one of `gyronorth.many.tasks`
    settings: str = ""
    checksums: bool = True  # whether the outcome carries one

    def outcomes(self, item: Item, known: str = "") -> list[Any]:
        """What became of a recording, whatever that is; nothing where its checksum is `known`, which is done."""
        checksum = state_of(item.address) if self.checksums else ""
        if known and checksum == known:
            return []
        found: list[Any] = []
        try:
            with at_hand(item.address) as path:
                if self.checksums and not checksum:
                    checksum = checksum_of(path)
                    if known and checksum == known:
                        return []
                found = self.task.found(item.name, path)
        except Exception as error:
            transient = isinstance(error, OSError | NotFetched) or is_of_memory(error)
            found = [self.task.failed(item.name, told(error))]
            checksum = "" if transient else checksum
        return [outcome.stamped(checksum, self.settings) for outcome in found]


def told(error: Exception) -> str:
    """What the row of a recording says of an exception."""
    if isinstance(error, InputError | OSError):
        return str(error)
    if is_of_memory(error):
        said = f": {error}" if str(error) else ""
        return f"There is not enough memory{said}. Read a part of it with --window, or take fewer --workers."
    fault = f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
    return f"a fault of gyronorth, please report it: {fault}"


def heading_many(
    sources: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
    reading: ReadOptions | None = None,
    *,
    executor: Executor | None = None,
    latitude: float | None = None,
    sensor: Sensor | str | None = None,
    method: str = "auto",
    model: str | Path | None = None,
    attitude: tuple[float, float] | None = None,
    turn_angles: tuple[float, ...] | None = None,
    deviation: DeviationModel | None = None,
    windows: tuple[float, float] | None = None,
) -> Iterator[Outcome]:
    """Headings of many recordings, as they are found; a recording that cannot be read is one of the results.

    Parameters
    ----------
    sources : str, path, or iterable of these
        Files, folders, patterns such as `data/**/*.csv`, URLs (extra `cloud`), lists as `@files.txt`.
    reading : ReadOptions, optional
        What the files do not say about themselves.
    executor : concurrent.futures.Executor, optional
        Who does the work: a process pool or Dask's `client.get_executor()`. Without one it is done here.
    latitude : float, optional
        Geodetic latitude, rad, in place of that of `reading`.
    sensor, method, model, attitude, turn_angles, deviation
        As in `heading`.
    windows : tuple of float, optional
        Length and step, s: a heading of every window of each recording in place of one of the whole. A file is read
        once and never held whole.

    Yields
    ------
    Outcome
        `file`, `estimate` (None where the recording could not be read; `message` says why), `heading_true` (rad),
        `checksum`, `settings` and `window` (s). Without an executor in the order of the sources; with one in the
        order in which they are finished. The windows of one recording come together, in order of time.

    Raises
    ------
    InputError
        If a folder holds no recording, nothing matches a pattern, or an option is not one of the choices.
    """
    from dataclasses import replace

    from gyronorth.readers import ReadOptions
    from gyronorth.sensor import read_sensor

    reading = ReadOptions() if reading is None else reading
    of_kind("reading", reading, ReadOptions, "ReadOptions")
    if latitude is not None:
        reading = replace(reading, latitude=latitude)
    if windows is not None:
        lengths = numbers("windows", windows, "(2,)")
        if lengths.shape != (2,) or not ((lengths > 0) & np.isfinite(lengths)).all():
            raise InputError(f"windows is {windows!r:.80}; length and step, two positive times in s, are expected.")
    profile = None if sensor is None else read_sensor(sensor)
    request = Request(
        reading,
        profile,
        method,
        None,
        attitude,
        None if model is None else checked_path("model", model),
        turn_angles,
        deviation,
    )
    task = HeadingTask(request, windows)
    one = isinstance(sources, str | os.PathLike)
    of_kind("sources", sources, (str, os.PathLike, Iterable), "a path, or several")
    named: list[Any] = [sources] if one else list(sources)  # type: ignore[arg-type]
    for each in named:
        checked_path("One of sources", each)
    items = recordings(named)
    work = Work(task, task.settings())
    return (outcome for _, found in outcomes_of(items, work, executor) for outcome in found)


def outcomes_of(
    items: Iterable[Item], work: Work, executor: Executor | None = None, known: Mapping[str, str] | None = None
) -> Iterator[tuple[Item, list[Any]]]:
    """The outcomes of each item, as `each` finds them.

    Parameters
    ----------
    items : iterable of Item
        Recordings.
    work : Work
        What is done with each.
    executor : Executor, optional
        Who does it.
    known : mapping, optional
        Name -> checksum of those that are done: where it still holds, their outcomes are an empty list.
    """
    from gyronorth.many.running import WorkerLost, each

    pairs = ((item, (known or {}).get(item.name, "")) for item in items)
    for (item, _), found in each(partial(_outcomes, work), pairs, executor):
        if isinstance(found, Exception):
            lost = str(found) if isinstance(found, WorkerLost) else told(found)
            found = [work.task.failed(item.name, lost).stamped("", work.settings)]
        yield item, found


def _outcomes(work: Work, pair: tuple[Item, str]) -> list[Any]:
    return work.outcomes(*pair)


def given_of(settings: Any) -> dict[str, Any]:
    """Fields of a dataclass that are not as by default, by name, as values of JSON."""
    found = {}
    for field in fields(settings):
        value = getattr(settings, field.name)
        if value == field.default or field.name in ("reading", "method", "force"):
            continue
        if field.name in _ANGLES:
            found[f"{field.name}_deg"] = [degrees(a) for a in value] if isinstance(value, tuple) else degrees(value)
        else:
            found[field.name] = _plain(value)
    return found


def _plain(value: Any) -> Any:
    """A setting as a value of JSON; what is too long for that as its checksum."""
    import hashlib

    if isinstance(value, Path):
        return f"{value.name} {checksum_of(value)[:23]}" if value.exists() else str(value)
    if is_dataclass(value):
        import sys

        import numpy as np

        with np.printoptions(threshold=sys.maxsize, precision=17):
            digest = hashlib.sha256(repr(value).encode()).hexdigest()
        return f"{getattr(value, 'name', '')} sha256:{digest[:16]}".strip()
    if isinstance(value, Mapping):
        return dict(value)
    return list(value) if isinstance(value, tuple) else value
