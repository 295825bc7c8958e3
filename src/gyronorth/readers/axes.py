"""Mountings: from the axes f of a file to the body axes b, forward-right-down."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from gyronorth.attitude import mat_bn
from gyronorth.errors import InputError

#: Each letter of a convention: (index of the body axis it lies along, sign).
_LETTERS = {"f": (0, 1), "b": (0, -1), "r": (1, 1), "l": (1, -1), "d": (2, 1), "u": (2, -1)}


def mat_bf(axes: str) -> NDArray[np.float64]:
    """Rotation from file axes f to body axes b, shape (3, 3), entries 0 and +-1.

    Parameters
    ----------
    axes : str
        Three letters say where the file's x, y and z point: f or b, r or l, u or d,
        as in frd, flu, rfu. Or a signed permutation says which file axis is body
        forward, right and down: +y+x-z is the same as rfu.

    Raises
    ------
    InputError
        If it is neither, or left-handed.
    """
    mat = np.zeros((3, 3))
    permutation = re.fullmatch(r"([+-])([xyz])([+-])([xyz])([+-])([xyz])", axes)
    if permutation:
        for body, (sign, letter) in enumerate(zip(permutation.groups()[::2], permutation.groups()[1::2], strict=True)):
            mat[body, "xyz".index(letter)] = 1.0 if sign == "+" else -1.0
    elif len(axes) == 3 and set(axes) <= set(_LETTERS):
        for file_axis, letter in enumerate(axes):
            body, sign = _LETTERS[letter]
            mat[body, file_axis] = sign
    else:
        raise InputError(
            f"axes is {axes!r}; three letters of f/b, r/l, u/d (frd, flu, rfu, ...) saying where x, y, z point, "
            "or a signed permutation such as +y+x-z (file axes along forward, right, down) are expected."
        )
    if abs(np.linalg.det(mat)) < 0.5:
        raise InputError(f"axes is {axes!r}; each of the three directions must occur once.")
    if np.linalg.det(mat) < 0:
        raise InputError(f"axes is {axes!r}, which is left-handed; inertial sensors have right-handed axes.")
    return mat


def convention(mat: NDArray[np.float64]) -> str:
    """The three letters of a signed permutation `mat_bf`."""
    letters = ""
    for file_axis in range(3):
        body = int(np.argmax(np.abs(mat[:, file_axis])))
        letters += "fbrldu"[2 * body + (mat[body, file_axis] < 0)]
    return letters


def about_vertical(axes: str) -> tuple[tuple[str, float], ...]:
    """The three other conventions with the same axis down, and what each adds to the heading, rad."""
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # forward becomes right
    mats = [np.linalg.matrix_power(turn, times) @ mat_bf(axes) for times in (1, 2, 3)]
    return tuple((convention(mat), -times * np.pi / 2) for times, mat in enumerate(mats, 1))


def mat_vb(boresight: tuple[float, float, float]) -> NDArray[np.float64] | None:
    """Rotation from the sensor's to the vehicle's forward-right-down axes; None for none.

    `boresight` is (roll, pitch, yaw), rad, of the sensor in the vehicle: a sensor turned
    clockwise by yaw points to the vehicle's heading plus yaw.
    """
    if not any(boresight):
        return None
    return mat_bn(*boresight).T


def in_axes(samples: NDArray[np.float64], mat: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors (n, 3) in other axes; exact where `mat` only swaps and flips axes."""
    if np.isin(mat, (-1.0, 0.0, 1.0)).all():
        return samples[:, np.abs(mat).argmax(axis=1)] * mat.sum(axis=1)
    return samples @ mat.T
