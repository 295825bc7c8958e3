"""What a method found: attitude, posterior of the heading, error budget. Arrays over recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field

import numpy as np
from numpy.typing import ArrayLike

from gyronorth.arrays import Array, Mask, stacked
from gyronorth.estimate import DisturbanceFound, HeadingDensity, Pose, SensorErrors, Turn
from gyronorth.findings import Finding
from gyronorth.frozen import frozen
from gyronorth.uncertainty import SIGMA_UNKNOWN


@frozen
class Attitude:
    """The attitude of a unit and the Earth rate it senses there."""

    heading: Array  # (...,) rad in [0, 2 pi), clockwise from true north
    roll: Array  # (...,) rad
    pitch: Array  # (...,) rad
    rate_l: Array  # (..., 3) Earth's rotation as seen in the level frame, rad/s
    measured_variance: Array | None = None  # (...,) of a horizontal rate component from the residuals, (rad/s)^2


@frozen
class Posterior:
    """What is believed of the heading: the interval stays as the method found it, skewed or not."""

    sigma: Array  # (...,) root mean square deviation from the heading, rad
    low: Array  # (...,) ends of the 95 % interval, rad from the heading: -pi <= low <= 0
    high: Array  # 0 <= high <= pi

    @classmethod
    def symmetric(cls, sigma: ArrayLike, half_width: ArrayLike) -> Posterior:
        """One whose interval reaches as far to either side."""
        half = np.asarray(half_width, dtype=float)
        return cls(np.asarray(sigma, dtype=float), -half, half)

    @classmethod
    def unknown(cls, shape: tuple[int, ...] = ()) -> Posterior:
        """Nothing is known: any heading."""
        return cls.symmetric(np.full(shape, SIGMA_UNKNOWN), np.full(shape, np.pi))

    @property
    def half_width(self) -> Array:
        """Half of the interval's width, rad; pi where it is the whole circle."""
        return np.minimum((self.high - self.low) / 2, np.pi)

    @property
    def whole(self) -> Mask:
        """Where the interval is the whole circle."""
        return np.asarray(self.half_width >= np.pi)


@frozen
class Judged:
    """What the gates of the rate and of motion hold against the Earth, where a method lets them."""

    rate_l: Array  # (..., 3) levelled mean rate, rad/s
    variance: Array  # (...,) claimed, of a horizontal component, (rad/s)^2
    vertical_variance: Array  # (...,) of the vertical component
    turn_limit: Array  # (...,) largest rotation about the mean attitude that the method allows for, rad


@frozen
class Result:
    """What one method found of a problem; every array has the problem's leading dimensions."""

    method: str
    attitude: Attitude
    posterior: Posterior
    variance: Mapping[str, Array]  # error budget of a horizontal rate component, (rad/s)^2: noise, drift, ...
    arm: Array  # (...,) rad/s: root variance over it is the angle that a term costs
    why: str = "asked for"
    judged: Judged | None = None  # None: neither rate nor motion is judged
    refusals: tuple[Finding, ...] = ()  # what the method alone can judge, of one recording
    findings: tuple[Finding, ...] = ()  # warnings
    swaying: bool = True  # whether sway is told of, where it is seen
    poses: tuple[Pose, ...] = ()
    turns: tuple[Turn, ...] = ()
    sensor_errors: SensorErrors | None = None
    disturbance: DisturbanceFound | None = None
    density: HeadingDensity | None = None
    bundle: str | None = None
    known: bool = field(default=True)  # False: there is no heading to report

    @property
    def total(self) -> Array:
        """Variance of a horizontal rate component from all terms, (rad/s)^2."""
        return sum(self.variance.values(), np.zeros(()))


def together(results: Sequence[Result]) -> Result:
    """Results of single recordings by one method as that of a batch, without what is told of one recording only."""
    first = results[0]
    return Result(
        first.method,
        stacked([result.attitude for result in results]),
        stacked([result.posterior for result in results]),
        {name: np.stack([result.variance[name] for result in results]) for name in first.variance},
        np.stack([result.arm for result in results]),
        judged=stacked([result.judged for result in results]),
    )


def unknown(attitude: Attitude, *, method: str = "mean", why: str = "asked for", **told: object) -> Result:
    """The result of a recording that says nothing: any heading."""
    shape = attitude.heading.shape
    return Result(method, attitude, Posterior.unknown(shape), {}, np.ones(shape), why=why, swaying=False, **told)  # type: ignore[arg-type]
