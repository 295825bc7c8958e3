"""A recording on its way into a file: samples chunk by chunk, and the facts that are known once all have passed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.frozen import frozen
from gyronorth.readers.axes import in_axes, mat_bf
from gyronorth.readers.facts import write_facts
from gyronorth.readers.source import Facts
from gyronorth.recording import Gap, Recording

#: Rows handed over at a time.
BLOCK_ROWS = 1 << 14
#: What the facts of a file say already, or its samples show again.
TOLD_ANEW = ("axes_assumed", "axes_suspect", "gaps", "gaps_bridged", "rows_dropped")


@frozen
class SampleRows:
    """Consecutive samples, SI and body axes; those of the source where they are assumed."""

    first: int  # number of the first one in the recording
    gyro_b: NDArray[np.float64]  # (m, 3)
    accel_b: NDArray[np.float64] | None  # (m, 3)

    def numbers(self) -> NDArray[np.int64]:
        """Sample numbers, shape (m,)."""
        return np.arange(self.first, self.first + len(self.gyro_b))


class RecordingStream:
    """Passes the chunks of one recording on and keeps count of samples, gaps and dropped rows.

    Raises
    ------
    InputError
        If a remark on the recording blocks a valid heading (axes that nobody declared and gravity
        contradicts): the file would state its axes, and the remark would be lost.
    """

    def __init__(self, chunks: Iterable[Recording]) -> None:
        self._chunks = iter(chunks)
        self._first = next(self._chunks)
        blocking = [note.message for note in self._first.notes if note.blocking]
        if blocking:
            raise InputError(f"{' '.join(blocking)} Nothing is written: the new file would state axes as if declared.")
        self._gaps: list[Gap] = []
        self._samples = self._dropped = 0
        self._said: dict[str, float | None] = {}
        self.rate_hz = float(self._first.rate_hz)
        self.has_accel = self._first.accel_b is not None
        self.start_time_utc = self._first.start_time_utc
        #: Axes of the rows where nobody said so: they stay in those of the source, and are written as assumed.
        self.axes_assumed = self._first.axes if self._first.axes_origin == "assumed" else None

    def rows(self) -> Iterator[SampleRows]:
        """The samples, once."""
        chunk: Recording | None = self._first
        while chunk is not None:
            for start in range(0, len(chunk.gyro_b), BLOCK_ROWS):
                part = slice(start, start + BLOCK_ROWS)
                gyro, accel = chunk.gyro_b[part], None if chunk.accel_b is None else chunk.accel_b[part]
                if self.axes_assumed is not None:
                    mat_fb = mat_bf(self.axes_assumed).T
                    gyro, accel = in_axes(gyro, mat_fb), None if accel is None else in_axes(accel, mat_fb)
                yield SampleRows(self._samples + start, gyro, accel)
            self._gaps += [Gap(gap.start + self._samples / self.rate_hz, gap.samples) for gap in chunk.gaps]
            self._dropped += chunk.rows_dropped
            self._said |= {note.code: note.value for note in chunk.notes if note.code not in TOLD_ANEW}
            self._samples += len(chunk.gyro_b)
            chunk = next(self._chunks, None)

    @property
    def facts(self) -> Facts:
        """What is known once all rows have passed; SI and body axes."""
        first = self._first
        return Facts(
            rate_hz=self.rate_hz,
            gyro_unit="rad/s",
            accel_unit="m/s2" if self.has_accel else None,
            axes="frd" if self.axes_assumed is None else None,
            axes_assumed=self.axes_assumed,
            latitude=first.latitude,
            heading_true=first.heading_true,
            session=first.session,
            start_time_utc=first.start_time_utc,
            samples=self._samples,
            rows_dropped=self._dropped,
            gaps=_joined(self._gaps, self.rate_hz),
            warnings=tuple(self._said.items()),
        )

    def texts(self) -> dict[str, str]:
        """The facts by key, once all rows have passed."""
        return write_facts(self.facts)


def _joined(gaps: list[Gap], rate_hz: float) -> tuple[Gap, ...]:
    """The gaps, halves of one that was cut between two chunks put together again."""
    joined: list[Gap] = []
    for gap in gaps:
        if joined and abs(joined[-1].start + joined[-1].samples / rate_hz - gap.start) < 0.5 / rate_hz:
            gap = Gap(joined[-1].start, joined.pop().samples + gap.samples)
        joined.append(gap)
    return tuple(joined)
