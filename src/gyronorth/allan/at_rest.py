"""A recording axis by axis: in memory, or in temporary files when it is longer than that."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from tempfile import TemporaryFile

import numpy as np

from gyronorth.arrays import Array
from gyronorth.files import temporary_files_told
from gyronorth.recording import Gap, Recording


@dataclass(frozen=True)
class AtRest:
    """A recording of which one axis at a time is in use."""

    gyro: Callable[[int], Array]  # axis -> its samples (n,), rad/s
    accel: Callable[[int], Array] | None  # axis -> its samples (n,), m/s^2; None: gyro only
    samples: int
    rate_hz: float  # Hz
    latitude: float | None  # rad
    gaps: tuple[Gap, ...]
    source: str  # file name

    @property
    def duration(self) -> float:
        """Length, s."""
        return self.samples / self.rate_hz


def at_rest(recording: Recording) -> AtRest:
    """A recording in memory."""
    accel = recording.accel_b
    return AtRest(
        gyro=lambda axis: recording.gyro_b[:, axis],
        accel=None if accel is None else lambda axis: accel[:, axis],
        samples=len(recording.gyro_b),
        rate_hz=recording.rate_hz,
        latitude=recording.latitude,
        gaps=recording.gaps,
        source=recording.source,
    )


@contextmanager
def axes_in_files(chunks: Iterable[Recording]) -> Iterator[AtRest]:
    """The chunks of one recording, its axes in temporary files as long as the context lasts."""
    chunks = iter(chunks)
    first = chunk = next(chunks)
    gaps: list[Gap] = []
    samples = 0
    with ExitStack() as stack:
        with temporary_files_told():
            files = [stack.enter_context(TemporaryFile()) for _ in range(3 if first.accel_b is None else 6)]
        while chunk is not None:
            columns = [*chunk.gyro_b.T, *(() if chunk.accel_b is None else chunk.accel_b.T)]
            with temporary_files_told():
                for file, column in zip(files, columns, strict=True):
                    file.write(np.ascontiguousarray(column).tobytes())
                    file.flush()
            gaps += [Gap(gap.start + samples / first.rate_hz, gap.samples) for gap in chunk.gaps]
            samples += len(chunk.gyro_b)
            chunk = next(chunks, None)

        def axis_of(files: list, axis: int) -> Array:  # type: ignore[type-arg]
            files[axis].seek(0)
            return np.fromfile(files[axis], dtype=np.float64)

        yield AtRest(
            gyro=lambda axis: axis_of(files[:3], axis),
            accel=None if first.accel_b is None else lambda axis: axis_of(files[3:], axis),
            samples=samples,
            rate_hz=first.rate_hz,
            latitude=first.latitude,
            gaps=tuple(gaps),
            source=first.source,
        )
