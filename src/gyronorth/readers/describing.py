"""Content of a file, before any heading: a short file is read completely, a long one at some places."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gyronorth.angles import DEG_PER_HOUR
from gyronorth.earth import EARTH_RATE
from gyronorth.errors import InputError
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.probe import Probe, probe
from gyronorth.readers.reading import CHUNK_SAMPLES, Progress, Reading, RecordingInfo, chunks_of, options_of
from gyronorth.recording import Gap, Note


@dataclass(frozen=True)
class ProbeEstimate:
    """What a description is based on that did not read all of a file."""

    places: int  # blocks of samples read, evenly spread
    samples: int  # in these
    samples_known: bool  # whether the file's number of samples is known; else it is estimated
    rate_mean_sigma: tuple[float, float, float]  # of each axis' mean rate, by the scatter between the places, rad/s
    missing: float | None  # samples missing in all, by first and last time; None where these do not tell
    missing_sigma: float | None  # of `missing`, by the scatter of the sample interval between the places


@dataclass(frozen=True)
class ClockReport:
    """What the time stamps of a file show; counts of rows."""

    data: float  # s of samples that are not bridged
    lost: int  # samples missing between the rows, and bridged
    late: int  # stamps that are late by more than half an interval, though no sample is lost
    latest: float  # by how much the latest is, s
    repeated: int  # stamps that repeat the one before, with other values: taken as samples
    duplicated: int  # rows that repeat the one before, left out
    backwards: int  # rows whose stamp runs backwards or leaps ahead, left out
    wraps: tuple[str, ...]  # where the clock started again from 0 and was followed
    given_back: int  # bridged samples which later stamps show not to have been lost
    scatter: float  # root mean square of the steps about the interval, in intervals


@dataclass(frozen=True)
class Description:
    """A file and its means, body axes and SI."""

    info: RecordingInfo
    samples: int
    duration: float  # s
    rate_mean: tuple[float, float, float]  # mean angular rate, rad/s
    force_mean: tuple[float, float, float] | None  # mean specific force, m/s^2
    rows_dropped: int
    gaps: tuple[Gap, ...]  # with `estimate`: those that the file states and those at the places that were read
    notes: tuple[Note, ...]
    estimate: ProbeEstimate | None = None  # None: all of the file was read
    clock: ClockReport | None = None  # None without a time column, and where not all was read

    @property
    def rate_norm(self) -> float:
        """Norm of the mean angular rate, rad/s: Earth rate if the gyro were perfect and still."""
        return float(np.linalg.norm(self.rate_mean))

    def to_json(self) -> dict[str, Any]:
        """The same with angles in degrees, for printing; None where there is no value."""
        info = asdict(self.info)
        latitude, heading = info.pop("latitude"), info.pop("heading_true")
        info.pop("notes")
        read_as = info.pop("read_as")
        origin = info.pop("axes_origin")
        return info | {
            "latitude_deg": None if latitude is None else float(np.degrees(latitude)),
            "heading_true_deg": None if heading is None else float(np.degrees(heading)),
            "samples": self.samples,
            "duration_s": self.duration,
            "rate_mean_deg_h": [value / DEG_PER_HOUR for value in self.rate_mean],
            "rate_norm_deg_h": self.rate_norm / DEG_PER_HOUR,
            "rate_norm_earth_rates": self.rate_norm / EARTH_RATE,
            "force_mean_m_s2": None if self.force_mean is None else list(self.force_mean),
            "rows_dropped": self.rows_dropped,
            "gaps": [asdict(gap) for gap in self.gaps],
            "notes": [asdict(note) for note in self.notes],
            "estimated_from": None if self.estimate is None else _estimate_json(self.estimate),
            "read_as": read_as,
            "axes_origin": origin,
            "clock": None if self.clock is None else _clock_json(self.clock),
            "schema": "gyronorth.info/1",
        }


def describe(
    path: str | Path,
    options: ReadOptions | None = None,
    *,
    chunk_samples: int = CHUNK_SAMPLES,
    progress: Progress | None = None,
    **declared: Any,
) -> Description:
    """Describe a file; arguments and errors as for `read_chunks`.

    A long file is read at some places, unless what is there cannot be used as it stands: then
    all of it is read, chunk by chunk, as a short one is, and told from.
    """
    try:
        found = probe(path, options, **declared)
    except InputError:  # a bad row, a gap: the whole file gives the row and the count
        found = None
    if found is not None:
        return _estimated(found)
    reading = Reading(path, options_of(options, declared), progress)
    info, chunks = chunks_of(reading, chunk_samples)
    total, samples, dropped = np.zeros(6), 0, 0
    gaps: list[Gap] = []
    notes: dict[str, Note] = {}
    for chunk in chunks:
        total[:3] += chunk.gyro_b.sum(axis=0)
        total[3:] += chunk.accel_b.sum(axis=0) if chunk.accel_b is not None else np.nan
        gaps += [Gap(gap.start + samples / info.rate_hz, gap.samples) for gap in chunk.gaps]
        samples += len(chunk.gyro_b)
        dropped += chunk.rows_dropped
        notes |= {note.code: note for note in chunk.notes}
    mean = (total / samples).tolist()
    return Description(
        info=info,
        samples=samples,
        duration=samples / info.rate_hz,
        rate_mean=(mean[0], mean[1], mean[2]),
        force_mean=None if info.accel_unit is None else (mean[3], mean[4], mean[5]),
        rows_dropped=dropped,
        gaps=tuple(gaps),
        notes=tuple(notes.values()),
        clock=_clock(reading, samples - sum(gap.samples for gap in gaps)),
    )


def _clock(reading: Reading, kept: int) -> ClockReport | None:
    """The report of a file that was read to its end, with so many samples that are not bridged."""
    grid, counts = reading.grid, reading.grid.counts
    if reading.source.clock is None:
        return None
    return ClockReport(
        data=kept / reading.rate_hz,
        lost=grid.missing,
        late=counts.late,
        latest=counts.latest,
        repeated=counts.repeated,
        duplicated=counts.duplicated,
        backwards=counts.backwards,
        wraps=counts.wraps,
        given_back=counts.given_back,
        scatter=grid.jitter,
    )


def _clock_json(clock: ClockReport) -> dict[str, Any]:
    document = asdict(clock)
    return {
        "data_s": document.pop("data"),
        "latest_s": document.pop("latest"),
        "wraps": list(document.pop("wraps")),
        **document,
    }


def _estimated(seen: Probe) -> Description:
    """The description of a file that was read at some places."""
    weight = seen.samples / seen.samples.sum()
    rate = (weight @ seen.rate_mean).tolist()
    force = None if seen.force_mean is None else (weight @ seen.force_mean).tolist()
    sigma = (seen.rate_mean.std(axis=0, ddof=1) / np.sqrt(len(weight))).tolist()
    samples, missing, missing_sigma = seen.rows, None, None
    if seen.span is not None:
        on_grid = seen.span * seen.rate_hz.mean() + 1
        samples = seen.rows if seen.rows_known else round(on_grid)
        if seen.rows_known:
            missing = float(on_grid - seen.rows)
            missing_sigma = float(seen.span * seen.rate_hz.std(ddof=1) / np.sqrt(len(weight)))
    return Description(
        info=seen.info,
        samples=samples,
        duration=samples / seen.info.rate_hz,
        rate_mean=(rate[0], rate[1], rate[2]),
        force_mean=None if force is None else (force[0], force[1], force[2]),
        rows_dropped=seen.rows_dropped,
        gaps=seen.gaps,
        notes=seen.notes,
        estimate=ProbeEstimate(
            places=len(weight),
            samples=int(seen.samples.sum()),
            samples_known=seen.rows_known,
            rate_mean_sigma=(sigma[0], sigma[1], sigma[2]),
            missing=missing,
            missing_sigma=missing_sigma,
        ),
    )


def _estimate_json(estimate: ProbeEstimate) -> dict[str, Any]:
    document = asdict(estimate)
    sigma = document.pop("rate_mean_sigma")
    return document | {"rate_mean_sigma_deg_h": [value / DEG_PER_HOUR for value in sigma]}
