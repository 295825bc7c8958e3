"""A heading that was found standing still, carried on while the unit moves: the gyro less its bias, integrated.

The attitude of the last valid estimate is turned on by each sample, less the bias that the gyro showed in that stand
and less Earth rate. What grows is the error of the heading against that at the stand: with the mean over the T seconds
of the stand as the bias, and t seconds since, its variance is

    t^2 Var(mean over t - mean over T) + (scale factor x angle turned)^2,

the first term by the noise law of the profile: for white noise N alone it is N^2 (t + t^2 / T).

The Earth is taken as still below the unit: at a speed v along the equator's direction the vertical turns by v / R,
0.3 deg/h at 10 m/s. `LONGEST` bounds that, and the tilt that the horizontal biases build up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyronorth.angles import wrap, wrap_heading
from gyronorth.arrays import Array
from gyronorth.attitude import angles_of, attitude_path, from_rotation_vector, mat_bn, multiply, quaternion_nb, rotate
from gyronorth.earth import earth_rate_n
from gyronorth.estimate import HeadingEstimate
from gyronorth.sensor import Sensor
from gyronorth.sensor.law import NoiseLaw

#: A stand is trusted so long, s, before the last estimate that is valid: a motion that begins slowly is seen late.
GUARD = 3.0
#: A heading is held for so long, s, at most, and up to this sigma, rad, where none is required.
LONGEST, LARGEST_SIGMA = 1800.0, float(np.radians(3.0))
#: A bridged gap that is longer than this, s, hides how the unit turned.
LONGEST_GAP = 0.1
#: A unit that sways by more than this about its mean attitude, rad, rms, is not where its heading says at one instant.
MOST_SWAY = float(np.radians(0.1))
#: The unit has moved since a valid estimate when it turned by more than this, rad, and so many sigma of what grew.
MOVED, MOVED_SIGMAS = float(np.radians(0.2)), 4.0
#: The rate of turn is that of so long, s, looked at so often, s.
TURN_TIME, LOOKED = 1.0, 0.1
#: So much is integrated at a time, s.
LONGEST_STEP = 10.0
#: Samples that are kept to start from an estimate that comes late, s.
KEPT = 300.0


@dataclass(frozen=True)
class Held:
    """A heading carried on from a stand."""

    heading: float  # rad in [0, 2 pi)
    sigma: float  # one standard deviation, rad
    roll: float  # rad
    pitch: float  # rad
    since: float  # s since the stand


@dataclass(frozen=True)
class _Stand:
    """A valid estimate from which a heading can be carried on."""

    sample: int  # samples up to it, since the start of the stretch
    sigma: float  # rad
    attitude: Array  # (4,) quaternion_nb
    bias_b: Array  # (3,) rad/s
    length: float  # s that it stood still, over which the bias is a mean


class Holding:
    """Takes the samples and the estimates of one stretch, in step.

    Parameters
    ----------
    rate_hz : float
        Sample rate, Hz.
    latitude : float
        rad.
    sensor : Sensor, optional
        Profile by which sigma grows; without one there is a rate of turn and no held heading.
    """

    def __init__(self, rate_hz: float, latitude: float, sensor: Sensor | None) -> None:
        self._rate_hz, self._earth_n = rate_hz, earth_rate_n(latitude)
        self._sensor = sensor
        self._law = None if sensor is None else NoiseLaw(sensor.gyro)
        self._pieces: list[Array] = []  # samples since `_first`
        self._first = self._samples = 0
        self._waiting: list[_Stand] = []  # valid estimates that are not trusted yet
        self._stand: _Stand | None = None
        self._now: Array = np.zeros(4)  # quaternion_nb at the last sample
        self._turned = 0.0  # rad since the stand
        self._path: list[tuple[float, float]] = []  # (s, rad turned) of the last `TURN_TIME`

    def add(self, gyro_b: Array, *, broken: bool = False) -> None:
        """Take samples (n, 3), rad/s; `broken`: a gap that hides how the unit turned lies before or among them."""
        self._samples += len(gyro_b)
        if broken:
            self._pieces, self._first, self._waiting, self._stand = [], self._samples, [], None
            self._path = []
            return
        self._pieces.append(gyro_b)
        while self._samples - self._first > KEPT * self._rate_hz:
            self._first += len(self._pieces.pop(0))
        if self._stand is not None:
            self._carry(self._stand, gyro_b, self._samples)

    def found(self, estimate: HeadingEstimate, samples: int) -> None:
        """Take an estimate of the first `samples` samples of the stretch."""
        if not _fit(estimate):
            self._waiting = []
            return
        trusted = [stand for stand in self._waiting if stand.sample <= samples - GUARD * self._rate_hz]
        self._waiting = [*self._waiting[max(len(trusted) - 1, 0) :], _stand_of(estimate, samples, self._earth_n)]
        if trusted and trusted[-1].sample >= self._first:
            self._start(trusted[-1])

    def held(self, estimate: HeadingEstimate, *, limit: float | None) -> Held | None:
        """The heading carried on, where it says more than `estimate`, the latest; None elsewhere.

        That is where the unit has moved since its last valid estimate. `limit` is the largest sigma, rad.
        """
        stand = self._stand
        if stand is None or self._law is None or any(reason.code == "saturated" for reason in estimate.reasons):
            return None
        time = (self._samples - stand.sample) / self._rate_hz
        grown = self._grown(stand, time)
        heading, roll, pitch = (float(angle) for angle in _angles(self._now))
        shown, moved = estimate.heading if estimate.valid else None, MOVED + MOVED_SIGMAS * grown
        if shown is not None and min(abs(wrap(heading - shown)), abs(self._turned)) < moved:
            return None  # the estimate has caught up, or grows more certain while the unit stands
        sigma = float(np.hypot(stand.sigma, grown))
        if time > LONGEST or sigma > (LARGEST_SIGMA if limit is None else limit):
            return None
        return Held(heading, sigma, roll, pitch, time)

    @property
    def rate_of_turn(self) -> float | None:
        """How fast the heading changes, rad/s, positive to starboard; None before a stand is known."""
        if len(self._path) < 2:
            return None
        (start, before), (end, after) = self._path[0], self._path[-1]
        return (after - before) / (end - start)

    def _start(self, stand: _Stand) -> None:
        """Carry on from a stand: over the samples that came since."""
        since = np.concatenate([np.zeros((0, 3)), *self._pieces])[stand.sample - self._first :]
        self._stand, self._now, self._turned, self._path = stand, stand.attitude, 0.0, []
        self._pieces, self._first = [since], stand.sample
        self._carry(stand, since, stand.sample + len(since))

    def _carry(self, stand: _Stand, gyro_b: Array, samples: int) -> None:
        """Turn the attitude on by samples, up to which there were `samples`."""
        longest = round(LONGEST_STEP * self._rate_hz) + 1
        for first in range(0, len(gyro_b), longest):
            piece = gyro_b[first : first + longest]
            _, path = attitude_path(piece - stand.bias_b, rate_hz=self._rate_hz)
            ends = np.arange(len(path) - 1, -1, -max(1, round(LOOKED * self._rate_hz)))[::-1]
            earth = from_rotation_vector(-self._earth_n * ((ends[:, None] + 1) / self._rate_hz))
            attitudes = multiply(earth, multiply(self._now, path[ends]))
            headings, _, _ = _angles(np.concatenate([self._now[None], attitudes]))
            turned = self._turned + np.cumsum(wrap(np.diff(headings)))
            times = (samples - len(gyro_b) + first + ends + 1) / self._rate_hz
            self._now = attitudes[-1] / np.linalg.norm(attitudes[-1])
            self._turned = float(turned[-1])
            self._path += zip(times.tolist(), turned.tolist(), strict=True)
        while len(self._path) > 2 and self._path[1][0] < samples / self._rate_hz - TURN_TIME:
            self._path.pop(0)

    def _grown(self, stand: _Stand, time: float) -> float:
        """Sigma of what was added to the heading since the stand, rad."""
        assert self._law is not None
        assert self._sensor is not None
        if time <= 0:
            return 0.0
        edges = np.array([0.0, stand.length, stand.length + time]) * self._rate_hz
        covariance = self._law.mean_covariance(edges[:-1], edges[1:], rate_hz=self._rate_hz)
        of_rate = covariance[0, 0] + covariance[1, 1] - 2 * covariance[0, 1]
        return float(np.sqrt(max(of_rate, 0.0) * time**2 + (self._sensor.gyro.scale_factor * self._turned) ** 2))


def _fit(estimate: HeadingEstimate) -> bool:
    """Whether a heading can be carried on from it: valid, level known, and standing quite still."""
    level = all(warning.code != "assumed_level" for warning in estimate.warnings)
    known = None not in (estimate.heading, estimate.sigma, estimate.roll, estimate.pitch)
    return estimate.valid and known and level and bool(estimate.poses) and _sway(estimate) <= MOST_SWAY


def _sway(estimate: HeadingEstimate) -> float:
    """By how much the attitude of an instant differs from that of the estimate, rad."""
    arcsec = [warning.value or 0.0 for warning in estimate.warnings if warning.code == "swaying"]
    return float(np.radians(max(arcsec, default=0.0) / 3600))


def _stand_of(estimate: HeadingEstimate, samples: int, earth_n: Array) -> _Stand:
    assert estimate.heading is not None
    assert estimate.sigma is not None
    assert estimate.roll is not None
    assert estimate.pitch is not None
    turn = mat_bn(estimate.roll, estimate.pitch, estimate.heading)
    pose = estimate.poses[-1]
    return _Stand(
        samples,
        float(np.hypot(estimate.sigma, _sway(estimate))),
        quaternion_nb(estimate.roll, estimate.pitch, estimate.heading),
        np.asarray(estimate.rate_mean) - turn @ earth_n,
        pose.end - pose.start,
    )


def _angles(attitude: Array) -> tuple[Array, Array, Array]:
    """Heading in [0, 2 pi), roll and pitch, rad, of quaternions (..., 4)."""
    heading, roll, pitch = angles_of(np.stack([rotate(attitude, axis) for axis in np.eye(3)], axis=-1))
    return wrap_heading(heading), roll, pitch
