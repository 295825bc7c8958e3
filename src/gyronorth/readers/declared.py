"""What holds for a file: the user's declarations, the file's statements, its format's conventions."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.readers.axes import convention, mat_bf, mat_vb
from gyronorth.readers.options import ACCEL_UNITS, GYRO_UNITS, ReadOptions
from gyronorth.readers.source import FORCES, RATES, TIME, Source

#: Largest relative difference between a declared rate and the one that the file states.
RATE_STATED_TOLERANCE = 1e-3
#: Largest difference between a declared latitude and the one that the file states, rad.
LATITUDE_TOLERANCE = float(np.radians(0.1))


@dataclass(frozen=True)
class Declared:
    """Everything that turns the numbers of a file into SI and body axes."""

    rate_hz: float | None  # None: to be taken from the time column
    gyro_unit: str
    accel_unit: str  # "" without an accelerometer
    axes: str  # three letters
    axes_declared: bool  # by the user or the file, not by mere convention
    increments: bool
    mat_vf: NDArray[np.float64] | None  # file axes to vehicle axes, shape (3, 3); None: the same
    latitude: float | None  # rad
    heading_true: float | None  # rad

    @property
    def scale(self) -> NDArray[np.float64]:
        """SI per unit of each value column, without the rate that increments need, shape (3,) or (6,)."""
        scale = [GYRO_UNITS[self.gyro_unit]] * 3
        return np.array(scale + [ACCEL_UNITS[self.accel_unit]] * 3 if self.accel_unit else scale)


def resolve(source: Source, options: ReadOptions) -> Declared:
    """Put declarations, statements and conventions together.

    Raises
    ------
    InputError
        If two of them contradict each other, or something needed is known from none.
    """
    stated, usual, name = source.stated, source.usual, source.name
    if source.decoded:
        options = replace(options, gyro_unit=None, accel_unit=None, increments=None)
    gyro_unit = _unit("gyro", options.gyro_unit, stated.gyro_unit, usual.gyro_unit, GYRO_UNITS, name)
    accel_unit = ""
    if FORCES[0] in source.columns:
        accel_unit = _unit("accel", options.accel_unit, stated.accel_unit, usual.accel_unit, ACCEL_UNITS, name)
    if options.increments and source.ours:
        raise InputError(f"{name} was written by gyronorth and holds rates; leave --increments out.")
    declared_axes = options.axes or stated.axes
    usual_axes = usual.axes or "frd"
    mat = mat_bf(declared_axes or usual_axes)
    if options.axes and stated.axes and not np.array_equal(mat, mat_bf(stated.axes)):
        raise InputError(
            f"{name} states axes {stated.axes}; {options.axes} is declared. Leave --axes out, or correct it."
        )
    heading_true = stated.heading_true
    if source.truth_follows_axes and not np.array_equal(mat, mat_bf(usual_axes)):
        heading_true = None
    boresight = mat_vb(options.boresight)
    turned = mat if boresight is None else boresight @ mat
    return Declared(
        rate_hz=_rate(source, options),
        gyro_unit=gyro_unit,
        accel_unit=accel_unit,
        axes=convention(mat),
        axes_declared=declared_axes is not None,
        increments=bool(options.increments) or stated.increments,
        mat_vf=None if np.array_equal(turned, np.eye(3)) else turned,
        latitude=_latitude(source, options),
        heading_true=heading_true,
    )


def _unit(
    sensor: str, declared: str | None, stated: str | None, usual: str | None, choices: dict[str, float], name: str
) -> str:
    if declared and stated and declared != stated:
        raise InputError(
            f"{name} states {sensor}_unit {stated}; {declared} is declared. Leave --{sensor}-unit out, or correct it."
        )
    unit = declared or stated or usual
    if unit is None:
        what = ", ".join(RATES if sensor == "gyro" else FORCES)
        raise InputError(
            f"{name} does not say in which unit {what} are. Declare it: --{sensor}-unit {' or '.join(choices)}."
        )
    return unit


def _rate(source: Source, options: ReadOptions) -> float | None:
    declared, stated = options.rate_hz, source.stated.rate_hz
    if declared and stated and abs(declared / stated - 1) > RATE_STATED_TOLERANCE:
        raise InputError(
            f"{source.name} states a rate of {stated:g} Hz; {declared:g} Hz is declared. --rate declares what the "
            "file holds and never resamples: leave it out, or correct it."
        )
    rate_hz = declared or stated or source.usual.rate_hz
    if rate_hz is None and (source.clock is None or source.clock.unit is None):
        why = "has no time column" if source.clock is None else f"counts samples in {source.clock.name}, not time,"
        also = "" if TIME in source.columns else " or name its time column (seconds): --columns t=NAME"
        raise InputError(f"{source.name} {why} and does not state its rate. Declare it: --rate HZ{also}.")
    return rate_hz


def _latitude(source: Source, options: ReadOptions) -> float | None:
    declared, stated = options.latitude, source.stated.latitude
    if declared is not None and stated is not None and not abs(declared - stated) <= LATITUDE_TOLERANCE:
        raise InputError(
            f"{source.name} states latitude {np.degrees(stated):.4f} deg; {np.degrees(declared):.4f} deg is given. "
            f"They may differ by {np.degrees(LATITUDE_TOLERANCE):.1f} deg: leave --latitude out, or correct it."
        )
    return stated if stated is not None else declared
