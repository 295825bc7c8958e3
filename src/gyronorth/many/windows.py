"""Headings of every window of a recording, which is read once and of which one window is held."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gyronorth.errors import InputError
from gyronorth.findings import Finding
from gyronorth.readers.gaps import judged_in_parts
from gyronorth.recording import Gap, Recording, gap_notes
from gyronorth.report.tables import Outcome

if TYPE_CHECKING:
    from gyronorth.many.headings import Request

#: Samples that are read at once.
CHUNK_SAMPLES = 1 << 16


def window_outcomes(request: Request, name: str, path: Path, windows: tuple[float, float]) -> list[Outcome]:
    """The heading of every whole window of a file, in order of time.

    Parameters
    ----------
    request : Request
        What is asked of each window.
    name : str
        Of the file, in the outcomes.
    path : Path
        The file.
    windows : tuple of float
        Length and step, s.

    Returns
    -------
    list of Outcome
        A window that has no heading says why; the others go on. Where the file is damaged behind some windows, the
        last outcome tells of it and has no window.

    Raises
    ------
    InputError
        If the file cannot be read, or is shorter than one window.
    """
    found: list[Outcome] = []
    try:
        for outcome in _windows(request, name, path, windows):
            found.append(outcome)
    except InputError as error:
        if not found:
            raise
        found.append(Outcome(name, message=f"{error} The windows above are those before it was found."))
    return found


def _windows(request: Request, name: str, path: Path, windows: tuple[float, float]) -> Iterator[Outcome]:
    """The outcomes of the windows, until the reader complains."""
    from gyronorth import readers

    length, step = windows
    _, chunks = readers.read_chunks(path, request.reading, chunk_samples=CHUNK_SAMPLES, keep_gaps=True)
    before = request.reading.window[0] if request.reading.window else 0.0
    found = duration = 0.0
    for start, recording in _cut(map(request.unbiased, chunks), length, step):
        if recording.duration < length - 1.5 / recording.rate_hz:  # what is left at the end
            duration = start + recording.duration
            continue
        place = (before + start, before + start + recording.duration)
        found += 1
        try:
            judged_in_parts(recording.gaps, samples=len(recording.gyro_b), rate_hz=recording.rate_hz)
            outcome = Outcome(name, request.heading(recording), heading_true=recording.heading_true)
        except InputError as error:
            outcome = Outcome(name, message=str(error))
        yield replace(outcome, window=place)
    if not found:
        raise InputError(
            f"{path.name} lasts {duration:g} s, less than one window of {length:g} s. Give a shorter --windows."
        )


def _cut(chunks: Iterator[Recording], length: float, step: float) -> Iterator[tuple[float, Recording]]:
    """Start, s, and recording of each window; the last one may be short."""
    held: deque[Recording] = deque()
    first = count = number = 0  # sample number of the first held, how many are held, window
    rate_hz = 1.0
    for chunk in chunks:
        rate_hz = chunk.rate_hz
        held.append(chunk)
        count += len(chunk.gyro_b)
        size = _samples(length, step, rate_hz)
        while True:
            start = round(number * step * rate_hz)
            while held and start >= first + len(held[0].gyro_b):  # a step may pass over whole chunks
                gone = len(held.popleft().gyro_b)
                first, count = first + gone, count - gone
            if start + size > first + count:
                break
            yield start / rate_hz, _joined(held, start - first, start - first + size)
            number += 1
    if held and number == 0:
        yield 0.0, _joined(held, 0, count)


def _samples(length: float, step: float, rate_hz: float) -> int:
    size = round(length * rate_hz)
    if step * rate_hz < 1 - 1e-9:
        raise InputError(
            f"A step of {step:g} s is less than a sample at {rate_hz:g} Hz: windows would repeat. Give a longer STEP."
        )
    if size < 1:
        raise InputError(f"A window of {length:g} s holds no sample at {rate_hz:g} Hz. Give longer --windows.")
    return size


def _joined(held: deque[Recording], first: int, last: int) -> Recording:
    """The samples [first, last) of consecutive recordings as one."""
    parts: list[Recording] = []
    gaps: list[Gap] = []
    notes: dict[str, Finding] = {}
    start = 0  # of this chunk
    for chunk in held:
        low, high = max(first - start, 0), min(last - start, len(chunk.gyro_b))
        if low < high:
            part = chunk.window(low / chunk.rate_hz, high / chunk.rate_hz)
            shift = (start + low - first) / chunk.rate_hz
            gaps += [Gap(gap.start + shift, gap.samples) for gap in part.gaps]
            notes |= {note.code: note for note in part.notes if note.code != "gaps_bridged"}
            parts.append(part)
        start += len(chunk.gyro_b)
    accel = None if parts[0].accel_b is None else np.concatenate([p.accel_b for p in parts if p.accel_b is not None])
    merged = _merged(gaps, parts[0].rate_hz)
    return replace(
        parts[0],
        gyro_b=np.concatenate([part.gyro_b for part in parts]),
        accel_b=accel,
        rows_dropped=sum(part.rows_dropped for part in parts),
        gaps=merged,
        notes=(*notes.values(), *gap_notes(merged, samples=last - first)),
    )


def _merged(gaps: list[Gap], rate_hz: float) -> tuple[Gap, ...]:
    """A gap that was cut where one chunk ends and the next begins is one gap."""
    merged: list[Gap] = []
    for gap in gaps:
        if merged and round((gap.start - merged[-1].start) * rate_hz) == merged[-1].samples:
            last = merged.pop()
            gap = Gap(last.start, last.samples + gap.samples)
        merged.append(gap)
    return tuple(merged)
