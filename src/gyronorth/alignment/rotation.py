"""Composition of rotations along time with quaternions (x, y, z, w), without per-sample loops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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
