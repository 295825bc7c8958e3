"""Which gate judges which result: the one table, and the one place where it is gone through.

A gate is a function of `gates` or `outputs`, and has a name here. The catalogue's row of a method names those that
judge its results; those of `OF_EVERY_RECORDING` judge all.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from gyronorth.alignment.error_budget import level_sigma
from gyronorth.alignment.gates import Gate, gimbal_gate, motion_gate, rate_gates, saturation_gates, width_gates
from gyronorth.alignment.outputs import output_gates
from gyronorth.alignment.problem import Problem
from gyronorth.alignment.registry import METHODS
from gyronorth.alignment.result import Result
from gyronorth.arrays import Array

#: Largest component of the angular rate, rad/s, and of the specific force, m/s^2, of each recording.
Peaks = tuple[Array, Array | None]
#: Tilt that an accelerometer sees of a unit that turned about a level axis, root mean square over the largest angle of
#: the integrated rate.
SEEN = 0.1


def _rate(problem: Problem, result: Result, _: Peaks | None) -> list[Gate]:
    if result.judged is None:
        return []
    return rate_gates(
        result.judged.rate_l,
        variance=result.judged.variance,
        vertical_variance=result.judged.vertical_variance,
        latitude=problem.latitude,
        known=problem.sensor is not None,
    )


def _width(problem: Problem, result: Result, _: Peaks | None) -> list[Gate]:
    half = result.posterior.half_width
    return width_gates(
        half,
        variance=result.total + np.zeros_like(half),
        noise_variance=result.variance.get("noise", np.zeros(())) + np.zeros_like(half),
        latitude=problem.latitude,
        duration=problem.duration,
    )


def _motion(problem: Problem, result: Result, _: Peaks | None) -> list[Gate]:
    if result.judged is None:
        return []
    excursion, tilted = problem.motion.sway.excursion, None
    if problem.accel_b is not None:
        seen = np.hypot(np.sqrt(np.maximum(problem.motion.sway.tilt_variance, 0)), problem.motion.tilt)
        tilted = bool(np.any(seen > SEEN * excursion))
    return [motion_gate(excursion, result.judged.turn_limit, tilted=tilted)]


def _pitch(problem: Problem, result: Result, _: Peaks | None) -> list[Gate]:
    return [gimbal_gate(result.attitude.pitch, level_sigma(problem))] if result.known else []


def _range(problem: Problem, _: Result, peaks: Peaks | None) -> list[Gate]:
    return saturation_gates(problem.sensor, peaks_of(problem) if peaks is None else peaks)


def _outputs(problem: Problem, _: Result, __: Peaks | None) -> list[Gate]:
    return output_gates(problem)


#: What may judge a result: the gates of a problem, its result and the peaks of the outputs.
GATES: Mapping[str, Callable[[Problem, Result, Peaks | None], list[Gate]]] = {
    "rate": _rate,
    "width": _width,
    "motion": _motion,
    "pitch": _pitch,
    "range": _range,
    "outputs": _outputs,
}
#: Names of those that judge every recording, whichever method answered.
OF_EVERY_RECORDING = ("pitch", "range", "outputs")


def judge(problem: Problem, result: Result, *, peaks: Peaks | None = None) -> list[Gate]:
    """Every gate that judges a result: those of its method, then those of every recording.

    Parameters
    ----------
    problem : Problem
    result : Result
    peaks : tuple, optional
        Largest output of gyro and accelerometer, where the problem's samples are means that do not show it.
    """
    return judge_claim(problem, result) + _gates(OF_EVERY_RECORDING, problem, result, peaks)


def judge_claim(problem: Problem, result: Result) -> list[Gate]:
    """The gates of the method on its result; none where there is no heading, or no claim to judge."""
    if not result.known or not result.variance:
        return []
    return _gates(METHODS.info(result.method).gates, problem, result, None)


def peaks_of(problem: Problem) -> Peaks:
    """The peaks that the samples show."""
    accel_b = problem.accel_b
    return _peak(problem.gyro_b), None if accel_b is None else _peak(accel_b)


def _gates(names: Sequence[str], problem: Problem, result: Result, peaks: Peaks | None) -> list[Gate]:
    return [gate for name in names for gate in GATES[name](problem, result, peaks)]


def _peak(x: Array) -> Array:
    """Largest absolute value of each recording, without a copy of it."""
    return np.maximum(x.max(axis=(-2, -1)), -x.min(axis=(-2, -1)))
