"""Attitude: levelling, rotation matrices and vectors, quaternions along time.

The level frame l is the navigation frame turned by the heading about the vertical: its x
axis is the body x axis laid level, its z axis points down. T_n^b of the paper (eq:2) is
`mat_bn`; `mat_lb` undoes pitch and roll only.

Orientation for estimators
--------------------------
- n is north-east-down, b forward-right-down; quaternions are (x, y, z, w), Hamilton's, w real.
- `quaternion` and `matrix` take body vectors to n: v_n = matrix @ v_b.
- The error is a small rotation in n: the true matrix is exp([e x]) matrix, e = (about north, about east, about down),
  rad. `covariance` is that of e: its last diagonal entry is sigma^2 of the heading, as a turn about down raises it.
- `yaw_enu` is the angle of the forward axis from east, counter-clockwise, in [-pi, pi): pi / 2 - heading.

A levelling error e_N about north turns the vertical Earth rate into the horizontal, so that a heading that is read from
the mean rate has e_D = -tan(latitude) e_N beside its other errors: the covariance of both is -tan(latitude) of the
variance of e_N.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gyronorth.angles import wrap
from gyronorth.arrays import Array
from gyronorth.frozen import frozen

#: Cosine of a rotation below which its axis is read from the symmetric part of its matrix.
HALF_TURN = -0.9


def level(accel_b: ArrayLike) -> tuple[Array, Array]:
    """Roll and pitch, rad, of a body at rest from its mean specific force.

    Parameters
    ----------
    accel_b : array_like, shape (..., 3)
        Mean specific force in the body frame, m/s^2: (0, 0, -g) when level.

    Returns
    -------
    roll, pitch : ndarray, shape (...)
        Roll in [-pi, pi], pitch in [-pi/2, pi/2], rad.

    Notes
    -----
    roll = atan2(-f_y, -f_z), pitch = atan2(f_x, sqrt(f_y^2 + f_z^2)) (Groves 2013, eq. 5.101).
    """
    accel_b = np.asarray(accel_b, dtype=float)
    f_x, f_y, f_z = np.moveaxis(accel_b, -1, 0)
    return np.arctan2(-f_y, -f_z), np.arctan2(f_x, np.hypot(f_y, f_z))


def heading_of_rate(rate_l: ArrayLike) -> Array:
    """Heading, rad in [-pi, pi], from the Earth rate (..., 3) that the level frame sees: atan2(-w_y, w_x) (eq:7)."""
    rate_l = np.asarray(rate_l, dtype=float)
    return np.arctan2(-rate_l[..., 1], rate_l[..., 0])


def angles_of(mat_nb: ArrayLike) -> tuple[Array, Array, Array]:
    """Heading in [-pi, pi], roll and pitch, rad, of rotations (..., 3, 3) from the body to the navigation frame."""
    mat_nb = np.asarray(mat_nb, dtype=float)
    pitch = -np.arcsin(np.clip(mat_nb[..., 2, 0], -1, 1))
    return heading_of(mat_nb), np.arctan2(mat_nb[..., 2, 1], mat_nb[..., 2, 2]), pitch


def heading_of(mat_nb: Array) -> Array:
    """The heading of `angles_of` alone."""
    return np.arctan2(mat_nb[..., 1, 0], mat_nb[..., 0, 0])


def mat_lb(roll: ArrayLike, pitch: ArrayLike) -> Array:
    """Rotation from the body frame to the level frame, shape (..., 3, 3)."""
    return np.swapaxes(mat_bn(roll, pitch, np.zeros_like(np.asarray(roll, dtype=float))), -1, -2)


def mat_bn(roll: ArrayLike, pitch: ArrayLike, heading: ArrayLike) -> Array:
    """Rotation from the navigation to the body frame, shape (..., 3, 3) (the paper's eq:2)."""
    roll, pitch, heading = (np.asarray(a, dtype=float) for a in (roll, pitch, heading))
    sr, cr, sp, cp, sh, ch = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch), np.sin(heading), np.cos(heading)
    mat = np.empty((*np.broadcast(roll, pitch, heading).shape, 3, 3))
    mat[..., 0, 0], mat[..., 0, 1], mat[..., 0, 2] = cp * ch, cp * sh, -sp
    mat[..., 1, 0], mat[..., 1, 1], mat[..., 1, 2] = sr * sp * ch - cr * sh, sr * sp * sh + cr * ch, sr * cp
    mat[..., 2, 0], mat[..., 2, 1], mat[..., 2, 2] = cr * sp * ch + sr * sh, cr * sp * sh - sr * ch, cr * cp
    return mat


def cross_matrix(vector: ArrayLike) -> Array:
    """[v x], shape (..., 3, 3): cross_matrix(v) @ u = v x u."""
    vector = np.asarray(vector, dtype=float)
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    out = np.zeros((*vector.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -z, y, -x
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = z, -y, x
    return out


def rotation(vector: ArrayLike) -> Array:
    """Rotation matrix of a rotation vector, rad, shape (..., 3) -> (..., 3, 3) (Rodrigues)."""
    vector = np.asarray(vector, dtype=float)
    size = np.linalg.norm(vector, axis=-1)[..., None, None]
    cross = cross_matrix(vector)
    return np.eye(3) + np.sinc(size / np.pi) * cross + np.sinc(size / (2 * np.pi)) ** 2 / 2 * (cross @ cross)


def rotation_vector(mat: ArrayLike) -> Array:
    """Rotation vector, rad, length at most pi, of rotation matrices, shape (..., 3, 3) -> (..., 3).

    Near half a turn the sine of the angle vanishes, and the axis is read from the symmetric part, 1 + (1 - cos) of
    which belong to it; at half a turn either sign is right.
    """
    mat = np.asarray(mat, dtype=float)
    twice_sine_axis = np.stack(
        [mat[..., 2, 1] - mat[..., 1, 2], mat[..., 0, 2] - mat[..., 2, 0], mat[..., 1, 0] - mat[..., 0, 1]], axis=-1
    )
    cosine = (np.trace(mat, axis1=-2, axis2=-1) - 1) / 2
    sine = np.linalg.norm(twice_sine_axis, axis=-1) / 2
    angle = np.arctan2(sine, cosine)
    short = twice_sine_axis / 2 / np.maximum(np.sinc(angle / np.pi), 1e-12)[..., None]
    if np.all(cosine > HALF_TURN):
        return short
    square = (mat + np.swapaxes(mat, -1, -2)) / 2 - cosine[..., None, None] * np.eye(3)  # (1 - cos) n n^T
    largest = np.argmax(np.diagonal(square, axis1=-2, axis2=-1), axis=-1)
    axis: Array = np.take_along_axis(square, largest[..., None, None], axis=-1)[..., 0]
    axis = axis / np.maximum(np.linalg.norm(axis, axis=-1, keepdims=True), 1e-300)
    sign = np.where(np.sum(axis * twice_sine_axis, axis=-1) < 0, -1.0, 1.0)
    return np.asarray(np.where((cosine > HALF_TURN)[..., None], short, (sign * angle)[..., None] * axis), dtype=float)


def mean_rotation(vector: ArrayLike) -> Array:
    """Mean of rotation(s v) over s in [0, 1], shape (..., 3) -> (..., 3, 3): the left Jacobian of SO(3).

    1 + (1 - cos a) / a^2 [v x] + (a - sin a) / a^3 [v x]^2, a = |v| (Chirikjian, "Stochastic
    Models, Information Theory, and Lie Groups", vol. 2, 2012, eq. 10.86).
    """
    vector = np.asarray(vector, dtype=float)
    size = np.linalg.norm(vector, axis=-1)[..., None, None]
    cross = cross_matrix(vector)
    safe = np.where(size > 1e-3, size, 1.0)
    cubic = np.where(size > 1e-3, (safe - np.sin(safe)) / safe**3, 1 / 6 - size**2 / 120)
    return np.eye(3) + np.sinc(size / (2 * np.pi)) ** 2 / 2 * cross + cubic * (cross @ cross)


def multiply(p: Array, q: Array) -> Array:
    """Hamilton product p q, shape (..., 4): rotate by q, then by p."""
    px, py, pz, pw = np.moveaxis(p, -1, 0)
    qx, qy, qz, qw = np.moveaxis(q, -1, 0)
    return np.stack(
        [
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
            pw * qw - px * qx - py * qy - pz * qz,
        ],
        axis=-1,
    )


def conjugate(q: Array) -> Array:
    """The opposite rotation."""
    return q * np.array([-1.0, -1.0, -1.0, 1.0])


def rotate(q: Array, vector: Array) -> Array:
    """Vectors (..., 3) rotated by q (..., 4)."""
    axis = q[..., :3]
    twice = 2 * np.cross(axis, vector)
    return vector + q[..., 3:] * twice + np.cross(axis, twice)


def from_rotation_vector(phi: Array) -> Array:
    """Quaternion of a rotation vector (..., 3), rad."""
    half = np.linalg.norm(phi, axis=-1, keepdims=True) / 2
    return np.concatenate([phi / 2 * np.sinc(half / np.pi), np.cos(half)], axis=-1)


def quaternion_nb(roll: ArrayLike, pitch: ArrayLike, heading: ArrayLike) -> Array:
    """Quaternion (x, y, z, w) that takes body vectors to the navigation frame, shape (..., 4): mat_bn transposed."""
    angles = np.stack(np.broadcast_arrays(*(np.asarray(a, dtype=float) for a in (roll, pitch, heading))), axis=-1)
    about_x, about_y, about_z = (from_rotation_vector(angles[..., i : i + 1] * np.eye(3)[i]) for i in range(3))
    return multiply(about_z, multiply(about_y, about_x))


def attitude_path(gyro_b: Array, *, rate_hz: float) -> tuple[Array, Array]:
    """Attitude of the body against its start, by integrating the gyro.

    Parameters
    ----------
    gyro_b : ndarray, shape (..., n, 3)
        Angular rate in the body frame, rad/s, each sample the mean over its interval.
    rate_hz : float
        Sample rate, Hz.

    Returns
    -------
    middle, end : ndarray, shape (..., n, 4)
        Quaternions taking body vectors at the middle and at the end of each interval into
        b0, the body frame frozen in inertial space at the start.

    Notes
    -----
    The ordered product of n rotations, in about sqrt(n) steps: products within blocks side by
    side, then the blocks' totals one after another.
    """
    n = gyro_b.shape[-2]
    step = gyro_b / rate_hz
    size = int(np.ceil(np.sqrt(n)))
    count = -(-n // size)
    path = np.zeros((*gyro_b.shape[:-2], count * size, 4))
    path[..., 3] = 1.0
    path[..., :n, :] = from_rotation_vector(step)
    path = path.reshape(*gyro_b.shape[:-2], count, size, 4)
    for j in range(1, size):
        path[..., j, :] = multiply(path[..., j - 1, :], path[..., j, :])
    before = np.zeros((*path.shape[:-2], 4))
    before[..., 3] = 1.0
    for j in range(1, count):
        before[..., j, :] = multiply(before[..., j - 1, :], path[..., j - 1, -1, :])
    end = multiply(before[..., None, :], path).reshape(*gyro_b.shape[:-2], count * size, 4)[..., :n, :]
    return multiply(end, from_rotation_vector(-step / 2)), end


#: Below this latitude, rad, the share of levelling in the heading does not tell how well it is level.
FLAT = 1e-3
#: Quaternion from n to east-north-up, and from forward-left-up to b: half turns about (1, 1, 0) and about x.
_ENU_NED = np.array([np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0])
_FRD_FLU = np.array([1.0, 0.0, 0.0, 0.0])


@frozen
class Orientation:
    """An attitude and how well it is known."""

    quaternion: Array  # (4,) x, y, z, w: body to north-east-down
    matrix: Array  # (3, 3) the same
    covariance: Array | None  # (3, 3) of the error about north, east, down, rad^2; None: the level's is not known
    yaw_enu: float  # rad in [-pi, pi)

    @property
    def quaternion_enu(self) -> Array:
        """Forward-left-up to east-north-up, as in `sensor_msgs/Imu` by REP 103, shape (4,)."""
        return multiply(multiply(_ENU_NED, self.quaternion), _FRD_FLU)

    @property
    def covariance_enu(self) -> Array | None:
        """`covariance` about east, north, up."""
        if self.covariance is None:
            return None
        turn = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
        return turn @ self.covariance @ turn.T

    def to_json(self) -> dict[str, Any]:
        """The object `orientation` of the JSON."""
        return {
            "quaternion_nb_xyzw": self.quaternion.tolist(),
            "matrix_nb": self.matrix.tolist(),
            "covariance_n_rad2": None if self.covariance is None else self.covariance.tolist(),
            "yaw_enu_deg": float(np.degrees(self.yaw_enu)),
        }


def orientation(
    roll: float,
    pitch: float,
    heading: float,
    *,
    sigma: float | None,
    levelling: float | None,
    latitude: float,
    level_in_heading: bool,
) -> Orientation:
    """The orientation of angles.

    Parameters
    ----------
    roll, pitch, heading : float
        rad.
    sigma : float or None
        One standard deviation of the heading, rad.
    levelling : float or None
        The share of it that comes from levelling, rad.
    latitude : float
        rad.
    level_in_heading : bool
        Whether the heading is read from the mean rate, so that an error of level is in it.
    """
    matrix = mat_bn(roll, pitch, heading).T
    covariance = None
    if sigma is not None and levelling and abs(latitude) > FLAT:
        tangent = np.tan(latitude)
        level = (min(levelling, sigma) / tangent) ** 2
        cross = -tangent * level if level_in_heading else 0.0
        covariance = np.array([[level, 0.0, cross], [0.0, level, 0.0], [cross, 0.0, sigma**2]])
    return Orientation(quaternion_nb(roll, pitch, heading), matrix, covariance, float(wrap(np.pi / 2 - heading)))
