"""The mountings that gravity allows, and the heading that each of them would give."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyronorth.readers.axes import convention

#: Of gravity along body down that a mounting must have, as a share: a tilt of 60 deg.
LEAST_DOWN = 0.5
#: Mountings that people use, in the order in which they are proposed.
USUAL = ("frd", "flu", "rfu")


@dataclass(frozen=True)
class Mounting:
    """Where the file's x, y and z point, and what follows."""

    axes: str  # three letters
    heading: float  # rad, of the forward axis, from the mean rate and the mean force
    forward: str  # the file axis that points forward, as +x


def mountings(rate_file: ArrayLike, force_file: ArrayLike) -> list[Mounting]:
    """The right-handed mountings whose down axis is where gravity points, usual ones first.

    Parameters
    ----------
    rate_file, force_file : array_like, shape (3,)
        Mean angular rate, any unit, and mean specific force in file axes.

    Returns
    -------
    list of Mounting
        Four, 90 deg apart, unless the unit lies far from level.

    Notes
    -----
    With d the direction of gravity, the horizontal part of the rate points north: a forward axis f makes the angle
    atan2(-w (d x f), w f) with it.
    """
    rate, force = np.asarray(rate_file, dtype=float), np.asarray(force_file, dtype=float)
    down = -force / np.linalg.norm(force)
    found = []
    for mat in _rotations():
        if mat[2] @ down < max(LEAST_DOWN, float(np.max(np.abs(down))) - 1e-9):
            continue
        forward = mat[0] - (mat[0] @ down) * down
        heading = float(np.arctan2(-rate @ np.cross(down, forward), rate @ forward)) % (2 * np.pi)
        axis = int(np.argmax(np.abs(mat[0])))
        found.append(Mounting(convention(mat), heading, f"{'+' if mat[0, axis] > 0 else '-'}{'xyz'[axis]}"))
    return sorted(found, key=lambda each: (each.axes not in USUAL, each.forward[0] == "-", each.forward))


def _rotations() -> Iterator[NDArray[np.float64]]:
    """The 24 rotations by right angles, file axes to body axes, shape (3, 3) each."""
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            mat = np.zeros((3, 3))
            mat[range(3), order] = signs
            if np.linalg.det(mat) > 0:
                yield mat
