"""Solutions of the methods beside mean and inertial: turned, bayes, and trained networks.

Each takes a `Data` of one recording and gives a `Solution`, so that the verdict and the
report treat all methods alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from gyronorth.alignment.closed_form import Levelled
from gyronorth.alignment.turned_segments import Segments, find_segments
from gyronorth.arrays import Array
from gyronorth.attitude import mat_lb
from gyronorth.conditioning import decimate
from gyronorth.deviation import DeviationModel, rate_surplus
from gyronorth.earth import EARTH_RATE
from gyronorth.estimate import Pose, Turn, Unrest
from gyronorth.findings import Finding
from gyronorth.solution import Data, Disturbance, Solution, claimed_parts, solve_mean
from gyronorth.uncertainty import NORMAL_975, SIGMA_UNKNOWN, von_mises
from gyronorth.validity import Gate, rate_gates, width_gates

if TYPE_CHECKING:
    from gyronorth.alignment.bundle import Mismatch
    from gyronorth.alignment.learned import LoadedBundle
    from gyronorth.alignment.turned import TurnedFit


#: Rate, Hz, at which `bayes` works, and the durations, s, that its grid of tones is made for.
BAYES_RATE, BAYES_SHORTEST, BAYES_LONGEST = 3.0, 30.0, 300.0
#: Residuals over the noise law, root mean square, above which poses and turns contradict each other.
MISFIT_LIMIT = 5.0
#: Gates of the closed form that judge the recording and not the method.
OF_THE_RECORDING = ("rate_norm", "implied_latitude", "motion")


@dataclass(frozen=True)
class TurnedSolution:
    """A turned alignment, ready for the estimate."""

    solution: Solution
    fit: TurnedFit
    poses: tuple[Pose, ...]
    turns: tuple[Turn, ...]
    warnings: tuple[Finding, ...]


def segments_of(data: Data) -> Segments:
    """Poses and turns of one recording."""
    bias = None if data.sensor is None or data.sensor.gyro.turn_on_bias == 0 else data.sensor.gyro.turn_on_bias
    return find_segments(data.gyro_b, rate_hz=data.rate_hz, turn_on_bias=bias)


def solve_turned(data: Data, segments: Segments, turn_angles: Array | None) -> TurnedSolution:
    """Heading, bias and scale factor from poses and turns (`alignment.turned`)."""
    from gyronorth.alignment.turned import turned

    fit = turned(
        data.gyro_b,
        data.accel_b,
        rate_hz=data.rate_hz,
        latitude=data.latitude,
        errors=data.sensor,
        turn_angles=turn_angles,
        segments=segments,
    )
    sigma, half = von_mises(np.asarray(1 / max(fit.sigma, 1e-12) ** 2))
    signal = EARTH_RATE * np.cos(data.latitude)
    parts = {name: np.asarray((value * signal) ** 2) for name, value in fit.sigma_parts.items()}
    first, last = (
        (round(edge * data.rate_hz) for edge in (fit.poses[-1].start, fit.poses[-1].end)) if fit.poses else (0, None)
    )
    rate_b = data.gyro_b[first:last].mean(axis=0) - np.array(fit.gyro_bias)
    found = Levelled(
        np.asarray(fit.heading),
        np.asarray(fit.roll),
        np.asarray(fit.pitch),
        mat_lb(fit.roll, fit.pitch) @ rate_b,
        None,
    )
    misfit = np.asarray(np.sqrt(fit.chi2 / fit.dof))
    gates = [
        Gate(
            "motion",
            "The rates of the poses differ from one Earth rate and one bias by {value:.1f} times their noise; at most "
            "{limit:.1f} is believed. Likely the unit moved while it should have stood still.",
            misfit,
            np.asarray(MISFIT_LIMIT),
            misfit > MISFIT_LIMIT,
        ),
        *width_gates(
            half,
            variance=sum(parts.values(), np.zeros(())),
            noise_variance=parts["noise"],
            latitude=data.latitude,
            duration=data.duration,
        ),
    ]
    warnings = ()
    if fit.bias_rejected:
        message = "The gyro bias lies outside the sensor profile, which was not used for it; sigma allows for any bias."
        warnings = (Finding("bias_unknown", message),)
    poses = tuple(
        Pose(p.start, p.end, p.heading, float(np.linalg.norm(p.residual_b)), p.residual_sigma) for p in fit.poses
    )
    turns = tuple(Turn(turn.start, turn.end, turn.angle) for turn in fit.turns)
    return TurnedSolution(Solution(found, parts, sigma, half, gates), fit, poses, turns, warnings)


def _samples(start: float, end: float, rate_hz: float) -> slice:
    return slice(round(start * rate_hz), round(end * rate_hz))


def bayes_fits(data: Data) -> bool:
    """Whether `solve_bayes` is made for records of this rate and duration."""
    return data.rate_hz >= BAYES_RATE and BAYES_SHORTEST <= data.duration <= BAYES_LONGEST + 1


def part_of(data: Data, seconds: float) -> Data:
    """The first `seconds`, s, or the last where negative; all where there are no more."""
    count = round(abs(seconds) * data.rate_hz)
    part = slice(None, count) if seconds > 0 else slice(max(data.gyro_b.shape[-2] - count, 0), None)
    accel_b = None if data.accel_b is None else data.accel_b[..., part, :]
    return replace(data, gyro_b=data.gyro_b[..., part, :], accel_b=accel_b)


def solve_bayes(data: Data, mean: Levelled, moved: Disturbance) -> tuple[Solution, Unrest]:
    """Model averaging over tones, settling and bumps (`alignment.bayes`) of one recording, and what it found."""
    from gyronorth.alignment.bayes import bayes

    gyro_l = decimate(data.gyro_b, rate_hz=data.rate_hz, to_hz=BAYES_RATE) @ mat_lb(mean.roll, mean.pitch).T
    errors = None if data.sensor is None else data.sensor.gyro
    fit = bayes(gyro_l, rate_hz=BAYES_RATE, latitude=data.latitude, errors=errors)
    low, high = fit.interval95
    half = ((high - low) % (2 * np.pi)) / 2 if high - low < 2 * np.pi else np.pi
    found = replace(mean, heading=np.asarray(fit.heading), rate_l=fit.rate_l)
    unrest = Unrest(fit.tones, fit.settling, None, None, fit.bumps / BAYES_RATE, fit.noise, True)
    return _of_disturbed(data, found, moved, sigma=fit.sigma, half=half), unrest


def solve_learned(
    data: Data, mean: Levelled, moved: Disturbance, bundle: LoadedBundle
) -> tuple[Solution, Unrest | None]:
    """Proposals of a network weighed by evidence, and what they found; None if the bundle does not fit."""
    from gyronorth.alignment.bundle import RecordingFacts, mismatch
    from gyronorth.alignment.learned import solve

    misfits = mismatch(bundle.info, RecordingFacts(data.rate_hz, data.duration, data.latitude))
    if misfits:
        return mismatched(mean, bundle, misfits), None
    gyro_l = data.gyro_b @ mat_lb(mean.roll, mean.pitch).T
    errors = None if data.sensor is None else data.sensor.gyro
    solved = solve(bundle, gyro_l[None], rate_hz=data.rate_hz, latitude=data.latitude, errors=errors)
    one = solved.found[0]
    found = replace(mean, heading=solved.heading[0], rate_l=one.rate_l)
    half = min(float(solved.high[0] - solved.low[0]) / 2, np.pi)
    bumps, excess = one.bumps / solved.rate_hz, float(np.sqrt(one.excess))
    unrest = Unrest(one.tones, one.settling, one.tilt, one.walk, bumps, excess, bool(solved.fits[0]))
    return _of_disturbed(data, found, moved, sigma=float(solved.sigma[0]), half=half), unrest


def _of_disturbed(data: Data, found: Levelled, moved: Disturbance, *, sigma: float, half: float) -> Solution:
    """The solution of a method that models disturbance: what exceeds the profile's parts is called sway."""
    whole = np.asarray((sigma * EARTH_RATE * np.cos(data.latitude)) ** 2)
    parts = {"noise": moved.white} if data.sensor is None else claimed_parts(data, found, "mean")
    parts = {**parts, "sway": np.maximum(whole - sum(parts.values()), 0.0)}
    total = np.maximum(whole, sum(parts.values()))
    gates = [
        *rate_gates(
            found.rate_l,
            variance=total,
            vertical_variance=total,
            latitude=data.latitude,
            known=data.sensor is not None,
        ),
        *width_gates(
            np.asarray(half),
            variance=total,
            noise_variance=parts["noise"],
            latitude=data.latitude,
            duration=data.duration,
        ),
    ]
    return Solution(found, parts, np.asarray(sigma), np.asarray(half), gates)


def mismatched(mean: Levelled, bundle: LoadedBundle, misfits: Sequence[Mismatch]) -> Solution:
    """No heading: every way in which the recording does not fit the bundle is a reason."""
    gates = [
        Gate(
            "bundle_mismatch",
            f"The bundle {bundle.name} does not fit: {misfit.message}.".replace("{", "{{").replace("}", "}}"),
            np.asarray(np.nan if misfit.value is None else misfit.value),
            np.asarray(np.nan if misfit.limit is None else misfit.limit),
            np.asarray(True),
        )
        for misfit in misfits
    ]
    return Solution(mean, {}, np.asarray(SIGMA_UNKNOWN), np.asarray(np.pi), gates)


def solve_network(data: Data, mean: Levelled, moved: Disturbance, bundle: LoadedBundle) -> Solution:
    """Heading of a trained bundle, with the error it had on recordings it had not seen.

    A network claims no uncertainty of its own. Its sigma is the cyclic root mean square error on
    the bundle's test recordings, or its validation ones, or none at all, widened by Student's t for
    their number. A recording whose mean is not Earth rate, or that moved, is refused as it is for the closed form.
    """
    from scipy.special import stdtrit

    from gyronorth.alignment.learned import last_window, misfits, run

    gyro_l = data.gyro_b @ mat_lb(mean.roll, mean.pitch).T
    sensor = None if data.sensor is None else data.sensor.name
    found = misfits(bundle, gyro_l, rate_hz=data.rate_hz, latitude=data.latitude, sensor=sensor)
    if found:
        return mismatched(mean, bundle, found)
    heading = run(bundle, last_window(bundle, gyro_l[None], rate_hz=data.rate_hz))[0]
    metrics = bundle.info.metrics
    part = "test" if metrics.get("test_network_crmse_deg") else "validation"
    error, count = metrics.get(f"{part}_network_crmse_deg"), metrics.get(f"{part}_recordings") or 1.0
    sigma = SIGMA_UNKNOWN
    if error is not None:
        sigma = min(float(np.radians(error) * stdtrit(count, 0.975) / NORMAL_975), SIGMA_UNKNOWN)
    sigma, half = von_mises(np.asarray(1 / sigma**2)) if error is not None else (np.asarray(sigma), np.asarray(np.pi))
    signal = EARTH_RATE * np.cos(data.latitude)
    parts = {"network": np.asarray((sigma * signal) ** 2)}
    gates = [gate for gate in solve_mean(data, mean, moved).gates if gate.code in OF_THE_RECORDING]
    gates += width_gates(
        half, variance=parts["network"], noise_variance=np.zeros(()), latitude=data.latitude, duration=data.duration
    )
    return Solution(replace(mean, heading=np.asarray(heading)), parts, sigma, half, gates)


def with_deviation(
    solution: Solution, model: DeviationModel, *, latitude: float, duration: float, in_set: bool
) -> Solution:
    """The closed form corrected by a deviation curve, where the recording belongs to its set.

    The curve's sigma holds the noise of recordings as long as those fitted to; a shorter one adds what it
    has more. Outside the set nothing is corrected and nothing changes.
    """
    if not in_set:
        return solution
    found = solution.levelled
    heading, sigma = model.correct(found.heading, rate_surplus(found.rate_l, latitude))
    signal = EARTH_RATE * np.cos(latitude)
    shortfall = 0.0 if model.duration is None else max(1 - duration / model.duration, 0.0)
    parts = {
        "deviation": np.asarray((sigma[0] * signal) ** 2),
        "noise": shortfall * solution.parts["noise"],
        "sway": solution.parts["sway"],
    }
    spread = min(float(np.sqrt(sum(parts.values()))) / signal, SIGMA_UNKNOWN)
    return replace(
        solution,
        levelled=replace(found, heading=np.asarray(heading[0])),
        parts=parts,
        sigma=np.asarray(spread),
        half_width=np.asarray(min(NORMAL_975 * spread, np.pi)),
    )
