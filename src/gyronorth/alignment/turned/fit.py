"""Turned alignment: heading, gyro bias and scale factor from still poses and the turns between them.

Turning the unit moves the Earth rate in its axes while the turn-on bias stays: two poses
half a turn apart tell them from each other. The recording is segmented
(`turned_segments`), every block of it predicted from the attitude at its end and the sensor
errors, and all of them are fitted at once by generalised least squares with the noise law of
the sensor (`turned_law`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from gyronorth.alignment.turned.model import (
    COLUMNS,
    Linear,
    Prior,
    State,
    attitudes,
    heading_gradient,
    linearise,
    posterior,
    prior,
    regular,
)
from gyronorth.alignment.turned.noise import candidates, with_noise
from gyronorth.alignment.turned.segments import Blocks, Segments, SegmentTurn, blocks_per_stretch, cut, find_segments
from gyronorth.angles import DEG_PER_HOUR, wrap_heading
from gyronorth.arrays import Array
from gyronorth.attitude import level, mat_bn, rotation
from gyronorth.earth import earth_rate_n
from gyronorth.errors import InputError
from gyronorth.sensor import Sensor
from gyronorth.sensor.law import NoiseLaw

#: Least standard deviation of a mean rate, rad/s: a sensor without errors stays finite.
RATE_FLOOR = 1e-12
#: Gauss-Newton steps at most, and the change of attitude, rad, below which it has settled.
STEPS, SETTLED = 8, 1e-6
#: A fit this improbable under the noise law widens its covariance by chi2 / dof.
IMPROBABLE = 1e-3


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
    noise_inferred: bool  # no profile: noise and drift from the recording itself


def turned(
    gyro_b: ArrayLike,
    accel_b: ArrayLike | None = None,
    *,
    rate_hz: float,
    latitude: float,
    errors: Sensor | None = None,
    turn_angles: ArrayLike | None = None,
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
        them, good to `TURN_ANGLE_SIGMA`. Without it they come from the gyro.
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
        segments = find_segments(gyro_b, rate_hz=rate_hz, turn_on_bias=bias)
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
    given = _given_angles(turn_angles, segments)
    fine = cut(gyro_b, accel_b, segments, rate_hz=rate_hz, per_stretch=4 * per_stretch)
    if errors is not None:
        return _fit(blocks, with_noise(errors, blocks, fine), segments, latitude, given)[0]
    fits, start = list[tuple[TurnedFit, float]](), None
    for sensor in candidates(blocks, fine):
        fit, log_likelihood, start = _fit(blocks, sensor, segments, latitude, given, start)
        fits.append((fit, log_likelihood))
    return _averaged(fits)


def _given_angles(turn_angles: ArrayLike | None, segments: Segments) -> tuple[tuple[int, int, float], ...]:
    """(stretch before, stretch behind, angle) of each turn between poses."""
    if turn_angles is None:
        return ()
    angles = np.atleast_1d(np.asarray(turn_angles, dtype=float))
    pairs = [(k, k + 1) for k in range(len(segments.pose) - 1) if segments.pose[k + 1] != segments.pose[k]]
    if len(angles) != len(pairs):
        raise InputError(
            f"{len(angles)} turn angles were given, but the recording holds {len(pairs)} turns between "
            f"{len(pairs) + 1} poses. Give one angle per turn, or none to take them from the gyro."
        )
    return tuple((a, b, float(angle)) for (a, b), angle in zip(pairs, angles, strict=True))


def _fit(
    blocks: Blocks,
    sensor: Sensor,
    segments: Segments,
    latitude: float,
    given: tuple[tuple[int, int, float], ...],
    start: State | None = None,
) -> tuple[TurnedFit, float, State]:
    """Fit, its log marginal likelihood (up to a constant), and its state, from which the next may start."""
    fit = _solve(blocks, sensor, latitude, given, bias_known=True, start=start)
    rejected = False
    if sensor.gyro.turn_on_bias > 0:
        pull = fit.state.value[COLUMNS["bias"]] / np.hypot(sensor.gyro.turn_on_bias, fit.bias_sigma)
        if _improbable(float(pull @ pull), 3):
            fit, rejected = _solve(blocks, sensor, latitude, given, bias_known=False), True
    return fit.report(blocks, sensor, segments, rejected), fit.log_likelihood, fit.state


@dataclass(frozen=True)
class _Solution:
    state: State
    linear: Linear
    noise: Array  # (m, m)
    known: Prior
    covariance: Array  # (p, p)
    gain: Array  # (p, m)
    chi2: float
    latitude: float

    @property
    def bias_sigma(self) -> Array:
        return self.deviation[COLUMNS["bias"]]

    @property
    def deviation(self) -> Array:
        """Standard deviation of each parameter; where nearly nothing is left, rounding may reach below zero."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def log_likelihood(self) -> float:
        """log p(observations): -(chi2 + log|S| + log|P| - log|Sigma|) / 2 (Gaussian evidence)."""
        used = self.known.sigma > 0
        scaled = self.covariance[np.ix_(used, used)] / np.outer(self.known.sigma[used], self.known.sigma[used])
        return float(-0.5 * (self.chi2 + np.linalg.slogdet(self.noise)[1] - np.linalg.slogdet(scaled)[1]))

    def report(self, blocks: Blocks, sensor: Sensor, segments: Segments, rejected: bool) -> TurnedFit:
        gradient = heading_gradient(self.state.end)
        # Observations that only fix what is unknown leave chi2 unchanged: flat parameters cost freedom.
        seen = len(self.linear.residual) if blocks.accel_b is not None else int(np.sum(self.linear.kind != 1))
        dof = max(1, seen - int(np.sum((self.known.information == 0) & (self.known.sigma > 0))))
        inflation = float(np.sqrt(self.chi2 / dof)) if _improbable(self.chi2, dof) else 1.0
        sigma = inflation * float(np.sqrt(gradient @ self.covariance[:3, :3] @ gradient))
        parts = self._parts(blocks, sensor, gradient)
        roll, pitch = level(-self.state.end[2])
        deviation = self.deviation
        value, bias = self.state.value, COLUMNS["bias"]
        diagonal = np.arange(6, 15, 4)
        return TurnedFit(
            heading=float(wrap_heading(np.arctan2(self.state.end[1, 0], self.state.end[0, 0]))),
            sigma=sigma,
            sigma_parts={name: inflation * float(np.sqrt(max(part, 0.0))) for name, part in parts.items()},
            roll=float(roll),
            pitch=float(pitch),
            gyro_bias=_triple(value[bias]),
            gyro_bias_sigma=_triple(inflation * deviation[bias]),
            scale_factor=_triple(value[diagonal]),
            scale_factor_sigma=_triple(inflation * deviation[diagonal]),
            poses=_poses(blocks, self, segments),
            turns=segments.turns,
            end=float(blocks.last[-1] / blocks.rate_hz),
            chi2=self.chi2,
            dof=dof,
            inflation=inflation,
            bias_rejected=rejected,
            noise_inferred=False,
        )

    def _parts(self, blocks: Blocks, sensor: Sensor, gradient: Array) -> dict[str, float]:
        """Heading variance by cause: noise through the gain, priors through what they leave."""
        gain = gradient @ self.gain[:3]

        def through_gyro(white: bool) -> float:
            law = NoiseLaw(sensor.gyro)
            cov = law.mean_covariance(blocks.first, blocks.last, rate_hz=blocks.rate_hz, white=white, drift=not white)
            return float(gain @ self.linear.covariance(cov, own=False) @ gain)

        used = (self.known.sigma > 0) & (self.known.information > 0)
        left = np.zeros(len(used))
        left[used] = (gradient @ self.covariance[:3])[used] / self.known.sigma[used]
        by_prior = {name: float(np.sum(left[columns] ** 2)) for name, columns in COLUMNS.items()}
        return {
            "noise": through_gyro(True),
            "drift": through_gyro(False),
            "turn_on_bias": by_prior["bias"] + by_prior["g_sensitivity"],
            "scale_factor": by_prior["scale"],
            "levelling": float(gain @ self.linear.covariance(np.zeros((len(blocks.first),) * 2)) @ gain)
            + by_prior["accel_bias"]
            + by_prior["accel_scale"]
            + by_prior["arm"]
            + by_prior["gravity"],
        }


def _solve(
    blocks: Blocks,
    sensor: Sensor,
    latitude: float,
    given: tuple[tuple[int, int, float], ...],
    *,
    bias_known: bool,
    start: State | None = None,
) -> _Solution:
    known = prior(sensor, spins=int(blocks.spin.max(initial=-1)) + 1, bias_known=bias_known)
    gyro = NoiseLaw(sensor.gyro).mean_covariance(blocks.first, blocks.last, rate_hz=blocks.rate_hz)
    gyro = gyro + RATE_FLOOR**2 * np.eye(len(gyro))
    state, change = start or _first_guess(blocks, gyro, known, latitude), np.full(3, np.inf)
    step = 0
    while True:
        settled = step == STEPS or np.abs(change[:3]).max() < SETTLED
        linear = linearise(blocks, state, sensor, latitude=latitude, turn_angles=given)
        noise = regular(linear.covariance(gyro))
        covariance, gain = posterior(linear, noise, known)
        if settled:
            break
        step += 1
        pull = np.where(known.information > 0, state.value / np.where(known.sigma > 0, known.sigma, 1.0) ** 2, 0.0)
        change = gain @ linear.residual - covariance @ pull
        state = State(rotation(change[:3]) @ state.end, state.value + np.where(np.arange(len(change)) < 3, 0, change))
    scaled = np.where(known.sigma > 0, state.value / np.where(known.sigma > 0, known.sigma, 1.0), 0.0)
    chi2 = float(linear.residual @ np.linalg.solve(noise, linear.residual) + known.information @ scaled**2)
    return _Solution(state, linear, noise, known, covariance, gain, chi2, latitude)


def _first_guess(blocks: Blocks, gyro: Array, known: Prior, latitude: float) -> State:
    """Attitude and bias from a linear fit of Earth rate and bias, and a scan of the circle.

    With the end levelled and its heading called zero, y_i = R_i^T u + b is linear in the Earth
    rate u at the end and in b. Headings lie on the circle u = w (cos h, -sin h, .), on which the
    Gaussian of u is scanned: safe when the noise leaves more than one quadrant.
    """
    used = np.flatnonzero(blocks.still | (blocks.spin >= 0))
    if blocks.accel_b is None:
        down = np.array([0.0, 0.0, -1.0])
    else:
        at_end = blocks.still & (blocks.stretch == blocks.stretch.max()) if blocks.still.any() else blocks.spin >= 0
        down = blocks.accel_b[at_end].mean(axis=0)
    value = np.zeros(len(known.sigma))
    still = blocks.gyro_b[blocks.still]
    value[COLUMNS["bias"]] = still.mean(axis=0) if len(still) else 0.0
    roll, pitch = level(down)
    end = mat_bn(roll, pitch, 0.0).T
    attitude = attitudes(blocks, State(end, value), latitude=np.pi / 2)[used] @ blocks.mean_b[used]
    design = np.concatenate([np.swapaxes(attitude, -1, -2), np.tile(np.eye(3), (len(used), 1, 1))], axis=2)
    weight = np.ones(len(used))[:, None, None] * np.eye(3)
    target = blocks.gyro_b[used]
    for position, index in enumerate(used):
        if blocks.spin[index] >= 0:  # the rate along the axis of the spin tells nothing
            axis = blocks.gyro_b[index] / np.linalg.norm(blocks.gyro_b[index])
            weight[position] -= np.outer(axis, axis)
    weight /= (np.diag(gyro)[used] + gyro[np.ix_(used, used)].mean() * len(used))[:, None, None]
    information = np.einsum("nik,nij,njl->kl", design, weight, design)
    moment = np.einsum("nik,nij,nj->k", design, weight, target)
    rate = earth_rate_n(latitude)
    information[2, 2] += 1e6 / rate[0] ** 2 if rate[0] > 0 else 0.0
    moment[2] += 1e6 / rate[0] ** 2 * rate[2]
    bias = known.information[3:6] / np.maximum(known.sigma[3:6], 1e-300) ** 2
    information[3:, 3:] += np.diag(bias + 1e-6 / DEG_PER_HOUR**2 * 1e-6)
    solution = np.asarray(np.linalg.solve(information, moment), dtype=float)
    covariance = np.asarray(np.linalg.inv(information), dtype=float)
    heading = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    off: Array = rate[0] * np.stack([np.cos(heading), -np.sin(heading)], axis=1) - solution[:2]
    misfit = np.einsum("hi,ij,hj->h", off, np.linalg.inv(covariance[:2, :2]), off)
    best = float(heading[np.argmin(misfit)])
    return State(rotation([0.0, 0.0, best]) @ end, value)


def _poses(blocks: Blocks, solution: _Solution, segments: Segments) -> tuple[TurnedPose, ...]:
    gyro_rows = np.flatnonzero(solution.linear.kind == 0)
    residual = solution.linear.residual[gyro_rows]
    variance = np.diag(solution.noise)[gyro_rows]
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
                heading=float(wrap_heading(np.arctan2(attitude[1, 0], attitude[0, 0]))),
                roll=float(roll),
                pitch=float(pitch),
                number=segments.pose[number],
                residual_b=_triple(mean),
                residual_sigma=float(np.sqrt(max(weight @ picked @ weight, variance.min() * 0))),
            )
        )
    return tuple(poses)


def _averaged(fits: list[tuple[TurnedFit, float]]) -> TurnedFit:
    """The fit of the likeliest drift; its sigma from the mixture over all of them."""
    likelihood = np.array([value for _, value in fits])
    weight = np.exp(likelihood - likelihood.max())
    weight /= weight.sum()
    best = fits[int(np.argmax(weight))][0]
    off = np.array([(fit.heading - best.heading + np.pi) % (2 * np.pi) - np.pi for fit, _ in fits])
    total = float(np.sqrt(weight @ (np.array([fit.sigma for fit, _ in fits]) ** 2 + off**2)))
    parts = {name: part * total / best.sigma for name, part in best.sigma_parts.items()}
    return replace(best, sigma=total, sigma_parts=parts, noise_inferred=True)


def _improbable(chi2: float, dof: int) -> bool:
    from scipy.special import chdtrc  # scipy.stats, which has the law ready, takes a second to load

    return bool(chdtrc(dof, chi2) < IMPROBABLE)


def _triple(values: Array) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
