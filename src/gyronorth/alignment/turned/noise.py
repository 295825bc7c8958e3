"""The noise of a multi-position recording, where the sensor's profile is unknown or states none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gyronorth.alignment.turned.segments import TurnedBlocks
from gyronorth.arrays import Array
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.sensor import Sensor, TriadErrors

#: Of a sensor without a profile: relative scale factor and misalignment (MEMS data sheets).
UNKNOWN_SCALE, UNKNOWN_MISALIGNMENT, UNKNOWN_ACCEL_BIAS = 3e-3, 1e-3, 5e-3 * STANDARD_GRAVITY
#: In-run bias tried for a sensor without a profile, as B sqrt(duration of a pose) / N.
UNKNOWN_FLICKER = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
#: Least noise densities that are inferred, of rate, rad/s sqrt(s), and force, m/s^2 sqrt(s): below the best sensors'.
QUIETEST, QUIETEST_FORCE = 3e-8, 1e-5


def candidates(blocks: TurnedBlocks, fine: TurnedBlocks) -> list[Sensor]:
    """Sensors that might have made the recording: its own white noise, several in-run drifts."""
    white = _white(_scatter(blocks, blocks.gyro_b), _scatter(fine, fine.gyro_b))
    longest = max([blocks.seconds[blocks.stretch == s].sum() for s in range(blocks.stretch.max() + 1)], default=100.0)
    accel = TriadErrors(turn_on_bias=UNKNOWN_ACCEL_BIAS, misalignment=UNKNOWN_MISALIGNMENT)
    if blocks.accel_b is not None:
        accel = replace(accel, white=max(_scatter(blocks, blocks.accel_b)[0], QUIETEST_FORCE))
    gyro = TriadErrors(white=white, scale_factor=UNKNOWN_SCALE, misalignment=UNKNOWN_MISALIGNMENT)
    return [
        Sensor("inferred", replace(gyro, flicker=ratio * white / np.sqrt(longest)), accel) for ratio in UNKNOWN_FLICKER
    ]


def with_noise(sensor: Sensor, blocks: TurnedBlocks, fine: TurnedBlocks) -> Sensor:
    """A profile that states no white noise takes that of the recording: nothing measures without any."""
    gyro, accel = sensor.gyro, sensor.accel
    if gyro.white == 0:
        gyro = replace(gyro, white=_white(_scatter(blocks, blocks.gyro_b), _scatter(fine, fine.gyro_b)))
    if accel.white == 0 and blocks.accel_b is not None:
        accel = replace(accel, white=max(_scatter(blocks, blocks.accel_b)[0], QUIETEST_FORCE))
    return replace(sensor, gyro=gyro, accel=accel)


def _scatter(blocks: TurnedBlocks, values: Array) -> tuple[float, float]:
    """Noise density from differences of neighbouring blocks of a stretch, and the usual length of these, s.

    Of blocks of unequal length with turns between: `conditioning.noise_density` takes one record without a break.
    """
    inside = blocks.still[1:] & (blocks.stretch[1:] == blocks.stretch[:-1])
    inverse = (1 / blocks.seconds[1:] + 1 / blocks.seconds[:-1])[inside]
    if not inside.any():
        return QUIETEST, 1.0
    difference = np.diff(values, axis=0)[inside] / np.sqrt(inverse)[:, None]
    return max(float(np.sqrt(np.mean(difference**2))), QUIETEST), float(2 / inverse.mean())


def _white(coarse: tuple[float, float], fine: tuple[float, float]) -> float:
    """White noise density from the scatter of blocks of two lengths.

    Differences of means over t have the variance 2 N^2 / t + 2 F: in-run bias adds an F that hardly depends on t (its
    Allan deviation is flat) and drops out between the two. Where short blocks scatter too little, their noise is
    not white, and half of the long ones' density is the least.
    """
    (long_density, long), (short_density, short) = coarse, fine
    if long <= 1.5 * short:
        return long_density
    square = (short_density**2 / short - long_density**2 / long) / (1 / short - 1 / long)
    return float(np.sqrt(np.clip(square, long_density**2 / 4, long_density**2)))
