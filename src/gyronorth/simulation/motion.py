"""True angular rate and specific force of a unit that stands, turns about the vertical, or sways.

Every value is the mean over a sample's interval. Turns are about the vertical; their rate and the
Earth rate seen by the turning body are integrated over each interval. A disturbance is a small
rotation on top, given as a function of time; it moves gyro and accelerometer together. Its lever
arm is left out: the unit rotates about its own accelerometers. A bias that settles is added to
the true rate, since it is the named disturbance and not the sensor model that brings it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gyronorth.arrays import Array
from gyronorth.attitude import mat_lb
from gyronorth.catalogue import HELD_OUT, KINDS, PLATFORM, SLOW
from gyronorth.earth import EARTH_RATE, normal_gravity
from gyronorth.errors import InputError, did_you_mean
from gyronorth.given import numbers, of_kind
from gyronorth.simulation.disturbance import drawn

#: disturbance(times, runs=..., rng=...) -> rotation vector from the undisturbed body to the body at
#: the given times (k,), s, in undisturbed body axes, rad, shape (runs, k, 3) or (1, k, 3).
Disturbance = Callable[..., Array]

#: Disturbances that can be named, beside "quiet".
DISTURBANCES = tuple(kind for kind in (*KINDS, *SLOW, *PLATFORM, *HELD_OUT) if kind != "quiet")


@dataclass(frozen=True)
class Motion:
    """How the unit moves.

    Raises
    ------
    InputError
        If turns overlap or are not positive in time, or the disturbance is not known.
    """

    turns: tuple[tuple[float, float, float], ...] = ()  # start s, duration s, angle rad (positive clockwise from above)
    smooth: bool = False  # turn with a raised-cosine rate instead of a constant one
    disturbance: str | Disturbance = "quiet"  # "quiet", one of DISTURBANCES, or a function

    def __post_init__(self) -> None:
        end = 0.0
        turns = numbers("turns", self.turns, "(turns, 3)")
        if turns.size and (turns.ndim != 2 or turns.shape[1] != 3):
            raise InputError(f"turns has shape {turns.shape}; start, duration and angle of each turn are expected.")
        object.__setattr__(self, "turns", tuple(map(tuple, turns.reshape(-1, 3).tolist())))
        for start, duration, angle in sorted(self.turns):
            if not (np.isfinite([start, duration, angle]).all() and start >= end and duration > 0):
                raise InputError(
                    f"The turn START:DURATION:ANGLE = {start:g}:{duration:g}:{angle * (180 / np.pi):g} does not fit: "
                    f"START of at least {end:g} s (the end of the turn before) and DURATION above 0 s are expected."
                )
            end = start + duration
        if not callable(self.disturbance):
            of_kind("disturbance", self.disturbance, str, "a name or a function")
        if isinstance(self.disturbance, str) and self.disturbance not in ("quiet", *DISTURBANCES):
            known = ("quiet", *DISTURBANCES)
            nearest = did_you_mean(self.disturbance, known)
            raise InputError(f"There is no disturbance {self.disturbance!r}; known are {', '.join(known)}.{nearest}")

    @property
    def total_angle(self) -> float:
        """Sum of the turns, rad."""
        return float(sum(angle for _, _, angle in self.turns))

    def turned(self, times: Array) -> Array:
        """Angle turned clockwise since the start, rad, at times (k,), s."""
        angle = np.zeros_like(times)
        for start, duration, total in self.turns:
            share = np.clip((times - start) / duration, 0, 1)
            angle += total * (share - np.sin(2 * np.pi * share) / (2 * np.pi) if self.smooth else share)
        return angle


@dataclass(frozen=True)
class Truth:
    """Interval means without sensor errors; an axis of length 1 stands for all runs or all samples."""

    gyro_b: Array  # (runs, samples, 3) rad/s
    accel_b: Array  # (runs, samples, 3) m/s^2


def true_motion(motion: Motion, pose: Array, samples: int, rate_hz: float, *, rng: np.random.Generator) -> Truth:
    """True rate and specific force of units that start at `pose`.

    Parameters
    ----------
    motion : Motion
        Turns and disturbance, the same turns for all runs.
    pose : ndarray, shape (4, runs)
        Latitude, roll, pitch and heading at the start, rad.
    samples, rate_hz : int, float
        Samples per run and their rate, Hz.
    rng : numpy.random.Generator
        Draws the disturbance.
    """
    latitude, roll, pitch, heading = pose
    mat_bl = np.swapaxes(mat_lb(roll, pitch), -1, -2)
    turning = _turning_means(motion, samples, rate_hz) if motion.turns else np.array([[1.0], [0.0], [0.0]])
    gyro = _level_rate(latitude, heading, turning) @ np.swapaxes(mat_bl, -1, -2)
    gravity = np.asarray(normal_gravity(latitude))
    accel = -(gravity[:, None] * mat_bl[:, :, 2])[:, None]
    if motion.disturbance == "quiet":
        return Truth(gyro, accel)
    times = np.arange(2 * samples + 1) / (2 * rate_hz)
    if not isinstance(motion.disturbance, str):
        return _disturbed(gyro, accel, motion.disturbance(times, runs=len(latitude), rng=rng), rate_hz)
    rotation, bias_angle = drawn(motion.disturbance, times, runs=len(latitude), rng=rng)
    truth = _disturbed(gyro, accel, rotation, rate_hz)
    return Truth(truth.gyro_b + np.diff(bias_angle[:, ::2], axis=1) * rate_hz, truth.accel_b)


def _level_rate(latitude: Array, heading: Array, turning: Array) -> Array:
    """Mean rate in the level frame, (runs, samples, 3): rate (cos lat cos psi, -cos lat sin psi, -sin lat) + turn.

    With psi = heading + turned, the means of cos and sin psi follow from those of the turned angle.
    """
    cos_turned, sin_turned, turn_rate = turning
    horizontal, down = EARTH_RATE * np.cos(latitude)[:, None], -EARTH_RATE * np.sin(latitude)[:, None]
    cos_heading, sin_heading = np.cos(heading)[:, None], np.sin(heading)[:, None]
    north = horizontal * (cos_heading * cos_turned - sin_heading * sin_turned)
    east = horizontal * (sin_heading * cos_turned + cos_heading * sin_turned)
    return np.stack([north, -east, down + turn_rate], axis=-1)


def _turning_means(motion: Motion, samples: int, rate_hz: float) -> Array:
    """Means over each interval of cos and sin of the turned angle, and the turn rate, shape (3, samples).

    The rate is a difference of angles. The others are integrated by Gauss-Legendre quadrature with
    8 nodes on each piece between sample edges and the ends of turns, on which the angle is smooth.
    """
    edges = np.arange(samples + 1) / rate_hz
    ends = np.array([[start, start + duration] for start, duration, _ in motion.turns]).ravel()
    times = np.union1d(edges, ends[ends < edges[-1]])
    length, angle = np.diff(times), motion.turned(times)
    waves = np.stack([np.cos(angle[:-1]), np.sin(angle[:-1])])
    moving = np.flatnonzero(np.diff(angle))
    nodes, weights = np.polynomial.legendre.leggauss(8)
    inside = motion.turned(times[moving, None] + length[moving, None] * (nodes + 1) / 2)
    waves[:, moving] = np.stack([np.cos(inside) @ weights, np.sin(inside) @ weights]) / 2
    first = np.searchsorted(times, edges[:-1])
    means = np.add.reduceat(waves * length, first, axis=1) / np.add.reduceat(length, first)
    return np.vstack([means, np.diff(motion.turned(edges)) * rate_hz])


def _disturbed(gyro: Array, accel: Array, rotation: Array, rate_hz: float) -> Truth:
    """Truth of a body turned by `rotation` (runs, 2 samples + 1, 3), at sample edges and middles.

    The undisturbed rate and specific force are turned into the body (Simpson's rule over each
    interval). The rate of the small rotation theta itself is its right Jacobian times its rate
    (J. Sola et al., "A micro Lie theory for state estimation in robotics", 2018, eq. 143):
    theta' - (1 - cos |theta|) / |theta|^2 theta x theta' + ... With the parabola through start,
    middle and end, the integral of theta x theta' is (middle - (start - 2 middle + end) / 6) x
    (end - start): coning within an interval is kept.
    """
    start, middle, end = rotation[:, :-2:2], rotation[:, 1::2], rotation[:, 2::2]
    change, lever = end - start, middle - (start - 2 * middle + end) / 6
    squared = np.sum(lever**2, axis=-1, keepdims=True)
    size = np.sqrt(squared)
    third = np.where(size < 1e-2, 1 / 6 - squared / 120, (1 - np.sinc(size / np.pi)) / np.maximum(squared, 1e-4))
    across = np.cross(lever, change)
    own = change - np.sinc(size / (2 * np.pi)) ** 2 / 2 * across + third * np.cross(lever, across)
    return Truth(_mean_in_body(rotation, gyro) + own * rate_hz, _mean_in_body(rotation, accel))


def _mean_in_body(rotation: Array, vector: Array) -> Array:
    """Mean over each interval of `vector` (runs, samples or 1, 3) in the turned body's axes: Simpson, Rodrigues."""
    total = np.zeros(())
    for offset, weight in ((0, 1 / 6), (1, 4 / 6), (2, 1 / 6)):
        theta = rotation[:, offset : rotation.shape[1] - 2 + offset : 2]
        size = np.linalg.norm(theta, axis=-1, keepdims=True)
        across = np.cross(theta, vector)
        second = np.sinc(size / (2 * np.pi)) ** 2 / 2
        total = total + weight * (vector - np.sinc(size / np.pi) * across + second * np.cross(theta, across))
    return total
