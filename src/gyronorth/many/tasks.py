"""What `info`, `allan` and `convert` do with each of many recordings, and what became of one."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, urlsplit

from gyronorth.errors import InputError
from gyronorth.many.headings import given_of
from gyronorth.sources.remote import is_url

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gyronorth.readers import ReadOptions
    from gyronorth.recording import Recording
    from gyronorth.sensor import Sensor
    from gyronorth.sources.listing import Item

#: Columns of the tables; a field without a value is empty.
INFO_COLUMNS = (
    *("file", "format", "rate_hz", "samples", "duration_s", "gyro_unit", "accel_unit", "axes", "axes_origin"),
    *("latitude_deg", "heading_true_deg", "session", "start_time_utc", "rate_norm_deg_h", "gaps", "samples_missing"),
    *("rows_dropped", "notes", "message"),
)
ALLAN_BEFORE, ALLAN_BEHIND = ("file", "duration_s", "rate_hz"), ("notes", "message")
CONVERT_COLUMNS = ("file", "output", "samples", "rate_hz", "duration_s", "message")


@dataclass(frozen=True)
class FileOutcome:
    """What became of one file: cells of its row and a document, or the message why there are none."""

    file: str
    cells: Mapping[str, Any] = field(default_factory=dict)
    facts: Mapping[str, Any] | None = None  # for JSON; None where it failed
    message: str = ""
    checksum: str = ""
    settings: str = ""
    window: None = None

    def stamped(self, checksum: str, settings: str) -> FileOutcome:
        """The same with what tells later whether it still holds."""
        return replace(self, checksum=checksum, settings=settings)

    def row(self) -> dict[str, Any]:
        """One row of the table."""
        return {**self.cells, "file": self.file, "message": self.message}

    def document(self) -> dict[str, Any]:
        """One object of the JSON array."""
        return {"file": self.file, "error": self.message or None, **(self.facts or {})}


class _Task:
    """What all of them have: a file that failed is a row."""

    def failed(self, name: str, message: str) -> FileOutcome:
        """What stands for a file of which nothing could be had."""
        return FileOutcome(name, message=message)

    def settings(self) -> str:
        """All that decides the rows, as one JSON object: what is not as by default."""
        from importlib.metadata import version

        found = {"gyronorth": version("gyronorth")} | given_of(self) | given_of(self.reading)  # type: ignore[attr-defined]
        return json.dumps({name: found[name] for name in sorted(found)})


@dataclass(frozen=True)
class InfoTask(_Task):
    """What each recording holds."""

    reading: ReadOptions

    def found(self, name: str, path: Path) -> list[FileOutcome]:
        """The description of a file."""
        from gyronorth import readers

        facts = readers.describe(path, self.reading).to_json()
        cells = {column: facts.get(column) for column in INFO_COLUMNS} | {
            "gaps": len(facts["gaps"]),
            "samples_missing": sum(gap["samples"] for gap in facts["gaps"]),
            "notes": ";".join(note["code"] for note in facts["notes"]),
        }
        return [FileOutcome(name, cells, facts)]


@dataclass(frozen=True)
class AllanTask(_Task):
    """The error terms of the sensor of each recording."""

    reading: ReadOptions
    sensor: Sensor | None = None

    def found(self, name: str, path: Path) -> list[FileOutcome]:
        """The figures of the three axes as one; empty where a recording bounds but does not show a term."""
        from gyronorth import readers
        from gyronorth.allan import axes_in_files, characterise

        _, chunks = readers.read_chunks(path, self.reading)
        with axes_in_files(chunks) as recording:
            facts = characterise(recording, base=self.sensor).to_json()
        cells = {column: facts.get(column) for column in ALLAN_BEFORE} | {"notes": "; ".join(facts["notes"])}
        for triad in ("gyro", "accel"):
            for key, term in (facts[triad] or {"triad": {}})["triad"].items():
                if isinstance(term, dict):
                    cells[f"{triad}_{key}"] = term["value"]
        return [FileOutcome(name, cells, facts)]


def allan_columns() -> tuple[str, ...]:
    """Columns of the table of error terms, in the units of sensor profiles."""
    from gyronorth.sensor.terms import TERMS

    gyro, accel = (f"gyro_{term.gyro.key}" for term in TERMS), (f"accel_{term.accel.key}" for term in TERMS)
    return (*ALLAN_BEFORE, *gyro, *accel, *ALLAN_BEHIND)


@dataclass(frozen=True)
class ConvertTask(_Task):
    """Each recording rewritten."""

    reading: ReadOptions
    output: str  # with a star, which stands for the name of the recording
    decimate_to: float | None = None  # Hz
    force: bool = False  # whether a file that is there is overwritten

    def target(self, name: str) -> Path:
        """The file that is made of a recording."""
        path = PurePosixPath(unquote(urlsplit(name).path) if is_url(name) else name)
        inner = path.name if is_url(name) or path.is_absolute() or ".." in path.parts else str(path)
        return Path(self.output.replace("*", str(PurePosixPath(inner).with_suffix(""))))

    def check(self, items: Sequence[Item]) -> None:
        """Refuse, before any work, files of which two would go to one place, or that would be overwritten.

        Raises
        ------
        InputError
            Naming the first of them.
        """
        taken = {os.path.realpath(item.address): item.name for item in items if not is_url(item.address)}
        for item in items:
            target = self.target(item.name)
            other = taken.setdefault(place := os.path.realpath(target), item.name)
            if not is_url(item.address) and place == os.path.realpath(item.address):
                raise InputError(f"{item.name} would be written over itself, to {target}. Choose another -o.")
            if other != item.name:
                raise InputError(
                    f"{item.name} would be written to {target}, and so is {other}. Convert them apart, each with an -o "
                    "of its own."
                )
            if target.is_file() and not self.force:
                raise InputError(f"{target} exists. Give another -o, or --force to overwrite such files.")

    def found(self, name: str, path: Path) -> list[FileOutcome]:
        """Write the file."""
        from gyronorth import readers
        from gyronorth.conditioning import decimated_chunks

        target = self.target(name)
        target.parent.mkdir(parents=True, exist_ok=True)
        _, chunks = readers.read_chunks(path, self.reading)
        if self.decimate_to is not None:
            chunks = decimated_chunks(chunks, self.decimate_to)
        counted = _Counted(chunks)
        readers.write_chunks(counted, target)
        cells = {"output": str(target), "samples": counted.samples, "rate_hz": counted.rate_hz}
        cells["duration_s"] = counted.samples / counted.rate_hz
        return [FileOutcome(name, cells, cells)]


class _Counted:
    """Chunks that pass, and how many samples they had."""

    def __init__(self, chunks: Iterator[Recording]) -> None:
        self._chunks, self.samples, self.rate_hz = chunks, 0, 1.0

    def __iter__(self) -> Iterator[Recording]:
        for chunk in self._chunks:
            self.samples += len(chunk.gyro_b)
            self.rate_hz = chunk.rate_hz
            yield chunk
