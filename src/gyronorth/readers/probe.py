"""A look into a long file at evenly spread places, without reading what lies between."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.readers.grid import GridBuilder
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.reading import Reading, RecordingInfo, options_of
from gyronorth.readers.source import TIME, Block, Source
from gyronorth.readers.spool import is_stream
from gyronorth.recording import Gap, Note

#: Places that are read, and how many different ones there must be.
PLACES, FEWEST = 16, 8
#: A file of no more than so many times the rows of all places is read whole.
WHOLE = 4


@dataclass(frozen=True)
class Probe:
    """What was seen of a file: k places, body axes and SI."""

    info: RecordingInfo
    samples: NDArray[np.int64]  # (k,) that were read
    rate_mean: NDArray[np.float64]  # (k, 3) mean angular rate, rad/s
    force_mean: NDArray[np.float64] | None  # (k, 3) mean specific force, m/s^2
    rate_hz: NDArray[np.float64]  # (k,) sample rate by first and last time of a place; NaN where these do not tell
    gaps: tuple[Gap, ...]  # at the places, and those that the file states; from the start of the file
    rows: int  # in the file
    rows_known: bool  # else estimated
    span: float | None  # s from the first to the last time of the file; None where these do not tell
    rows_dropped: int  # before the file was written
    notes: tuple[Note, ...]


def probe(path: str | Path, options: ReadOptions | None = None, **declared: Any) -> Probe | None:
    """Look into a long file; None for a short one, a window, a pipe, and a format that can only be read as a whole.

    Raises
    ------
    InputError
        As for `read`, about what was read.
    """
    if is_stream(Path(path)):
        return None
    reading = Reading(path, options_of(options, declared), None)
    source, parts, stated = reading.source, reading.source.parts, reading.source.stated
    if parts is None or reading.options.window or parts.rows <= WHOLE * PLACES * parts.block:
        return None
    if parts.exact and stated.samples not in (None, parts.rows):
        raise InputError(f"{source.name} states {stated.samples} samples but has {parts.rows} rows.")
    try:
        at = [parts.read(share) for share in np.linspace(0, 1, PLACES)]
    except OSError as error:
        raise InputError(f"{source.name} cannot be read: {error}.") from None
    blocks = list({int(block.rows[0]): block for block in at if len(block.rows)}.values())
    if len(blocks) < FEWEST:  # large row groups, a topic of a small part of the time
        return None
    gyro, accel, gaps, jitter = [], [], list(stated.gaps), 0.0
    notes: tuple[Note, ...] = ()
    for block in blocks:
        if gyro:  # the first block settles the rate, against which the others are checked
            settled = replace(reading.declared, rate_hz=reading.rate_hz)
            reading.grid = GridBuilder(source, settled, reading.options)
        samples = np.concatenate([reading.grid.push(block), reading.grid.flush()])
        reading.grid.raise_bad()
        if reading.grid.rows_dropped:  # to be counted
            return None
        notes = notes if gyro else reading.check(samples)
        start = _seconds(block, source)[0] - _seconds(blocks[0], source)[0]
        gaps += [Gap(gap.start + start, gap.samples) for gap in reading.grid.gaps]
        jitter = max(jitter, reading.grid.jitter)
        rate, force = reading.in_body_axes(samples)
        gyro.append(rate)
        accel += [] if force is None else [force]
    reading.grid.jitter = jitter
    gaps = tuple(sorted(gaps, key=lambda gap: gap.start))
    return Probe(
        info=reading.info(notes),
        samples=np.array([len(samples) for samples in gyro]),
        rate_mean=np.array([samples.mean(axis=0) for samples in gyro]),
        force_mean=np.array([samples.mean(axis=0) for samples in accel]) if accel else None,
        rate_hz=np.array([_rate(len(samples), block, source) for samples, block in zip(gyro, blocks, strict=True)]),
        gaps=gaps,
        rows=stated.samples or parts.rows,
        rows_known=parts.exact or stated.samples is not None,
        span=_span(at[0], at[-1], source),
        rows_dropped=stated.rows_dropped,
        notes=(*notes, *reading.remarks(stated.samples or parts.rows, gaps, stated.rows_dropped)),
    )


def _seconds(block: Block, source: Source) -> NDArray[np.float64]:
    """Times of the first and the last row, s; NaN where the file has none, or where they start again from 0."""
    clock = source.clock
    if clock is None or clock.unit is None or clock.wrap is not None:
        return np.full(2, np.nan)
    return block.values[[0, -1], source.columns.index(TIME)] * clock.unit


def _rate(samples: int, block: Block, source: Source) -> float:
    first, last = _seconds(block, source)
    return (samples - 1) / (last - first) if last > first else np.nan


def _span(first: Block, last: Block, source: Source) -> float | None:
    if not (len(first.rows) and len(last.rows)):
        return None
    span = _seconds(last, source)[1] - _seconds(first, source)[0]
    return float(span) if np.isfinite(span) else None
