"""What the posterior looks at: means of the levelled rate and of the tilt over a few blocks.

Everything but tones and bumps is slow against a block, so that block means hold all of it (`COUNT` of them).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyronorth.arrays import Array
from gyronorth.attitude import level, mat_lb
from gyronorth.conditioning import block_means

#: Blocks of a recording.
COUNT = 24
#: Samples beyond which second-order terms of the motion are worked out from means.
FINE = 200_000


@dataclass(frozen=True)
class Blocks:
    """Block means of recordings, leading dimension (r,)."""

    rate_l: Array  # (r, COUNT, 3) angular rate in the level frame, rad/s, without second-order terms of the motion
    trace: Array | None  # (r, COUNT, 2) integrated rate less the tilt that the accelerometer sees, rad: free of motion
    seconds: float  # length of a block, s
    white: Array  # (r,) noise density of the rate at short lags, rad/sqrt(s)
    roll: Array  # (r,) rad
    pitch: Array  # (r,) rad
    gravity: Array  # (r,) size of the mean specific force, m/s^2; NaN without accelerometer

    @property
    def duration(self) -> float:
        """Length, s."""
        return self.seconds * COUNT


def blocks_of(
    gyro_b: Array, accel_b: Array | None, *, rate_hz: float, attitude: tuple[float, float] | None = None
) -> Blocks:
    """Block means of recordings (r, n, 3), n at least `COUNT`.

    Parameters
    ----------
    gyro_b, accel_b : ndarray, shape (r, n, 3)
        Angular rate, rad/s, and specific force, m/s^2.
    rate_hz : float
        Sample rate, Hz.
    attitude : tuple of float, optional
        Known roll and pitch, rad.

    Notes
    -----
    Relative to the Earth a small rotation theta has, to second order, theta_x' = w_x - w_z theta_y' ... ; written for
    the direction of gravity u in the body, u' = -w x u, the horizontal rates are w_x = u_y' + w_z u_x and w_y = -u_x' +
    w_z u_y, and the Earth rate seen by the tilted body differs by -theta x h. Both products are taken off the rate
    where the accelerometer shows the tilt, so that what is left is linear: constant plus derivative of the tilt.
    """
    r, n = gyro_b.shape[:2]
    if attitude is not None:
        roll, pitch = (np.full(r, angle) for angle in attitude)
    elif accel_b is None:
        roll = pitch = np.zeros(r)
    else:
        roll, pitch = level(accel_b.mean(axis=1))
    turn = np.swapaxes(mat_lb(roll, pitch), -1, -2)
    size = n // COUNT
    small = max(1, round(n * r / FINE)) if accel_b is not None else 1
    small = small if size // small >= 4 else 1
    rate, step = (block_means(gyro_b, small) if small > 1 else gyro_b) @ turn, small / rate_hz
    white = density_at_short_lags(rate, step=step)
    trace, gravity = None, np.full(r, np.nan)
    if accel_b is not None:
        force = (block_means(accel_b, small) if small > 1 else accel_b) @ turn
        gravity = np.linalg.norm(force.mean(axis=1), axis=-1)
        tilt = np.stack([-force[..., 1], force[..., 0]], axis=-1) / gravity[:, None, None]
        tilt = tilt - tilt.mean(axis=1, keepdims=True)
        if attitude is None:
            rate = _linear(rate, tilt)
        angle = (np.cumsum(rate[..., :2], axis=1) - rate[..., :2] / 2) * step
        trace = block_means(angle - tilt, size // small)[:, :COUNT]
    whole = size // small
    means = block_means(rate, whole)[:, :COUNT]
    return Blocks(means, trace, whole * step, white, roll, pitch, gravity)


def _linear(rate: Array, tilt: Array) -> Array:
    """The rate without its products with the tilt (see `blocks_of`)."""
    mean = rate.mean(axis=1, keepdims=True)
    yaw = rate[..., 2] - mean[..., 2]
    x, y = tilt[..., 0], tilt[..., 1]
    # u = (-theta_y, theta_x, 1): w_x - theta_x' = -yaw theta_y, w_y - theta_y' = yaw theta_x; -theta x h.
    out = rate.copy()
    out[..., 0] -= -yaw * y - y * mean[..., 2]
    out[..., 1] -= yaw * x + x * mean[..., 2]
    out[..., 2] -= y * mean[..., 0] - x * mean[..., 1]
    return out


def density_at_short_lags(rate: Array, *, step: float, longest: float = 1.0) -> Array:
    """Noise density, rad/sqrt(s), shape (r,), the least over lags up to `longest` s: vibration raises the shortest."""
    found = []
    size = 1
    while size == 1 or (size * step <= longest and rate.shape[1] // size >= 60):
        means = block_means(rate, size) if size > 1 else rate
        second = means[:, 2:] - 2 * means[:, 1:-1] + means[:, :-2]
        # Of three axes: a robust scale, since bumps and knocks stand out.
        middle = np.median(np.abs(second), axis=(1, 2)) / 0.6745 / np.sqrt(6)
        found.append(middle * np.sqrt(size * step))
        size *= 2
    return np.maximum(np.min(found, axis=0), 1e-15)
