"""From what a method found to an estimate or a batch: the gates run here, once, for one, many and streams."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce

import numpy as np

from gyronorth.alignment.checks import checks_of
from gyronorth.alignment.gates import FEWEST_SAMPLES, SHORTEST, implied_latitude
from gyronorth.alignment.judging import judge
from gyronorth.alignment.motion import MotionStatistics
from gyronorth.alignment.outputs import longest_hold
from gyronorth.alignment.problem import Problem
from gyronorth.alignment.registry import METHODS
from gyronorth.alignment.result import Result
from gyronorth.angles import wrap_heading
from gyronorth.arrays import Array, Mask, mean_of_rows
from gyronorth.estimate import HeadingBatch, HeadingEstimate, Pose
from gyronorth.findings import Finding
from gyronorth.recording import shift_utc


def estimate(
    problem: Problem,
    result: Result,
    *,
    peaks: tuple[Array, Array | None] | None = None,
    notes: Sequence[Finding] = (),
    start_time_utc: str | None = None,
    rate_hz: float | None = None,
) -> HeadingEstimate:
    """The estimate of one recording, with every reason to refuse it and every warning.

    Parameters
    ----------
    problem : Problem
        Of one recording.
    result : Result
        What a method found of it.
    peaks : tuple, optional
        Largest output of gyro and accelerometer, where the samples are means that do not show it.
    notes : sequence of Finding
        Remarks of the reader, told as warnings.
    start_time_utc : str, optional
        ISO 8601 time of the first sample.
    rate_hz : float, optional
        Rate of the unit, Hz, where the problem's samples are means over more.
    """
    low, high = _interval(result)
    poses = result.poses
    if not poses and result.known:
        poses = (Pose(0.0, problem.duration, float(result.attitude.heading)),)
    first, last = (round(edge * problem.rate_hz) for edge in (poses[-1].start, poses[-1].end)) if poses else (0, None)
    mean = mean_of_rows(problem.gyro_b[first:last])
    norm = float(np.linalg.norm(mean))
    gates = judge(problem, result, peaks=peaks)
    reasons = [*result.refusals, *(finding for gate in gates if (finding := gate.finding()))]
    arm = np.maximum(result.arm, np.finfo(float).tiny)
    return HeadingEstimate(
        heading=float(result.attitude.heading) if result.known else None,
        sigma=float(result.posterior.sigma) if result.known else None,
        interval95=(float(low), float(high)),
        reasons=tuple(_explained(finding, problem) for finding in reasons),
        warnings=(*_warnings(problem, result), *notes, *result.findings),
        method=result.method,
        method_reason=result.why,
        bundle=result.bundle,
        roll=float(result.attitude.roll),
        pitch=float(result.attitude.pitch),
        latitude=problem.latitude,
        sensor=None if problem.sensor is None else problem.sensor.name,
        duration=problem.duration,
        rate_hz=problem.rate_hz if rate_hz is None else rate_hz,
        end_time_utc=shift_utc(start_time_utc, problem.duration),
        poses=poses,
        turns=result.turns,
        sigma_parts={name: float(min(np.sqrt(value) / arm, np.pi)) for name, value in result.variance.items()},
        sensor_errors=result.sensor_errors,
        rate_mean=(float(mean[0]), float(mean[1]), float(mean[2])),
        rate_norm=norm,
        implied_latitude=float(implied_latitude(result.attitude.rate_l)) if norm > 0 else None,
        disturbance=result.disturbance,
        posterior=result.density,
        level_in_heading=METHODS.info(result.method).level_in_heading,
        checks=checks_of(gates, samples=problem.gyro_b.shape[-2], duration=problem.duration),
    ).checked()


def batch(problem: Problem, groups: Sequence[tuple[Mask, Problem, Result]]) -> HeadingBatch:
    """The estimates of a batch of shape (n,), from the groups of `registry.solve_batch`."""
    count = len(problem.gyro_b)
    angles = (np.full(count, np.nan) for _ in range(4))
    found = HeadingBatch(*angles, valid=np.zeros(count, dtype=bool), method=np.full(count, "", "<U32"))
    for where, some, result in groups:
        low, high = _interval(result)
        failed = reduce(np.logical_or, (gate.failed for gate in judge(some, result)))
        found.heading[where], found.sigma[where] = result.attitude.heading, result.posterior.sigma
        found.low[where], found.high[where] = low, high
        sound = np.isfinite(result.attitude.heading + result.posterior.sigma + low + high) & (
            result.posterior.sigma > 0
        )
        found.valid[where] = ~(failed | bool(result.refusals)) & sound
        found.method[where] = result.method
    return found


def refusal(
    finding: Finding, *, method: str, latitude: float, duration: float, rate_hz: float, sensor: str | None
) -> HeadingEstimate:
    """The estimate of a recording of which nothing can be worked out, for one reason."""
    return HeadingEstimate(
        heading=None,
        sigma=None,
        interval95=(0.0, 2 * np.pi),
        reasons=(finding,),
        warnings=(),
        method=method,
        method_reason="nothing could be worked out",
        bundle=None,
        roll=None,
        pitch=None,
        latitude=latitude,
        sensor=sensor,
        duration=duration,
        rate_hz=rate_hz,
        end_time_utc=None,
        poses=(),
        turns=(),
        sigma_parts={},
        sensor_errors=None,
        rate_mean=(0.0, 0.0, 0.0),
        rate_norm=0.0,
        implied_latitude=None,
    )


def _interval(result: Result) -> tuple[Array, Array]:
    """Ends of the 95 % interval on the circle, rad; the whole circle is [0, 2 pi]."""
    centre, posterior = result.attitude.heading, result.posterior
    low = np.where(posterior.whole, 0.0, wrap_heading(centre + posterior.low))
    return low, np.where(posterior.whole, 2 * np.pi, wrap_heading(centre + posterior.high))


def _explained(finding: Finding, problem: Problem) -> Finding:
    """Point from `motion` to the stretch that stood still longest."""
    if finding.code != "motion":
        return finding
    rate_hz, stretches = problem.rate_hz, problem.segments.stretches
    first, last = max(stretches, key=lambda stretch: stretch[1] - stretch[0], default=(0, 0))
    start, end = np.ceil(first / rate_hz), np.floor(last / rate_hz)
    if end <= start or end - start >= problem.duration - 1:
        return finding
    hint = f" It stood still longest from {start:.0f} to {end:.0f} s: try --window {start:.0f}:{end:.0f}."
    return replace(finding, message=finding.message + hint)


def _warnings(problem: Problem, result: Result) -> list[Finding]:
    warnings: list[Finding] = []
    if problem.sensor is None:
        message = "No sensor profile: the size of the gyro's errors is inferred from the recording itself."
        warnings.append(Finding("bias_unknown", message))
    if problem.sensor is not None and problem.sensor.bounds:
        message = (
            f"The profile {problem.sensor.name} has upper bounds in place of figures "
            f"({', '.join(problem.sensor.bounds)}): sigma is that or less. A longer recording at rest "
            "(gyronorth allan -o) would tell them."
        )
        warnings.append(Finding("profile_bounds", message))
    if problem.accel_b is None and problem.attitude is None:
        cost = np.tan(abs(problem.latitude))
        message = f"No accelerometer: the unit is taken as level; each degree of tilt costs up to {cost:.2f} deg."
        warnings.append(Finding("assumed_level", message))
    told = any(finding.code == "swaying" for finding in result.findings)
    if result.swaying and problem.motion.detected and not told:
        warnings.append(_swaying(problem.motion))
    first, held = longest_hold(problem.gyro_b)
    noiseless = problem.sensor is not None and problem.sensor.gyro.white == 0  # simulated
    if held >= max(FEWEST_SAMPLES, SHORTEST * problem.rate_hz) and not noiseless:
        warnings.append(_frozen(first / problem.rate_hz, held / problem.rate_hz))
    return warnings


def _frozen(start: float, duration: float) -> Finding:
    """The warning of an output that does not change."""
    message = (
        f"The gyro's output does not change from {start:.1f} to {start + duration:.1f} s: the sensor or its link hung, "
        "or it rounds far above its noise. Sigma knows nothing of that."
    )
    return Finding("frozen", message, duration, SHORTEST)


def _swaying(motion: MotionStatistics) -> Finding:
    """The warning of sway, with the statistic that showed it."""
    text = "The attitude swayed by {:.1f} arcsec rms about its trend"
    value, limit = motion.angle, motion.angle_limit
    if motion.angle <= motion.angle_limit and motion.tilt > motion.tilt_limit:
        text = "The tilt changed by {:.1f} arcsec over the recording"
        value, limit = motion.tilt, motion.tilt_limit
    value, limit = (float(np.degrees(angle) * 3600) for angle in (value, limit))
    return Finding("swaying", text.format(value) + f"; at rest it stays below {limit:.1f} arcsec.", value, limit)
