"""Plain averaging, in closed form, with its uncertainty."""

from __future__ import annotations

import numpy as np

from gyronorth.alignment.error_budget import claimed_variance, concluded, levelling_variance
from gyronorth.alignment.problem import Problem
from gyronorth.alignment.registry import Options
from gyronorth.alignment.result import Result
from gyronorth.catalogue import method_info

#: Measured over claimed noise variance above which the profile's noise is taken not to fit:
#: the 99.92 % point of chi-square over 16 degrees of freedom, divided by 16.
NOISE_MISFIT = 2.5


class Mean:
    """The closed form of the mean rate and the mean specific force."""

    info = method_info("mean")

    def solve(self, problem: Problem, options: Options) -> Result:
        """Heading with noise, drift, bias and levelling of the profile, or the noise that the recording shows."""
        motion = problem.motion
        white = motion.white
        if problem.sensor is None:
            variance = {"noise": white, "sway": motion.variance, "levelling": levelling_variance(problem)}
        else:
            variance = claimed_variance(problem, "mean")
            misfit = motion.white_is_noise & (white > NOISE_MISFIT * variance["noise"])
            variance["noise"] = np.where(misfit, white, variance["noise"])
            variance["sway"] = motion.variance
        vertical = white + motion.yaw_variance
        return concluded(problem, problem.mean, variance, method="mean", vertical=vertical, turn_limit="mean")


METHOD = Mean()
