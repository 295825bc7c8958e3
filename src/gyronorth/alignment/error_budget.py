"""From variances of the rate to the posterior of the heading: claimed by a profile, or inferred without one."""

from __future__ import annotations

from typing import Literal

import numpy as np

from gyronorth.alignment.motion import RATE_FLOOR
from gyronorth.alignment.problem import Problem
from gyronorth.alignment.result import Attitude, Judged, Posterior, Result
from gyronorth.alignment.rounding import rounding_variance
from gyronorth.arrays import Array
from gyronorth.earth import EARTH_RATE
from gyronorth.uncertainty import (
    NORMAL_975,
    SIGMA_UNKNOWN,
    STUDENT1_975,
    STUDENT2_975,
    horizontal_rate_variance,
    tilt_variance,
    von_mises,
)

#: Squared discrepancy, in units of known noise, that noise alone stays below in half of all records.
NOISE_EXPLAINS = np.log(2)
#: Turn-on bias over the profile's up to which the rate may differ from the Earth's: a mixture may widen an interval,
#: but not explain away a wrong latitude or a unit that is broken. Where only a bias far beyond the profile would
#: explain the recording, `posterior` judges the plain mean by that.
MOST_SCALE = 3.0
#: Error of level, rad, that is allowed for where no profile says it: an accelerometer bias of 2 mg.
LEVEL_UNKNOWN = 2e-3
#: Pitch, rad, up to which its share in an error of level is left out.
FLAT_PITCH = np.radians(10.0)
#: Pitch, rad, up to which the heading of the forward axis is worked out; beyond it stands straight up or down.
STEEPEST = np.radians(89.0)
#: The same that noise alone exceeds in one record of 100.
BIAS_EVIDENT = np.log(100)


def claimed_variance(problem: Problem, kind: Literal["mean", "inertial"]) -> dict[str, Array]:
    """Error budget that the profile claims, (rad/s)^2 by term, spread over the batch; rounding is a constant error."""
    assert problem.sensor is not None
    claimed = horizontal_rate_variance(
        problem.sensor, latitude=problem.latitude, duration=problem.duration, method=kind
    )
    if problem.accel_b is None:
        claimed["levelling"] = np.zeros(())
    claimed["turn_on_bias"] = claimed["turn_on_bias"] + rounding_variance(problem.gyro_b)
    claimed |= pitch_variance(problem)
    return {name: np.broadcast_to(value, problem.shape) for name, value in claimed.items()}


def level_sigma(problem: Problem) -> float:
    """One standard deviation of roll cos(pitch) and of pitch, rad; 0 without an accelerometer."""
    if problem.accel_b is None:
        return 0.0
    if problem.sensor is None:
        return LEVEL_UNKNOWN
    return float(np.sqrt(tilt_variance(problem.sensor, latitude=problem.latitude, duration=problem.duration)))


def pitch_variance(problem: Problem) -> dict[str, Array]:
    """What pitch adds to the cost of an error of level, as the term "pitch", (rad/s)^2; none below `FLAT_PITCH`.

    Notes
    -----
    With c = cos(pitch) an error f of the specific force across the forward axis rolls the unit by f / c, and turns the
    heading of that axis by (tan(pitch) - tan(lat) cos(heading)) f; one along it by tan(lat) sin(heading) f. The sum of
    squares is tan^2(lat) s^2, the term "levelling", and (tan^2(pitch) - 2 tan(lat) tan(pitch) cos(heading)) s^2, which
    grows without bound at the gimbal. Without a profile the sign of the second part is not used.
    """
    pitch = problem.mean.pitch
    if problem.accel_b is None or not np.any(np.abs(pitch) > FLAT_PITCH):
        return {}
    north, down = horizontal_earth_rate(problem.latitude), EARTH_RATE * np.sin(problem.latitude)
    raised = np.tan(np.clip(pitch, -STEEPEST, STEEPEST)) * north
    square = raised**2
    if problem.sensor is not None:
        square = np.maximum(square - 2 * down * raised * np.cos(problem.mean.heading), 0)
    return {"pitch": np.asarray(level_sigma(problem) ** 2 * square)}


def horizontal_earth_rate(latitude: float) -> float:
    """Horizontal Earth rate, rad/s: what the heading is read from."""
    return float(EARTH_RATE * np.cos(latitude))


def concluded(
    problem: Problem, attitude: Attitude, variance: dict[str, Array], *, method: str, vertical: Array, turn_limit: str
) -> Result:
    """The result of a method that reads the heading from a horizontal rate with the given error budget.

    Parameters
    ----------
    problem : Problem
    attitude : Attitude
        What the method found.
    variance : dict of ndarray
        Error budget of a horizontal component, (rad/s)^2 by term, without a bias of unknown size.
    method : str
        Its name.
    vertical : ndarray
        Variance of the vertical component without a bias of unknown size, (rad/s)^2.
    turn_limit : str
        A name of `TURN_LIMITS`.
    """
    signal = horizontal_earth_rate(problem.latitude)
    horizontal = np.hypot(attitude.rate_l[..., 0], attitude.rate_l[..., 1])
    # First-order scale: a rate error e turns a rate of size |h| by e / sqrt(|h| Omega cos lat).
    square = np.maximum(horizontal * signal, np.finfo(float).tiny)
    raised = variance.get("pitch", np.zeros(()))  # a turn about the vertical is seen in neither discrepancy
    if problem.sensor is None:
        known = np.maximum(sum(variance.values()) - raised, RATE_FLOOR**2)
        scale, quantile = _inferred_scale(
            horizontal - signal, attitude.rate_l[..., 2], known, vertical, problem.latitude
        )
        sigma, half = von_mises(square / (known + raised))
        biased = np.minimum(np.sqrt(((quantile * scale) ** 2 + NORMAL_975**2 * raised) / square), np.pi)
        half = np.where(quantile > 0, biased, half)
        sigma = np.where(quantile > 0, np.minimum(biased / NORMAL_975, SIGMA_UNKNOWN), sigma)
        whole = (quantile * scale / NORMAL_975) ** 2
        variance = {**variance, "turn_on_bias": np.where(quantile > 0, np.maximum(whole - known, 0), 0.0)}
        total, upright = np.maximum(known, whole), np.maximum(vertical, whole)
    else:
        total = np.maximum(sum(variance.values()) + np.zeros_like(horizontal), RATE_FLOOR**2)
        sigma, half = von_mises(square / total)
        yaw = problem.motion.yaw_variance
        total = total - raised
        upright = np.maximum(total - variance["levelling"] - variance["sway"], RATE_FLOOR**2) + yaw
    limit = TURN_LIMITS[turn_limit](sigma)
    judged = Judged(attitude.rate_l, total, upright, limit)
    return Result(method, attitude, Posterior.symmetric(sigma, half), variance, np.sqrt(square), judged=judged)


def averaged_over_models(
    problem: Problem, attitude: Attitude, posterior: Posterior, *, method: str, white: Array
) -> Result:
    """The result of a method that averages over models of a disturbance.

    Parameters
    ----------
    problem : Problem
    attitude : Attitude
        Of the average, with its constant rate.
    posterior : Posterior
        Its sigma and interval.
    method : str
        Its name.
    white : ndarray
        Variance of the mean rate from the white noise that the method took, (rad/s)^2.

    Notes
    -----
    The budget is that of the profile, or the white noise alone. What the mixture is wider by is the term "model"; where
    it is narrower, as when a settling bias is found and taken out, all terms shrink by one factor: their root sum
    square is sigma.

    Bumps are left out of the average, but the attitude that they leave behind is not: it enters the heading in first
    order, so that a rotation is held against sigma (0.25 deg at least), and what noise and drift integrate to.
    """
    signal = horizontal_earth_rate(problem.latitude)
    whole = np.asarray((posterior.sigma * signal) ** 2)
    claimed = {"noise": white} if problem.sensor is None else claimed_variance(problem, "mean")
    total = sum(claimed.values(), np.zeros(()))
    share = np.minimum(1.0, whole / np.maximum(total, np.finfo(float).tiny))
    variance = {name: value * share for name, value in claimed.items()}
    variance["model"] = np.maximum(whole - total, 0.0)
    believed = np.maximum(whole, total)
    if problem.sensor is not None:  # what the mixture does not know may not explain a bias that the profile forbids
        believed = np.minimum(believed, total + (MOST_SCALE**2 - 1) * claimed["turn_on_bias"])
    limit = np.clip(posterior.sigma, KNOCK_ALLOWANCE, np.sqrt(MOTION_ALLOWANCE_MOST))
    limit = limit + EXCURSION_OVER_RMS * problem.motion.angle_limit
    judged = Judged(attitude.rate_l, believed, believed, limit)
    arm = np.full(problem.shape, signal)
    return Result(method, attitude, posterior, variance, arm, judged=judged)


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


#: Heading error that second-order motion may cost before the recording counts as moving, rad.
MOTION_ALLOWANCE = np.radians(0.5)
#: The same for a heading that is known badly anyway, rad: 18 deg of excursion is motion to anyone.
MOTION_ALLOWANCE_MOST = 0.1
#: Attitude change that inertial-frame alignment may carry, rad: beyond it the unit turned.
INERTIAL_EXCURSION = np.radians(45.0)
#: Rotation, rad, that a method which leaves out bumps allows for however well it knows the heading: the sway and the
#: bumps of the reference mix turn a unit by 0.2 deg at most.
KNOCK_ALLOWANCE = np.radians(0.25)
#: Largest over root mean square excursion of an integrated rate that only drifts: of a random walk about its trend it
#: is below 4 in 999 of 1000.
EXCURSION_OVER_RMS = 4.0


def _of_a_mean(sigma: Array) -> Array:
    """An excursion of r rad biases a plain mean by up to r^2."""
    return np.sqrt(np.clip(sigma, MOTION_ALLOWANCE, MOTION_ALLOWANCE_MOST))


def _of_inertial(sigma: Array) -> Array:
    """Inertial-frame alignment follows any attitude; beyond 45 deg the unit is no longer in one pose."""
    return np.full(np.shape(sigma), INERTIAL_EXCURSION)


#: Largest rotation about the mean attitude, rad, by the sigma of the heading: what a kind of method allows for.
TURN_LIMITS = {"mean": _of_a_mean, "inertial": _of_inertial}
