"""A deviation curve applied to the closed form, with the warning that says whether it was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gyronorth.alignment.error_budget import horizontal_earth_rate
from gyronorth.alignment.problem import Problem
from gyronorth.alignment.result import Posterior, Result
from gyronorth.angles import angle_error
from gyronorth.deviation import DeviationModel, rate_surplus
from gyronorth.errors import InputError
from gyronorth.findings import Finding
from gyronorth.uncertainty import NORMAL_975, SIGMA_UNKNOWN

#: A deviation curve applies within this of the latitude it was measured at, rad.
DEVIATION_LATITUDE = np.radians(2.0)
#: And of one of its headings, rad: in the middle between the six that it takes at least one is 30 deg off.
DEVIATION_SUPPORT = np.radians(45.0)


def corrected(result: Result, problem: Problem, model: DeviationModel) -> Result:
    """The closed form of one recording corrected by a deviation curve, where the recording belongs to its set.

    Raises
    ------
    InputError
        If the curve was measured at another latitude.

    Notes
    -----
    The curve's sigma holds the noise of recordings as long as those fitted to; a shorter one adds what it
    has more. Outside the set nothing is corrected and nothing changes.
    """
    if model.latitude is not None and abs(model.latitude - problem.latitude) > DEVIATION_LATITUDE:
        raise InputError(
            f"The deviation curve was measured at latitude {np.degrees(model.latitude):.2f} deg, this recording is of "
            f"{np.degrees(problem.latitude):.2f} deg: the same bias costs another angle there. Measure a new curve."
        )
    off = float(np.min(np.abs(angle_error(model.heading, result.attitude.heading))))
    in_set = model.covers(problem.session)
    if in_set and off <= DEVIATION_SUPPORT:
        message = (
            f"Corrected by a deviation curve of {len(model.heading)} recordings; it holds for that unit and session."
        )
        return _applied(result, problem, model, Finding("deviation_applied", message))
    if in_set:
        message = (
            f"The nearest heading of the deviation curve is {np.degrees(off):.0f} deg away; within "
            f"{np.degrees(DEVIATION_SUPPORT):.0f} deg it is believed: not applied."
        )
    else:
        message = (
            f"The deviation curve was measured in session {_named(model.session)}, this recording is of "
            f"{_named(problem.session)}: not applied. Where both are of one power-up session, say so: --deviation FILE "
            "--any-session."
        )
    return replace(result, findings=(*result.findings, Finding("deviation_unused", message)))


def _applied(result: Result, problem: Problem, model: DeviationModel, finding: Finding) -> Result:
    found = result.attitude
    heading, sigma = model.correct(found.heading, rate_surplus(found.rate_l, problem.latitude))
    signal = horizontal_earth_rate(problem.latitude)
    shortfall = 0.0 if model.duration is None else max(1 - problem.duration / model.duration, 0.0)
    variance = {
        "deviation": np.asarray((sigma[0] * signal) ** 2),
        "noise": shortfall * result.variance["noise"],
        "sway": result.variance["sway"],
    }
    spread = min(float(np.sqrt(sum(variance.values()))) / signal, SIGMA_UNKNOWN)
    return replace(
        result,
        attitude=replace(found, heading=np.asarray(heading[0])),
        posterior=Posterior.symmetric(spread, min(NORMAL_975 * spread, np.pi)),
        variance=variance,
        arm=np.asarray(signal),
        findings=(*result.findings, finding),
    )


def _named(session: str | None) -> str:
    return "not stated" if session is None else repr(session)
