"""Heading in closed form from the mean rate and the mean specific force (the paper's eq:1-9)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gyronorth.alignment.result import Attitude
from gyronorth.angles import wrap_heading
from gyronorth.arrays import Array, mean_of_rows
from gyronorth.attitude import level, mat_lb


def gyrocompass(rate_b: ArrayLike, *, roll: ArrayLike, pitch: ArrayLike) -> Array:
    """Heading from the mean angular rate of a unit at rest with known roll and pitch.

    Parameters
    ----------
    rate_b : array_like, shape (..., 3)
        Mean angular rate in the body frame, rad/s.
    roll, pitch : array_like, shape (...)
        rad.

    Returns
    -------
    ndarray, shape (...)
        Heading in [0, 2 pi) rad. Undefined (some value) where the horizontal rate is zero.

    Notes
    -----
    heading = atan2(-w_y cos r + w_z sin r, w_x cos p + w_y sin r sin p + w_z cos r sin p)
    (the paper after eq:3; Groves 2013, eq. 5.105), which is atan2(-w_ly, w_lx) of the rate
    turned into the level frame. Level, it is eq:7: atan2(-w_y, w_x).
    """
    w_x, w_y, w_z = np.moveaxis(np.asarray(rate_b, dtype=float), -1, 0)
    sin_roll, cos_roll, sin_pitch, cos_pitch = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    sin_heading = -w_y * cos_roll + w_z * sin_roll
    cos_heading = w_x * cos_pitch + w_y * sin_roll * sin_pitch + w_z * cos_roll * sin_pitch
    return wrap_heading(np.arctan2(sin_heading, cos_heading))


def align_mean(gyro_b: Array, accel_b: Array | None, *, attitude: tuple[float, float] | None = None) -> Attitude:
    """Plain averaging: level by the mean specific force, then `gyrocompass` the mean rate.

    Parameters
    ----------
    gyro_b, accel_b : ndarray, shape (..., n, 3)
        Angular rate, rad/s, and specific force, m/s^2; no accelerometer means level.
    attitude : tuple of float, optional
        Known roll and pitch, rad, in place of levelling.
    """
    rate_b = mean_of_rows(gyro_b)
    if attitude is not None:
        roll, pitch = (np.full(rate_b.shape[:-1], angle) for angle in attitude)
    elif accel_b is None:
        roll = pitch = np.zeros(rate_b.shape[:-1])
    else:
        roll, pitch = level(mean_of_rows(accel_b))
    rate_l = np.einsum("...ij,...j->...i", mat_lb(roll, pitch), rate_b)
    return Attitude(gyrocompass(rate_b, roll=roll, pitch=pitch), roll, pitch, rate_l)
