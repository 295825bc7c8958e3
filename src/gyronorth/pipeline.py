"""From a recording, or a batch, to headings with sigma and verdict: joins the rooms."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyronorth.angles import DEG_PER_HOUR, wrap_heading
from gyronorth.conditioning import decimated, still_segments
from gyronorth.earth import EARTH_RATE
from gyronorth.recording import InputError, Recording, shift_utc
from gyronorth.sensor import Sensor, read_sensor
from gyronorth.solution import (
    Data,
    Disturbance,
    Solution,
    disturbance,
    mean_alignment,
    prefers_inertial,
    saturation_gates,
    solve_inertial,
    solve_mean,
    unknown,
)
from gyronorth.validity import Finding, Gate, implied_latitude, length_gate

Array = NDArray[np.float64]

#: Methods that `heading` offers.
METHODS = ("auto", "mean", "inertial")
#: Latitudes given and stored may differ by this, rad, before it is a mistake.
LATITUDE_CONFLICT = np.radians(0.1)
#: Recordings of a batch are worked in groups of about this many samples, to bound memory.
GROUP_SAMPLES = 1_500_000


@dataclass(frozen=True)
class Pose:
    """A stretch of standing still."""

    start: float  # s from the start of the recording
    end: float  # s
    heading: float  # rad


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
    sigma_parts: dict[str, float]  # rad, at most pi each; the root sum square is sigma where sigma is small
    gyro_bias: tuple[float, float, float] | None  # rad/s, where the method estimates it
    rate_mean: tuple[float, float, float]  # mean angular rate in the body frame, rad/s
    rate_norm: float  # its norm, rad/s
    implied_latitude: float | None  # asin(-w_down / |w|), rad

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
            "sigma_parts_deg": {name: deg(value) for name, value in self.sigma_parts.items()},
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


def heading(
    recording: Recording,
    *,
    latitude: float | None = None,
    sensor: Sensor | str | None = None,
    method: str = "auto",
    attitude: tuple[float, float] | None = None,
) -> HeadingEstimate:
    """Heading of a recording from the Earth rate it senses, with sigma and verdict.

    Parameters
    ----------
    recording : Recording
        Angular rate and, if there is one, specific force.
    latitude : float, optional
        Geodetic latitude, rad; taken from the recording when left out.
    sensor : Sensor or str, optional
        Profile: a `Sensor`, a shipped name or a file. Without one the bias scale is inferred
        from what can be seen, and `bias_unknown` warns.
    method : {"auto", "mean", "inertial"}
        "auto" takes the mean, or, if the recording is disturbed, the method whose own sigma
        is smallest.
    attitude : tuple of float, optional
        Known roll and pitch, rad, in place of levelling by the accelerometer.

    Returns
    -------
    HeadingEstimate

    Raises
    ------
    InputError
        If the latitude is missing, out of range or contradicts the recording, the method is
        unknown, or it needs an accelerometer that the recording does not have; or the heading
        would be valid but for a note of the reader that wants a declaration (`Note.blocking`).
    """
    data = Data(
        recording.gyro_b,
        recording.accel_b,
        recording.rate_hz,
        _latitude(latitude, recording),
        None if sensor is None else read_sensor(sensor),
        attitude,
    )
    _check_method(method, data)
    mean = mean_alignment(data)
    short = length_gate(data.gyro_b.shape[-2], data.duration, ())
    if short.failed:
        reasons = [short.finding()]
        return _estimate(recording, data, unknown(mean), "mean", "too short for any other", reasons, None)
    moved = disturbance(data, mean)
    chosen, solution, why = _choose(method, data, moved, solve_mean(data, mean, moved))
    reasons = [gate.finding() for gate in [*solution.gates, *saturation_gates(data)]]
    estimate = _estimate(recording, data, solution, chosen, why, reasons, moved)
    for note in recording.notes:
        if note.blocking and estimate.valid:
            raise InputError(note.message)
    return estimate


def heading_batch(
    gyro_b: ArrayLike,
    accel_b: ArrayLike | None = None,
    *,
    rate_hz: float,
    latitude: float,
    sensor: Sensor | str | None = None,
    method: str = "mean",
) -> HeadingBatch:
    """Headings of many recordings of one length at once.

    Parameters
    ----------
    gyro_b, accel_b : array_like, shape (recordings, samples, 3)
        Angular rate, rad/s, and specific force, m/s^2; without the latter the unit is taken
        as level.
    rate_hz : float
        Sample rate, Hz.
    latitude : float
        rad.
    sensor, method
        As in `heading`.

    Returns
    -------
    HeadingBatch
    """
    gyro = np.asarray(gyro_b, dtype=float)
    accel = None if accel_b is None else np.asarray(accel_b, dtype=float)
    if gyro.ndim != 3 or gyro.shape[-1] != 3 or (accel is not None and accel.shape != gyro.shape):
        raise ValueError(
            f"gyro_b has shape {gyro.shape}, accel_b {None if accel is None else accel.shape}; "
            "(recordings, samples, 3) is expected of both."
        )
    profile = None if sensor is None else read_sensor(sensor)
    group = max(1, GROUP_SAMPLES // gyro.shape[1])
    pieces = []
    for start in range(0, len(gyro), group):
        part = slice(start, start + group)
        data = Data(gyro[part], None if accel is None else accel[part], rate_hz, latitude, profile)
        _check_method(method, data)
        pieces.append(_batch(method, data))
    return HeadingBatch(*(np.concatenate([getattr(piece, name) for piece in pieces]) for name in vars(pieces[0])))


def convergence(
    recording: Recording,
    *,
    latitude: float | None = None,
    sensor: Sensor | str | None = None,
    method: str = "mean",
    attitude: tuple[float, float] | None = None,
    points: int = 60,
) -> Convergence:
    """Heading and interval against the time used, from the start of the recording.

    Parameters
    ----------
    recording, latitude, sensor, method, attitude
        As in `heading`.
    points : int
        Number of times, evenly spaced in the logarithm from 5 s, or a twentieth, to the end.
    """
    slow = decimated(recording, min(10.0, recording.rate_hz))
    times = np.geomspace(min(5.0, slow.duration / 20), slow.duration, points)
    counts = np.unique(np.maximum(2, np.round(times * slow.rate_hz).astype(int)))
    runs = [
        heading(
            replace(slow.window(0.0, count / slow.rate_hz), gaps=(), notes=()),
            latitude=latitude,
            sensor=sensor,
            method=method,
            attitude=attitude,
        )
        for count in counts
    ]
    angle = np.array([run.heading for run in runs], dtype=float)
    low, high = (np.array([run.interval95[side] for run in runs]) for side in (0, 1))
    return Convergence(
        time=counts / slow.rate_hz,
        heading=angle,
        half_width=np.where(high - low >= 2 * np.pi, np.pi, ((high - low) % (2 * np.pi)) / 2),
        valid=np.array([run.valid for run in runs]),
    )


def _check_method(method: str, data: Data) -> None:
    if method not in METHODS:
        raise InputError(f"Method {method!r} is not known; one of {', '.join(METHODS)} is expected.")
    if method == "inertial" and data.accel_b is None:
        raise InputError(
            "Method 'inertial' traces gravity and needs specific force; the recording has angular rate only. "
            "Use --method mean."
        )


def _latitude(given: float | None, recording: Recording) -> float:
    stored = recording.latitude
    if given is None and stored is None:
        raise InputError(
            "The latitude is not known: neither given nor in the file. Pass --latitude DEG (north positive); "
            "Earth rate cannot be read without it."
        )
    if given is not None and not (np.isfinite(given) and abs(given) <= np.pi / 2):
        raise InputError(f"The latitude is {np.degrees(given):g} deg; a value in [-90, 90] is expected.")
    if given is not None and stored is not None and abs(given - stored) > LATITUDE_CONFLICT:
        raise InputError(
            f"Latitude {np.degrees(given):.4f} deg was given, but {recording.source or 'the recording'} says "
            f"{np.degrees(stored):.4f} deg; they differ by more than 0.1 deg. Correct one of them."
        )
    return float(stored if given is None else given)  # type: ignore[arg-type]


def _choose(method: str, data: Data, moved: Disturbance, mean: Solution) -> tuple[str, Solution, str]:
    """The method of one recording, its solution and the reason for the choice."""
    if method == "mean":
        return "mean", mean, "asked for"
    if method == "inertial":
        return "inertial", solve_inertial(data, moved), "asked for"
    state = "one pose, swaying" if moved.detected else "one pose, undisturbed"
    if data.accel_b is None or data.attitude is not None:
        return "mean", mean, state + (", no specific force to trace gravity with" if moved.detected else "")
    if not moved.detected and data.sensor is not None:
        return "mean", mean, state
    traced = solve_inertial(data, moved)
    comparison = f"sigma {np.degrees(traced.sigma):.2f} deg by inertial, {np.degrees(mean.sigma):.2f} deg by mean"
    if prefers_inertial(data, moved, mean, traced):
        return "inertial", traced, f"one pose, swaying: {comparison}"
    return "mean", mean, f"{state}: {comparison}" if moved.detected else state


def _batch(method: str, data: Data) -> HeadingBatch:
    found = mean_alignment(data)
    shape = found.heading.shape
    short = length_gate(data.gyro_b.shape[-2], data.duration, shape)
    names = np.full(shape, "mean", dtype="<U16")
    if short.failed.any():
        return _as_batch(unknown(found), [short], names)
    moved = disturbance(data, found)
    mean = solve_mean(data, found, moved)
    extra = saturation_gates(data)
    result = _as_batch(mean, extra, names)
    asked = np.full(shape, method == "inertial" or (method == "auto" and data.sensor is None)) | moved.detected
    if method == "mean" or data.accel_b is None or not asked.any():
        return result
    # Only what may take the other method pays for it.
    some = replace(data, gyro_b=data.gyro_b[asked], accel_b=data.accel_b[asked])
    found = mean_alignment(some)
    moved = disturbance(some, found)
    traced = solve_inertial(some, moved)
    take = np.ones(asked.sum(), bool)
    if method == "auto":
        take = prefers_inertial(some, moved, solve_mean(some, found, moved), traced)
    other = _as_batch(traced, saturation_gates(some), np.full(asked.sum(), "inertial", dtype="<U16"))
    rows = np.flatnonzero(asked)[take]
    for name, values in vars(other).items():
        getattr(result, name)[rows] = values[take]
    return result


def _as_batch(solution: Solution, extra: list[Gate], method: NDArray[np.str_]) -> HeadingBatch:
    centre, half = solution.levelled.heading, solution.half_width
    whole = half >= np.pi
    failed = np.any([gate.failed for gate in [*solution.gates, *extra]], axis=0)
    return HeadingBatch(
        heading=centre,
        sigma=solution.sigma,
        low=np.where(whole, 0.0, wrap_heading(centre - half)),
        high=np.where(whole, 2 * np.pi, wrap_heading(centre + half)),
        valid=~failed,
        method=method,
    )


def _estimate(
    recording: Recording,
    data: Data,
    solution: Solution,
    method: str,
    why: str,
    reasons: list[Finding | None],
    moved: Disturbance | None,
) -> HeadingEstimate:
    found = solution.levelled
    result = _as_batch(solution, [], np.asarray(method))
    mean = data.gyro_b.mean(axis=0)
    norm = float(np.linalg.norm(mean))
    arm = np.sqrt(max(np.hypot(*found.rate_l[:2]) * _horizontal_earth_rate(data.latitude), np.finfo(float).tiny))
    return HeadingEstimate(
        heading=float(found.heading),
        sigma=float(solution.sigma),
        interval95=(float(result.low), float(result.high)),
        reasons=tuple(_explained(finding, recording) for finding in reasons if finding),
        warnings=_warnings(recording, data, moved),
        method=method,
        method_reason=why,
        bundle=None,
        roll=float(found.roll),
        pitch=float(found.pitch),
        latitude=data.latitude,
        sensor=None if data.sensor is None else data.sensor.name,
        duration=recording.duration,
        rate_hz=recording.rate_hz,
        end_time_utc=shift_utc(recording.start_time_utc, recording.duration),
        poses=(Pose(0.0, recording.duration, float(found.heading)),),
        sigma_parts={name: float(min(np.sqrt(value) / arm, np.pi)) for name, value in solution.parts.items()},
        gyro_bias=None,
        rate_mean=(float(mean[0]), float(mean[1]), float(mean[2])),
        rate_norm=norm,
        implied_latitude=float(implied_latitude(found.rate_l)) if norm > 0 else None,
    )


def _horizontal_earth_rate(latitude: float) -> float:
    return float(EARTH_RATE * np.cos(latitude))


def _explained(finding: Finding, recording: Recording) -> Finding:
    """Point from `motion` to the segment that stood still longest."""
    if finding.code != "motion":
        return finding
    segments = still_segments(recording.gyro_b, rate_hz=recording.rate_hz)
    start, end = max(segments, key=lambda segment: segment[1] - segment[0], default=(0.0, recording.duration))
    if end - start >= recording.duration:
        return finding
    start, end = np.ceil(start), np.floor(end)
    hint = f" It stood still longest from {start:.0f} to {end:.0f} s: try --window {start:.0f}:{end:.0f}."
    return replace(finding, message=finding.message + hint)


def _warnings(recording: Recording, data: Data, moved: Disturbance | None) -> tuple[Finding, ...]:
    warnings = []
    if data.sensor is None:
        message = "No sensor profile: the bias is inferred from the norm and the vertical component of the mean rate."
        warnings.append(Finding("bias_unknown", message))
    if data.accel_b is None and data.attitude is None:
        cost = np.tan(abs(data.latitude))
        message = f"No accelerometer: the unit is taken as level; each degree of tilt costs up to {cost:.2f} deg."
        warnings.append(Finding("assumed_level", message))
    if moved is not None and moved.detected:
        warnings.append(_swaying(moved))
    warnings += [Finding(note.code, note.message, note.value, note.limit) for note in recording.notes]
    return tuple(warnings)


def _swaying(moved: Disturbance) -> Finding:
    """The warning of sway, with the statistic that showed it."""
    if moved.angle > moved.angle_limit or moved.tilt <= moved.tilt_limit:
        what, value, limit = "The attitude swayed by {:.1f} arcsec rms about its trend", moved.angle, moved.angle_limit
    else:
        what, value, limit = "The tilt changed by {:.1f} arcsec over the recording", moved.tilt, moved.tilt_limit
    value, limit = (float(np.degrees(angle) * 3600) for angle in (value, limit))
    return Finding("swaying", what.format(value) + f"; at rest it stays below {limit:.1f} arcsec.", value, limit)


def _degrees(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else float(np.degrees(value))
