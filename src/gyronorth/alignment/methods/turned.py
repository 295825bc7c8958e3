"""Multi-position alignment: heading, bias and scale factor from still poses and the turns between them."""

from __future__ import annotations

import numpy as np

from gyronorth.alignment.error_budget import horizontal_earth_rate
from gyronorth.alignment.problem import Problem
from gyronorth.alignment.registry import Options
from gyronorth.alignment.result import Attitude, Posterior, Result
from gyronorth.alignment.turned.fit import TurnedFit, turned
from gyronorth.attitude import mat_lb
from gyronorth.catalogue import method_info
from gyronorth.estimate import Pose, SensorErrors, Turn
from gyronorth.findings import Finding

#: Residuals over the noise law, root mean square, above which poses and turns contradict each other.
MISFIT_LIMIT = 5.0


class Turned:
    """Two or more poses and the turns between them."""

    info = method_info("turned")

    def solve(self, problem: Problem, options: Options) -> Result:
        """Heading at the end, with the errors of the gyro that the poses tell."""
        fit = turned(
            problem.gyro_b,
            problem.accel_b,
            rate_hz=problem.rate_hz,
            latitude=problem.latitude,
            errors=problem.sensor,
            turn_angles=options.turn_angles,
            turn_angle_sigma=options.turn_angle_sigma,
            segments=problem.segments,
        )
        signal = horizontal_earth_rate(problem.latitude)
        last = fit.poses[-1] if fit.poses else None
        first, end = (0, None) if last is None else (round(edge * problem.rate_hz) for edge in (last.start, last.end))
        rate_b = problem.gyro_b[first:end].mean(axis=0) - np.array(fit.gyro_bias)
        attitude = Attitude(
            np.asarray(fit.heading), np.asarray(fit.roll), np.asarray(fit.pitch), mat_lb(fit.roll, fit.pitch) @ rate_b
        )
        return Result(
            "turned",
            attitude,
            Posterior(np.asarray(fit.sigma), *(np.asarray(end) for end in fit.interval95)),
            {name: np.asarray((value * signal) ** 2) for name, value in fit.sigma_parts.items()},
            np.asarray(signal),
            refusals=_refusals(fit),
            findings=_findings(fit),
            swaying=False,
            poses=tuple(
                Pose(p.start, p.end, p.heading, float(np.linalg.norm(p.residual_b)), p.residual_sigma)
                for p in fit.poses
            ),
            turns=tuple(Turn(turn.start, turn.end, turn.angle) for turn in fit.turns),
            sensor_errors=SensorErrors(fit.gyro_bias, fit.gyro_bias_sigma, fit.scale_factor, fit.scale_factor_sigma),
        )


def _refusals(fit: TurnedFit) -> tuple[Finding, ...]:
    misfit = float(np.sqrt(fit.chi2 / fit.dof))
    if misfit <= MISFIT_LIMIT:
        return ()
    message = (
        f"The rates of the poses differ from one Earth rate and one bias by {misfit:.1f} times their noise; at most "
        f"{MISFIT_LIMIT:.1f} is believed. Likely the unit moved while it should have stood still."
    )
    return (Finding("motion", message, misfit, MISFIT_LIMIT),)


def _findings(fit: TurnedFit) -> tuple[Finding, ...]:
    if not fit.bias_rejected:
        return ()
    message = "The gyro bias lies outside the sensor profile, which was not used for it; sigma allows for any bias."
    return (Finding("bias_unknown", message),)


METHOD = Turned()
