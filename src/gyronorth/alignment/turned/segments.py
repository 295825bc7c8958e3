"""Still poses and the turns between them, found in a recording, and cut into blocks.

A *stretch* is a piece without motion; a *turn* is what lies between two stretches, its edges
included; two stretches belong to one *pose* if the unit turned by less than `SAME_POSE`
between them (it was only knocked). A *spin* is a turn so long and so steady about one axis
that the rates across that axis tell of the Earth while it lasts (carouseling).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gyronorth.alignment.turned.driving import standing
from gyronorth.angles import DEG_PER_HOUR
from gyronorth.arrays import Array, Mask, median, robust_noise
from gyronorth.attitude import attitude_path, conjugate, multiply, rotate
from gyronorth.conditioning import block_means
from gyronorth.earth import EARTH_RATE
from gyronorth.sensor import TriadErrors

DEG = np.pi / 180
#: Motion is looked for in means over this time, s.
CHUNK = 0.2
#: A chunk moves if its rate is off the still rate by so many robust sigmas on an axis ...
MOTION_SIGMAS = 7.0
#: ... and by this rate at least, rad/s: Earth rate and bias seen from another pose are no motion.
MOTION_FLOOR = 60 * DEG_PER_HOUR
#: A still unit reads less than this, rad/s, if its sensor is unknown: bias, mostly.
STILL_LIMIT = 0.2 * DEG
#: Left out on both sides of a motion, s: slow beginnings of a turn, settling after it.
EDGE = 0.4
#: Shorter stretches belong to the turn, s.
SHORTEST_STRETCH = 3.0
#: Two stretches that differ by less are one pose, rad.
SAME_POSE = 2 * DEG
#: A turn shorter than this tells nothing by itself, s.
SHORTEST_SPIN = 20.0
#: Rate across the axis of a spin over the rate about it, at most (root mean square).
SPIN_WOBBLE = 0.03
#: Largest rotation within a block of a turn, rad.
BLOCK_ANGLE = 30 * DEG
#: Most blocks of one turn.
MOST_BLOCKS = 400


@dataclass(frozen=True)
class TurnedBlocks:
    """Consecutive pieces of a recording, from its first stretch or spin to its last; n of them."""

    first: NDArray[np.int64]  # (n,) first sample
    last: NDArray[np.int64]  # (n,) behind the last sample
    stretch: NDArray[np.int64]  # (n,) number of the stretch, -1 in a turn
    spin: NDArray[np.int64]  # (n,) number of the spin, -1 elsewhere
    gyro_b: Array  # (n, 3) mean rate, rad/s
    accel_b: Array | None  # (n, 3) mean specific force, m/s^2
    turn_b: Array  # (n, 3, 3) integrated rotation over the block; the identity when still
    mean_b: Array  # (n, 3, 3) mean over the block of the rotation since its start
    rate_hz: float
    sway: Array  # (n,) root mean square angle of one axis that the unit sways by in its stretch, rad; 0: none is seen
    surge: Array  # (n,) likewise the velocity that sways, m/s
    measured: bool = True  # whether the gyro was recorded through the turns

    @property
    def seconds(self) -> Array:
        """Length of each block, s."""
        return (self.last - self.first) / self.rate_hz

    @property
    def still(self) -> NDArray[np.bool_]:
        """Whether each block belongs to a still stretch."""
        return self.stretch >= 0

    @property
    def traced(self) -> NDArray[np.bool_]:
        """Whether the gyro carries the attitude through each block: turns, and stretches that sway."""
        return ~self.still | (self.sway > 0)

    @property
    def scattered(self) -> Array:
        """Covariance (n, n) of a bias that steps from pose to pose, of unit scale.

        It steps in the middle of a turn, whose own mean differs once more as much: when it steps is not known.
        """
        part = np.cumsum(np.concatenate([[0], np.diff(self.stretch) != 0]))
        pose = part.copy()
        for turn in np.unique(part[~self.still]):
            members = np.flatnonzero(part == turn)
            pose[members[: len(members) // 2]] -= 1
            pose[members[len(members) // 2 :]] += 1
        own = (part[:, None] == part) & ~np.outer(self.still, self.still)
        return (pose[:, None] == pose).astype(float) + own

    def sway_covariance(self, bounded: Array) -> Array:
        """Covariance of mean rates of the still blocks, (k, k), whose integral is bounded: `bounded` rms, (n,).

        A mean over L s is the difference of the integral at its two ends over L; neighbours share an end.
        """
        size, first, last = bounded[self.still], self.first[self.still], self.last[self.still]
        stretch, length = self.stretch[self.still], self.seconds[self.still]
        joined = (last[:, None] == first) & (stretch[:, None] == stretch)
        return np.outer(size, size) * (2 * np.eye(len(size)) - joined - joined.T) / np.outer(length, length)


@dataclass(frozen=True)
class SegmentTurn:
    """A rotation between two stretches (before the first and after the last: not a turn)."""

    start: float  # s
    end: float  # s
    angle: float  # rad about its main axis, with full revolutions; positive clockwise from above
    spin: bool


@dataclass(frozen=True)
class Segments:
    """Where a recording stands still and where it turns."""

    stretches: tuple[tuple[int, int], ...]  # samples [first, last) of each still stretch, edges trimmed
    pose: tuple[int, ...]  # number of the pose of each stretch
    turns: tuple[SegmentTurn, ...]  # between the stretches; at the ends only spins
    measured: bool = True  # whether the gyro was recorded through the turns

    @property
    def poses(self) -> int:
        """Number of distinct poses; a spin counts as one more."""
        return (self.pose[-1] + 1 if self.pose else 0) + sum(turn.spin for turn in self.turns)


def find_segments(
    gyro_b: Array, accel_b: Array | None = None, *, rate_hz: float, turn_on_bias: float | None = None
) -> Segments:
    """Still stretches, poses and turns of a recording.

    Parameters
    ----------
    gyro_b : ndarray, shape (n, 3)
        Angular rate, rad/s.
    accel_b : ndarray, shape (n, 3), optional
        Specific force, m/s^2, which shows whether a vehicle drives straight on.
    rate_hz : float
        Sample rate, Hz.
    turn_on_bias : float, optional
        Its standard deviation, rad/s, if known: what reads more than Earth rate and five of
        these all the time is a rotation. Without it `STILL_LIMIT`.
    """
    limit = STILL_LIMIT if turn_on_bias is None else max(5 * turn_on_bias + 2 * EARTH_RATE, MOTION_FLOOR)
    size = max(1, round(CHUNK * rate_hz))
    count = len(gyro_b) // size
    if count < 3:
        return Segments((), (), ())
    chunk = block_means(gyro_b, size)
    scatter = robust_noise(chunk, axis=0)
    slow = chunk[(np.abs(chunk) < limit + MOTION_SIGMAS * scatter).all(axis=1)]
    if len(slow) * size < SHORTEST_STRETCH * rate_hz:
        moving: Mask = np.ones(count, dtype=bool)
    else:
        centre = median(slow, axis=0)
        sigma = np.maximum(scatter, 1.4826 * median(np.abs(slow - centre), axis=0))
        off = np.abs(chunk - centre) > np.maximum(MOTION_SIGMAS * sigma, MOTION_FLOOR)
        moving = np.asarray(off.any(axis=1), dtype=bool)
    moving = _widened(moving, max(1, round(EDGE * rate_hz / size)))
    found = [(a * size, len(gyro_b) if b == count else b * size) for a, b in _runs(~moving)]
    if accel_b is not None and found:
        found = standing(accel_b, found, rate_hz=rate_hz)
    stretches = tuple((a, b) for a, b in found if b - a >= SHORTEST_STRETCH * rate_hz)
    return _with_turns(gyro_b, stretches, rate_hz)


def _with_turns(gyro_b: Array, stretches: tuple[tuple[int, int], ...], rate_hz: float) -> Segments:
    edges = [0, *(edge for stretch in stretches for edge in stretch), len(gyro_b)]
    turns: list[SegmentTurn] = []
    pose: list[int] = [0] if stretches else []
    for number, (first, last) in enumerate(zip(edges[::2], edges[1::2], strict=True)):
        inner = 0 < number < len(stretches)
        if first == last:
            continue
        part = gyro_b[first:last]
        axis = part.sum(axis=0) / max(np.linalg.norm(part.sum(axis=0)), 1e-300)
        axis = -axis if axis[2] < 0 else axis
        angle = float((part @ axis).sum() / rate_hz)
        spin = _is_spin(part, rate_hz)
        if inner or spin:
            turns.append(SegmentTurn(first / rate_hz, last / rate_hz, angle, spin))
        if inner:
            net = attitude_path(part, rate_hz=rate_hz)[1][-1]
            moved = 2 * np.arctan2(np.linalg.norm(net[:3]), abs(net[3])) > SAME_POSE or abs(angle) > np.pi
            pose.append(pose[-1] + int(moved))
    return Segments(stretches, tuple(pose), tuple(turns))


def _is_spin(part: Array, rate_hz: float) -> bool:
    """Long, of more than a quarter turn, and about one axis within twice the Earth rate and the noise.

    Driving is none: there the rates across the axis exceed `SPIN_WOBBLE` of the rate about it.
    """
    if len(part) < SHORTEST_SPIN * rate_hz:
        return False
    size = max(1, round(rate_hz))
    chunk = part[: len(part) // size * size].reshape(-1, size, 3).mean(axis=1)
    axis = np.asarray(np.linalg.svd(chunk, full_matrices=False)[2][0], dtype=float)
    angle = abs(float((part @ axis).sum())) / rate_hz
    across = np.asarray(chunk - np.outer(chunk @ axis, axis), dtype=float)
    noise = float(robust_noise(across))
    wobble = float(np.sqrt(np.mean(across**2)))
    return bool(
        angle > np.pi / 2
        and wobble < 2 * EARTH_RATE + 3 * noise
        and wobble < SPIN_WOBBLE * float(np.sqrt(np.mean(np.asarray(chunk @ axis, dtype=float) ** 2)))
    )


def cut(gyro_b: Array, accel_b: Array | None, segments: Segments, *, rate_hz: float, per_stretch: int) -> TurnedBlocks:
    """The recording cut into blocks: `per_stretch` of each stretch, turns by rotation angle."""
    spins = [(round(t.start * rate_hz), round(t.end * rate_hz)) for t in segments.turns if t.spin]
    parts = sorted(
        [(*s, number, -1) for number, s in enumerate(segments.stretches)]
        + [(*s, -1, number) for number, s in enumerate(spins)]
    )
    pieces: list[TurnedBlocks] = []
    for index, (first, last, stretch, spin) in enumerate(parts):
        if index and parts[index - 1][1] < first:
            pieces.append(_turning(gyro_b, parts[index - 1][1], first, rate_hz))
        if spin >= 0:
            piece = _turning(gyro_b, first, last, rate_hz)
            pieces.append(replace(piece, spin=np.full(len(piece.first), spin)))
        else:
            pieces.append(_standing(gyro_b, first, last, stretch, per_stretch, rate_hz))
    names = ("first", "last", "stretch", "spin", "gyro_b", "turn_b", "mean_b")
    joined = {name: np.concatenate([getattr(piece, name) for piece in pieces]) for name in names}
    accel = None if accel_b is None else _means(accel_b, joined["first"], joined["last"])
    none = np.zeros(len(joined["first"]))
    return TurnedBlocks(**joined, accel_b=accel, rate_hz=rate_hz, sway=none, surge=none, measured=segments.measured)


def blocks_per_stretch(stretches: int, errors: TriadErrors | None) -> int:
    """How finely stretches are cut: 24 blocks in all give drift its weights, 8 show that there is none."""
    drifts = errors is None or errors.flicker > 0 or errors.random_walk > 0
    return max(2, (24 if drifts else 8) // max(1, stretches))


def _standing(gyro_b: Array, first: int, last: int, stretch: int, parts: int, rate_hz: float) -> TurnedBlocks:
    edges = np.linspace(first, last, min(parts, last - first) + 1).round().astype(np.int64)
    n = len(edges) - 1
    still = np.tile(np.eye(3), (n, 1, 1))
    mean = _means(gyro_b, edges[:-1], edges[1:])
    none = np.zeros(n)
    return TurnedBlocks(
        edges[:-1], edges[1:], np.full(n, stretch), np.full(n, -1), mean, None, still, still, rate_hz, none, none
    )


def _turning(gyro_b: Array, first: int, last: int, rate_hz: float) -> TurnedBlocks:
    part = gyro_b[first:last]
    swept = np.linalg.norm(part, axis=1).sum() / rate_hz
    count = max(1, min(int(np.ceil(swept / BLOCK_ANGLE)), len(part), MOST_BLOCKS))
    edges = np.linspace(0, len(part), count + 1).round().astype(np.int64)
    turn_b, mean_b = rotations(part, edges, rate_hz=rate_hz)
    none, nothing = np.full(count, -1), np.zeros(count)
    mean = _means(part, edges[:-1], edges[1:])
    first_b, last_b = first + edges[:-1], first + edges[1:]
    return TurnedBlocks(first_b, last_b, none, none, mean, None, turn_b, mean_b, rate_hz, nothing, nothing)


def rotations(gyro_b: Array, edges: NDArray[np.int64], *, rate_hz: float) -> tuple[Array, Array]:
    """Integrated rotation over each block between edges (k + 1,), and its mean since the start, (k, 3, 3) each."""
    middle, end = attitude_path(gyro_b, rate_hz=rate_hz)
    before = np.concatenate([[[0.0, 0.0, 0.0, 1.0]], end])[edges]  # (k + 1, 4) at the edges
    mean = np.add.reduceat(_matrix(middle), edges[:-1], axis=0) / np.diff(edges)[:, None, None]
    turn_b = _matrix(multiply(conjugate(before[:-1]), before[1:]))
    return turn_b, np.swapaxes(_matrix(before[:-1]), -1, -2) @ mean


def _matrix(q: Array) -> Array:
    """Rotation matrices (..., 3, 3) of quaternions."""
    return np.stack([rotate(q, axis) for axis in np.eye(3)], axis=-1)


def _means(values: Array, first: NDArray[np.int64], last: NDArray[np.int64]) -> Array:
    return np.stack([values[a:b].mean(axis=0) for a, b in zip(first, last, strict=True)])


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _widened(flags: NDArray[np.bool_], by: int) -> NDArray[np.bool_]:
    return np.convolve(flags, np.ones(2 * by + 1), mode="same") > 0.5 if len(flags) > 2 * by else flags
