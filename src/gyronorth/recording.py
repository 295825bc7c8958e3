"""A recording: what an inertial sensor measured, in SI units and body axes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray


class InputError(ValueError):
    """Bad input from the user: one clear message, exit code 2.

    The message says what came in, what was expected, the likely cause and the cure.
    """


@dataclass(frozen=True)
class Gap:
    """Samples that were missing and have been bridged by a straight line."""

    start: float  # s from the start of the recording
    samples: int  # how many samples were missing


@dataclass(frozen=True)
class Recording:
    """Angular rate and specific force on a uniform time grid.

    Raises
    ------
    InputError
        If an array is not (n, 3) and finite, or the rate is not positive.
    """

    gyro_b: NDArray[np.float64]  # (n, 3) angular rate in the body frame, rad/s
    accel_b: NDArray[np.float64] | None  # (n, 3) specific force in the body frame, m/s^2; None: gyro only
    rate_hz: float  # sample rate, Hz
    latitude: float | None = None  # geodetic latitude, rad, when the file knows it
    heading_true: float | None = None  # reference heading at the end, rad, when the file knows it
    session: str | None = None  # power-up session: recordings that share one share a turn-on bias
    start_time_utc: str | None = None  # ISO 8601 with Z
    source: str = ""  # file name, for messages and reports
    rows_dropped: int = 0  # rows left out on the user's request
    gaps: tuple[Gap, ...] = ()  # bridged gaps
    notes: tuple[str, ...] = ()  # remarks of the reader, shown as warnings

    def __post_init__(self) -> None:
        for name in ("gyro_b", "accel_b"):
            value = getattr(self, name)
            if value is None:
                continue
            if value.ndim != 2 or value.shape[1] != 3 or len(value) == 0:
                raise InputError(f"{name} has shape {value.shape}; (n, 3) with n > 0 is expected.")
            if not np.isfinite(value).all():
                row = int(np.flatnonzero(~np.isfinite(value).all(axis=1))[0])
                raise InputError(f"{name} is not finite at sample {row}: {value[row]}.")
        if self.accel_b is not None and len(self.accel_b) != len(self.gyro_b):
            raise InputError(f"accel_b has {len(self.accel_b)} samples, gyro_b {len(self.gyro_b)}; they must match.")
        if not (np.isfinite(self.rate_hz) and self.rate_hz > 0):
            raise InputError(f"rate_hz is {self.rate_hz}; a positive sample rate in Hz is expected.")

    @property
    def duration(self) -> float:
        """Length in s: number of samples over the rate."""
        return len(self.gyro_b) / self.rate_hz

    def window(self, start: float, end: float) -> Recording:
        """The samples in [start, end) s, the time and the truth kept in step."""
        first, last = round(start * self.rate_hz), round(end * self.rate_hz)
        if not 0 <= first < last <= len(self.gyro_b):
            raise InputError(
                f"Window {start:g}:{end:g} s does not fit a recording of {self.duration:g} s. "
                f"Give START:END in seconds with 0 <= START < END <= {self.duration:g}."
            )
        gaps = tuple(
            replace(gap, start=gap.start - start) for gap in self.gaps if start <= gap.start < end
        )
        return replace(
            self,
            gyro_b=self.gyro_b[first:last],
            accel_b=None if self.accel_b is None else self.accel_b[first:last],
            start_time_utc=_shift_utc(self.start_time_utc, first / self.rate_hz),
            gaps=gaps,
        )

    def rotated(self, mat: ArrayLike) -> Recording:
        """The recording in axes v, from `mat` = mat_vb, shape (3, 3): another mounting."""
        mat = np.asarray(mat, dtype=float)
        accel = None if self.accel_b is None else self.accel_b @ mat.T
        return replace(self, gyro_b=self.gyro_b @ mat.T, accel_b=accel)

    def without_bias(self, gyro_bias_b: ArrayLike) -> Recording:
        """The recording with a known gyro bias (3,), rad/s in the body frame, subtracted."""
        return replace(self, gyro_b=self.gyro_b - np.asarray(gyro_bias_b, dtype=float))


def _shift_utc(start_time_utc: str | None, seconds: float) -> str | None:
    if start_time_utc is None:
        return None
    from datetime import datetime, timedelta

    moment = datetime.fromisoformat(start_time_utc.replace("Z", "+00:00")) + timedelta(seconds=seconds)
    return moment.isoformat().replace("+00:00", "Z")
