"""One alignment of a batch with its uncertainty: the step between a method and a verdict.

A `Solution` holds arrays over recordings: what the method found, the variance of the
levelled rate by part, the heading's sigma and interval, and the gates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyronorth.alignment.closed_form import Levelled, align_mean
from gyronorth.alignment.inertial import align_inertial
from gyronorth.arrays import Array, Mask
from gyronorth.attitude import mat_lb
from gyronorth.conditioning import GATE_SIGMA, Sway, block_means, noise_density, sway
from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY
from gyronorth.sensor import Sensor, TriadErrors
from gyronorth.sensor.law import mean_covariance
from gyronorth.uncertainty import (
    NORMAL_975,
    SIGMA_UNKNOWN,
    STUDENT1_975,
    STUDENT2_975,
    STUDENT14_975,
    bent_angle_variance,
    horizontal_rate_variance,
    rate_variance,
    von_mises,
)
from gyronorth.validity import Gate, motion_gate, rate_gates, saturation_gate, width_gates

#: Inertial variance over the mean's noise below which the gyro's noise is motion: at rest it is
#: at least 1.2, and its estimate on 16 degrees of freedom is below a quarter of that in 1e-4.
MOTION_RATIO = 0.3
#: Measured over claimed noise variance above which the profile's noise is taken not to fit:
#: the 99.92 % point of chi-square over 16 degrees of freedom, divided by 16.
NOISE_MISFIT = 2.5
#: Blocks in which slow change is looked for, and what its square in units of noise exceeds in a tenth of all
#: recordings at rest (chi-square with 3 degrees of freedom): enough to ask a method that knows such a change.
SLOW_BLOCKS, SLOW_LIMIT = 24, 6.25
#: Least standard deviation of a mean rate, rad/s (2e-7 deg/h): keeps a record without noise finite.
RATE_FLOOR = 1e-12
#: Squared discrepancy, in units of known noise, that noise alone stays below in half of all records.
NOISE_EXPLAINS = np.log(2)
#: The same that noise alone exceeds in one record of 100.
BIAS_EVIDENT = np.log(100)


@dataclass(frozen=True)
class Data:
    """A batch on one time grid and what is known of it."""

    gyro_b: Array  # (..., n, 3) rad/s
    accel_b: Array | None  # (..., n, 3) m/s^2
    rate_hz: float
    latitude: float  # rad
    sensor: Sensor | None
    attitude: tuple[float, float] | None = None  # known roll and pitch, rad

    @property
    def duration(self) -> float:
        """Length, s."""
        return self.gyro_b.shape[-2] / self.rate_hz


@dataclass(frozen=True)
class Disturbance:
    """What the batch shows of motion and noise, arrays over recordings."""

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


@dataclass(frozen=True)
class Solution:
    """An alignment with its uncertainty, arrays over recordings."""

    levelled: Levelled
    parts: dict[str, Array]  # variance of a horizontal rate component by part of sigma, (rad/s)^2
    sigma: Array  # rad
    half_width: Array  # of the 95 % interval, rad
    gates: list[Gate]


def disturbance(data: Data, mean: Levelled) -> Disturbance:
    """Sway and noise of a batch, judged against the profile or the recording's own noise.

    The mean over T is wrong by the net tilt change over T: in variance 2 V / T^2 for an
    oscillation of variance V, plus the square of the change that the accelerometer's trend
    shows; of yaw nothing shows the trend, and 3 V / T^2 allows for it. With a profile the
    integrated rate is held against what its noise and drift stray from a line
    (`bent_angle_variance`), and the trend against the accelerometer's noise and drift; without
    one, against the recording's own.
    """
    moved = sway(data.gyro_b, data.accel_b, mat_lb=mat_lb(mean.roll, mean.pitch), rate_hz=data.rate_hz)
    noise = noise_density(data.gyro_b, rate_hz=data.rate_hz)
    if data.sensor is None:
        unit, unit_limit = bent_angle_variance(TriadErrors(white=1.0), data.duration)
        expected, limit = noise.density**2 * unit, noise.density**2 * unit_limit
        bent = noise.excess > noise.excess_limit
        own_change = moved.tilt_noise
    else:
        unit, unit_limit = bent_angle_variance(data.sensor.gyro, data.duration)
        expected, limit = np.full_like(noise.density, unit), np.full_like(noise.density, unit_limit)
        bent = np.ones(limit.shape, dtype=bool)
        own_change = np.maximum(moved.tilt_noise, _trend_variance(data.sensor, data.duration))
    # Rounding of a record without noise is no sway.
    limit, own_change = limit + (RATE_FLOOR * data.duration) ** 2, own_change + (RATE_FLOOR * data.duration) ** 2
    bent = bent & (moved.gyro_variance > limit)
    white = noise.density**2 / data.duration
    if data.accel_b is None:
        detected, change, square = bent, np.zeros_like(limit), np.zeros_like(limit)
        oscillation = np.maximum(moved.gyro_variance - expected, 0)
        white_is_noise = ~detected | (noise.excess <= noise.excess_limit)
    else:
        square = moved.tilt_change**2 / 2
        detected = bent | (square > GATE_SIGMA**2 * own_change)
        change = np.maximum(square - own_change, 0)
        oscillation = np.maximum(moved.tilt_variance, 0)
        # Sway looks like noise of the gyro, but not in the difference of gyro and tilt.
        white = np.where(detected, np.minimum(white, moved.tilt_noise / data.duration**2), white)
        white_is_noise = np.ones_like(detected)
    return Disturbance(
        sway=moved,
        white=white,
        white_is_noise=white_is_noise,
        variance=np.where(detected, (2 * oscillation + change) / data.duration**2, 0.0),
        yaw_variance=np.where(detected, 3 * moved.yaw_variance / data.duration**2, 0.0),
        detected=detected,
        angle=np.sqrt(moved.gyro_variance),
        angle_limit=np.sqrt(limit),
        tilt=np.sqrt(square),
        tilt_limit=GATE_SIGMA * np.sqrt(own_change),
    )


def changes_slowly(data: Data) -> bool:
    """Whether the rate of one recording may change as a bias does that settles, beyond the profile's noise and drift.

    The means of `SLOW_BLOCKS` blocks against a constant, as shapes that settle early, late, or not at all: the sum
    of squares over the axes of each is chi-square with 3 degrees of freedom in a recording at rest.
    """
    assert data.sensor is not None
    size = data.gyro_b.shape[-2] // SLOW_BLOCKS
    if size == 0:
        return False
    edges = np.arange(SLOW_BLOCKS + 1) * size
    covariance = mean_covariance(data.sensor.gyro, edges[:-1], edges[1:], rate_hz=data.rate_hz)
    covariance += np.eye(SLOW_BLOCKS) * RATE_FLOOR**2
    whiten = np.linalg.inv(np.linalg.cholesky(covariance))
    time = (np.arange(SLOW_BLOCKS) + 0.5) / SLOW_BLOCKS
    shapes = whiten @ np.stack([np.ones(SLOW_BLOCKS), np.exp(-time / 0.1), np.exp(-time / 0.3), time], axis=1)
    constant = shapes[:, 0] / np.linalg.norm(shapes[:, 0])
    changing = shapes[:, 1:] - np.outer(constant, constant @ shapes[:, 1:])
    changing = changing / np.linalg.norm(changing, axis=0)
    seen = changing.T @ whiten @ block_means(data.gyro_b, size)[:SLOW_BLOCKS]
    return bool(np.sum(seen**2, axis=1).max() > SLOW_LIMIT)


def _trend_variance(sensor: Sensor, duration: float) -> float:
    """Variance per axis of the net tilt change that the accelerometer's own noise and drift fake, rad^2."""
    slope = rate_variance(sensor.accel, duration, weighting="ramp")
    return float((slope["noise"] + slope["drift"]) * (duration / STANDARD_GRAVITY) ** 2)


def prefers_inertial(data: Data, moved: Disturbance, mean: Solution, traced: Solution) -> Mask:
    """Where `auto` takes inertial-frame alignment: disturbed, and its own sigma is smaller.

    Without a profile a gyro that is noisier than what gravity's trace leaves room for counts
    as disturbed too: then its noise is motion.
    """
    disturbed = moved.detected
    if data.sensor is None:
        disturbed = disturbed | (traced.parts["noise"] < MOTION_RATIO * moved.white)
    return disturbed & (traced.sigma < mean.sigma)


def solve_mean(data: Data, mean: Levelled, moved: Disturbance) -> Solution:
    """Plain averaging with its uncertainty."""
    white = moved.white
    if data.sensor is None:
        parts = {"noise": white, "sway": moved.variance}
    else:
        parts = claimed_parts(data, mean, "mean")
        misfit = moved.white_is_noise & (white > NOISE_MISFIT * parts["noise"])
        parts["noise"] = np.where(misfit, white, parts["noise"])
        parts["sway"] = moved.variance
    return _conclude(data, mean, parts, moved, vertical=white + moved.yaw_variance, inertial=False)


def solve_inertial(data: Data, moved: Disturbance) -> Solution:
    """Inertial-frame alignment with its uncertainty.

    Without a profile its noise is read from the residuals, 16 harmonics less 2 fitted
    parameters, and widened to what Student's t with 14 degrees of freedom deserves.
    """
    if data.accel_b is None:
        raise ValueError("Inertial-frame alignment needs specific force; accel_b is None.")
    traced = align_inertial(data.gyro_b, data.accel_b, rate_hz=data.rate_hz, latitude=data.latitude)
    measured = traced.measured_variance
    assert measured is not None
    if data.sensor is None:
        parts = {"noise": measured * (STUDENT14_975 / NORMAL_975) ** 2}
    else:
        parts = claimed_parts(data, traced, "inertial")
        claimed = parts["noise"] + parts["drift"]
        parts["sway"] = np.where(measured > NOISE_MISFIT * claimed, measured - claimed, 0.0)
    return _conclude(data, traced, parts, moved, vertical=moved.white + moved.yaw_variance, inertial=True)


def claimed_parts(data: Data, found: Levelled, method: str) -> dict[str, Array]:
    """Variance parts that the profile claims, spread over the batch."""
    assert data.sensor is not None
    kind = "mean" if method == "mean" else "inertial"
    claimed = horizontal_rate_variance(data.sensor, latitude=data.latitude, duration=data.duration, method=kind)
    if data.accel_b is None:
        claimed["levelling"] = np.zeros(())
    return {name: np.broadcast_to(value, found.heading.shape) for name, value in claimed.items()}


def _conclude(
    data: Data, found: Levelled, parts: dict[str, Array], moved: Disturbance, *, vertical: Array, inertial: bool
) -> Solution:
    signal = EARTH_RATE * np.cos(data.latitude)
    horizontal = np.hypot(found.rate_l[..., 0], found.rate_l[..., 1])
    tiny = np.finfo(float).tiny
    # First-order scale: a rate error e turns a rate of size |h| by e / sqrt(|h| Omega cos lat).
    arm = np.maximum(horizontal * signal, tiny)
    if data.sensor is None:
        known = np.maximum(sum(parts.values()), RATE_FLOOR**2)
        scale, quantile = _inferred_scale(horizontal - signal, found.rate_l[..., 2], known, vertical, data.latitude)
        sigma, half = von_mises(arm / known)
        biased = np.minimum(quantile * scale / np.sqrt(arm), np.pi)
        half = np.where(quantile > 0, biased, half)
        sigma = np.where(quantile > 0, np.minimum(biased / NORMAL_975, SIGMA_UNKNOWN), sigma)
        whole = (quantile * scale / NORMAL_975) ** 2
        parts = {**parts, "turn_on_bias": np.where(quantile > 0, np.maximum(whole - known, 0), 0.0)}
        total, upright = np.maximum(known, whole), np.maximum(vertical, whole)
    else:
        total = np.maximum(sum(parts.values()) + np.zeros_like(horizontal), RATE_FLOOR**2)
        sigma, half = von_mises(arm / total)
        upright = np.maximum(total - parts["levelling"] - parts["sway"], RATE_FLOOR**2) + moved.yaw_variance
    gates = [
        *rate_gates(
            found.rate_l,
            variance=total,
            vertical_variance=upright,
            latitude=data.latitude,
            known=data.sensor is not None,
        ),
        *width_gates(
            half, variance=total, noise_variance=parts["noise"], latitude=data.latitude, duration=data.duration
        ),
        motion_gate(moved.sway.excursion, sigma, inertial=np.full(sigma.shape, inertial)),
    ]
    return Solution(found, parts, sigma, half, gates)


def _inferred_scale(
    off_horizontal: Array, vertical_rate: Array, known: Array, vertical: Array, latitude: float
) -> tuple[Array, Array]:
    """Scale of the rate error, rad/s, and the quantile it deserves, inferred from two discrepancies.

    The horizontal rate is off by d_h, the vertical by d_v. Against known noise of variance k
    (horizontal) and k_v (vertical), D = (d_h^2 / k + d_v^2 / k_v) / 2 is exponential with mean
    1 where noise is all there is. Up to its median noise explains what is seen (quantile 0:
    use the noise). Beyond, s^2 = k D, which is (d_h^2 + d_v^2) / 2 in the usual case k = k_v,
    and the error is Student t with 2 degrees of freedom. Where yaw sway hides the vertical and
    a bias is evident all the same, only one discrepancy speaks, and t has 1.
    """
    off_vertical = vertical_rate + EARTH_RATE * np.sin(latitude)
    upright = np.maximum(vertical, known)
    ratio = (off_horizontal**2 / known + off_vertical**2 / upright) / 2
    alone = (ratio > BIAS_EVIDENT) & (upright > np.maximum(off_horizontal**2, 2 * known))
    scale = np.where(alone, np.abs(off_horizontal), np.sqrt(known * ratio))
    quantile = np.where(ratio <= NOISE_EXPLAINS, 0.0, np.where(alone, STUDENT1_975, STUDENT2_975))
    return scale, quantile


def saturation_gates(data: Data) -> list[Gate]:
    """Gates on the sensor's ranges, where the profile states them."""
    gates = []
    if data.sensor is not None and np.isfinite(data.sensor.gyro.saturation):
        peak = np.abs(data.gyro_b).max(axis=(-2, -1))
        gates.append(
            saturation_gate(peak, limit=data.sensor.gyro.saturation, what="gyro", unit=np.pi / 180, unit_name="deg/s")
        )
    if data.sensor is not None and data.accel_b is not None and np.isfinite(data.sensor.accel.saturation):
        peak = np.abs(data.accel_b).max(axis=(-2, -1))
        gates.append(
            saturation_gate(
                peak, limit=data.sensor.accel.saturation, what="accelerometer", unit=STANDARD_GRAVITY, unit_name="g"
            )
        )
    return gates


def unknown(found: Levelled) -> Solution:
    """The solution of a record too short to say anything of its noise: any heading."""
    sigma = np.full(found.heading.shape, SIGMA_UNKNOWN)
    return Solution(found, {}, sigma, np.full_like(sigma, np.pi), [])


def mean_alignment(data: Data) -> Levelled:
    """The closed form, which every other method is judged beside."""
    return align_mean(data.gyro_b, data.accel_b, attitude=data.attitude)
