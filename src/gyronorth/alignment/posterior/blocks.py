"""What the posterior looks at: means of the levelled rate and of the tilt over a few blocks.

Everything but tones and bumps is slow against a block, so that block means hold all of it (`COUNT` of them).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyronorth.alignment.rounding import rounding_of_tilt
from gyronorth.arrays import Array, Index, Mask, mean_of_rows, median
from gyronorth.attitude import level, mat_lb
from gyronorth.conditioning import block_means, decimate

#: Blocks of a recording.
COUNT = 24
#: Rate at which tones and bumps are looked for, Hz, and their most samples.
FINE_RATE, FINE_SAMPLES = 3.0, 900
#: Parts in which the yaw is looked at, and the share of its variance that one step explains where it was nudged.
YAW_BLOCKS, NUDGED = 48, 0.9
#: Samples beyond which second-order terms of the motion are worked out from means, and second differences from which
#: the noise is read.
FINE, DIFFERENCES = 80_000, 10_000
#: Mean specific force, m/s^2, below which a tilt is not told from it: the heading is refused (`gravity`).
LEAST_GRAVITY = 0.1


@dataclass(frozen=True)
class Blocks:
    """Block means of recordings, leading dimension (r,)."""

    rate_l: Array  # (r, COUNT, 3) angular rate in the level frame, rad/s, without second-order terms of the motion
    trace: Array | None  # (r, COUNT, 2) integrated rate less the tilt that the accelerometer sees, rad: free of motion
    seconds: float  # length of a block, s
    fine_l: Array  # (r, q COUNT, 3) the same over q parts of each block, at `FINE_RATE` or below
    white: Array  # (r,) noise density of the rate at short lags, rad/sqrt(s)
    roll: Array  # (r,) rad
    pitch: Array  # (r,) rad
    gravity: Array  # (r,) size of the mean specific force, m/s^2; NaN without accelerometer
    rounding: Array  # (r,) error of the tilt by rounding of the specific force, rad; infinite without accelerometer

    @property
    def duration(self) -> float:
        """Length, s."""
        return self.seconds * COUNT


def blocks_of(
    gyro_b: Array, accel_b: Array | None, *, rate_hz: float, attitude: tuple[float, float] | None = None
) -> Blocks:
    """Block means of recordings (r, n, 3), n at least `COUNT`.

    Parameters
    ----------
    gyro_b, accel_b : ndarray, shape (r, n, 3)
        Angular rate, rad/s, and specific force, m/s^2.
    rate_hz : float
        Sample rate, Hz.
    attitude : tuple of float, optional
        Known roll and pitch, rad.

    Notes
    -----
    A turn about the vertical is taken out first: in the level frame after the last lasting turn, carried there by the
    integrated vertical rate, the horizontal rate is Earth rate and the derivative of the tilt theta as the
    accelerometer sees it, to second order (the direction of gravity obeys u' = -w x u, and the product of yaw rate and
    tilt goes with the frame). What is left of second order is the Earth rate h in the tilted body, -theta x h; it is
    taken off where the tilt is seen.
    """
    r, n = gyro_b.shape[:2]
    if attitude is not None:
        roll, pitch = (np.full(r, angle) for angle in attitude)
    elif accel_b is None:
        roll = pitch = np.zeros(r)
    else:
        roll, pitch = level(mean_of_rows(accel_b))
    turn = np.swapaxes(mat_lb(roll, pitch), -1, -2)
    size = n // COUNT
    small = max(1, round(n / FINE)) if accel_b is not None else 1
    small = small if size // small >= 4 else 1
    rate, step = (block_means(gyro_b, small) if small > 1 else gyro_b) @ turn, small / rate_hz
    white = density_at_short_lags(rate, step=step)
    rate, turned = _without_turn(rate, step)
    trace, gravity, rounding = None, np.full(r, np.nan), np.full(r, np.inf)
    if accel_b is not None:
        force = (block_means(accel_b, small) if small > 1 else accel_b) @ turn
        gravity = np.linalg.norm(mean_of_rows(force), axis=-1)
        rounding = rounding_of_tilt(accel_b)
        down = np.maximum(gravity, LEAST_GRAVITY)[:, None, None]
        tilt = np.stack([-force[..., 1], force[..., 0]], axis=-1) / down
        tilt = _turned(tilt - mean_of_rows(tilt)[:, None], *turned)
        if attitude is None:
            rate = _linear(rate, tilt)
        angle = (np.cumsum(rate[..., :2], axis=1) - rate[..., :2] / 2) * step
        trace = block_means(angle - tilt, size // small)[:, :COUNT]
    whole = size // small
    means = block_means(rate, whole)[:, :COUNT]
    parts = max(1, min(int(whole * step * FINE_RATE), FINE_SAMPLES // COUNT, whole))
    covered = rate[:, : whole * COUNT]
    fine = decimate(covered, rate_hz=1 / step, to_hz=parts / (whole * step)) if parts < whole else covered
    return Blocks(means, trace, whole * step, fine, white, roll, pitch, gravity, rounding)


def _without_turn(rate: Array, step: float) -> tuple[Array, tuple[Array, Array]]:
    """Rates in the level frame that the unit ends in, and cosine and sine of the yaw (r, n) from there.

    A nudge is no change of the Earth rate. The yaw is the integral of the vertical rate off its median over blocks,
    which a turn within a block leaves alone; that median also stands for the vertical rate while it is nudged, since
    a step is no noise of the rate.
    """
    whole = max(rate.shape[1] // COUNT, 1)
    steady = median(block_means(rate[..., 2:], whole), axis=1)
    turn = (rate[..., 2] - steady) * step
    yaw = np.cumsum(turn, axis=1) - turn / 2  # in the middle of each sample
    size = max(rate.shape[1] // YAW_BLOCKS, 1)
    last, first = _last_yaw(block_means(yaw[..., None], size)[..., 0])
    yaw = yaw - last[:, None]
    sample: Index = np.asarray(np.arange(rate.shape[1]), dtype=int)
    start: Index = np.asarray(size * first[:, None], dtype=int)
    turned, out = (np.cos(yaw), np.sin(yaw)), rate.copy()
    out[..., :2] = _turned(rate[..., :2], *turned)
    nudged: Mask = np.asarray((sample >= start) & (sample < start + 2 * size), dtype=bool)
    np.copyto(out[..., 2], steady, where=nudged)
    return out, turned


def _last_yaw(yaw: Array) -> tuple[Array, Index]:
    """Yaw (r,) in which a unit ends whose yaw has the block means (r, k), rad: the mean, or that after a nudge.

    The nudge is in the block of the second array or the next one; in none where that is before the first.

    It was nudged where one step explains nearly all of its variance; sway has its mean at no particular time.
    """
    k = yaw.shape[1]
    count = np.arange(1, k, dtype=float)
    total: Array = np.cumsum(yaw, axis=1)
    before, after = total[:, :-1] / count, (total[:, -1:] - total[:, :-1]) / (k - count)
    whole: Array = np.asarray(yaw.mean(axis=1), dtype=float)
    gained: Array = count * (before - whole[:, None]) ** 2 + (k - count) * (after - whole[:, None]) ** 2
    best: Index = np.asarray(np.argmax(gained, axis=1))
    share: Array = gained.max(axis=1) / np.maximum(np.sum((yaw - whole[:, None]) ** 2, axis=1), np.finfo(float).tiny)
    # The block of the step itself is left out where another follows.
    first = np.minimum(best + 2, k - 1)
    settled: Array = (total[:, -1] - np.take_along_axis(total, first[:, None] - 1, axis=1)[:, 0]) / (k - first)
    nudged = share > NUDGED
    return np.asarray(np.where(nudged, settled, whole), dtype=float), np.where(nudged, best, -2)


def _turned(vector: Array, cosine: Array, sine: Array) -> Array:
    """Horizontal vectors (r, n, 2) of a frame turned clockwise by a yaw, seen before the turn."""
    x, y, out = vector[..., 0], vector[..., 1], np.empty_like(vector)
    out[..., 0] = x * cosine - y * sine
    out[..., 1] = y * cosine + x * sine
    return out


def _linear(rate: Array, tilt: Array) -> Array:
    """The rate without its products with the tilt (see `blocks_of`)."""
    mean = mean_of_rows(rate)[:, None]
    x, y = tilt[..., 0], tilt[..., 1]
    out = rate.copy()
    out[..., 0] += y * mean[..., 2]
    out[..., 1] -= x * mean[..., 2]
    out[..., 2] -= y * mean[..., 0] - x * mean[..., 1]
    return out


def density_at_short_lags(rate: Array, *, step: float, longest: float = 1.0) -> Array:
    """Noise density, rad/sqrt(s), shape (r,), the least over lags up to `longest` s: vibration raises the shortest.

    What short means scatter by, for the prior of the noise that `posterior` tries. That of one sample alone is
    `arrays.robust_noise`, that of the mean of the record `conditioning.noise_density`.
    """
    found: list[Array] = []
    size, means = 1, rate
    while size == 1 or (size * step <= longest and rate.shape[1] // size >= 60):
        some = slice(None, None, -(-means.shape[1] // DIFFERENCES))
        second = means[:, 2:][:, some] - 2 * means[:, 1:-1][:, some] + means[:, :-2][:, some]
        # Of three axes: a robust scale, since bumps and knocks stand out.
        middle = median(np.abs(second).reshape(len(second), -1), axis=1) / 0.6745 / np.sqrt(6)
        found.append(middle * np.sqrt(size * step))
        size, means = 2 * size, block_means(means, 2)
    return np.maximum(np.min(found, axis=0), 1e-15)
