"""Roll and pitch from specific force; the rotation from the body frame to the level frame.

The level frame l is the navigation frame turned by the heading about the vertical: its x
axis is the body x axis laid level, its z axis points down. T_n^b of the paper (eq:2) is
`mat_bn`; `mat_lb` undoes pitch and roll only.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def level(accel_b: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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


def mat_lb(roll: ArrayLike, pitch: ArrayLike) -> NDArray[np.float64]:
    """Rotation from the body frame to the level frame, shape (..., 3, 3)."""
    return np.swapaxes(mat_bn(roll, pitch, np.zeros_like(np.asarray(roll, dtype=float))), -1, -2)


def mat_bn(roll: ArrayLike, pitch: ArrayLike, heading: ArrayLike) -> NDArray[np.float64]:
    """Rotation from the navigation to the body frame, shape (..., 3, 3) (the paper's eq:2)."""
    roll, pitch, heading = np.broadcast_arrays(*(np.asarray(a, dtype=float) for a in (roll, pitch, heading)))
    sr, cr, sp, cp, sh, ch = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch), np.sin(heading), np.cos(heading)
    rows = [
        [cp * ch, cp * sh, -sp],
        [sr * sp * ch - cr * sh, sr * sp * sh + cr * ch, sr * cp],
        [cr * sp * ch + sr * sh, cr * sp * sh - sr * ch, cr * cp],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
