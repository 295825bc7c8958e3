"""What a file holds, for a look before any heading."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gyronorth.angles import DEG_PER_HOUR
from gyronorth.earth import EARTH_RATE
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.reading import Progress, RecordingInfo, read_chunks
from gyronorth.recording import Gap, Note


@dataclass(frozen=True)
class Description:
    """A file and its means, body axes and SI."""

    info: RecordingInfo
    samples: int
    duration: float  # s
    rate_mean: tuple[float, float, float]  # mean angular rate, rad/s
    force_mean: tuple[float, float, float] | None  # mean specific force, m/s^2
    rows_dropped: int
    gaps: tuple[Gap, ...]
    notes: tuple[Note, ...]

    @property
    def rate_norm(self) -> float:
        """Norm of the mean angular rate, rad/s: Earth rate if the gyro were perfect and still."""
        return float(np.linalg.norm(self.rate_mean))

    def to_json(self) -> dict[str, Any]:
        """The same with angles in degrees, for printing; None where there is no value."""
        info = asdict(self.info)
        latitude, heading = info.pop("latitude"), info.pop("heading_true")
        info.pop("notes")
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
        }


def describe(
    path: str | Path, options: ReadOptions | None = None, *, progress: Progress | None = None, **declared: Any
) -> Description:
    """Read a file in chunks and describe it; arguments and errors as for `read`."""
    info, chunks = read_chunks(path, options, progress=progress, **declared)
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
    )
