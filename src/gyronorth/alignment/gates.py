"""When a heading may be believed: the gates, each with its measured value beside its limit.

Limits scale with the claimed uncertainty. Each is explained in docs/theory/uncertainty.md, section
"Validity"; values and limits are in the reader's units (deg, deg/h, s).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gyronorth.alignment.error_budget import STEEPEST
from gyronorth.angles import DEG_PER_HOUR
from gyronorth.arrays import Array, Mask
from gyronorth.conditioning import GATE_SIGMA
from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY
from gyronorth.findings import Finding
from gyronorth.frozen import frozen

if TYPE_CHECKING:
    from gyronorth.sensor import Sensor

#: An interval wider than this to either side cannot tell north from south, rad.
WIDEST_HALF_WIDTH = np.pi / 2
#: Concentration of the von Mises law whose 95 % interval is that wide (solved numerically).
WIDEST_CONCENTRATION = 2.36
#: Fewest samples and shortest time, s, from which a noise level can be read at all.
FEWEST_SAMPLES, SHORTEST = 16, 2.0
#: Error of roll, rad, up to which an error of level enters the heading to first order.
LARGEST_ROLL_ERROR = 0.1
#: Share of the sensor's range at which an output counts as saturated.
SATURATION_SHARE = 0.999


@frozen
class Shown:
    """How a gate reads in the list of checks; symbols are those of docs/theory/uncertainty.md, section "Validity"."""

    title: str  # what is compared
    unit: str
    formula: str


@frozen
class Gate:
    """A gate over a batch: it fails where value > limit; arrays over its recordings, or one number for all."""

    code: str
    message: str  # with {value} and {limit}
    value: Array
    limit: Array
    failed: Mask
    shown: Shown | None = None  # None: not in the list of checks

    def finding(self, index: tuple[int, ...] = ()) -> Finding | None:
        """The finding of one recording of the batch, or None where the gate holds."""
        if not self.failed[index]:
            return None
        value, limit = float(self.value[index]), float(self.limit[index])
        message = self.message.format(value=value, limit=limit)
        known_value, known_limit = (None if np.isnan(number) else number for number in (value, limit))
        return Finding(self.code, message, known_value, known_limit)


def rate_gates(rate_l: Array, *, variance: Array, vertical_variance: Array, latitude: float, known: bool) -> list[Gate]:
    """Norm of the rate against Earth rate, and the latitude that it implies.

    Parameters
    ----------
    rate_l : ndarray, shape (..., 3)
        Levelled mean rate, rad/s.
    variance, vertical_variance : ndarray, shape (...)
        Claimed variance of a horizontal and of the vertical component, (rad/s)^2.
    latitude : float
        rad.
    known : bool
        Whether the variance is claimed from a profile. If it was itself inferred from these
        two discrepancies it cannot judge them, and the limit is the horizontal Earth rate: a
        rate error as large as the signal can point the heading anywhere.

    Notes
    -----
    rate_norm: | |w| - Omega | <= 3.29 sqrt(cos^2 var_h + sin^2 var_v).
    implied_latitude: | asin(-w_down / |w|) - lat | <= 3.29 sqrt(sin^2 var_h + cos^2 var_v) / Omega.
    """
    sin2, cos2 = np.sin(latitude) ** 2, np.cos(latitude) ** 2
    signal = np.full_like(variance, EARTH_RATE * np.cos(latitude))
    along = GATE_SIGMA * np.sqrt(cos2 * variance + sin2 * vertical_variance) if known else signal
    across = GATE_SIGMA * np.sqrt(sin2 * variance + cos2 * vertical_variance) if known else signal
    norm = np.linalg.norm(rate_l, axis=-1)
    off_norm = np.abs(norm - EARTH_RATE)
    off_latitude = np.abs(implied_latitude(rate_l) - latitude)
    return [
        Gate(
            "rate_norm",
            f"The mean rate differs from Earth rate (15.041 deg/h) by {{value:.2f}} deg/h; at most {{limit:.2f}} deg/h "
            f"{'fits the sensor profile' if known else 'leaves a heading to be found'}. "
            "Likely a gyro bias larger than expected, or the unit was turning.",
            off_norm / DEG_PER_HOUR,
            along / DEG_PER_HOUR,
            off_norm > along,
            Shown(
                "mean rate against Earth rate",
                "deg/h",
                f"| |w| - 15.041 deg/h |; limit {GATE_SIGMA} sqrt(cos^2(lat) var_horizontal + sin^2(lat) var_vertical) "
                "with a profile, 15.041 cos(lat) without one",
            ),
        ),
        Gate(
            "implied_latitude",
            "The rate and the vertical imply a latitude {value:.1f} deg from the given one; at most {limit:.1f} deg "
            f"{'fits the sensor profile' if known else 'leaves a heading to be found'}. "
            "Likely a vertical gyro bias, a wrong latitude or wrong axes.",
            np.degrees(off_latitude),
            np.degrees(across / EARTH_RATE),
            off_latitude > across / EARTH_RATE,
            Shown(
                "implied latitude against the given one",
                "deg",
                f"| asin(-w_down / |w|) - lat |; limit {GATE_SIGMA} sqrt(sin^2(lat) var_horizontal + cos^2(lat) "
                "var_vertical) / 15.041 deg/h with a profile, 57.3 cos(lat) without one",
            ),
        ),
    ]


def implied_latitude(rate_l: Array) -> Array:
    """Latitude that the rate and the vertical imply, asin(-w_down / |w|), rad, shape (...)."""
    norm = np.linalg.norm(rate_l, axis=-1)
    return np.arcsin(np.clip(-rate_l[..., 2] / np.maximum(norm, np.finfo(float).tiny), -1, 1))


def width_gates(
    half_width: Array, *, variance: Array, noise_variance: Array, latitude: float, duration: float
) -> list[Gate]:
    """Interval too wide to tell north from south: too_short, near_pole or too_noisy, by what would cure it.

    `variance` is the total of a horizontal component, `noise_variance` the share of it that
    falls as 1 / duration, both (rad/s)^2, shape (...).
    """
    wide = half_width > WIDEST_HALF_WIDTH
    signal = EARTH_RATE * np.cos(latitude)
    # Largest total variance whose interval still tells north from south, here and at 45 degrees.
    allowed, allowed_45 = ((level**2 / WIDEST_CONCENTRATION) for level in (signal, EARTH_RATE * np.sqrt(0.5)))
    rest = np.maximum(variance - noise_variance, 0)
    needed = duration * noise_variance / np.maximum(allowed - rest, 1e-60)
    short = wide & (needed > duration) & (rest < allowed)
    polar = wide & ~short & (variance < allowed_45) & (allowed < allowed_45)
    half_deg = np.degrees(half_width)
    limit_deg = np.full_like(half_width, np.degrees(WIDEST_HALF_WIDTH))
    return [
        Gate(
            "too_short",
            "The recording of {value:.1f} s is too short for this noise; about {limit:.0f} s would do.",
            np.full_like(half_width, duration),
            needed,
            short,
        ),
        Gate(
            "near_pole",
            f"At latitude {np.degrees(latitude):.2f} deg the horizontal Earth rate is only {signal / DEG_PER_HOUR:.2f} "
            "deg/h: the 95 % interval is +-{value:.0f} deg; at most +-{limit:.0f} deg tells north from south.",
            half_deg,
            limit_deg,
            polar,
        ),
        Gate(
            "too_noisy",
            "The 95 % interval is +-{value:.0f} deg; at most +-{limit:.0f} deg tells north from south. "
            "The sensor's bias or noise hides Earth rate.",
            half_deg,
            limit_deg,
            wide & ~short & ~polar,
            Shown(
                "half-width of the 95 % interval",
                "deg",
                "of the von Mises law with concentration |w_horizontal| 15.041 cos(lat) / var_horizontal, or of the "
                "method's posterior; beyond 90 deg north and south look alike",
            ),
        ),
    ]


def motion_gate(excursion: Array, limit: Array, *, tilted: bool | None = None) -> Gate:
    """Attitude change that the method does not model, rad; `error_budget.TURN_LIMITS` says why so much.

    `tilted` is whether the accelerometer saw a good part of it, None without one.
    """
    cause = "Likely the unit turned."
    if tilted is None:
        cause = "Likely the unit turned, or the gyro bias drifts."
    elif not tilted:
        cause = "The accelerometer did not tilt: likely the gyro bias drifts, or the unit turned about the vertical."
    return Gate(
        "motion",
        "The integrated rate turns by {value:.2f} deg about the mean attitude; at most {limit:.2f} deg is standing "
        f"still. {cause}",
        np.degrees(excursion),
        np.degrees(limit),
        np.asarray(excursion > limit),
        Shown(
            "rotation about the mean attitude",
            "deg",
            "largest excursion of the integrated rate; limit of mean sqrt(sigma), sigma taken as 0.5 to 5.7 deg; of "
            "inertial 45 deg; of bayes and learned what sigma allows, at least 0.25 deg",
        ),
    )


def gimbal_gate(pitch: Array, level_sigma: float) -> Gate:
    """Pitch so near to 90 degrees that the forward axis has no heading, or none that an error of level leaves.

    `level_sigma` is the standard deviation of the direction of gravity in the body, rad: over cos(pitch) it is that
    of roll, and over cot(pitch) what it costs the heading (`error_budget.pitch_variance`).
    """
    limit = min(STEEPEST, float(np.arccos(min(level_sigma / LARGEST_ROLL_ERROR, 1.0))))
    value = np.degrees(np.abs(pitch))
    return Gate(
        "gimbal",
        "The forward axis points {value:.1f} deg up or down; beyond {limit:.1f} deg an error of level turns its "
        "heading by too much. Likely the axes are declared wrong; else name another axis of the unit forward (--axes).",
        value,
        np.full_like(value, np.degrees(limit)),
        value > np.degrees(limit),
        Shown(
            "pitch",
            "deg",
            "of the forward axis; limit 89 deg, or arccos(10 sigma of the direction of gravity) where that is less",
        ),
    )


def length_finding(samples: int, duration: float) -> Finding | None:
    """Fewer samples or seconds than a noise level can be read from."""
    if samples >= FEWEST_SAMPLES and duration >= SHORTEST:
        return None
    needed = max(SHORTEST, FEWEST_SAMPLES * duration / samples)
    return Finding(
        "too_short",
        f"The recording holds {samples} samples in {duration:.2f} s; at least {FEWEST_SAMPLES} samples and "
        f"{SHORTEST:g} s are needed, that is {needed:.1f} s.",
        duration,
        needed,
    )


def saturation_gate(peak: Array, *, limit: float, what: str, unit: float, unit_name: str, quantity: str) -> Gate:
    """Output at the end of the sensor's range: the mean is then not the mean of the motion."""
    held = np.full_like(peak, SATURATION_SHARE * limit / unit)
    return Gate(
        "saturated",
        f"The {what} reaches {{value:.1f}} {unit_name}; the sensor's range ends at {limit / unit:.1f} {unit_name}.",
        peak / unit,
        held,
        peak / unit > held,
        Shown(f"largest {quantity}", unit_name, "largest |component| of a sample; limit 0.999 of the sensor's range"),
    )


def saturation_gates(sensor: Sensor | None, peaks: tuple[Array, Array | None]) -> list[Gate]:
    """Gates on the sensor's ranges, where the profile states them."""
    gates: list[Gate] = []
    gyro, accel = peaks
    if sensor is not None and np.isfinite(sensor.gyro.saturation):
        unit, limit = np.pi / 180, sensor.gyro.saturation
        names = {"what": "gyro", "unit_name": "deg/s", "quantity": "angular rate"}
        gates.append(saturation_gate(gyro, limit=limit, unit=unit, **names))
    if sensor is not None and accel is not None and np.isfinite(sensor.accel.saturation):
        unit, limit = STANDARD_GRAVITY, sensor.accel.saturation
        names = {"what": "accelerometer", "unit_name": "g", "quantity": "specific force"}
        gates.append(saturation_gate(accel, limit=limit, unit=unit, **names))
    return gates
