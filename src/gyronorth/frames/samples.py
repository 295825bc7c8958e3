"""Output of the frame layer: samples in SI, and a report on the stream."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from gyronorth.arrays import Array, Index, Mask
from gyronorth.findings import Finding
from gyronorth.frames.protocol import Fields

#: Rates, rad/s, and specific forces, m/s^2, beyond these come from no sensor.
LARGEST_RATE, LARGEST_FORCE = 1e5, 1e6


@dataclass(frozen=True)
class Samples:
    """Inertial samples in SI, in the axes of the protocol's data (`axes`), in the order in which they were sent.

    A sample that was lost is missing; `number` shows where.
    """

    gyro: Array  # (n, 3) angular rate, rad/s
    accel: Array | None  # (n, 3) specific force, m/s^2
    number: Index  # (n,) sample number from 0, lost ones counted
    t: Array | None  # (n,) s from the first sample: the unit's clock, else number over rate; None without a rate
    saturated: Mask  # (n,) the unit says that an output is at the end of its range
    sensor_fault: Mask  # (n,) the unit says that an output is not to be trusted
    temperature: Array | None  # (n,) degC
    start: Index  # (n,) byte at which the frame began in the stream
    jumped: Mask  # (n,) before this sample the unit or its clock was reset: how long it was is not known

    def __len__(self) -> int:
        return len(self.gyro)

    def columns(self) -> tuple[tuple[str, ...], Array]:
        """Names as in a recording's file (t, w_x, ..., f_z), and the table (n, columns)."""
        names, parts = ["w_x", "w_y", "w_z"], [self.gyro]
        if self.t is not None:
            names, parts = ["t", *names], [self.t[:, None], *parts]
        if self.accel is not None:
            names, parts = [*names, "f_x", "f_y", "f_z"], [*parts, self.accel]
        return tuple(names), np.concatenate(parts, axis=1)


def joined(parts: list[Samples]) -> Samples:
    """One after the other; `parts` are not empty and of one stream."""

    def join(name: str) -> np.ndarray | None:
        arrays = [getattr(part, name) for part in parts]
        return None if any(array is None for array in arrays) else np.concatenate(arrays)

    return Samples(*(join(name) for name in Samples.__dataclass_fields__))  # type: ignore[arg-type]


def taken(samples: Samples, part: slice) -> Samples:
    """Some of them."""
    arrays = {name: getattr(samples, name) for name in Samples.__dataclass_fields__}
    return replace(samples, **{name: values[part] for name, values in arrays.items() if values is not None})


def usable_ones(fields: Fields, gyro: Array, accel: Array | None) -> Mask:
    """Which samples hold numbers that a sensor can give."""
    usable = np.asarray((np.abs(gyro) < LARGEST_RATE).all(axis=1))
    if accel is not None:
        usable &= (np.abs(accel) < LARGEST_FORCE).all(axis=1)
    return usable if fields.usable is None else usable & fields.usable


def to_next(jumped: Mask, usable: Mask) -> Mask:
    """A jump before a sample that is left out is one before the next."""
    moved = jumped.copy()
    for place in np.flatnonzero(jumped & ~usable).tolist():
        following = np.flatnonzero(usable[place:])
        if len(following):
            moved[place + following[0]] = True
    return moved


def held(values: Array, before: float) -> Array:
    """Values (n,), the last one before it in the place of each NaN; the first of all in the places before it."""
    known = np.flatnonzero(np.isfinite(values))
    if len(known) == len(values):
        return values
    first = values[known[0]] if len(known) and not np.isfinite(before) else before
    place = np.searchsorted(known, np.arange(len(values)), side="right")
    return np.append(first, values[known])[place]


class Kind(NamedTuple):
    """What one setting of a unit sends."""

    rate_hz: float | None
    clock: bool
    accel: bool


@dataclass(frozen=True)
class Report:
    """Account of a stream up to now."""

    protocol: str
    axes: str | None  # where x, y and z of the data point, as `--axes`; None: as marked on the unit
    rate_hz: float | None  # sample rate, Hz
    rate_from: str  # "unit's clock", "its increments", "configuration", "declared", "usual for the unit" or ""
    clock: str  # what `Samples.t` is: "unit's clock", "counted" or ""
    imu: str | None  # name of the IMU, where the frames tell it
    profile: str | None  # name of the shipped sensor profile that fits it
    samples: int  # frames that became samples
    other: int  # whole frames that hold no inertial data, or another layout than the one taken
    unusable: int  # frames whose checksum holds, with numbers of no sensor, or that the frames on both sides contradict
    lost: int  # samples missing between the first and the last
    lost_from: str  # how they are known: "counter", "clock" or "bytes"
    skipped: int  # bytes that belong to no whole frame
    clock_jumps: int  # times the unit's clock jumped
    settings: int  # times the unit was found to be reset: its layout, its rate
    kinds: tuple[Kind, ...]  # what came, in order, where the unit was reset to something else
    saturated: int  # samples that the unit marks so
    sensor_fault: int
    findings: tuple[Finding, ...]  # assumptions and conflicts
    messages: tuple[str, ...]  # what whole frames without inertial data were called, while no sample had come
