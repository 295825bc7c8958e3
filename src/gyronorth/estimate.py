"""What a pipeline answers: the estimate of one recording, of a batch, and along time. SI and radians."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyronorth.angles import DEG_PER_HOUR
from gyronorth.arrays import Array
from gyronorth.findings import Finding

#: Parts of sigma that the JSON always names, null where the method or the lack of a profile leaves them unknown.
PARTS = ("noise", "drift", "turn_on_bias", "levelling")


@dataclass(frozen=True)
class Pose:
    """A stretch of standing still."""

    start: float  # s from the start of the recording
    end: float  # s
    heading: float  # rad
    residual: float | None = None  # mean rate minus what was fitted, its length, rad/s
    residual_sigma: float | None = None  # of one axis of it, rad/s


@dataclass(frozen=True)
class Turn:
    """A rotation between two poses."""

    start: float  # s
    end: float  # s
    angle: float  # rad, as the gyro measured it


@dataclass(frozen=True)
class Unrest:
    """What a method that models disturbance (bayes, learned) found in a recording."""

    tones: float  # expected number of sway tones
    settling: float  # probability that the gyro bias settles
    tilt: float | None  # probability that the unit tilts slowly; None where the method does not ask
    walk: float | None  # probability that the gyro bias walks from switch-on; likewise
    bumps: float  # time left out as bumps, s
    excess: float  # residual over the sensor's noise, root mean square
    fits: bool  # whether the method explains the recording

    @property
    def unsteady(self) -> float:
        """Probability that the gyro bias changes in a way that averages take for Earth rate."""
        return self.settling + (self.walk or 0.0)


@dataclass(frozen=True)
class HeadingEstimate:
    """The heading of one recording, its uncertainty and the verdict on it. SI and radians."""

    heading: float | None  # [0, 2 pi), clockwise from true north, at the end of the recording
    sigma: float | None  # one standard deviation, rad
    interval95: tuple[float, float]  # (low, high) clockwise: low > high where it crosses north
    reasons: tuple[Finding, ...]  # why the heading is refused; empty when valid
    warnings: tuple[Finding, ...]
    method: str
    method_reason: str
    bundle: str | None
    roll: float | None
    pitch: float | None
    latitude: float
    sensor: str | None
    duration: float  # s
    rate_hz: float
    end_time_utc: str | None
    poses: tuple[Pose, ...]
    turns: tuple[Turn, ...]
    sigma_parts: dict[str, float]  # rad, at most pi each; the root sum square is sigma where sigma is small
    gyro_bias: tuple[float, float, float] | None  # rad/s, where the method estimates it
    rate_mean: tuple[float, float, float]  # mean angular rate in the body frame, rad/s
    rate_norm: float  # its norm, rad/s
    implied_latitude: float | None  # asin(-w_down / |w|), rad
    unrest: Unrest | None = None  # where a method was tried that models disturbance

    @property
    def valid(self) -> bool:
        """Whether there are no reasons to refuse."""
        return not self.reasons

    def to_json(self) -> dict[str, Any]:
        """The object that `heading --json` prints (schema gyronorth.heading/1), in degrees."""
        deg = _degrees
        return {
            "schema": "gyronorth.heading/1",
            "heading_deg": deg(self.heading),
            "sigma_deg": deg(self.sigma),
            "interval95_deg": [deg(self.interval95[0]), deg(self.interval95[1])],
            "valid": self.valid,
            "reasons": [vars(finding) for finding in self.reasons],
            "warnings": [vars(finding) for finding in self.warnings],
            "method": self.method,
            "method_reason": self.method_reason,
            "bundle": self.bundle,
            "roll_deg": deg(self.roll),
            "pitch_deg": deg(self.pitch),
            "latitude_deg": deg(self.latitude),
            "sensor": self.sensor,
            "duration_s": self.duration,
            "rate_hz": self.rate_hz,
            "end_time_utc": self.end_time_utc,
            "poses": [
                {"start_s": pose.start, "end_s": pose.end, "heading_deg": deg(pose.heading)} for pose in self.poses
            ],
            "sigma_parts_deg": {name: deg(value) for name, value in (dict.fromkeys(PARTS) | self.sigma_parts).items()},
            "gyro_bias_deg_h": None if self.gyro_bias is None else [b / DEG_PER_HOUR for b in self.gyro_bias],
            "rate_mean_deg_h": [rate / DEG_PER_HOUR for rate in self.rate_mean],
            "rate_norm_deg_h": self.rate_norm / DEG_PER_HOUR,
            "implied_latitude_deg": deg(self.implied_latitude),
        }


@dataclass(frozen=True)
class HeadingBatch:
    """Headings of a batch, arrays of shape (recordings,)."""

    heading: Array  # rad in [0, 2 pi)
    sigma: Array  # rad
    low: Array  # lower end of the 95 % interval, rad in [0, 2 pi)
    high: Array  # upper end, clockwise from `low`
    valid: NDArray[np.bool_]
    method: NDArray[np.str_]


@dataclass(frozen=True)
class Convergence:
    """The heading that the first `time` seconds would have given, arrays of shape (k,)."""

    time: Array  # s
    heading: Array  # rad
    half_width: Array  # of the 95 % interval, rad
    valid: NDArray[np.bool_]


def _degrees(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else float(np.degrees(value))
