"""Turned alignment: heading, gyro bias and scale factor from still poses and the turns between them.

Turning the unit moves the Earth rate in its axes while the turn-on bias stays: two poses
half a turn apart tell them from each other. The recording is segmented (`segments`), every block of
it predicted from the attitude at its end and the sensor errors (`model`), and all of them are
fitted at once by generalised least squares with the noise law of the sensor (`solve`). What no
profile knows, how the bias scatters between poses and how good given angles are, is weighed by
its evidence (`unknowns`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gyronorth.alignment.posterior.density import mixture
from gyronorth.alignment.turned.model import COLUMNS, GivenTurn, heading_gradient
from gyronorth.alignment.turned.noise import candidates, with_noise
from gyronorth.alignment.turned.segments import (
    Segments,
    SegmentTurn,
    TurnedBlocks,
    blocks_per_stretch,
    cut,
    find_segments,
)
from gyronorth.alignment.turned.solve import Solution, Unknowns, solve, under
from gyronorth.alignment.turned.sway import with_sway
from gyronorth.alignment.turned.unknowns import hypotheses
from gyronorth.angles import wrap_heading
from gyronorth.arrays import Array
from gyronorth.attitude import heading_of, level
from gyronorth.errors import InputError
from gyronorth.sensor import Sensor

#: A fit this improbable under the noise law widens its covariance by chi2 / dof.
IMPROBABLE = 1e-3
#: Standard deviation of a heading of which nothing is known, rad.
NOTHING_KNOWN = np.pi / np.sqrt(3)
#: Hypotheses of less weight than this are left out.
LEAST_WEIGHT = 1e-6


@dataclass(frozen=True)
class TurnedPose:
    """One still stretch, as the fit sees it."""

    start: float  # s
    end: float  # s
    heading: float  # rad
    roll: float  # rad
    pitch: float  # rad
    number: int  # of the pose: stretches parted by a knock share one
    residual_b: tuple[float, float, float]  # mean rate minus its prediction, rad/s
    residual_sigma: float  # of one axis of it, from the noise law, rad/s


@dataclass(frozen=True)
class TurnedFit:
    """Heading and sensor errors from a turned recording, each with its standard deviation."""

    heading: float  # at the end of the last pose or spin, rad
    sigma: float  # rad
    interval95: tuple[float, float]  # ends of the shortest arc that holds 95 %, rad from `heading`: -pi to 0, 0 to pi
    sigma_parts: dict[str, float]  # rad: noise, drift, turn_on_bias, scale_factor, levelling; root sum square = sigma
    roll: float  # at the end, rad
    pitch: float  # rad
    gyro_bias: tuple[float, float, float]  # rad/s
    gyro_bias_sigma: tuple[float, float, float]  # rad/s
    scale_factor: tuple[float, float, float]  # relative
    scale_factor_sigma: tuple[float, float, float]
    poses: tuple[TurnedPose, ...]
    turns: tuple[SegmentTurn, ...]
    end: float  # s, where `heading` holds
    chi2: float  # of the observations under the noise law
    dof: int
    inflation: float  # factor on sigma from an improbable chi2; 1 when the law fits
    bias_rejected: bool  # the bias lies too far outside the profile, which was not used for it
    bias_scatter: float  # of the bias from pose to pose beyond the noise law, one axis, rad/s: most probable; 0: none
    turn_angle_sigma: float | None  # of the given turn angles, rad: as given or most probable; None: none were given
    sway: float  # largest of the poses, root mean square of one axis, rad; 0: none is seen
    noise_inferred: bool  # no profile: noise and drift from the recording itself


def turned(
    gyro_b: ArrayLike,
    accel_b: ArrayLike | None = None,
    *,
    rate_hz: float,
    latitude: float,
    errors: Sensor | None = None,
    turn_angles: ArrayLike | None = None,
    turn_angle_sigma: float | None = None,
    segments: Segments | None = None,
) -> TurnedFit:
    """Heading at the end of a recording of two or more poses.

    Parameters
    ----------
    gyro_b : array_like, shape (n, 3)
        Angular rate in the body frame, rad/s.
    accel_b : array_like, shape (n, 3), optional
        Specific force, m/s^2. Without it each pose is taken as level.
    rate_hz : float
        Sample rate, Hz.
    latitude : float
        Geodetic latitude, rad.
    errors : Sensor, optional
        Error model; a white noise of zero is read from the recording. Without a model the white noise comes from the
        scatter within poses, the in-run drift from the likelihood of the fit, and any turn-on bias is allowed.
    turn_angles : array_like, shape (turns,), optional
        Angles of the turns between poses, rad, clockwise from above, as an index table gives
        them. Without it they come from the gyro.
    turn_angle_sigma : float, optional
        Standard deviation of one of them, rad. Without it, from what the gyro measures of the turns.
    segments : Segments, optional
        Poses and turns, if `find_segments` has been called already.

    Raises
    ------
    InputError
        If there is nothing to align, or the number of turn angles is not that of the turns.
    """
    gyro_b = np.asarray(gyro_b, dtype=float)
    accel_b = None if accel_b is None else np.asarray(accel_b, dtype=float)
    if segments is None:
        bias = None if errors is None or errors.gyro.turn_on_bias == 0 else errors.gyro.turn_on_bias
        segments = find_segments(gyro_b, accel_b, rate_hz=rate_hz, turn_on_bias=bias)
    if segments.poses == 0:
        raise InputError(
            f"No still pose of 3 s and no steady rotation was found in {len(gyro_b) / rate_hz:g} s; "
            "turned alignment needs at least one. Let the unit stand still between turns."
        )
    if errors is None and segments.poses == 1 and not any(turn.spin for turn in segments.turns):
        raise InputError(
            "The recording holds one pose, which cannot tell Earth rate from a gyro bias of unknown size. Turn the "
            "unit and record a second pose, give a sensor profile, or use --method mean."
        )
    per_stretch = blocks_per_stretch(len(segments.stretches), None if errors is None else errors.gyro)
    blocks = cut(gyro_b, accel_b, segments, rate_hz=rate_hz, per_stretch=per_stretch)
    given = _given_turns(turn_angles, segments)
    fine = cut(gyro_b, accel_b, segments, rate_hz=rate_hz, per_stretch=4 * per_stretch)
    if errors is None:
        sensors = candidates(blocks, fine)
    else:
        sensors = [with_noise(errors, blocks, fine)]
        blocks = with_sway(blocks, gyro_b, accel_b, sensors[0])
    case = _Case(blocks, segments, latitude, given, turn_angle_sigma)
    weighed = _weighed(case, sensors, bias_known=True)
    rejected = _beyond_profile(next(one for one in weighed if one.steady))
    if rejected:
        weighed = _weighed(case, sensors, bias_known=False)
    return _report(case, weighed, rejected=rejected, noise_inferred=errors is None)


def _given_turns(turn_angles: ArrayLike | None, segments: Segments) -> tuple[GivenTurn, ...]:
    if turn_angles is None:
        return ()
    angles = np.atleast_1d(np.asarray(turn_angles, dtype=float))
    pairs = [(k, k + 1) for k in range(len(segments.pose) - 1) if segments.pose[k + 1] != segments.pose[k]]
    if len(angles) != len(pairs):
        raise InputError(
            f"{len(angles)} turn angles were given, but the recording holds {len(pairs)} turns between "
            f"{len(pairs) + 1} poses. Give one angle per turn, or none to take them from the gyro."
        )
    return tuple(GivenTurn(a, b, float(angle)) for (a, b), angle in zip(pairs, angles, strict=True))


@dataclass(frozen=True)
class _Case:
    """What is fitted, whatever the noise."""

    blocks: TurnedBlocks
    segments: Segments
    latitude: float
    given: tuple[GivenTurn, ...]
    angle_sigma: float | None

    def solve(self, sensor: Sensor, unknowns: Unknowns, *, bias_known: bool, near: Solution | None = None) -> Solution:
        start = None if near is None else near.improved
        return solve(self.blocks, sensor, self.latitude, self.given, unknowns, bias_known=bias_known, start=start)


@dataclass(frozen=True)
class _Weighed:
    """A hypothesis, its estimate and its posterior probability."""

    sensor: Sensor
    solution: Solution
    weight: float

    @property
    def steady(self) -> bool:
        """Whether the bias of every pose is the same, but for the drift of the noise law."""
        return self.solution.unknowns.scatter == 0


def _weighed(case: _Case, sensors: list[Sensor], *, bias_known: bool) -> list[_Weighed]:
    """Every hypothesis that counts, the most probable first and its fit settled."""
    tried, near = list[tuple[Sensor, Solution, float]](), None
    for sensor in sensors:
        options = hypotheses(case.blocks, sensor, case.given, case.angle_sigma, scatter=len(sensors) == 1)
        near = base = case.solve(sensor, options[0].unknowns, bias_known=bias_known, near=near)
        for option in options:
            solution = under(base, option.unknowns)
            tried.append((sensor, solution, solution.log_likelihood + option.log_prior))
    evidence = np.array([value for _, _, value in tried])
    weight = np.exp(evidence - evidence.max())
    weight /= weight.sum()
    every = [_Weighed(sensor, one, float(share)) for (sensor, one, _), share in zip(tried, weight, strict=True)]
    every.sort(key=lambda one: -one.weight)
    found = [one for one in every if one.steady or one.weight > LEAST_WEIGHT]
    best = found[0]
    settled = case.solve(best.sensor, best.solution.unknowns, bias_known=bias_known, near=best.solution)
    return [_Weighed(best.sensor, settled, best.weight), *found[1:]]


def _beyond_profile(best: _Weighed) -> bool:
    """Whether the bias lies too far outside the profile."""
    sigma = best.sensor.gyro.turn_on_bias
    if sigma <= 0:
        return False
    pull = best.solution.improved.value[COLUMNS["bias"]] / np.hypot(sigma, best.solution.bias_sigma)
    return _improbable(float(pull @ pull), 3)


def _report(case: _Case, weighed: list[_Weighed], *, rejected: bool, noise_inferred: bool) -> TurnedFit:
    blocks, best, solution = case.blocks, weighed[0], weighed[0].solution
    linear, known, state = solution.linear, solution.known, solution.state
    # Observations that only fix what is unknown leave chi2 unchanged: flat parameters cost freedom.
    seen = len(linear.residual) if blocks.accel_b is not None else int(np.sum(linear.kind != 1))
    dof = max(1, seen - int(np.sum((known.information == 0) & (known.sigma > 0))))
    inflation = float(np.sqrt(solution.chi2 / dof)) if _improbable(solution.chi2, dof) else 1.0
    weight = np.array([one.weight for one in weighed])
    weight /= weight.sum()
    gradient = heading_gradient(state.end)
    sigmas = inflation * np.array([_sigma(one.solution) for one in weighed])
    headings = np.array([heading_of(one.solution.improved.end) for one in weighed])
    off = (headings - headings[0] + np.pi) % (2 * np.pi) - np.pi
    shift = float(weight @ off)
    density = mixture(headings, 1 / np.maximum(sigmas, 1e-12) ** 2, weight)
    sigma = min(float(np.sqrt(weight @ (sigmas**2 + (off - shift) ** 2))), NOTHING_KNOWN)
    parts = {
        name: inflation**2 * max(part, 0.0) for name, part in solution.parts(blocks, best.sensor, gradient).items()
    }
    rest = sigma**2 - sum(parts.values())  # what the other hypotheses add or take: mostly how much the bias drifts
    parts["drift"] = max(parts["drift"] + rest, 0.0)
    roll, pitch = level(-state.end[2])
    value, deviation, diagonal = state.value, inflation * solution.deviation, np.arange(6, 15, 4)
    return TurnedFit(
        heading=float(wrap_heading(headings[0] + shift)),
        sigma=sigma,
        interval95=(float(density.low), float(density.high)),
        sigma_parts={name: float(np.sqrt(part)) for name, part in parts.items()},
        roll=float(roll),
        pitch=float(pitch),
        gyro_bias=_triple(value[COLUMNS["bias"]]),
        gyro_bias_sigma=_triple(deviation[COLUMNS["bias"]]),
        scale_factor=_triple(value[diagonal]),
        scale_factor_sigma=_triple(deviation[diagonal]),
        poses=_poses(blocks, solution, case.segments),
        turns=case.segments.turns,
        end=float(blocks.last[-1] / blocks.rate_hz),
        chi2=solution.chi2,
        dof=dof,
        inflation=inflation,
        bias_rejected=rejected,
        bias_scatter=solution.unknowns.scatter,
        turn_angle_sigma=solution.unknowns.angle_sigma if case.given else None,
        sway=float(blocks.sway.max(initial=0.0)),
        noise_inferred=noise_inferred,
    )


def _sigma(solution: Solution) -> float:
    gradient = heading_gradient(solution.improved.end)
    return float(np.sqrt(gradient @ solution.covariance[:3, :3] @ gradient))


def _poses(blocks: TurnedBlocks, solution: Solution, segments: Segments) -> tuple[TurnedPose, ...]:
    gyro_rows = np.flatnonzero(solution.linear.kind == 0)
    residual = solution.linear.residual[gyro_rows]
    still, poses = np.flatnonzero(blocks.still), list[TurnedPose]()
    for number in range(len(segments.stretches)):
        place = np.flatnonzero(blocks.stretch[still] == number)
        members = still[place]
        rows = 3 * place[:, None] + np.arange(3)  # the gyro rows of still blocks come first
        weight = blocks.seconds[members] / blocks.seconds[members].sum()
        mean = weight @ residual[rows]
        picked = solution.noise[np.ix_(gyro_rows[rows[:, 0]], gyro_rows[rows[:, 0]])]
        attitude = solution.linear.attitude[members[0]]
        roll, pitch = level(-attitude[2])
        poses.append(
            TurnedPose(
                start=float(blocks.first[members[0]] / blocks.rate_hz),
                end=float(blocks.last[members[-1]] / blocks.rate_hz),
                heading=float(wrap_heading(heading_of(attitude))),
                roll=float(roll),
                pitch=float(pitch),
                number=segments.pose[number],
                residual_b=_triple(mean),
                residual_sigma=float(np.sqrt(max(weight @ picked @ weight, 0.0))),
            )
        )
    return tuple(poses)


def _improbable(chi2: float, dof: int) -> bool:
    from scipy.special import chdtrc  # scipy.stats, which has the law ready, takes a second to load

    return bool(chdtrc(dof, chi2) < IMPROBABLE)


def _triple(values: Array) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
