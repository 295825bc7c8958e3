"""Inertial-frame alignment with its uncertainty."""

from __future__ import annotations

import numpy as np

from gyronorth.alignment.error_budget import claimed_variance, concluded, pitch_variance
from gyronorth.alignment.inertial import align_inertial
from gyronorth.alignment.methods.mean import NOISE_MISFIT
from gyronorth.alignment.problem import Problem
from gyronorth.alignment.registry import Options
from gyronorth.alignment.result import Result
from gyronorth.alignment.rounding import rounding_of_tilt
from gyronorth.arrays import Array
from gyronorth.catalogue import method_info
from gyronorth.uncertainty import NORMAL_975, STUDENT14_975

#: Error of a tilt of which nothing is known, rad: with it no recording of less than an hour shows Earth rate.
ANY_TILT = 0.2


class Inertial:
    """Gravity followed in an inertial frame."""

    info = method_info("inertial")

    def solve(self, problem: Problem, options: Options) -> Result:
        """Heading with the profile's error budget, or the noise of the residuals.

        Without a profile that noise, 16 harmonics less 2 fitted parameters, is widened to what Student's t with 14
        degrees of freedom deserves.
        """
        if problem.accel_b is None:
            raise ValueError("Inertial-frame alignment needs specific force; accel_b is None.")
        motion = problem.motion
        attitude = align_inertial(problem.gyro_b, problem.accel_b, rate_hz=problem.rate_hz, latitude=problem.latitude)
        measured = attitude.measured_variance
        assert measured is not None
        if problem.sensor is None:
            variance = {"noise": measured * (STUDENT14_975 / NORMAL_975) ** 2} | pitch_variance(problem)
        else:
            variance = claimed_variance(problem, "inertial")
            claimed = variance["noise"] + variance["drift"]
            variance["sway"] = np.where(measured > NOISE_MISFIT * claimed, measured - claimed, 0.0)
        unseen = _unseen_tilt_variance(problem)
        if np.any(unseen > 0):
            variance["levelling"] = variance.get("levelling", np.zeros(())) + unseen
        vertical = motion.white + motion.yaw_variance
        return concluded(problem, attitude, variance, method="inertial", vertical=vertical, turn_limit="inertial")


def _unseen_tilt_variance(problem: Problem) -> Array:
    """Variance of a horizontal rate, (rad/s)^2, by a tilt that stays within one step of a rounded specific force.

    The tilt at the beginning and that at the end are each off by the error e of rounding: together by sqrt(2) e over
    the duration. A force that never changes has steps of any size, unless the profile says that it has no noise.
    """
    if problem.accel_b is None or (problem.sensor is not None and problem.sensor.accel.white == 0):
        return np.zeros(problem.shape)
    error = np.minimum(rounding_of_tilt(problem.accel_b), ANY_TILT)
    return np.asarray(2 * (error / problem.duration) ** 2)


METHOD = Inertial()
