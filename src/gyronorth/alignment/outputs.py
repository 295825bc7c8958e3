"""What the outputs themselves show: an axis that hangs or is dead, an accelerometer that does not show gravity.

No sigma knows of these: a mean over an axis that hung is as smooth as any other.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gyronorth.alignment.gates import FEWEST_SAMPLES, SHORTEST, Gate, Shown
from gyronorth.angles import DEG_PER_HOUR
from gyronorth.arrays import Array, Mask, mean_of_rows
from gyronorth.conditioning import BLOCK_SAMPLES
from gyronorth.earth import STANDARD_GRAVITY

if TYPE_CHECKING:
    from gyronorth.alignment.problem import Problem

#: Log of the odds against a run of equal samples by chance, from which an axis is said to hang.
HUNG = 14.0
#: Share of samples that differ from the one before in an output that is not coarse.
FINE = 0.99
#: Times `HUNG` for a coarse output, whose mean drifts from step to step; rows of a long stream are means of it.
HUNG_IF_COARSE = 10.0
#: Step of an output, rad/s and m/s^2, whose rounding no heading would show; an axis may then rest on one value.
HARMLESS_STEP = {"gyro": 1.0 * DEG_PER_HOUR, "accelerometer": 1e-3 * STANDARD_GRAVITY}
#: An axis whose noise is this share of the other two's is dead but for its dither.
DEAD_SHARE = 0.01
#: Rate of a dead axis with dither, rad/s: an axis that senses nothing shows nothing.
DEAD_RATE = 0.5 * DEG_PER_HOUR
#: Share by which the mean specific force may differ from standard gravity: local gravity by 0.003, biases, scale.
GRAVITY_SHARE = 0.1
#: Samples that are looked at at once, in all recordings of a batch.
_PIECE = 1 << 18


def output_gates(problem: Problem) -> list[Gate]:
    """Gates on every axis of the gyro and of the accelerometer, and on gravity."""
    noiseless = problem.sensor is not None and problem.sensor.gyro.white == 0  # simulated
    gates = [] if noiseless else axis_gates(problem.gyro_b, rate_hz=problem.rate_hz, what="gyro")
    if problem.accel_b is None:
        return gates
    if problem.sensor is None or problem.sensor.accel.white > 0:
        gates += axis_gates(problem.accel_b, rate_hz=problem.rate_hz, what="accelerometer")
    return [*gates, gravity_gate(problem.accel_b)]


def gravity_gate(accel_b: Array) -> Gate:
    """A mean specific force that is not about 1 g: no attitude can be read from it."""
    size = np.linalg.norm(mean_of_rows(accel_b), axis=-1) / STANDARD_GRAVITY
    off = np.abs(size - 1)
    return Gate(
        "gravity",
        "The mean specific force differs from 1 g by {value:.2f} g; at most {limit:.1f} g is gravity. Likely "
        "another unit than m/s^2, or acceleration without gravity: give specific force in m/s^2, or leave the "
        "accelerometer out.",
        off,
        np.full_like(off, GRAVITY_SHARE),
        ~(off <= GRAVITY_SHARE),
        Shown("mean specific force against 1 g", "g", "of the norm of its mean; limit 0.1"),
    )


def axis_gates(x: Array, *, rate_hz: float, what: str) -> list[Gate]:
    """A gate for each axis: whether it hangs for a while, or is dead.

    Parameters
    ----------
    x : ndarray, shape (..., n, 3)
        Outputs, SI.
    rate_hz : float
        Sample rate, Hz.
    what : str
        A key of `HARMLESS_STEP`.

    Notes
    -----
    An axis whose sample differs from the one before with probability r stays the same for L samples with probability
    exp(-r L), at any of n places. It hangs where n exp(-r L) < exp(-`HUNG`), and for 2 s at least. A coarse output
    stays longer where its mean is between two steps: ten times as much is
    asked. It is dead where it never changes, beside axes that do (a coarse one with harmless steps may rest), or where
    its noise, by fourth differences that smooth motion does not reach, is a hundredth of both others' and its mean
    shows nothing.
    """
    count = x.shape[-2]
    longest, changes = _holds(x)
    often = changes / np.maximum(count - longest, 1)
    least = max(FEWEST_SAMPLES, SHORTEST * rate_hz)
    needed = (HUNG + np.log(count)) * np.where(often > FINE, 1.0, HUNG_IF_COARSE)
    hung = (longest >= least) & (often * longest > needed)
    limit = np.full(longest.shape, SHORTEST)
    still = changes == 0
    all_still = still.all(axis=-1, keepdims=True)
    dead = still & ~all_still & (longest >= least)
    if dead.any():
        dead &= ~((often.max(axis=-1, keepdims=True) <= 0.5) & (_step(x) <= HARMLESS_STEP[what])[..., None])
    if what == "gyro":
        dead |= _only_dither(x) & ~still
        hung |= all_still & still & (longest >= least)
    seconds = np.where(dead & ~still, count, longest) / rate_hz
    return [
        Gate(
            "hung_axis",
            f"The {name} axis of the {what} does not change, or hardly, for {{value:.1f}} s while it should; more than "
            "{limit:.0f} s is no chance. Likely the axis is dead, or it or its link hung. Leave that stretch out with "
            "--window, or repair the unit.",
            seconds[..., axis],
            limit[..., axis],
            np.asarray((hung | dead)[..., axis]),
        )
        for axis, name in enumerate("xyz")
    ]


def longest_hold(x: Array) -> tuple[int, int]:
    """First sample and length of the longest run of equal rows in `x`, shape (n, k), n at least 1."""
    repeats = np.zeros(len(x) + 1, dtype=bool)  # whether a row is as the one before
    for start in range(1, len(x), _PIECE):
        end = min(start + _PIECE, len(x))
        equal = x[start:end, 0] == x[start - 1 : end - 1, 0]
        if equal.any():
            equal = (x[start:end] == x[start - 1 : end - 1]).all(axis=1)
        repeats[start:end] = equal
    change = np.flatnonzero(repeats[1:] != repeats[:-1])
    if len(change) == 0:
        return 0, 1
    first, last = change[0::2], change[1::2]
    longest = int(np.argmax(last - first))
    return int(first[longest]), int(last[longest] - first[longest]) + 1


def _holds(x: Array) -> tuple[Array, Array]:
    """Longest run of equal samples and number of changes, of each axis, shape (..., 3)."""
    lead, count = x.shape[:-2], x.shape[-2]
    flat = x.reshape(-1, count, 3)
    longest, repeats = np.ones((len(flat), 3)), np.zeros((len(flat), 3))
    size = max(1, _PIECE // max(count, 1))
    for first in range(0, len(flat), size):
        part = flat[first : first + size]
        equal = part[:, 1:] == part[:, :-1]
        if not equal.any():
            continue
        equal = np.ascontiguousarray(np.swapaxes(equal, -1, -2))
        repeats[first : first + size] = np.count_nonzero(equal, axis=-1)
        for run, axis in np.argwhere(repeats[first : first + size]).tolist():
            edges = np.flatnonzero(np.diff(equal[run, axis], prepend=False, append=False))
            longest[first + run, axis] = (edges[1::2] - edges[::2]).max() + 1
    return longest.reshape(*lead, 3), (max(count - 1, 0) - repeats).reshape(*lead, 3)


def _step(x: Array) -> Array:
    """Smallest change of any axis, shape (...); 0 where nothing changes."""
    change = np.abs(np.diff(x, axis=-2))
    least = np.where(change > 0, change, np.inf).min(axis=(-2, -1), initial=np.inf)
    return np.where(np.isfinite(least), least, 0.0)


def _only_dither(x: Array) -> Mask:
    """Axes that show nothing but a noise far below that of both others."""
    count = x.shape[-2]
    silent = np.abs(mean_of_rows(x)) < DEAD_RATE
    if count < FEWEST_SAMPLES or not silent.any():
        return np.zeros((*x.shape[:-2], 3), dtype=bool)
    noise = np.zeros((*x.shape[:-2], 3))
    size = max(1, BLOCK_SAMPLES * count // max(x.size // 3, 1))
    for start in range(0, count - 4, size):
        noise += np.einsum("...tk->...k", np.abs(np.diff(x[..., start : start + size + 4, :], n=4, axis=-2)))
    others = np.stack([np.minimum(noise[..., (k + 1) % 3], noise[..., (k + 2) % 3]) for k in range(3)], axis=-1)
    return (noise < DEAD_SHARE * others) & silent
