"""The covariances of the posterior's mixture: noise and drift of the unit, motion of the platform, by hypothesis.

A hypothesis is a *base* (scale of the in-run drift, and a broadband motion of the platform) and a *shape* (one slow
change beside it: a tilt that goes on or settles, a bias that settles or walks). Bases are whitened once for each
length and sensor; shapes are a few columns on top, eliminated in closed form.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from gyronorth.alignment.posterior.axis import Axis, axis_of
from gyronorth.alignment.posterior.blocks import COUNT
from gyronorth.alignment.posterior.force import FORCE, force_noise, forces_of
from gyronorth.angles import DEG_PER_HOUR
from gyronorth.arrays import Array, Index, Mask
from gyronorth.sensor import Sensor, TriadErrors
from gyronorth.sensor.law import NoiseLaw

#: In-run drift over the profile's, and the prior of each.
DRIFTS = (0.1, 0.3, 1.0, 3.0, 10.0)
DRIFT_PRIOR = (0.04, 0.06, 0.86, 0.03, 0.01)
#: Broadband motion: tilt, rad rms per axis, and correlation time over the duration.
SWAYS = tuple(np.radians((3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3)))
SWAY_TIMES = (0.01, 0.04, 0.16)
#: Where tones or bumps were fitted, broadband motion is what they leave: every size, at one time.
SWAY_TIMES_LEFT = SWAY_TIMES[1:2]
#: Of the yaw two sizes at two times.
YAWS_LEFT, YAW_TIMES_LEFT = tuple(np.radians((3e-3, 0.1))), (0.01, 0.3)
#: Probability of broadband motion, with and without an accelerometer that would show it.
SWAY, SWAY_UNSEEN = 0.08, 0.04
#: Slow tilt: rate, rad/s rms per axis, of a line or of an exponential at its beginning, and its share of the prior.
TILTS = tuple(np.radians((1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3)) / 100)
TILT_PRIOR = (0.075, 0.105, 0.149, 0.149, 0.149, 0.149, 0.149, 0.075)
TILT, TILT_UNSEEN = 0.5, 0.15
#: Time constants over the duration of a tilt that settles; infinite for one that goes on.
TILT_TIMES = (np.inf, 0.5, 0.15)
#: Tilt and yaw that settle in any time: time constants over the duration, from and to; angle at the end, rad rms per
#: axis; and the probability of such a tilt beside an accelerometer. The yaw's is part of `YAW`.
CREEP_TIMES, CREEP = (0.05, 3.0), 0.05
CREEPS, YAW_CREEPS = tuple(np.radians((0.01, 0.03, 0.1, 0.3))), tuple(np.radians((0.03, 0.3)))
#: Settling bias: time constants, s, probability, and size over the profile's constant and in-run bias.
SETTLING_TIMES = tuple(15.0 * 1.6 ** np.arange(13))
SETTLING, SETTLING_SIZES = 0.12, (1.0, 3.0, 10.0, 30.0)
SETTLING_SIZE_PRIOR = (0.15, 0.25, 0.57, 0.03)
#: Time constants up to this, s, and their share of the prior.
FAST, FAST_SHARE = 120.0, 0.4
#: Walking bias: probability, and rate at the end over the profile's bias.
WALK, WALK_SIZES, WALK_MODES = 0.01, (3.0, 10.0), 6
#: Yaw of the platform: probability, rms, rad, and correlation time over the duration.
YAW = 0.2
YAWS = tuple(np.radians((1e-3, 1e-2, 0.1, 0.5)))
YAW_TIMES = (0.01, 0.1, 1.0)
#: Rotation of a bump, rad.
BUMP_ANGLE = np.radians(0.1)
#: How far a line may lie from where it was found, cycles in the recording.
NEAR_LINE = 0.08
#: Points of a block at which the motion is integrated, and least noise of a mean rate, rad/s.
FINE, FLOOR = 8, 1e-12
#: Tilt of which nothing is known, rad: the constant of the accelerometer's tilt.
ANY_TILT = 0.02


@dataclass(frozen=True)
class Shapes:
    """Slow changes: rank-one shapes first, then walks."""

    gyro: Array  # (COUNT, c) rate of each column, unit amplitude
    trace: Array  # (COUNT, c) the same in the integrated rate less the tilt: nothing of a motion
    column: Index  # (s,) column of each shape, -1 for none
    size: Array  # (s,) amplitude, one standard deviation
    tilts: Mask  # (s,) whether it is a tilt: horizontal axes only
    log_prior: Array  # (s,)
    kind: NDArray[np.str_]  # (s,)

    @cached_property
    def settles(self) -> Mask:
        """Where it is a bias that settles."""
        return self.of("settling")

    @cached_property
    def walks(self) -> Index:
        """Numbers of the walks."""
        return np.flatnonzero(self.of("walk"))

    def of(self, kind: str) -> Mask:
        """Where it is of one kind."""
        return self.kind == kind

    @cached_property
    def lasting(self) -> Array:
        """Mean of a bias whose time constant is the duration or longer, rad/s: in the recording next to constant."""
        mean = np.where(self.column >= 0, self.gyro.mean(axis=0)[self.column], 0.0)
        return np.where(self.settles & (mean > 1 - np.exp(-1)), self.size * mean, 0.0)


@dataclass(frozen=True)
class Law:
    """Everything that does not depend on the samples."""

    horizontal: Axis  # d = COUNT, or twice that with an accelerometer; bases drift x (motion or force)
    vertical: Axis  # d = COUNT; bases drift x yaw
    drift: Index  # (b,) number of the drift of each horizontal base
    sway: Array  # (b,) rad rms of its motion, 0 for none
    creep: Mask  # (b,) whether it tilts by what settles in any time
    force: Array  # (b,) rad rms of what the accelerometer drifts beyond its noise, 0 for nothing
    log_prior: Array  # (b,) of its motion and force
    yaw_drift: Index  # (v,)
    yaw_log_prior: Array  # (v,)
    shapes: Shapes
    bias: float  # turn-on and in-run bias of the profile, rad/s


#: Laws that are kept: 2.3 MB each at most, as many as one recording without a profile takes. A running unit, whose
#: every estimate is of another length, fills all places. So do the parts below, of which one recording takes fewer.
KEPT = 8


@lru_cache(maxsize=KEPT)
def law(
    seconds: float, sensor: Sensor, *, known: bool, accel: bool, bumped: tuple[int, ...] = (), tones: bool = False
) -> Law:
    """The law of recordings of `COUNT` blocks of so many seconds, some of which hold bumps.

    `sensor` is the profile where it is `known`, else it stands for one. Beside `tones`, whose own noise `weigh` adds,
    broadband motion is what they leave; without an accelerometer tones and bumps were taken from the block means.
    """
    gyro, duration = sensor.gyro, seconds * COUNT
    scale = max(float(np.hypot(gyro.turn_on_bias, gyro.flicker)), 2 * gyro.white / np.sqrt(duration), 1e-12)
    shapes = _shapes(seconds, scale, accel=accel)
    samples = _white(gyro.white, 0.0 if tones and not accel else gyro.quantisation, seconds, accel=accel)
    base = samples.copy()
    base[:COUNT, :COUNT] += FLOOR**2 * np.eye(COUNT)
    base[bumped, bumped] += (BUMP_ANGLE / seconds) ** 2
    if accel:
        base[COUNT:, COUNT:] += (
            force_noise(sensor.accel, seconds) + ANY_TILT**2 + (FLOOR * duration) ** 2 * np.eye(COUNT)
        )
    noise = base + _drifts(replace(gyro, white=0.0) if gyro.flicker or gyro.random_walk else gyro, seconds, accel=accel)
    forces, levels = forces_of(sensor.accel) if accel else (np.zeros(1), np.zeros((1, 0, 0)))
    moves = _moves(seconds, len(forces), known=known, beside=tones or bool(bumped))
    used, number = np.unique(moves.drift * len(forces) + moves.force, return_inverse=True)
    horizontal = noise[used // len(forces)].copy()
    horizontal[:, COUNT:, COUNT:] += levels[used % len(forces)]
    walk, trace = _walk_modes() * scale, shapes.trace if accel else None
    return Law(
        horizontal=axis_of(horizontal, number, moves.motion, shapes.gyro, trace, walk, seconds),
        vertical=axis_of(noise[:, :COUNT, :COUNT], moves.yaw_drift, moves.turning, shapes.gyro, None, walk, seconds),
        drift=moves.drift,
        sway=moves.sway,
        creep=moves.creep,
        force=forces[moves.force],
        log_prior=moves.log_prior,
        yaw_drift=moves.yaw_drift,
        yaw_log_prior=moves.yaw_log_prior,
        shapes=shapes,
        bias=scale,
    )


@dataclass(frozen=True)
class _Moves:
    """Numbers of the bases, and covariances of the rate by motion."""

    drift: Index  # (b,)
    force: Index  # (b,)
    sway: Array  # (b,) rad rms
    creep: Mask  # (b,)
    motion: Array  # (b, COUNT, COUNT)
    log_prior: Array  # (b,)
    yaw_drift: Index  # (v,)
    turning: Array  # (v, COUNT, COUNT)
    yaw_log_prior: Array  # (v,)


@lru_cache(maxsize=4)
def _moves(seconds: float, forces: int, *, known: bool, beside: bool) -> _Moves:
    """Bases of all motions; beside tones or bumps, of what they leave."""
    duration, some = seconds * COUNT, SWAY if forces > 1 else SWAY_UNSEEN
    sways = [(0.0, 1.0), *((size, time) for size in SWAYS for time in (SWAY_TIMES_LEFT if beside else SWAY_TIMES))]
    motion = [size**2 * _motion(seconds, time * duration) for size, time in sways]
    # Without an accelerometer a tilt that settles is next to a constant bias: the shapes' smaller prior holds.
    creeps = CREEPS if forces > 1 else ()
    motion += [size**2 * _creep(seconds) for size in creeps]
    sizes, lags = (YAWS_LEFT, YAW_TIMES_LEFT) if beside else (YAWS, YAW_TIMES)
    yaws = [(0.0, 1.0), *((size, time) for size in sizes for time in lags)]
    turning = [yaw**2 * _motion(seconds, time * duration) for yaw, time in yaws]
    turning += [yaw**2 * _creep(seconds) for yaw in YAW_CREEPS]
    drift, moved, force = _paired(len(sways), len(creeps), forces, known=known)
    yaw_drift, yaw, _ = _paired(len(yaws), len(YAW_CREEPS), 1, known=known)
    sway, creep = np.where(moved < len(sways), moved, 0), np.maximum(moved - len(sways) + 1, 0)
    return _Moves(
        drift=drift,
        force=force,
        sway=np.array([tilt for tilt, _ in sways])[sway],
        creep=creep > 0,
        motion=np.array(motion)[moved],
        log_prior=_log_prior((some, FORCE, CREEP), drift, (sway, force, creep)),
        yaw_drift=yaw_drift,
        turning=np.array(turning)[yaw],
        yaw_log_prior=_log_prior((YAW,), yaw_drift, (yaw,)),
    )


def _paired(motions: int, creeps: int, forces: int, *, known: bool) -> tuple[Index, Index, Index]:
    """Numbers of drift, motion (those that creep last) and force of each base.

    What drifts less than a known profile only where nothing moves, what creeps beside a gyro as it should be, a force
    beside no motion and such a gyro.
    """
    pairs = [
        (d, m, f)
        for d, factor in enumerate(DRIFTS)
        for m in range(motions + creeps)
        for f in range(forces)
        if (factor >= 1 or m == 0 or not known)
        and (f == 0 or (m == 0 and factor == 1))
        and (m < motions or factor == 1)
    ]
    drift, motion, force = np.array(pairs).T
    return drift, motion, force


def _log_prior(some: tuple[float, ...], drift: Index, moved: tuple[Index, ...]) -> Array:
    """Log probability of each base given its drift: of any of one kind that is `moved` it is its `some`, shared."""
    probability, left = np.zeros(len(drift)), np.ones(len(drift))
    for share, number in zip(some, moved, strict=True):
        count = np.bincount(drift, weights=number > 0)[drift]
        probability += np.where(number > 0, share / np.maximum(count, 1), 0.0)
        left -= np.where(count > 0, share, 0.0)
    return np.asarray(np.log(np.where(probability > 0, probability, left)), dtype=float)


def tone_root(seconds: float, frequency: float, size: float) -> Array:
    """Root (COUNT, 4) of the covariance of block means of a rate that sways at about `frequency`, Hz, in any phase.

    `size`, rad/s, is its rms.
    """
    near = frequency + np.array([-NEAR_LINE, NEAR_LINE]) / (seconds * COUNT)
    phase = 2 * np.pi * (np.arange(COUNT) + 0.5) * seconds * near[:, None, None]
    wave = np.concatenate([np.cos(phase), np.sin(phase)]) * np.sinc(near * seconds)[[0, 1, 0, 1], None, None]
    return np.asarray(wave[:, 0].T * (size / np.sqrt(2)), dtype=float)


@lru_cache(maxsize=8)
def _white(white: float, quantisation: float, seconds: float, *, accel: bool) -> Array:
    """Covariance of the noise without memory."""
    errors = TriadErrors(white=white, quantisation=quantisation)
    return _blocked(NoiseLaw(errors), seconds, accel=accel)


def _drifting(gyro: TriadErrors, seconds: float, factor: float) -> TriadErrors:
    """The in-run drift alone; of a profile without any, in units of its bias where it is looked for."""
    flicker = gyro.flicker
    if gyro.flicker == 0 and gyro.random_walk == 0 and factor > 1:
        flicker = max(0.1 * gyro.turn_on_bias, 0.02 * gyro.white / np.sqrt(seconds))
    return replace(gyro, white=0.0, quantisation=0.0, turn_on_bias=0.0, flicker=flicker)


@lru_cache(maxsize=4)
def _drifts(gyro: TriadErrors, seconds: float, *, accel: bool) -> Array:
    """Covariances of the in-run drift at every scale, (drifts, d, d)."""
    each = [factor**2 * _blocked(NoiseLaw(_drifting(gyro, seconds, factor)), seconds, accel=accel) for factor in DRIFTS]
    return np.array(each)


def _blocked(noise: NoiseLaw, seconds: float, *, accel: bool) -> Array:
    """Covariance of block means of the rate, then of its integral."""
    fine, both = np.arange(FINE * COUNT + 1), block_operators(seconds, accel=accel)
    return both @ noise.mean_covariance(fine[:-1], fine[1:], rate_hz=FINE / seconds) @ both.T


@lru_cache(maxsize=4)
def block_operators(seconds: float, *, accel: bool) -> Array:
    """From means over `FINE` parts of each block to block means of the rate, then of its integral."""
    mean: Array = np.asarray(np.kron(np.eye(COUNT), np.full(FINE, 1 / FINE)), dtype=float)
    if not accel:
        return mean
    integral = (np.tri(FINE * COUNT) - 0.5 * np.eye(FINE * COUNT)) * seconds / FINE
    return np.concatenate([mean, np.asarray(mean @ integral, dtype=float)])


@lru_cache(maxsize=16)
def _motion(seconds: float, time: float) -> Array:
    """Covariance of block means of the rate of a tilt of unit variance and correlation time `time`, s.

    The tilt is an Ornstein-Uhlenbeck process; the rate of a block is the difference of its ends over its length.
    """
    at = np.arange(COUNT + 1) * seconds
    tilt = np.exp(-np.abs(at[:, None] - at) / time)
    return np.diff(np.diff(tilt, axis=0), axis=1) / seconds**2


@lru_cache(maxsize=4)
def _creep(seconds: float) -> Array:
    """Covariance of block means of the rate of an angle that settles to unit variance at the end, in any time."""
    edges: Array = np.asarray(np.arange(COUNT + 1) / COUNT, dtype=float)
    tau = np.geomspace(*CREEP_TIMES, 16)[:, None]
    rate = np.diff(np.expm1(-edges / tau) / np.expm1(-1 / tau), axis=1) / seconds
    covariance = rate.T @ rate / len(tau)
    # Of full rank, for a profile without white noise.
    return covariance + 1e-12 * np.trace(covariance) * np.eye(COUNT)


def _walk_modes() -> Array:
    """Karhunen-Loeve modes of a random walk of unit variance at the end, (COUNT, WALK_MODES), as `tones.evidence`."""
    wave = np.pi * (np.arange(WALK_MODES) + 0.5)
    time = (np.arange(COUNT) + 0.5) / COUNT
    return np.sqrt(2) * np.sin(wave * time[:, None]) / wave


@lru_cache(maxsize=8)
def _shapes(seconds: float, scale: float, *, accel: bool) -> Shapes:
    duration = seconds * COUNT
    edges = np.asarray(np.arange(COUNT + 1) * seconds, dtype=float)
    gyro: list[Array] = []
    trace: list[Array] = []
    column, size, tilts, prior, kind = [-1], [0.0], [False], [0.0], ["none"]
    some = TILT if accel else TILT_UNSEEN

    def add(angle: Callable[[Array], Array], *, motion: bool) -> int:
        fine = (edges[:-1, None] + (np.arange(FINE) + 0.5) * seconds / FINE).ravel()
        gyro.append(np.diff(angle(edges)) / seconds)
        trace.append(np.zeros(COUNT) if motion else angle(fine).reshape(COUNT, FINE).mean(axis=1))
        return len(gyro) - 1

    for time in TILT_TIMES:
        tau = min(time, 1e4) * duration
        number = add(lambda t, tau=tau: -tau * np.expm1(-t / tau), motion=True)
        for amount, share in zip(TILTS, TILT_PRIOR, strict=True):
            column.append(number)
            size.append(amount)
            tilts.append(True)
            prior.append(np.log(some / len(TILT_TIMES) * share))
            kind.append("tilt")
    for tau in SETTLING_TIMES:
        number = add(lambda t, tau=tau: -tau * np.expm1(-t / tau), motion=False)
        for factor, share in zip(SETTLING_SIZES, SETTLING_SIZE_PRIOR, strict=True):
            column.append(number)
            size.append(factor * scale)
            tilts.append(False)
            prior.append(np.log(SETTLING * settling_share(tau) * share))
            kind.append("settling")
    for factor in WALK_SIZES:
        column.append(-1)
        size.append(factor)
        tilts.append(False)
        prior.append(np.log(WALK / len(WALK_SIZES)))
        kind.append("walk")
    prior[0] = np.log(1 - some - SETTLING - WALK)
    return Shapes(
        np.array(gyro).T,
        np.array(trace).T,
        np.array(column),
        np.array(size),
        np.array(tilts),
        np.array(prior),
        np.array(kind),
    )


def settling_share(tau: float) -> float:
    """Prior of a time constant: most are of up to two minutes, the rest of up to an hour."""
    fast = sum(one <= FAST for one in SETTLING_TIMES)
    return FAST_SHARE / fast if tau <= FAST else (1 - FAST_SHARE) / (len(SETTLING_TIMES) - fast)


def unit_bias(sensor: Sensor) -> float:
    """Scale by which the turn-on bias is tried: the profile's, or where it has none a floor, rad/s."""
    return max(sensor.gyro.turn_on_bias, 1e-4 * DEG_PER_HOUR)
