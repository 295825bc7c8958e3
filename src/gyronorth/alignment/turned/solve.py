"""The generalised least squares fit of poses and turns, for one law of the noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyronorth.alignment.turned.model import (
    COLUMNS,
    GivenTurn,
    Linear,
    Prior,
    State,
    attitudes,
    linearise,
    posterior,
    prior,
    regular,
)
from gyronorth.alignment.turned.segments import TurnedBlocks
from gyronorth.angles import DEG_PER_HOUR
from gyronorth.arrays import Array
from gyronorth.attitude import level, mat_bn, rotation
from gyronorth.earth import earth_rate_n
from gyronorth.sensor import Sensor
from gyronorth.sensor.law import NoiseLaw

#: Least standard deviation of a mean rate, rad/s: a sensor without errors stays finite.
RATE_FLOOR = 1e-12
#: Gauss-Newton steps at most, and the change of attitude, rad, below which it has settled.
STEPS, SETTLED = 8, 1e-6


@dataclass(frozen=True)
class Unknowns:
    """What no profile knows: how the bias scatters from pose to pose, and how good the given angles are."""

    scatter: float = 0.0  # rad/s, of one axis
    angle_sigma: float = 0.0  # rad


@dataclass(frozen=True)
class Model:
    """The linear model about a state, and the noise that holds whatever the unknowns are."""

    state: State
    linear: Linear
    common: Array  # (m, m)
    scattered: Array  # (m, m) that of a bias that scatters by 1 rad/s from pose to pose, and in the turns between
    known: Prior
    latitude: float

    def scatter(self, unknowns: Unknowns) -> Array:
        """What the bias of each pose adds to the covariance, (m, m)."""
        return unknowns.scatter**2 * self.scattered

    def angles(self, unknowns: Unknowns) -> Array:
        """What the errors of given angles add, (m, m)."""
        return np.diag(unknowns.angle_sigma**2 * (self.linear.kind == 2))


@dataclass(frozen=True)
class Solution:
    """Estimate, its covariance and the model about it."""

    model: Model
    unknowns: Unknowns
    noise: Array  # (m, m)
    covariance: Array  # (p, p)
    gain: Array  # (p, m)
    change: Array  # (p,) from the model's state to the estimate
    chi2: float

    @property
    def state(self) -> State:
        """The state about which the model is linear: the estimate, where the fit has settled."""
        return self.model.state

    @property
    def linear(self) -> Linear:
        """The model about it."""
        return self.model.linear

    @property
    def known(self) -> Prior:
        """What the profile says of the parameters."""
        return self.model.known

    @property
    def improved(self) -> State:
        """The estimate."""
        turn, value = np.arange(len(self.change)) < 3, self.state.value
        return State(rotation(self.change[:3]) @ self.state.end, value + np.where(turn, 0, self.change))

    @property
    def bias_sigma(self) -> Array:
        """Standard deviation of the bias, rad/s."""
        return self.deviation[COLUMNS["bias"]]

    @property
    def deviation(self) -> Array:
        """Standard deviation of each parameter; where nearly nothing is left, rounding may reach below zero."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def log_likelihood(self) -> float:
        """log p(observations) up to a constant: -(chi2 + log|S| + log|P| - log|Sigma|) / 2 (Gaussian evidence)."""
        used = self.known.sigma > 0
        scaled = self.covariance[np.ix_(used, used)] / np.outer(self.known.sigma[used], self.known.sigma[used])
        return float(-0.5 * (self.chi2 + np.linalg.slogdet(self.noise)[1] - np.linalg.slogdet(scaled)[1]))

    def parts(self, blocks: TurnedBlocks, sensor: Sensor, gradient: Array) -> dict[str, float]:
        """Heading variance by cause: noise through the gain, priors through what they leave."""
        gain, linear = gradient @ self.gain[:3], self.linear

        def through_gyro(white: bool) -> float:
            law = NoiseLaw(sensor.gyro)
            cov = law.mean_covariance(blocks.first, blocks.last, rate_hz=blocks.rate_hz, white=white, drift=not white)
            return float(gain @ linear.covariance(cov, own=False) @ gain)

        used = (self.known.sigma > 0) & (self.known.information > 0)
        left = np.zeros(len(used))
        left[used] = (gradient @ self.covariance[:3])[used] / self.known.sigma[used]
        by_prior = {name: float(np.sum(left[columns] ** 2)) for name, columns in COLUMNS.items()}
        return {
            "noise": through_gyro(True),
            "drift": through_gyro(False) + float(gain @ self.model.scatter(self.unknowns) @ gain),
            "turn_on_bias": by_prior["bias"] + by_prior["g_sensitivity"],
            "scale_factor": by_prior["scale"] + float(gain @ self.model.angles(self.unknowns) @ gain),
            "levelling": float(gain @ linear.covariance(np.zeros((len(blocks.first),) * 2)) @ gain)
            + by_prior["accel_bias"]
            + by_prior["accel_scale"]
            + by_prior["arm"]
            + by_prior["gravity"],
        }


def solve(
    blocks: TurnedBlocks,
    sensor: Sensor,
    latitude: float,
    given: tuple[GivenTurn, ...],
    unknowns: Unknowns,
    *,
    bias_known: bool,
    start: State | None = None,
) -> Solution:
    """The fit under one law of the noise."""
    known = prior(sensor, spins=int(blocks.spin.max(initial=-1)) + 1, bias_known=bias_known)
    gyro = NoiseLaw(sensor.gyro).mean_covariance(blocks.first, blocks.last, rate_hz=blocks.rate_hz)
    gyro = gyro + RATE_FLOOR**2 * np.eye(len(gyro))
    state, change = start or _first_guess(blocks, gyro, known, latitude), np.full(3, np.inf)
    step = 0
    while True:
        settled = step == STEPS or np.abs(change[:3]).max() < SETTLED
        linear = linearise(blocks, state, sensor, latitude=latitude, turn_angles=given)
        scattered = linear.covariance(blocks.scattered, own=False)
        solution = _solution(Model(state, linear, linear.covariance(gyro), scattered, known, latitude), unknowns)
        if settled:
            return solution
        step += 1
        change, state = solution.change, solution.improved


def under(solution: Solution, unknowns: Unknowns) -> Solution:
    """The estimate that other unknowns would give, of the same linear model; its state is still to be improved."""
    return _solution(solution.model, unknowns)


def _solution(model: Model, unknowns: Unknowns) -> Solution:
    linear, known = model.linear, model.known
    noise = regular(model.common + model.scatter(unknowns) + model.angles(unknowns))
    covariance, gain = posterior(linear, noise, known)
    pull = np.where(known.information > 0, model.state.value / np.where(known.sigma > 0, known.sigma, 1.0) ** 2, 0.0)
    change = gain @ linear.residual - covariance @ pull
    left = linear.residual - linear.design @ change
    value = model.state.value + np.where(np.arange(len(change)) < 3, 0, change)
    scaled = np.where(known.sigma > 0, value / np.where(known.sigma > 0, known.sigma, 1.0), 0.0)
    chi2 = float(left @ np.linalg.solve(noise, left) + known.information @ scaled**2)
    return Solution(model, unknowns, noise, covariance, gain, change, chi2)


def _first_guess(blocks: TurnedBlocks, gyro: Array, known: Prior, latitude: float) -> State:
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
