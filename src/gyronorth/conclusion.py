"""From what a method found to an estimate: reasons, warnings, poses, and the parts of sigma in angles."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gyronorth.angles import wrap_heading
from gyronorth.conditioning import longest_hold, still_segments
from gyronorth.earth import EARTH_RATE
from gyronorth.estimate import HeadingBatch, HeadingEstimate, Pose, Turn, Unrest
from gyronorth.findings import Finding
from gyronorth.recording import Recording, shift_utc
from gyronorth.solution import Data, Disturbance, Solution, saturation_gates
from gyronorth.validity import FEWEST_SAMPLES, SHORTEST, Gate, implied_latitude


@dataclass(frozen=True)
class Found:
    """What one method found of one recording, before it becomes an estimate."""

    method: str
    solution: Solution
    why: str
    moved: Disturbance | None = None
    poses: tuple[Pose, ...] = ()
    turns: tuple[Turn, ...] = ()
    gyro_bias: tuple[float, float, float] | None = None
    bundle: str | None = None
    warnings: tuple[Finding, ...] = ()
    unrest: Unrest | None = None


def as_batch(solution: Solution, extra: list[Gate], method: NDArray[np.str_]) -> HeadingBatch:
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


def estimate_of(recording: Recording, data: Data, found: Found) -> HeadingEstimate:
    levelled, solution = found.solution.levelled, found.solution
    known = not any(gate.code == "bundle_mismatch" for gate in solution.gates)
    bounds = as_batch(solution, [], np.asarray(found.method))
    poses = found.poses or ((Pose(0.0, recording.duration, float(levelled.heading)),) if known else ())
    first, last = (round(edge * data.rate_hz) for edge in (poses[-1].start, poses[-1].end)) if poses else (0, None)
    mean = data.gyro_b[first:last].mean(axis=0)
    norm = float(np.linalg.norm(mean))
    arm = EARTH_RATE * np.cos(data.latitude)
    if found.method in ("mean", "inertial") and "deviation" not in solution.parts:
        arm = np.sqrt(np.hypot(*levelled.rate_l[:2]) * arm)
    arm = max(float(arm), np.finfo(float).tiny)
    gates = [*solution.gates, *saturation_gates(data)]
    reasons = [finding for gate in gates if (finding := gate.finding())]
    return HeadingEstimate(
        heading=float(levelled.heading) if known else None,
        sigma=float(solution.sigma) if known else None,
        interval95=(float(bounds.low), float(bounds.high)),
        reasons=tuple(_explained(finding, recording) for finding in reasons),
        warnings=(*_warnings(recording, data, found.moved), *found.warnings),
        method=found.method,
        method_reason=found.why,
        bundle=found.bundle,
        roll=float(levelled.roll),
        pitch=float(levelled.pitch),
        latitude=data.latitude,
        sensor=None if data.sensor is None else data.sensor.name,
        duration=recording.duration,
        rate_hz=recording.rate_hz,
        end_time_utc=shift_utc(recording.start_time_utc, recording.duration),
        poses=poses,
        turns=found.turns,
        sigma_parts={name: float(min(np.sqrt(value) / arm, np.pi)) for name, value in solution.parts.items()},
        gyro_bias=found.gyro_bias,
        rate_mean=(float(mean[0]), float(mean[1]), float(mean[2])),
        rate_norm=norm,
        implied_latitude=float(implied_latitude(levelled.rate_l)) if norm > 0 else None,
        unrest=found.unrest,
    )


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
        message = "No sensor profile: the size of the gyro's errors is inferred from the recording itself."
        warnings.append(Finding("bias_unknown", message))
    if data.accel_b is None and data.attitude is None:
        cost = np.tan(abs(data.latitude))
        message = f"No accelerometer: the unit is taken as level; each degree of tilt costs up to {cost:.2f} deg."
        warnings.append(Finding("assumed_level", message))
    if moved is not None and moved.detected:
        warnings.append(_swaying(moved))
    first, held = longest_hold(data.gyro_b)
    noiseless = data.sensor is not None and data.sensor.gyro.white == 0  # simulated
    if held >= max(FEWEST_SAMPLES, SHORTEST * data.rate_hz) and not noiseless:
        warnings.append(_frozen(first / data.rate_hz, held / data.rate_hz))
    warnings += [Finding(note.code, note.message, note.value, note.limit) for note in recording.notes]
    return tuple(warnings)


def _frozen(start: float, duration: float) -> Finding:
    """The warning of an output that does not change."""
    message = (
        f"The gyro's output does not change from {start:.1f} to {start + duration:.1f} s: the sensor or its link hung, "
        "or it rounds far above its noise. Sigma knows nothing of that."
    )
    return Finding("frozen", message, duration, SHORTEST)


def _swaying(moved: Disturbance) -> Finding:
    """The warning of sway, with the statistic that showed it."""
    if moved.angle > moved.angle_limit or moved.tilt <= moved.tilt_limit:
        what, value, limit = "The attitude swayed by {:.1f} arcsec rms about its trend", moved.angle, moved.angle_limit
    else:
        what, value, limit = "The tilt changed by {:.1f} arcsec over the recording", moved.tilt, moved.tilt_limit
    value, limit = (float(np.degrees(angle) * 3600) for angle in (value, limit))
    return Finding("swaying", what.format(value) + f"; at rest it stays below {limit:.1f} arcsec.", value, limit)
