"""Recordings that the studies are run on: the published reconstruction, or public recordings that a user brings."""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.published import Twin, published_twin

if TYPE_CHECKING:
    from gyronorth.sources.listing import Item

_RECORDING = re.compile(r"x_\d+(?:\.\d+)?\.csv", re.IGNORECASE)
#: Rate of the studies, Hz: the paper's, from 600 Hz by averages of 200 samples, which keep the mean.
RATE = 3.0
#: Length of the windows of the paper, s.
WINDOW = 100.0


def recordings_of(seed: int, data: dict | None = None) -> Twin:
    """The reconstruction of a seed; with `data`, of `described`, the public recordings in that folder."""
    if data is None:
        return published_twin(rate_hz=RATE, rng=np.random.default_rng(seed))
    found = public_recordings(data["folder"])
    if _sha256(found) != data["sha256"]:
        raise InputError(f"The recordings in {data['folder']} have changed since the study began. Use another -o.")
    return found


def described(folder: str) -> dict:
    """Folder, checksum, sessions and files passed over of public recordings, as the argument of a unit of work."""
    found = public_set(folder)
    return {
        "folder": folder,
        "sha256": _sha256(found.recordings),
        "sessions": dict(Counter(found.sessions)),
        "passed_over": list(found.passed_over),
    }


def about(data: str | None) -> str:
    """Sentences of what the recordings of a study are: the beginning of its text."""
    if data is None:
        return "On the published reconstruction: its biases are real (the printed mean rates), its noise is simulated."
    found = described(data)
    count = sum(found["sessions"].values())
    sessions = ", ".join(f"{name} ({number})" for name, number in found["sessions"].items())
    duration = public_recordings(data).duration
    text = f"On the first {duration:.0f} s of the {count} recordings in {data}, of the folders {sessions}; "
    text += "biases and noise are theirs."
    if len(found["sessions"]) > 1:
        text += " Each folder is taken for a session of its own; splits draw from all of them."
    if found["passed_over"]:
        text += f" {passed_over_text(found['passed_over'])}"
    return text


def passed_over_text(names: list[str]) -> str:
    """The message about files that are no recordings."""
    return f"Passed over, being no recordings x_<degrees>.csv: {', '.join(names)}."


@dataclass(frozen=True)
class PublicSet:
    """Recordings of the published layout."""

    recordings: Twin
    sessions: tuple[str, ...]  # of each: the folder that it is in
    passed_over: tuple[str, ...]  # names of files x_* that are no recordings


def public_recordings(folder: str) -> Twin:
    """The recordings of `public_set`."""
    return public_set(folder).recordings


@lru_cache(maxsize=1)
def public_set(folder: str) -> PublicSet:
    """Levelled 3 Hz rates of the published layout (`x_<heading>.csv`), below `folder` at any depth.

    Only files x_<number>.csv are recordings; tables of results such as x_GC_MA.csv are passed over. All are cut to
    the shortest. Their noise is real; its size is taken from first differences.

    Raises
    ------
    InputError
        If there are no such files, or one has no reference heading, is shorter than a window of the studies, or holds
        the samples of another.
    """
    from gyronorth.attitude import level, mat_lb
    from gyronorth.conditioning import decimated
    from gyronorth.sources.listing import recordings
    from gyronorth.sources.reading import read_each

    named: list[Item] = []
    with suppress(InputError):  # what was expected is said below
        named = sorted(
            (item for item in recordings([folder]) if Path(item.address).name.lower().startswith("x_")),
            key=lambda item: Path(item.address),
        )
    items = [item for item in named if _RECORDING.fullmatch(Path(item.address).name)]
    if not items:
        raise InputError(
            f"{folder} holds no files x_<heading>.csv with a number for the heading. Give your clone of "
            "ansfl/Learning-Based-MEMS-Gyrocompassing or its folder data."
        )
    rates, headings = [], []
    for item, recording in zip(items, read_each(items), strict=True):
        if recording.heading_true is None:
            raise InputError(f"{item.address} has no reference heading; its name should be x_<degrees>.csv.")
        if recording.accel_b is not None:
            recording = recording.rotated(mat_lb(*level(recording.accel_b.mean(axis=0))))
        rates.append(decimated(recording, RATE).gyro_b)
        headings.append(recording.heading_true)
    _check_rates(rates, items)
    samples = min(len(rate) for rate in rates)
    gyro_l = np.stack([rate[:samples] for rate in rates])
    noise = np.sqrt(np.median(np.mean(np.diff(gyro_l, axis=1) ** 2, axis=1)) / 2)
    twin = Twin(gyro_l, np.array(headings), RATE, float(noise / np.sqrt(RATE)))
    others = tuple(Path(item.address).name for item in named if item not in items)
    return PublicSet(twin, tuple(Path(item.address).parent.name for item in items), others)


def _check_rates(rates: list[NDArray[np.float64]], items: list[Item]) -> None:
    """Refuse a recording too short for a window, and one that is there twice: a split would train on what it tests."""
    known: dict[bytes, Item] = {}
    for rate, item in zip(rates, items, strict=True):
        if len(rate) < WINDOW * RATE:
            raise InputError(
                f"{item.address} lasts {len(rate) / RATE:.1f} s; the studies need {WINDOW:g} s. Is it cut off, or its "
                "rate another one? Remove it, or bring it whole."
            )
        if (first := known.setdefault(rate.tobytes(), item)) is not item:
            raise InputError(
                f"{item.address} holds the same samples as {first.address}: a split would train on a recording that "
                "it tests. Remove one of them."
            )


def _sha256(recordings: Twin) -> str:
    digest = hashlib.sha256(np.ascontiguousarray(recordings.gyro_l).tobytes())
    digest.update(np.ascontiguousarray(recordings.heading_true).tobytes())
    return digest.hexdigest()
