"""What no profile knows of turned alignment, as hypotheses with prior weights.

*How the bias scatters from pose to pose.* A bias that steps when the unit is turned (thermal gradients, g-sensitivity,
a knock) is no drift of a noise law. Its scale is 0 with probability `STEADY`, else one of `SCATTER` times the standard
deviation that the law gives the mean rate of a pose, each of less weight than the one before: a mixture of normal laws
of growing scale, which has a heavy tail as Student's has (Andrews and Mallows, J. R. Stat. Soc. B 36, 1974). Two poses
show it in two figures alone, the size of the horizontal Earth rate and the vertical rate; what they leave open, these
weights decide.

*How good given turn angles are.* Unless the user says it, one of `ANGLE_SIGMAS`: the gyro's own measure of the turns
tells them apart where its scale factor is known well enough.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyronorth.alignment.turned.model import GivenTurn
from gyronorth.alignment.turned.segments import TurnedBlocks
from gyronorth.alignment.turned.solve import Unknowns
from gyronorth.sensor import Sensor
from gyronorth.sensor.law import NoiseLaw

#: Prior probability that the bias of every pose is the same, but for the drift of the profile.
STEADY = 0.85
#: Scatter over the noise of a pose, and the weight of each over that of the one before.
SCATTER, TAIL = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0), 0.7
#: Standard deviation of a given turn angle, rad, from an index table to a mark on the floor, and its weight.
ANGLE_SIGMAS = tuple(np.radians((0.01, 0.03, 0.1, 0.3, 1.0, 3.0)).tolist())
ANGLE_WEIGHTS = (0.3, 0.25, 0.2, 0.13, 0.08, 0.04)


@dataclass(frozen=True)
class Hypothesis:
    """Values of what is not known, and the logarithm of their prior probability."""

    unknowns: Unknowns
    log_prior: float


def hypotheses(
    blocks: TurnedBlocks, sensor: Sensor, given: tuple[GivenTurn, ...], angle_sigma: float | None, *, scatter: bool
) -> list[Hypothesis]:
    """All of them, the steady bias first; with `scatter` also one that scatters between two poses or more."""
    places = len(np.unique(np.where(blocks.still, blocks.stretch, -1 - blocks.spin)[blocks.still | (blocks.spin >= 0)]))
    scales, weights = [0.0], [1.0]
    if scatter and places > 1:
        tail = TAIL ** np.arange(len(SCATTER))
        scales += [ratio * _pose_noise(blocks, sensor) for ratio in SCATTER]
        weights = [STEADY, *((1 - STEADY) * tail / tail.sum()).tolist()]
    angles = [(0.0, 1.0)]
    if given:
        angles = list(zip(ANGLE_SIGMAS, ANGLE_WEIGHTS, strict=True)) if angle_sigma is None else [(angle_sigma, 1.0)]
    return [
        Hypothesis(Unknowns(scale, angle), float(np.log(weight * share)))
        for scale, weight in zip(scales, weights, strict=True)
        for angle, share in angles
    ]


def _pose_noise(blocks: TurnedBlocks, sensor: Sensor) -> float:
    """Standard deviation that the law gives the mean rate of a usual pose, rad/s."""
    still = blocks.still
    if not still.any():
        return float(np.sqrt(sum(NoiseLaw(sensor.gyro).mean_variance(blocks.seconds.sum()).values())))
    lengths = np.bincount(blocks.stretch[still], blocks.seconds[still])
    return float(np.sqrt(sum(NoiseLaw(sensor.gyro).mean_variance(float(np.median(lengths))).values())))
