"""What a pipeline answers: the estimate of one recording, of a batch, and along time. SI and radians."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import degrees, inf, isfinite
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gyronorth.angles import DEG_PER_HOUR
from gyronorth.arrays import Array
from gyronorth.attitude import Orientation, orientation
from gyronorth.errors import InputError
from gyronorth.findings import Check, Finding
from gyronorth.frozen import frozen
from gyronorth.given import number

#: aligning: more time helps. degraded: a heading, less certain than required. invalid: it must not be used.
Fitness = Literal["aligning", "degraded", "valid", "invalid"]
#: Codes that more time of standing still takes away.
ALIGNING = frozenset({"too_short", "too_noisy"})
#: Error budget that the JSON always names, null where the method or the lack of a profile leaves them unknown.
PARTS = ("noise", "drift", "turn_on_bias", "levelling")


@frozen
class Pose:
    """A stretch of standing still."""

    start: float  # s from the start of the recording
    end: float  # s
    heading: float  # rad
    residual: float | None = None  # mean rate minus what was fitted, its length, rad/s
    residual_sigma: float | None = None  # of one axis of it, rad/s


@frozen
class Turn:
    """A rotation between two poses."""

    start: float  # s
    end: float  # s
    angle: float  # rad, as the gyro measured it


@frozen
class SensorErrors:
    """Errors of the gyro that a method estimated from the recording itself, each with one standard deviation."""

    bias: tuple[float, float, float]  # rad/s, body axes
    bias_sigma: tuple[float, float, float]  # rad/s
    scale_factor: tuple[float, float, float]  # relative
    scale_factor_sigma: tuple[float, float, float]


@frozen
class DisturbanceFound:
    """What a method that models disturbance (bayes, learned) found in a recording."""

    sway_tones: float  # expected number
    settling: float  # probability that the gyro bias settles
    tilt: float | None  # probability that the unit tilts slowly; None where the method does not ask
    walk: float | None  # probability that the gyro bias walks from switch-on; likewise
    masked_s: float  # time left out as bumps, s
    residual_ratio: float  # residual over the sensor's noise, root mean square
    explained: bool  # whether the method explains the recording

    @property
    def drift_probability(self) -> float:
        """Probability that the gyro bias changes in a way that averages take for Earth rate."""
        return self.settling + (self.walk or 0.0)

    def to_json(self) -> dict[str, Any]:
        """The object `disturbance` of the JSON."""
        return {
            "sway_tones": self.sway_tones,
            "settling": self.settling,
            "tilt": self.tilt,
            "walk": self.walk,
            "masked_s": self.masked_s,
            "residual_ratio": self.residual_ratio,
            "explained": self.explained,
            "drift_probability": self.drift_probability,
        }


@frozen
class HeadingDensity:
    """What is believed of the heading, as a density: the method `posterior` gives one."""

    heading: Array  # (k,) rad in [0, 2 pi), evenly apart over the part of the circle that holds the mass
    density: Array  # (k,) 1/rad; its integral over the circle is 1

    def to_json(self) -> dict[str, list[float]]:
        """The object `posterior` of the JSON, in degrees."""
        return {
            "heading_deg": [round(float(angle), 6) for angle in np.degrees(self.heading)],
            "density_per_deg": [float(f"{value:.6g}") for value in np.radians(self.density)],
        }


@dataclass(frozen=True, repr=False)
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
    sensor_errors: SensorErrors | None  # where the method estimates them
    rate_mean: tuple[float, float, float]  # mean angular rate in the body frame, rad/s
    rate_norm: float  # its norm, rad/s
    implied_latitude: float | None  # asin(-w_down / |w|), rad
    disturbance: DisturbanceFound | None = None  # where a method was tried that models disturbance
    checks: tuple[Check, ...] = ()  # every gate that judged the heading, passed or not
    posterior: HeadingDensity | None = field(default=None, compare=False)  # of the method `posterior`
    level_in_heading: bool = True  # whether an error of level is in the heading (`catalogue.MethodInfo`)

    @property
    def valid(self) -> bool:
        """Whether there are no reasons to refuse."""
        return not self.reasons

    @property
    def fitness(self) -> Fitness:
        """What the heading is good for, by the reasons against it."""
        codes = {reason.code for reason in self.reasons}
        if not codes:
            return "valid"
        if codes & ALIGNING and codes <= ALIGNING | {"sigma_required"}:
            return "aligning"
        return "degraded" if codes == {"sigma_required"} else "invalid"

    def required(self, sigma: float | None) -> HeadingEstimate:
        """The same, refused with `sigma_required` where its sigma is unknown or above `sigma`, rad; None asks nothing.

        Raises
        ------
        InputError
            If `sigma` is not a positive number.
        """
        if sigma is None:
            return self
        sigma = number("The sigma required", sigma)
        if not 0 < sigma < inf:
            raise InputError(f"The sigma required is {sigma:g} rad; a positive number is expected.")
        if self.sigma is not None and self.sigma <= sigma:
            return self
        found, wanted = self.sigma_deg, degrees(sigma)
        told = "not known" if found is None else f"{found:.3g} deg"
        cure = "" if found is None else " Let the unit stand longer, or turn it by 180 deg."
        message = f"Sigma is {told}; {wanted:.3g} deg is required.{cure}"
        return replace(self, reasons=(*self.reasons, Finding("sigma_required", message, found, wanted)))

    def checked(self) -> HeadingEstimate:
        """The same; without a heading and refused with `not_finite` where it holds numbers that mean nothing.

        A heading that is known is finite and has a finite interval and a finite sigma above 0.
        """
        numbers = (self.heading, self.sigma, *self.interval95)
        if all(number is not None and isfinite(number) for number in numbers) and (self.sigma or 0) > 0:
            return self
        if self.heading is None and self.sigma is None and self.reasons and all(map(isfinite, self.interval95)):
            return self  # refused already, with nothing known
        message = (
            f"The method {self.method} gave {self.heading_deg} deg with sigma {self.sigma_deg} deg: no heading. Likely "
            "numbers beyond reason in the recording, its profile or its bundle."
        )
        reasons = (*self.reasons, Finding("not_finite", message))
        return replace(self, heading=None, sigma=None, interval95=(0.0, 2 * np.pi), reasons=reasons, posterior=None)

    @property
    def gyro_bias(self) -> tuple[float, float, float] | None:
        """Gyro bias, rad/s, body axes, where the method estimates it."""
        return None if self.sensor_errors is None else self.sensor_errors.bias

    @property
    def orientation(self) -> Orientation | None:
        """Quaternion, matrix, covariance and yaw of the attitude; None without a heading, roll and pitch."""
        if self.heading is None or self.roll_deg is None or self.pitch_deg is None:
            return None
        assert self.roll is not None
        assert self.pitch is not None
        return orientation(
            self.roll,
            self.pitch,
            self.heading,
            sigma=self.sigma,
            levelling=self.sigma_parts.get("levelling"),
            latitude=self.latitude,
            level_in_heading=self.level_in_heading,
        )

    @property
    def heading_deg(self) -> float | None:
        """`heading` in degrees."""
        return _degrees(self.heading)

    @property
    def sigma_deg(self) -> float | None:
        """`sigma` in degrees."""
        return _degrees(self.sigma)

    @property
    def interval95_deg(self) -> tuple[float, float]:
        """`interval95` in degrees."""
        low, high = np.degrees(self.interval95)
        return float(low), float(high)

    @property
    def roll_deg(self) -> float | None:
        """`roll` in degrees."""
        return _degrees(self.roll)

    @property
    def pitch_deg(self) -> float | None:
        """`pitch` in degrees."""
        return _degrees(self.pitch)

    @property
    def latitude_deg(self) -> float:
        """`latitude` in degrees."""
        return float(np.degrees(self.latitude))

    def __repr__(self) -> str:
        """The answer on one line, in degrees; `vars()` shows the rest."""
        verdict = "valid" if self.valid else "refused: " + ", ".join(dict.fromkeys(f.code for f in self.reasons))
        if self.heading is None or self.sigma is None:
            return f"HeadingEstimate(no heading, {verdict}, method {self.method})"
        low, high = self.interval95_deg
        return (
            f"HeadingEstimate({self.heading_deg:.2f} deg, sigma {self.sigma_deg:.3g} deg, "
            f"95 % {low:.2f} to {high:.2f} deg, {verdict}, method {self.method})"
        )

    def _repr_html_(self) -> str:
        """The same as a small table, for notebooks."""
        findings = [("reason", finding) for finding in self.reasons]
        findings += [("warning", finding) for finding in self.warnings]
        low, high = self.interval95_deg
        shown = "none" if self.heading is None else f"{self.heading_deg:.2f}°"
        spread = "unknown" if self.sigma is None else f"{self.sigma_deg:.3g}°, 95 % {low:.2f}° to {high:.2f}°"
        rows = [("heading", shown), ("sigma", spread), ("verdict", "valid" if self.valid else "refused")]
        rows += [("method", f"{self.method} ({self.method_reason})")]
        rows += [(kind, f"{finding.code}: {finding.message}") for kind, finding in findings]
        from html import escape

        cells = "".join(f"<tr><th>{escape(name)}</th><td>{escape(text)}</td></tr>" for name, text in rows)
        return f"<table>{cells}</table>"

    def to_json(self, *, posterior: bool = False) -> dict[str, Any]:
        """The object that `heading --json` prints (schema gyronorth.heading/1), in degrees; the density on request.

        `posterior` is null where the method gives no density.
        """
        deg, errors = _degrees, self.sensor_errors
        density = None if self.posterior is None else self.posterior.to_json()
        return {
            "schema": "gyronorth.heading/1",
            "heading_deg": deg(self.heading),
            "sigma_deg": deg(self.sigma),
            "interval95_deg": [deg(self.interval95[0]), deg(self.interval95[1])],
            "valid": self.valid,
            "reasons": [finding.to_json() for finding in self.reasons],
            "warnings": [finding.to_json() for finding in self.warnings],
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
            "gyro_bias_deg_h": _scaled(errors and errors.bias, DEG_PER_HOUR),
            "rate_mean_deg_h": [rate / DEG_PER_HOUR for rate in self.rate_mean],
            "rate_norm_deg_h": self.rate_norm / DEG_PER_HOUR,
            "implied_latitude_deg": deg(self.implied_latitude),
            "gyro_bias_sigma_deg_h": _scaled(errors and errors.bias_sigma, DEG_PER_HOUR),
            "scale_factor_ppm": _scaled(errors and errors.scale_factor, 1e-6),
            "scale_factor_sigma_ppm": _scaled(errors and errors.scale_factor_sigma, 1e-6),
            "disturbance": None if self.disturbance is None else self.disturbance.to_json(),
            "fitness": self.fitness,
            "orientation": None if (found := self.orientation) is None else found.to_json(),
            **({"posterior": density} if posterior else {}),
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


def _scaled(values: tuple[float, float, float] | None, unit: float) -> list[float] | None:
    return None if values is None else [value / unit for value in values]


def _degrees(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else float(np.degrees(value))
