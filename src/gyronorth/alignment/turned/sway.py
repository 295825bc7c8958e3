"""Poses that sway or tilt: carried by the gyro, levelled by the accelerometer.

Sway is motion whose angle stays bounded. In the mean rate of a block it is noise of the angle at both ends over the
length (`TurnedBlocks.sway_covariance`). With an accelerometer a swaying stretch tells more: the gyro carries the
attitude through it, as through a turn, and what gravity disagrees with is the gyro's error and the Earth's rotation.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gyronorth.alignment.turned.segments import TurnedBlocks, rotations
from gyronorth.arrays import Array
from gyronorth.conditioning import GATE_SIGMA, block_means
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.sensor import Sensor, TriadErrors
from gyronorth.sensor.law import NoiseLaw

#: Sway is looked for in means over this time, s, or of one sample.
STEP = 0.1
#: White noise is read at the sample interval and at these lags, s, of at least so many means each.
LAGS, FEWEST = (0.1, 0.4), 40


def with_sway(blocks: TurnedBlocks, gyro_b: Array, accel_b: Array | None, sensor: Sensor) -> TurnedBlocks:
    """The blocks with the sway of each stretch, where more than the sensor's noise is seen."""
    sway, surge = blocks.sway.copy(), blocks.surge.copy()
    turn_b, mean_b = blocks.turn_b.copy(), blocks.mean_b.copy()
    for number in range(int(blocks.stretch.max(initial=-1)) + 1):
        where = np.flatnonzero(blocks.stretch == number)
        first, last = int(blocks.first[where[0]]), int(blocks.last[where[-1]])
        angle = _bounded(gyro_b[first:last], sensor.gyro, blocks.rate_hz)
        if accel_b is not None:
            surge[where] = _bounded(accel_b[first:last], sensor.accel, blocks.rate_hz)
            angle = float(
                np.hypot(angle, _tilted(accel_b[first:last], sensor.accel, float(surge[where[0]]), blocks.rate_hz))
            )
        sway[where] = angle
        if angle > 0:
            edges = np.append(blocks.first[where], last) - first
            turn_b[where], mean_b[where] = rotations(gyro_b[first:last], edges, rate_hz=blocks.rate_hz)
    return replace(blocks, sway=sway, surge=surge, turn_b=turn_b, mean_b=mean_b)


def _bounded(rate: Array, errors: TriadErrors, rate_hz: float) -> float:
    """Root mean square of the integral of one axis about its trend, beyond what the noise makes; 0 within its limit."""
    size = max(1, round(STEP * rate_hz))
    mean = block_means(rate, size)
    duration = len(mean) * size / rate_hz
    integral = np.cumsum(mean - mean.mean(axis=0), axis=0) * size / rate_hz
    time = np.linspace(-1, 1, len(integral))
    integral = integral - integral.mean(axis=0)
    integral = integral - np.outer(time, time @ integral / (time @ time))
    # A unit noisier than its profile does not sway: its noise shows at the shortest lags.
    errors = replace(errors, white=max(errors.white, _shortest_noise(rate, rate_hz)))
    expected, limit = NoiseLaw(errors).detrended_angle_variance(duration)
    quantised = errors.quantisation**2 / 12
    seen = _mean_square(np.asarray(integral, dtype=float))
    return float(np.sqrt(seen - expected - quantised)) if seen > limit + 2 * quantised else 0.0


def _shortest_noise(rate: Array, rate_hz: float) -> float:
    """White noise density from fourth differences, which smooth motion hardly enters: the least of several lags."""
    if len(rate) < 8:
        return 0.0
    sizes = sorted({max(1, round(lag * rate_hz)) for lag in (0.0, *LAGS)})
    usable = [block_means(rate, size) for size in sizes if len(rate) // size >= FEWEST] or [rate]
    binomials = 70.0  # sum of the squares of 1, 4, 6, 4, 1
    squares = [_mean_square(np.diff(mean, 4, axis=0)) for mean in usable]
    sums = [square / binomials / len(mean) for square, mean in zip(squares, usable, strict=True)]
    return float(np.sqrt(min(sums) * len(rate) / rate_hz))


def _mean_square(x: Array) -> float:
    return float(np.mean(x**2))


def _tilted(accel_b: Array, errors: TriadErrors, surge: float, rate_hz: float) -> float:
    """Root mean square of the angle at both ends of a steady tilt, rad; 0 within the accelerometer's noise."""
    duration = len(accel_b) / rate_hz
    mean = block_means(accel_b, max(1, round(rate_hz)))
    if len(mean) < 3:
        return 0.0
    time = (np.arange(len(mean)) - (len(mean) - 1) / 2) * round(rate_hz) / rate_hz
    down = mean.mean(axis=0) / np.linalg.norm(mean.mean(axis=0))
    slope = time @ (mean - np.outer(mean @ down, down)) / (time @ time)
    made = NoiseLaw(errors).mean_variance(duration, weighting="ramp")
    noise = float(made["noise"] + made["drift"]) + 72 * surge**2 / duration**4
    square = float(slope @ slope) / 2  # of one of two axes
    if square <= GATE_SIGMA**2 * noise:
        return 0.0
    return float(np.sqrt(square / 12) * duration / STANDARD_GRAVITY)
