"""The problem that every method solves: samples on one time grid, and what is known of the unit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from gyronorth.alignment.closed_form import align_mean
from gyronorth.alignment.motion import MotionStatistics, motion_statistics
from gyronorth.alignment.result import Attitude
from gyronorth.arrays import Array, picked
from gyronorth.attitude import mat_lb
from gyronorth.conditioning import decimate
from gyronorth.sensor import Sensor

if TYPE_CHECKING:
    from gyronorth.alignment.turned.segments import Segments


@dataclass(frozen=True, eq=False)
class Problem:
    """One recording, or a batch with leading dimensions, and what is known of it. Derived values are worked out once.

    Attributes
    ----------
    gyro_b : ndarray, shape (..., n, 3)
        Angular rate in the body frame, rad/s.
    accel_b : ndarray, shape (..., n, 3), or None
        Specific force, m/s^2.
    rate_hz : float
        Sample rate, Hz.
    latitude : float
        Geodetic latitude, rad.
    sensor : Sensor, optional
        Profile of the unit.
    attitude : tuple of float, optional
        Known roll and pitch, rad.
    session : str, optional
        Power-up session, which a deviation curve is asked about.
    known_segments : Segments, optional
        Poses and turns, where they need not be found.
    """

    gyro_b: Array
    accel_b: Array | None
    rate_hz: float
    latitude: float
    sensor: Sensor | None = None
    attitude: tuple[float, float] | None = None
    session: str | None = None
    known_segments: Segments | None = None

    @property
    def duration(self) -> float:
        """Length, s."""
        return self.gyro_b.shape[-2] / self.rate_hz

    @property
    def shape(self) -> tuple[int, ...]:
        """Leading dimensions: () for one recording."""
        return self.gyro_b.shape[:-2]

    @cached_property
    def mean(self) -> Attitude:
        """The closed form of the mean rate and specific force, with which every method is compared."""
        return align_mean(self.gyro_b, self.accel_b, attitude=self.attitude)

    @cached_property
    def mat_lb(self) -> Array:
        """Rotation from the body frame to the level frame of the mean, shape (..., 3, 3)."""
        return mat_lb(self.mean.roll, self.mean.pitch)

    @cached_property
    def motion(self) -> MotionStatistics:
        """What the samples show of motion and noise."""
        return motion_statistics(
            self.gyro_b,
            self.accel_b,
            rate_hz=self.rate_hz,
            mat_lb=self.mat_lb,
            sensor=self.sensor,
        )

    @cached_property
    def segments(self) -> Segments:
        """Still poses and turns of one recording."""
        if self.known_segments is not None:
            return self.known_segments
        bias = None if self.sensor is None or self.sensor.gyro.turn_on_bias == 0 else self.sensor.gyro.turn_on_bias
        from gyronorth.alignment.turned.segments import find_segments

        return find_segments(self.gyro_b, self.accel_b, rate_hz=self.rate_hz, turn_on_bias=bias)

    def rate_l(self, to_hz: float | None = None) -> Array:
        """Angular rate in the level frame of the mean, rad/s, averaged down to `to_hz` where that is lower."""
        gyro_b = self.gyro_b
        if to_hz is not None and to_hz < self.rate_hz:
            gyro_b = decimate(gyro_b, rate_hz=self.rate_hz, to_hz=to_hz)
        return gyro_b @ np.swapaxes(self.mat_lb, -1, -2)

    def part(self, seconds: float) -> Problem:
        """The first `seconds`, s, or the last where negative; all where there are no more."""
        count = round(abs(seconds) * self.rate_hz)
        part = slice(None, count) if seconds > 0 else slice(max(self.gyro_b.shape[-2] - count, 0), None)
        accel_b = None if self.accel_b is None else self.accel_b[..., part, :]
        return replace(self, gyro_b=self.gyro_b[..., part, :], accel_b=accel_b)

    def __getitem__(self, index: Any) -> Problem:
        """Some recordings of a batch, by an index of the leading dimensions, with what has been worked out of them."""
        accel_b = None if self.accel_b is None else self.accel_b[index]
        some = replace(self, gyro_b=self.gyro_b[index], accel_b=accel_b)
        for name in ("mean", "mat_lb", "motion"):
            if name in vars(self):
                vars(some)[name] = picked(vars(self)[name], index)
        return some
