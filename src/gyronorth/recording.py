"""A recording: what an inertial sensor measured, in SI units and body axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyronorth.errors import InputError as InputError
from gyronorth.findings import Finding
from gyronorth.frozen import frozen
from gyronorth.given import checked_latitude, number, numbers, of_kind

#: The former name of `gyronorth.findings.Finding` where a reader remarks on a file.
Note = Finding

#: Latitudes given and stored may differ by this, rad, before it is a mistake.
LATITUDE_CONFLICT = np.radians(0.1)
#: Sample rates outside these bounds, Hz, are taken for a mistake (milliseconds for seconds, a damaged field).
SLOWEST_RATE_HZ = 1e-3
FASTEST_RATE_HZ = 1e6
#: Samples beyond this, rad/s or m/s^2, are damage, and their squares would overflow.
LARGEST_SAMPLE = 1e9


#: How the axes of a file are known: it states them, the user declares them, its format defines them, or nobody
#: says so and they are assumed.
AxesOrigin = Literal["stated", "declared", "format", "assumed"]


@frozen
class Gap:
    """Samples that were missing and have been bridged by a straight line."""

    start: float  # s from the start of the recording
    samples: int  # how many samples were missing


@dataclass(frozen=True, eq=False)
class Recording:
    """Angular rate and specific force on a uniform time grid.

    Raises
    ------
    InputError
        If an array is not (n, 3) and finite, or the rate, the latitude, the true
        heading or the start time makes no sense.
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
    notes: tuple[Finding, ...] = ()  # remarks of the reader, shown as warnings
    read_as: str = ""  # what each column of the file was taken for, for people
    axes: str = "frd"  # where x, y, z of the file point, three letters
    axes_origin: AxesOrigin = "stated"  # how that is known; the samples are in body axes if it is right
    units: str = ""  # units of the file, of rate and specific force, for people

    def __post_init__(self) -> None:
        for name in ("gyro_b", "accel_b"):
            if name == "gyro_b" or getattr(self, name) is not None:
                object.__setattr__(self, name, _checked_samples(name, getattr(self, name)))
        if self.accel_b is not None and len(self.accel_b) != len(self.gyro_b):
            raise InputError(f"accel_b has {len(self.accel_b)} samples, gyro_b {len(self.gyro_b)}; they must match.")
        for name in ("rate_hz", "latitude", "heading_true"):
            if name == "rate_hz" or getattr(self, name) is not None:
                object.__setattr__(self, name, number(name, getattr(self, name)))
        if not SLOWEST_RATE_HZ <= self.rate_hz <= FASTEST_RATE_HZ:
            raise InputError(
                f"rate_hz is {self.rate_hz:g}; a sample rate of {SLOWEST_RATE_HZ:g} to {FASTEST_RATE_HZ:g} Hz "
                "is expected."
            )
        if self.latitude is not None:
            checked_latitude(self.latitude)
        if self.heading_true is not None and not np.isfinite(self.heading_true):
            raise InputError(f"heading_true is {self.heading_true}; a finite angle in rad is expected.")
        if self.start_time_utc is not None:
            _parse_utc(self.start_time_utc)
        for name, kind in (("gaps", Gap), ("notes", Finding)):
            of_kind(name, getattr(self, name), tuple | list, "a tuple")
            for one in getattr(self, name):
                of_kind(f"One of {name}", one, kind, f"a {kind.__name__}")

    @property
    def duration(self) -> float:
        """Length in s: number of samples over the rate."""
        return len(self.gyro_b) / self.rate_hz

    def latitude_given(self, given: float | None) -> float:
        """The latitude to work with, rad: see `chosen_latitude`."""
        return chosen_latitude(given, self.latitude, self.source)

    def window(self, start: float, end: float) -> Recording:
        """The samples in [start, end) s, the start time and the gaps kept in step.

        `heading_true` is kept: it stays the truth as long as the sensor does not turn
        between `end` and the end of the recording.
        """
        first, last = window_samples(start, end, rate_hz=self.rate_hz, samples=len(self.gyro_b))
        gaps = clip_gaps(self.gaps, first, last, rate_hz=self.rate_hz)
        notes = tuple(note for note in self.notes if note.code != "gaps_bridged")
        return replace(
            self,
            gyro_b=self.gyro_b[first:last],
            accel_b=None if self.accel_b is None else self.accel_b[first:last],
            start_time_utc=shift_utc(self.start_time_utc, first / self.rate_hz),
            gaps=gaps,
            notes=notes + gap_notes(gaps, samples=last - first),
        )

    def rotated(self, mat: ArrayLike) -> Recording:
        """The recording in axes v, from `mat` = mat_vb, shape (3, 3): another mounting."""
        mat = numbers("The rotation", mat, "(3, 3)")
        if mat.shape != (3, 3):
            raise InputError(f"The rotation has shape {mat.shape}; (3, 3) is expected.")
        accel = None if self.accel_b is None else self.accel_b @ mat.T
        return replace(self, gyro_b=self.gyro_b @ mat.T, accel_b=accel, axes="frd")

    def without_bias(self, gyro_bias_b: ArrayLike) -> Recording:
        """The recording with a known gyro bias (3,), rad/s in the body frame, subtracted."""
        bias = numbers("The gyro bias", gyro_bias_b, "(3,)")
        if bias.shape != (3,) or not np.isfinite(bias).all():
            raise InputError(f"The gyro bias is {gyro_bias_b}; three finite rates in rad/s are expected.")
        return replace(self, gyro_b=self.gyro_b - bias)


def chosen_latitude(given: float | None, stored: float | None, source: str) -> float:
    """The latitude to work with, rad: the one given, or else that of the file. Every command chooses by this.

    Raises
    ------
    InputError
        If neither is known, the given one is out of range, or the two differ by more than `LATITUDE_CONFLICT`.
    """
    given = None if given is None else checked_latitude(given)
    known = agreed_latitude(given, stored, source)
    if known is None:
        raise InputError(
            "The latitude is not known: neither given nor in the file. Pass --latitude DEG (north positive); "
            "Earth rate cannot be read without it."
        )
    return float(known)


def agreed_latitude(given: float | None, stored: float | None, source: str) -> float | None:
    """The latitude given, rad, or else that of the file; None where neither is known.

    Raises
    ------
    InputError
        If the two differ by more than `LATITUDE_CONFLICT`.
    """
    if given is not None and stored is not None and not abs(given - stored) <= LATITUDE_CONFLICT:
        raise InputError(
            f"{source or 'The recording'} states latitude {np.degrees(stored):.4f} deg; {np.degrees(given):.4f} deg is "
            f"given. They may differ by {np.degrees(LATITUDE_CONFLICT):.1f} deg: leave --latitude out, or correct it."
        )
    return stored if given is None else given


def window_samples(start: float, end: float, *, rate_hz: float, samples: int) -> tuple[int, int]:
    """First sample and one past the last of the window [start, end) s."""
    duration = samples / rate_hz
    if 0 <= start < end <= duration + 0.5 / rate_hz:
        first, last = round(start * rate_hz), min(round(end * rate_hz), samples)
        if first < last:
            return first, last
    raise InputError(
        f"Window {start:g}:{end:g} s does not fit a recording of {duration:g} s. "
        f"Give START:END in seconds with 0 <= START < END <= {duration:g}, at least one sample apart."
    )


def gap_notes(gaps: Sequence[Gap], *, samples: int) -> tuple[Finding, ...]:
    """The warning that `gaps` deserve in a recording of `samples` samples: none or one note."""
    missing = sum(gap.samples for gap in gaps)
    if missing == 0:
        return ()
    longest = max(gaps, key=lambda gap: gap.samples)
    return (
        Finding(
            "gaps_bridged",
            f"{missing} of {samples} samples were missing in {len(gaps)} gap(s) and are bridged by straight lines; "
            f"the longest, of {longest.samples} samples, begins at {longest.start:g} s.",
            value=missing / samples,
        ),
    )


def clip_gaps(gaps: Sequence[Gap], first: int, last: int, *, rate_hz: float) -> tuple[Gap, ...]:
    """What is left of `gaps` among the samples [first, last), their starts counted from `first`."""
    clipped = []
    for gap in gaps:
        begin = round(gap.start * rate_hz)
        low, high = max(begin, first), min(begin + gap.samples, last)
        if low < high:
            clipped.append(Gap((low - first) / rate_hz, high - low))
    return tuple(clipped)


def shift_utc(start_time_utc: str | None, seconds: float) -> str | None:
    """An ISO 8601 time moved by `seconds`; None stays None."""
    if start_time_utc is None:
        return None
    try:
        moment = _parse_utc(start_time_utc) + timedelta(seconds=seconds)
    except OverflowError:
        raise InputError(f"start_time_utc {start_time_utc!r} plus {seconds:g} s leaves the calendar.") from None
    return moment.isoformat().replace("+00:00", "Z")


def utc_from_ns(time: int) -> str | None:
    """ISO 8601 of a time in ns since 1970, to the microsecond; None where it leaves the calendar."""
    try:
        moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=time // 1000)
    except OverflowError:
        return None
    return moment.isoformat().replace("+00:00", "Z")


def ns_from_utc(text: str) -> int:
    """Nanoseconds since 1970 of an ISO 8601 time.

    Raises
    ------
    InputError
        If it is none.
    """
    return (_parse_utc(text) - datetime(1970, 1, 1, tzinfo=UTC)) // timedelta(microseconds=1) * 1000


def _parse_utc(text: str) -> datetime:
    try:
        moment = datetime.fromisoformat(text)
        return moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment.astimezone(UTC)
    except (ValueError, OverflowError, TypeError):
        raise InputError(
            f"start_time_utc is {text!r:.80}; an ISO 8601 time such as 2024-05-01T12:00:00Z is expected."
        ) from None


def _checked_samples(name: str, value: ArrayLike) -> NDArray[np.float64]:
    samples = numbers(name, value, "(n, 3)")
    if samples.ndim != 2 or samples.shape[1] != 3 or len(samples) == 0:
        raise InputError(f"{name} has shape {samples.shape}; (n, 3) with n > 0 is expected.")
    # None is larger than the root of the sum of squares, which takes no memory and half the time of the extremes.
    with np.errstate(over="ignore"):
        if np.einsum("tk,tk->", samples, samples) <= LARGEST_SAMPLE**2:  # not of NaN
            return samples
    if samples.min() >= -LARGEST_SAMPLE and samples.max() <= LARGEST_SAMPLE:
        return samples
    if not np.isfinite(samples).all():
        row = int(np.flatnonzero(~np.isfinite(samples).all(axis=1))[0])
        raise InputError(f"{name} is not finite at sample {row}: {samples[row]}.")
    row = int(np.flatnonzero((abs(samples) > LARGEST_SAMPLE).any(axis=1))[0])
    raise InputError(
        f"{name} is {samples[row]} at sample {row}; at most {LARGEST_SAMPLE:g} rad/s or m/s^2 is expected. The data "
        "are damaged, or not in SI units."
    )
