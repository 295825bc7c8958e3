"""One posterior over the heading of one pose, whatever unit and platform do (`alignment.posterior`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from importlib.util import find_spec

import numpy as np

from gyronorth.alignment.error_budget import (
    EXCURSION_OVER_RMS,
    MOST_SCALE,
    MOTION_ALLOWANCE,
    MOTION_ALLOWANCE_MOST,
    horizontal_earth_rate,
)
from gyronorth.alignment.posterior.blocks import COUNT
from gyronorth.alignment.posterior.law import TILT
from gyronorth.alignment.posterior.model import Inferred, posterior
from gyronorth.alignment.posterior.tones import periodograms
from gyronorth.alignment.problem import Problem
from gyronorth.alignment.registry import METHODS, Options
from gyronorth.alignment.result import Attitude, Judged, Posterior, Result
from gyronorth.alignment.rounding import rounding_bias
from gyronorth.alignment.tones.side_by_side import Proposing
from gyronorth.angles import DEG_PER_HOUR
from gyronorth.arrays import Array
from gyronorth.catalogue import method_info
from gyronorth.earth import EARTH_RATE
from gyronorth.estimate import DisturbanceFound
from gyronorth.findings import Finding
from gyronorth.sensor import Sensor

#: Scale of bias or drift from which a profile is said not to fit, and the probability that a kind must have to be told.
TOLD_SCALE, TOLD = 2.0, 0.5
#: Probability of a bias far beyond the profile from which the plain mean is judged: the prior of such a bias is small.
FAULT = 0.25
#: A slow tilt is likely from the start (0.72 beside an accelerometer): told where the recording makes its odds three
#: times those, positive evidence by Kass and Raftery (J. Am. Stat. Assoc. 90, 1995).
TILT_TOLD = 3 * TILT / (1 + 2 * TILT)
#: Variance of a mean rate by noise below which there is none, (rad/s)^2, and rate in which there is no heading, rad/s.
NOISELESS, HOPELESS = 1e-28, 100 * EARTH_RATE
#: Rotation about the mean attitude, rad, that an accelerometer explains to second order.
EXPLAINED_TURN = np.radians(5.0)


class PosteriorMethod:
    """A mixture over scale of the profile, tilt, sway, settling, tones and bumps."""

    info = method_info("posterior")

    def solve(self, problem: Problem, options: Options) -> Result:
        """Heading, interval and what was inferred of one recording.

        The mean answers where there is nothing to weigh: fewer samples than blocks, no noise at all, or a rate so far
        from Earth rate that it holds no heading.
        """
        return self.solve_many([problem], options)[0]

    def solve_many(self, problems: Sequence[Problem], options: Options) -> list[Result]:
        """The same of several recordings of one length, rate and place, side by side."""
        found: dict[int, Result] = {}
        rounded: dict[int, tuple[Problem, tuple[Finding, ...]]] = {}
        alike: dict[tuple[Sensor | None, tuple[float, float] | None], list[int]] = {}
        for number, problem in enumerate(problems):
            reason = _unfit(problem)
            if reason is not None:
                found[number] = replace(METHODS["mean"].solve(problem, Options()), why=f"one pose, {reason}")
                continue
            problem, coarse = rounded[number] = _rounded(problem)
            alike.setdefault((problem.sensor, problem.attitude), []).append(number)
        for (sensor, attitude), numbers in alike.items():
            first = problems[numbers[0]]
            forces = [force for n in numbers if (force := problems[n].accel_b) is not None]
            inferred = posterior(
                _together([problems[n].gyro_b for n in numbers]),
                _together(forces) if forces else None,
                rate_hz=first.rate_hz,
                latitude=first.latitude,
                sensor=sensor,
                attitude=attitude,
                propose=_proposals,
            )
            for number, one in zip(numbers, inferred, strict=True):
                problem, coarse = rounded[number]
                result = _result(problem, one)
                found[number] = replace(result, findings=(*result.findings, *coarse))
        return [found[number] for number in range(len(problems))]


def _together(parts: list[Array]) -> Array:
    """Samples (n, 3) of each recording as (r, n, 3); one alone, which may be long, is not copied."""
    return parts[0][None] if len(parts) == 1 else np.stack(parts)


def _unfit(problem: Problem) -> str | None:
    """Why there is nothing to weigh, if so."""
    if problem.gyro_b.shape[-2] < COUNT:
        return f"fewer than {COUNT} samples"
    if problem.motion.white < NOISELESS:
        return "no noise"
    return None if np.linalg.norm(problem.mean.rate_l) < HOPELESS else "rate far from Earth rate"


def _rounded(problem: Problem) -> tuple[Problem, tuple[Finding, ...]]:
    """The problem with a profile whose turn-on bias holds the error of rounding, and the warning of it."""
    sensor, error = problem.sensor, rounding_bias(problem.gyro_b)
    least = 0.1 * (sensor.gyro.turn_on_bias if sensor is not None else DEG_PER_HOUR)
    if error <= least:
        return problem, ()
    message = (
        f"The rate is rounded to steps above its noise: its mean may be wrong by {error / DEG_PER_HOUR:.2g} deg/h, for "
        "which sigma allows. Record with more digits, or increments of angle."
    )
    told = Finding("coarse", message, float(error / DEG_PER_HOUR), float(least / DEG_PER_HOUR))
    if sensor is not None:
        bias = float(np.hypot(sensor.gyro.turn_on_bias, error))
        problem = replace(problem, sensor=replace(sensor, gyro=replace(sensor.gyro, turn_on_bias=bias)))
    return problem, (told,)


def _proposals(asked: Sequence[Proposing]) -> Sequence[tuple[Array, Array]]:
    """Those of the network that ships, where it can run; loaded for a recording that shows tones or bumps only."""
    if find_spec("onnxruntime") is None:
        return periodograms(asked)
    from gyronorth.alignment.networks.runtime import bundle_of, side_by_side

    bundle = bundle_of("learned", None)
    return periodograms(asked) if bundle.proposal is None else side_by_side(bundle.proposal)(asked)


def _result(problem: Problem, found: Inferred) -> Result:
    density, signal = found.density, horizontal_earth_rate(problem.latitude)
    attitude = Attitude(np.asarray(density.heading), np.asarray(found.roll), np.asarray(found.pitch), found.rate_l)
    claimed = dict(found.variance)
    whole, total = (density.sigma * signal) ** 2, sum(claimed.values())
    share = min(1.0, whole / max(total, np.finfo(float).tiny))
    variance = {name: np.asarray(value * share) for name, value in claimed.items()}
    variance["model"] = np.asarray(max(whole - total, 0.0))
    sensor = problem.sensor
    believed = found.rate_variance
    if sensor is not None:
        believed = found.rate_variance - claimed["turn_on_bias"] + (MOST_SCALE * sensor.gyro.turn_on_bias) ** 2
    rate_l, upright = found.rate_l, found.vertical_variance
    if sensor is not None and found.beyond > FAULT:
        rate_l = found.mean_l
        believed = claimed["noise"] + claimed["drift"] + (MOST_SCALE * sensor.gyro.turn_on_bias) ** 2
        upright = believed
    if found.sees_tilt:
        limit = EXPLAINED_TURN
    else:
        limit = np.clip(2 * density.sigma, MOTION_ALLOWANCE, np.sqrt(MOTION_ALLOWANCE_MOST))
        limit = float(limit + EXCURSION_OVER_RMS * problem.motion.angle_limit)
    limit = np.asarray(limit)
    probability = found.probability
    return Result(
        "posterior",
        attitude,
        Posterior(
            np.asarray(density.sigma), np.asarray(max(density.low, -np.pi)), np.asarray(min(density.high, np.pi))
        ),
        variance,
        np.asarray(signal),
        why=_why(found, known=sensor is not None),
        density=density.told(),
        judged=Judged(rate_l, np.asarray(believed), np.asarray(upright), limit),
        findings=_findings(found) if sensor is not None else (),
        disturbance=DisturbanceFound(
            sway_tones=found.tones,
            settling=probability["settling"],
            tilt=probability["tilt"],
            walk=probability["walk"],
            masked_s=found.masked_s,
            residual_ratio=found.white_scale,
            explained=True,
        ),
    )


def _why(found: Inferred, *, known: bool) -> str:
    words = {
        "sway": "sway",
        "tilt": "slow tilt",
        "settling": "bias settling",
        "walk": "bias random walk",
        "force": "accelerometer drift",
    }
    least = {"tilt": TILT_TOLD}
    told = [
        f"{words[name]} (probability {value:.2f})"
        for name, value in found.probability.items()
        if value >= least.get(name, TOLD)
    ]
    if found.tones >= TOLD and found.probability["sway"] < TOLD:
        told.append("sway at a steady frequency")
    if known and max(found.scale, found.drift_scale) >= TOLD_SCALE:
        told.append(f"the unit behaves as {max(found.scale, found.drift_scale):.1f} times its profile")
    return "one pose, " + (", ".join(told) if told else "undisturbed")


def _findings(found: Inferred) -> tuple[Finding, ...]:
    scale = max(found.scale, found.drift_scale)
    if scale < TOLD_SCALE:
        return ()
    message = f"This unit behaves as {scale:.1f} times its profile; sigma allows for it."
    return (Finding("profile_scaled", message, scale, TOLD_SCALE),)


METHOD = PosteriorMethod()
