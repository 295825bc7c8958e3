"""What a recording shows of motion and noise: sway, change of tilt, slow change of the rate."""

from __future__ import annotations

import numpy as np

from gyronorth.arrays import Array, Mask
from gyronorth.conditioning import GATE_SIGMA, Sway, noise_density, sway
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.frozen import frozen
from gyronorth.sensor import Sensor, TriadErrors
from gyronorth.sensor.law import NoiseLaw
from gyronorth.uncertainty import rate_variance

#: Least standard deviation of a mean rate, rad/s (2e-7 deg/h): keeps a record without noise finite.
RATE_FLOOR = 1e-12


@frozen
class MotionStatistics:
    """What a batch shows of motion and noise, arrays over recordings."""

    sway: Sway
    white: Array  # variance of the mean rate per axis from white noise, by the record itself, (rad/s)^2
    white_is_noise: Mask  # False where sway may stand behind it
    variance: Array  # added to a horizontal component of the mean rate, (rad/s)^2
    yaw_variance: Array  # added to the vertical component, (rad/s)^2
    detected: Mask
    angle: Array  # rms of the integrated horizontal rate about its trend, rad
    angle_limit: Array  # what noise and drift alone stay below, rad
    tilt: Array  # net tilt change by the accelerometer, rms per axis, rad; 0 without one
    tilt_limit: Array  # what its noise and drift alone stay below, rad


def motion_statistics(
    gyro_b: Array, accel_b: Array | None, *, rate_hz: float, mat_lb: Array, sensor: Sensor | None
) -> MotionStatistics:
    """Sway and noise of a batch, compared with the profile or the recording's own noise.

    Parameters
    ----------
    gyro_b, accel_b : ndarray, shape (..., n, 3)
        Angular rate, rad/s, and specific force, m/s^2.
    rate_hz : float
        Sample rate, Hz.
    mat_lb : ndarray, shape (..., 3, 3)
        Rotation to the frame levelled by the mean.
    sensor : Sensor, optional
        Profile of the unit.

    Notes
    -----
    The mean over T is wrong by the net tilt change over T: in variance 2 V / T^2 for an
    oscillation of variance V, plus the square of the change that the accelerometer's trend
    shows; of yaw nothing shows the trend, and 3 V / T^2 allows for it. With a profile the
    integrated rate is held against what its noise and drift deviate from a line
    (`NoiseLaw.detrended_angle_variance`), and the trend against the accelerometer's noise and drift; without
    one, against the recording's own.
    """
    duration = gyro_b.shape[-2] / rate_hz
    moved = sway(gyro_b, accel_b, mat_lb=mat_lb, rate_hz=rate_hz)
    noise = noise_density(gyro_b, rate_hz=rate_hz)
    if sensor is None:
        unit, unit_limit = NoiseLaw(TriadErrors(white=1.0)).detrended_angle_variance(duration)
        expected, limit = noise.density**2 * unit, noise.density**2 * unit_limit
        bent = noise.excess > noise.excess_limit
        own_change = moved.tilt_noise
    else:
        unit, unit_limit = NoiseLaw(sensor.gyro).detrended_angle_variance(duration)
        expected, limit = np.full_like(noise.density, unit), np.full_like(noise.density, unit_limit)
        bent = np.ones(limit.shape, dtype=bool)
        own_change = np.maximum(moved.tilt_noise, _trend_variance(sensor, duration))
    # Rounding of a record without noise is no sway.
    limit, own_change = limit + (RATE_FLOOR * duration) ** 2, own_change + (RATE_FLOOR * duration) ** 2
    bent = bent & (moved.gyro_variance > limit)
    white = noise.density**2 / duration
    if accel_b is None:
        detected, change, square = bent, np.zeros_like(limit), np.zeros_like(limit)
        oscillation = np.maximum(moved.gyro_variance - expected, 0)
        white_is_noise = ~detected | (noise.excess <= noise.excess_limit)
    else:
        square = moved.tilt_change**2 / 2
        detected = bent | (square > GATE_SIGMA**2 * own_change)
        change = np.maximum(square - own_change, 0)
        oscillation = np.maximum(moved.tilt_variance, 0)
        # Sway looks like noise of the gyro, but not in the difference of gyro and tilt.
        white = np.asarray(np.where(detected, np.minimum(white, moved.tilt_noise / duration**2), white), dtype=float)
        white_is_noise = np.ones_like(detected)
    return MotionStatistics(
        sway=moved,
        white=white,
        white_is_noise=white_is_noise,
        variance=np.where(detected, (2 * oscillation + change) / duration**2, 0.0),
        yaw_variance=np.where(detected, 3 * moved.yaw_variance / duration**2, 0.0),
        detected=detected,
        angle=np.sqrt(moved.gyro_variance),
        angle_limit=np.sqrt(limit),
        tilt=np.sqrt(square),
        tilt_limit=GATE_SIGMA * np.sqrt(own_change),
    )


def _trend_variance(sensor: Sensor, duration: float) -> float:
    """Variance per axis of the net tilt change that the accelerometer's own noise and drift fake, rad^2."""
    slope = rate_variance(sensor.accel, duration, weighting="ramp")
    return float((slope["noise"] + slope["drift"]) * (duration / STANDARD_GRAVITY) ** 2)
