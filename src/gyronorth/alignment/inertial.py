"""Inertial-frame alignment: heading from the way gravity turns in an inertial frame.

The gyro carries the specific force into b0, the body frame frozen in inertial space at the
start. There gravity describes a cone about Earth's axis, whatever the vehicle does in
between: sway drops out of the rate and stays only as a disturbance of the specific force.
"""

from __future__ import annotations

import numpy as np

from gyronorth.alignment.result import Attitude
from gyronorth.angles import circular_mean
from gyronorth.arrays import Array, mean_of_rows
from gyronorth.attitude import angles_of, attitude_path, conjugate, from_rotation_vector, rotate
from gyronorth.conditioning import HARMONICS, block_means, slope_variance
from gyronorth.earth import EARTH_RATE, earth_rate_n

#: Specific force is averaged to about this rate before the fit, Hz.
FIT_RATE = 4.0


def align_inertial(gyro_b: Array, accel_b: Array, *, rate_hz: float, latitude: float) -> Attitude:
    """Attitude by tracing gravity in an inertial frame (Wahba's problem, solved by SVD).

    Parameters
    ----------
    gyro_b, accel_b : ndarray, shape (..., n, 3)
        Angular rate, rad/s, and specific force, m/s^2.
    rate_hz : float
        Sample rate, Hz.
    latitude : float
        rad.

    Returns
    -------
    Attitude
        Heading, roll and pitch are means over the record. `rate_l` has the vertical rate of
        the plain mean; its horizontal size is that of gravity's motion, fitted freely, so
        that it can be compared with Omega cos(lat).

    Notes
    -----
    Markley, J. Astronautical Sciences 36(3), 1988, "Attitude determination using vector
    observations and the singular value decomposition". With n0 the navigation frame frozen at
    the start, f_n0(t) = exp(omega t) (0, 0, -1) in units of g, and b0 -> n0 minimises the sum
    of |f_n0 - C f_b0|^2. To first order the heading is that of the slope of f_b0: gyro white
    noise costs sqrt(1.2) of the floor, accelerometer white noise sqrt(12) N_a / (g Omega
    cos(lat) T^1.5).
    """
    n = gyro_b.shape[-2]
    middle, _ = attitude_path(gyro_b, rate_hz=rate_hz)
    size = max(1, round(rate_hz / FIT_RATE))
    if n // size < 2 * HARMONICS[-1]:
        size = 1
    force = block_means(rotate(middle, accel_b), size)
    force = force / np.linalg.norm(force.mean(axis=-2), axis=-1)[..., None, None]
    time: Array = (np.arange(force.shape[-2], dtype=float) + 0.5) * size / rate_hz
    expected = rotate(_earth_turn(latitude, time), np.array([0.0, 0.0, -1.0]))
    mat = _wahba(force, expected)
    traced = np.einsum("...ij,...tj->...ti", mat, force)
    moved = expected - expected.mean(axis=-2)
    signal = EARTH_RATE * np.cos(latitude)
    size_ratio = np.sum(traced * moved, axis=(-2, -1)) / np.sum(moved**2)
    heading, roll, pitch = _mean_attitude(mat, middle, latitude, rate_hz)
    horizontal = signal * size_ratio
    vertical = _vertical_rate(gyro_b, accel_b)
    rate_l = np.stack([horizontal * np.cos(heading), -horizontal * np.sin(heading), vertical], axis=-1)
    variance = slope_variance((traced - expected)[..., :2], duration=n / rate_hz)
    return Attitude(heading, roll, pitch, rate_l, variance)


def _earth_turn(latitude: float, time: Array) -> Array:
    """Quaternions taking n vectors at `time` into n0: the turn of Earth since the start."""
    return from_rotation_vector(earth_rate_n(latitude) * time[:, None])


def _wahba(force: Array, expected: Array) -> Array:
    """Rotation (..., 3, 3) that best takes `force` (..., t, 3) to `expected` (t, 3)."""
    left, _, right = np.linalg.svd(np.einsum("ti,...tj->...ij", expected, force))
    sign = np.sign(np.linalg.det(left) * np.linalg.det(right))
    left[..., 2] *= sign[..., None]
    return left @ right


def _mean_attitude(mat: Array, middle: Array, latitude: float, rate_hz: float) -> tuple[Array, Array, Array]:
    """Mean heading, roll and pitch of the body over the record, rad."""
    time: Array = (np.arange(middle.shape[-2], dtype=float) + 0.5) / rate_hz
    back = conjugate(_earth_turn(latitude, time))

    def in_n(axis_b: Array) -> Array:
        return rotate(back, np.einsum("...ij,...tj->...ti", mat, rotate(middle, axis_b)))

    heading, roll, pitch = angles_of(np.stack([in_n(axis_b) for axis_b in np.eye(3)], axis=-1))
    return circular_mean(heading, axis=-1), roll.mean(axis=-1), pitch.mean(axis=-1)


def _vertical_rate(gyro_b: Array, accel_b: Array) -> Array:
    """Mean rate about the mean direction of gravity, positive about down, rad/s."""
    down = -mean_of_rows(accel_b)
    down = down / np.linalg.norm(down, axis=-1, keepdims=True)
    return np.sum(mean_of_rows(gyro_b) * down, axis=-1)
