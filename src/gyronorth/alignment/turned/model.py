"""The law of turned alignment: what poses and turns tell of heading, bias and scale factor.

Measured mean rate of a block i of poses and turns, sensor errors as in `gyronorth.sensor`:

    y_i = (1 + M) R_i^T w_n + b + G R_i^T f_n + x_i        R_i: attitude, body to navigation frame
    a_i = (1 + M_a) R_i^T f_n + b_a + x_a,i

with noise x of known covariance between *all* blocks (`NoiseLaw.mean_covariance`). The attitudes are
those of the end of the recording carried backwards through the turns by the gyro, whose
errors x, b, M and G enter there too. Unknown are the attitude error phi (3) at the end, b, M,
G, b_a, M_a, each with the prior of the sensor profile; a flat prior for phi. Linearised this
is one Gaussian model, y - h = H theta + noise of covariance S, and

    Sigma = (H^T S^-1 H + P^-1)^-1

is both the covariance of its generalised least squares estimate and its Cramer-Rao bound
(van Trees, "Detection, Estimation, and Modulation Theory", part I, 1968, sec. 2.4.3 and
2.6.3, random parameters with Gaussian prior).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyronorth.alignment.turned.segments import TurnedBlocks
from gyronorth.arrays import Array
from gyronorth.attitude import cross_matrix, heading_of, mean_rotation, rotation, rotation_vector
from gyronorth.earth import STANDARD_GRAVITY, earth_rate_n
from gyronorth.sensor import Sensor, TriadErrors
from gyronorth.sensor.law import NoiseLaw

#: A gyro-only pose is taken as level within this, rad (one standard deviation).
LEVEL_SIGMA = 1e-3
#: What the error model leaves out of a turn of 180 deg (nonlinear scale factor, timing, coning), rad
#: per axis, growing with the root of the angle: 20 arcsec. Without it a simulated accelerometer would
#: read the heading from Earth rate integrated through the turns, which no real sensor does as well.
TURN_SIGMA = 1e-4
#: Attitude after a turn that nobody recorded, rad per axis: near what level and given angles say.
FREE_SIGMA = 0.3
#: Distance of the accelerometer from the axis of a spin, m (one standard deviation per axis).
SPIN_ARM = 0.3
#: Gravity is standard within this, m/s^2 (one standard deviation): latitude, height, scale factor.
GRAVITY_SIGMA = 0.05
#: Unit of a parameter without a prior, for the numerics only: rad, rad/s.
FLAT_ATTITUDE, FLAT_BIAS = 1.0, 1e-4

#: The parameters: name -> columns. M and its kin are stored by rows.
COLUMNS = {
    "attitude": slice(0, 3),
    "bias": slice(3, 6),
    "scale": slice(6, 15),
    "g_sensitivity": slice(15, 24),
    "accel_bias": slice(24, 27),
    "accel_scale": slice(27, 36),
    "arm": slice(36, 39),
    "gravity": slice(39, 40),
}
#: From here two columns a spin: tilt of its axis in the body, rad.
SPIN = 40


@dataclass(frozen=True)
class GivenTurn:
    """A turn between two stretches whose angle is given."""

    before: int  # number of the stretch
    behind: int
    angle: float  # rad, clockwise from above


@dataclass(frozen=True)
class State:
    """Attitude at the end and the values of the other parameters, shape (p,); attitude zero."""

    end: Array  # (3, 3) body to navigation frame
    value: Array

    def matrix(self, name: str) -> Array:
        """The nine values of a name of `COLUMNS` as a matrix, shape (3, 3)."""
        return self.value[COLUMNS[name]].reshape(3, 3)


@dataclass(frozen=True)
class Prior:
    """Scale (p,) and information (p,) in units of it: 1, or 0 for no prior."""

    sigma: Array
    information: Array


def prior(sensor: Sensor, *, spins: int, bias_known: bool) -> Prior:
    """What the sensor profile says of the parameters; with `bias_known` its turn-on bias too."""

    def matrix(errors: TriadErrors) -> Array:
        diagonal = np.eye(3)
        return np.ravel(errors.scale_factor * diagonal + errors.misalignment * (1 - diagonal))

    bias_known = bias_known and sensor.gyro.turn_on_bias > 0
    sigma = np.concatenate(
        [
            np.full(3, FLAT_ATTITUDE),
            np.full(3, sensor.gyro.turn_on_bias if bias_known else FLAT_BIAS),
            matrix(sensor.gyro),
            np.full(9, sensor.g_sensitivity),
            np.full(3, sensor.accel.turn_on_bias),
            matrix(sensor.accel),
            np.full(3, SPIN_ARM),
            np.full(1, GRAVITY_SIGMA),
            np.full(2 * spins, 1.0),  # tilt of a spin axis in the body, rad: flat
        ]
    )
    information = np.ones(len(sigma))
    information[:3] = 0
    information[3:6] = float(bias_known)
    information[SPIN:] = 0
    return Prior(sigma, information)


def attitudes(blocks: TurnedBlocks, state: State, *, latitude: float) -> Array:
    """Attitude R_nb at the start of each block, shape (n, 3, 3): the end's, carried backwards.

    The integrated rotation of a block is corrected for bias and scale factor in the frame of
    its start: errors of rate act in the mean over time, errors of scale in the mean over angle.
    """
    bias = np.einsum("nij,j->ni", blocks.mean_b, state.value[COLUMNS["bias"]])
    scale = np.einsum(
        "nij,njk,nk->ni", over_angle(blocks), np.broadcast_to(state.matrix("scale"), blocks.turn_b.shape), blocks.gyro_b
    )
    error = (bias + scale) * blocks.seconds[:, None]
    back = np.swapaxes(blocks.turn_b, -1, -2) @ rotation(error)
    earth = rotation(earth_rate_n(latitude) * blocks.seconds[:, None])
    attitude = np.empty((len(back), 3, 3))
    current = state.end
    for index in range(len(back) - 1, -1, -1):
        if blocks.traced[index]:
            current = earth[index] @ current @ back[index]
        attitude[index] = current
    return attitude


def over_angle(blocks: TurnedBlocks) -> Array:
    """Mean over the angle of a block of the rotation since its start, shape (n, 3, 3)."""
    return mean_rotation(rotation_vector(blocks.turn_b))


@dataclass(frozen=True)
class Linear:
    """residual = design @ error + noise, and where the noise of each block enters.

    Noise is (mean gyro noise of the blocks) through `gyro`, (attitude error of the blocks that
    it makes through the turns) through `attitude_noise`, and what has covariance `own`.
    """

    residual: Array  # (m,)
    design: Array  # (m, p)
    gyro: Array  # (m, 3 n)
    attitude_noise: Array  # (m, 3 n)
    own: Array  # (m, m) covariance of what else disturbs the observations
    earth: Array  # (n, 3, 3) rotation of the Earth between a block and the end, while turning
    step: Array  # (n, 3, 3) attitude error, at the end, by mean gyro error of a block
    loose: Array  # (n,) attitude variance against the end from `TURN_SIGMA`, rad^2
    attitude: Array  # (n, 3, 3) at the start of each block
    kind: NDArray[np.int64]  # (m,) 0 gyro, 1 accelerometer or level, 2 given turn angle

    def covariance(self, gyro: Array, *, own: bool = True) -> Array:
        """Noise covariance (m, m) from that of the mean gyro noise of one axis, (n, n).

        Attitude errors are phi_i = E_i sum over j >= i of U_j x_j, so that their covariances are
        sums from the end of C_jl U_j U_l^T over both blocks.
        """
        n = len(gyro)
        turned = np.einsum("il,lab->ilba", gyro, self.step)[:, ::-1].cumsum(axis=1)[
            :, ::-1
        ]  # cov(x_i, .), (i, l, b, a)
        both = (self.step.reshape(n, 1, 3, 3) @ turned)[::-1].cumsum(axis=0)[::-1]
        cross = turned @ np.swapaxes(self.earth, -1, -2)
        both = self.earth[:, None] @ both @ np.swapaxes(self.earth, -1, -2)
        if own:
            both += np.minimum(self.loose[:, None], self.loose)[:, :, None, None] * np.eye(3)
        cross, both = (np.swapaxes(part, 1, 2).reshape(3 * n, 3 * n) for part in (cross, both))
        mixed = self.gyro @ cross @ self.attitude_noise.T
        total = self.gyro @ np.kron(gyro, np.eye(3)) @ self.gyro.T + mixed + mixed.T
        total += self.attitude_noise @ both @ self.attitude_noise.T
        return total + self.own if own else total


def linearise(
    blocks: TurnedBlocks,
    state: State,
    sensor: Sensor,
    *,
    latitude: float,
    turn_angles: tuple[GivenTurn, ...] = (),
) -> Linear:
    """The model about a state, without the noise of given turn angles."""
    n, p = len(blocks.first), len(state.value)
    attitude = attitudes(blocks, state, latitude=latitude)
    mean = attitude @ blocks.mean_b
    to_body = np.swapaxes(mean, -1, -2)
    rate, force = earth_rate_n(latitude), np.array([0.0, 0.0, -STANDARD_GRAVITY])
    force_b = to_body @ force
    local = np.zeros((n, 3, p))  # gyro error by parameter
    local[:, :, COLUMNS["bias"]] = np.eye(3)
    local[:, :, COLUMNS["scale"]] = _by_rows(blocks.gyro_b)
    local[:, :, COLUMNS["g_sensitivity"]] = _by_rows(force_b)

    moving = np.where(blocks.traced, blocks.seconds, 0.0)[:, None, None]
    # Attitude errors turn with the Earth while the unit turns: phi_i = E_i (phi + sum over j >= i of step_j).
    earth = rotation(_from_end(moving[:, 0]) * earth_rate_n(latitude))
    back = np.swapaxes(earth, -1, -2) @ attitude * moving
    noise_step = back @ blocks.mean_b
    step = noise_step @ local
    step[:, :, COLUMNS["scale"]] = back @ over_angle(blocks) @ local[:, :, COLUMNS["scale"]]
    step = _from_end(step)
    step[:, :, COLUMNS["attitude"]] = np.eye(3)
    chain = earth @ step  # attitude error at block i by parameter
    swept = np.linalg.norm(blocks.gyro_b * moving[:, 0], axis=1)
    loose = TURN_SIGMA**2 * swept / np.pi + FREE_SIGMA**2 * (~blocks.still & (not blocks.measured))

    sees_rate, sees_force = to_body @ cross_matrix(rate), to_body @ cross_matrix(force)
    known = np.where(np.arange(p) < 3, 0.0, state.value)
    gyro_residual = blocks.gyro_b - to_body @ rate - local @ known
    gyro_design = sees_rate @ chain + local

    rows = _Rows(n)
    for index in np.flatnonzero(blocks.still).tolist():
        rows.add(0, gyro_residual[index], gyro_design[index], index, np.eye(3), sees_rate[index])
    for spin in range(blocks.spin.max(initial=-1) + 1):
        members = np.flatnonzero(blocks.spin == spin)
        across = np.linalg.svd(blocks.gyro_b[members], full_matrices=False)[2][1:]
        axis = np.cross(across[0], across[1])
        tilt = slice(SPIN + 2 * spin, SPIN + 2 * spin + 2)
        for index in members.tolist():
            design = across @ gyro_design[index]
            design[:, tilt] = np.eye(2) * (blocks.gyro_b[index] @ axis)
            residual = across @ gyro_residual[index] - design[:, tilt] @ state.value[tilt]
            rows.add(0, residual, design, index, across, across @ sees_rate[index])
    swaying = np.kron(blocks.sway_covariance(blocks.sway), np.eye(3))
    own: list[Array] = [np.asarray(swaying, dtype=float)] if blocks.still.any() else []
    own.append(np.zeros((rows.count - sum(map(len, own)),) * 2))

    seen = np.flatnonzero(blocks.still | (blocks.spin >= 0))
    own_accel, accel_b = _levelling(blocks, seen, sensor)
    for position, index in enumerate(seen.tolist()):
        errors = np.zeros((3, p))
        if blocks.accel_b is not None:
            errors[:, COLUMNS["accel_bias"]] = np.eye(3)
            errors[:, COLUMNS["accel_scale"]] = _by_rows(force_b[index])
            errors[:, COLUMNS["gravity"]] = force_b[index][:, None] / STANDARD_GRAVITY
            if blocks.spin[index] >= 0:
                spin_cross = cross_matrix(blocks.gyro_b[index])
                errors[:, COLUMNS["arm"]] = spin_cross @ spin_cross
        residual = accel_b[position] - force_b[index] - errors @ state.value
        rows.add(1, residual, sees_force[index] @ chain[index] + errors, index, None, sees_force[index])
    own.append(own_accel)

    for turn in turn_angles:
        a, b = (int(np.flatnonzero(blocks.stretch == s)[0]) for s in (turn.before, turn.behind))
        turned = float(heading_of(attitude[b]) - heading_of(attitude[a]))
        residual = (turn.angle - turned + np.pi) % (2 * np.pi) - np.pi
        down_a, down_b = heading_gradient(attitude[a]), heading_gradient(attitude[b])
        design = down_b @ chain[b] - down_a @ chain[a]
        rows.add(2, np.array([residual]), design[None], b, None, down_b[None])
        rows.attitude_noise[-1][:, 3 * a : 3 * a + 3] = -down_a
        own.append(np.zeros((1, 1)))
    return Linear(
        np.concatenate(rows.residual),
        np.concatenate(rows.design),
        np.concatenate(rows.gyro),
        np.concatenate(rows.attitude_noise),
        _block_diagonal(own),
        earth,
        noise_step,
        _from_end(loose),
        attitude,
        np.array(rows.kind),
    )


class _Rows:
    """Rows of the model as they are collected."""

    def __init__(self, blocks: int) -> None:
        self.columns = 3 * blocks
        self.kind: list[int] = []
        self.residual: list[Array] = []
        self.design: list[Array] = []
        self.gyro: list[Array] = []
        self.attitude_noise: list[Array] = []

    @property
    def count(self) -> int:
        return len(self.kind)

    def add(self, kind: int, residual: Array, design: Array, block: int, gyro: Array | None, attitude: Array) -> None:
        place = slice(3 * block, 3 * block + 3)
        self.kind += [kind] * len(residual)
        self.residual.append(residual)
        self.design.append(design)
        for store, values in ((self.gyro, gyro), (self.attitude_noise, attitude)):
            store.append(np.zeros((len(residual), self.columns)))
            if values is not None:
                store[-1][:, place] = values


def _from_end(values: Array) -> Array:
    """Sums from each block to the end."""
    return np.cumsum(values[::-1], axis=0)[::-1]


def _block_diagonal(parts: list[Array]) -> Array:
    size = sum(len(part) for part in parts)
    total, start = np.zeros((size, size)), 0
    for part in parts:
        total[start : start + len(part), start : start + len(part)] = part
        start += len(part)
    return total


def _levelling(blocks: TurnedBlocks, seen: NDArray[np.int64], sensor: Sensor) -> tuple[Array, Array]:
    """Covariance (3 k, 3 k) and means (k, 3) of the specific force; level poses without an accelerometer."""
    if blocks.accel_b is not None:
        law = NoiseLaw(sensor.accel)
        covariance = law.mean_covariance(blocks.first[seen], blocks.last[seen], rate_hz=blocks.rate_hz)
        still = np.flatnonzero(blocks.still[seen])
        covariance[np.ix_(still, still)] += blocks.sway_covariance(blocks.surge)
        return np.asarray(np.kron(covariance, np.eye(3)), dtype=float), blocks.accel_b[seen]
    place = np.where(blocks.spin[seen] >= 0, -1 - blocks.spin[seen], blocks.stretch[seen])
    same = (place[:, None] == place).astype(float)
    covariance = (LEVEL_SIGMA * STANDARD_GRAVITY) ** 2 * (same + 1e-4 * np.eye(len(seen)))
    return np.asarray(np.kron(covariance, np.eye(3)), dtype=float), np.tile(
        [0.0, 0.0, -STANDARD_GRAVITY], (len(seen), 1)
    )


def _by_rows(vector: Array) -> Array:
    """d(M v) / dM for M stored by rows, shape (..., 3) -> (..., 3, 9)."""
    out = np.zeros((*vector.shape[:-1], 3, 9))
    for row in range(3):
        out[..., row, 3 * row : 3 * row + 3] = vector
    return out


def heading_gradient(attitude: Array) -> Array:
    """Change of the heading with an attitude error in n, shape (3,): 1 about down, the rest from pitch."""
    north, east, down = attitude[:, 0]
    return np.array([-down * north, -down * east, north**2 + east**2]) / (north**2 + east**2)


def posterior(linear: Linear, noise: Array, known: Prior) -> tuple[Array, Array]:
    """Covariance (p, p) of the parameters and the gain (p, m) from residuals to their error."""
    from scipy.linalg import cho_factor, cho_solve

    scaled = linear.design * known.sigma
    weighted = cho_solve(cho_factor(noise, lower=True), scaled)
    information = scaled.T @ weighted + np.diag(np.maximum(known.information, known.sigma == 0) + 1e-12)
    covariance = np.linalg.inv(information) * np.outer(known.sigma, known.sigma)
    return covariance, (covariance / np.where(known.sigma > 0, known.sigma, 1.0)) @ weighted.T


def regular(noise: Array) -> Array:
    """Noise covariance that can be inverted when parts of the sensor are ideal."""
    diagonal = np.diag(noise)
    return noise + np.diag(1e-9 * diagonal + 1e-24 * (1 + (diagonal == 0) * 1e8))
