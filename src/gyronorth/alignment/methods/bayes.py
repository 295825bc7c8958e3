"""Model averaging over tones, settling and bumps on a fine grid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gyronorth.alignment.error_budget import averaged_over_models
from gyronorth.alignment.problem import Problem
from gyronorth.alignment.registry import LENGTH_SLACK, Options
from gyronorth.alignment.result import Posterior, Result
from gyronorth.alignment.tones.search import bayes, white_of
from gyronorth.angles import wrap
from gyronorth.catalogue import method_info
from gyronorth.estimate import DisturbanceFound


class Bayes:
    """Every model of a few tones, settling and bumps, weighed by its evidence."""

    info = method_info("bayes")

    def solve(self, problem: Problem, options: Options) -> Result:
        """Heading of the last `longest_s` seconds, and what disturbs them."""
        info = self.info
        if problem.duration > info.longest_s + LENGTH_SLACK:
            problem = problem.part(-info.longest_s)
        gyro_l, rate_hz = problem.rate_l(info.lowest_rate_hz), info.lowest_rate_hz
        errors = None if problem.sensor is None else problem.sensor.gyro
        fit = bayes(gyro_l, rate_hz=rate_hz, latitude=problem.latitude, errors=errors)
        low, high = fit.interval95
        if high - low >= 2 * np.pi:
            posterior = Posterior.symmetric(fit.sigma, np.pi)
        else:
            low, high = (np.asarray(wrap(end - fit.heading)) for end in (low, high))
            posterior = Posterior(np.asarray(fit.sigma), np.minimum(low, 0.0), np.maximum(high, 0.0))
        attitude = replace(problem.mean, heading=np.asarray(fit.heading), rate_l=fit.rate_l)
        white = np.asarray(white_of(gyro_l) ** 2 / len(gyro_l))
        result = averaged_over_models(problem, attitude, posterior, method="bayes", white=white)
        # 3 n squares scatter by sqrt(2 / 3 n): beyond 4 of these the law does not hold, and sigma was scaled up.
        explained = fit.noise**2 <= 1 + 4 * np.sqrt(2 / (3 * (len(gyro_l) - fit.bumps)))
        found = DisturbanceFound(fit.tones, fit.settling, None, None, fit.bumps / rate_hz, fit.noise, bool(explained))
        return replace(result, disturbance=found)


METHOD = Bayes()
