"""Rotation matrices of rotation vectors, and back."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def cross_matrix(vector: ArrayLike) -> Array:
    """[v x], shape (..., 3, 3): cross_matrix(v) @ u = v x u."""
    x, y, z = np.moveaxis(np.asarray(vector, dtype=float), -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def rotation(vector: ArrayLike) -> Array:
    """Rotation matrix of a rotation vector, rad, shape (..., 3) -> (..., 3, 3) (Rodrigues)."""
    vector = np.asarray(vector, dtype=float)
    size = np.linalg.norm(vector, axis=-1)[..., None, None]
    cross = cross_matrix(vector)
    return np.eye(3) + np.sinc(size / np.pi) * cross + np.sinc(size / (2 * np.pi)) ** 2 / 2 * (cross @ cross)


def rotation_vector(mat: ArrayLike) -> Array:
    """Rotation vector, rad, length below pi, of rotation matrices, shape (..., 3, 3) -> (..., 3)."""
    mat = np.asarray(mat, dtype=float)
    twice_sine_axis = np.stack(
        [mat[..., 2, 1] - mat[..., 1, 2], mat[..., 0, 2] - mat[..., 2, 0], mat[..., 1, 0] - mat[..., 0, 1]], axis=-1
    )
    cosine = (np.trace(mat, axis1=-2, axis2=-1) - 1) / 2
    sine = np.linalg.norm(twice_sine_axis, axis=-1) / 2
    angle = np.arctan2(sine, cosine)
    return twice_sine_axis / 2 / np.maximum(np.sinc(angle / np.pi), 1e-12)[..., None]


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
