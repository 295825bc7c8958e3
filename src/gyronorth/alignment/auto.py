"""The choice among the methods: by the poses, the motion and the slow change that a recording shows."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec

import numpy as np

from gyronorth.alignment.gates import judge_result
from gyronorth.alignment.methods.inertial import MOTION_RATIO
from gyronorth.alignment.motion import drift_detected
from gyronorth.alignment.problem import Problem
from gyronorth.alignment.registry import METHODS, Options, fits
from gyronorth.alignment.result import Result
from gyronorth.alignment.turned.segments import Segments
from gyronorth.arrays import Mask
from gyronorth.catalogue import method_info
from gyronorth.errors import InputError

#: Probability that the bias settles or walks from which auto takes no method that holds it constant.
UNSTEADY = 0.5
#: Share of the gyro's angle variance that the accelerometer's tilt has to have, for it to see the motion.
SEEN_SHARE = 0.5
#: Why the mean answers where nothing speaks against it.
UNDISTURBED = "one pose, undisturbed"


class Auto:
    """One more method, which asks the others."""

    info = method_info("auto")

    def solve(self, problem: Problem, options: Options) -> Result:
        """`turned` where there are poses; else the mean, or under disturbance what claims most and is not refused."""
        if problem.attitude is None and problem.segments.poses > 1:
            return replace(METHODS["turned"].solve(problem, options), why=_counted(problem.segments))
        if options.turn_angles is not None:
            raise InputError("Turn angles were given, but the recording holds one pose only. Leave them out.")
        return self._of_one_pose(problem)

    def leaves(self, problem: Problem) -> tuple[str, Mask]:
        """Recordings of a batch that the mean answers outright."""
        plain = ~problem.motion.detected & ~_changes_slowly(problem)
        if problem.sensor is None and problem.accel_b is not None and problem.attitude is None:
            plain[:] = False  # gravity's trace has to say whether the gyro's noise is motion
        if problem.attitude is None:
            for index in np.flatnonzero(plain):
                plain[index] = problem[index].segments.poses <= 1
        return "mean", plain

    def left(self, result: Result) -> Result:
        """The mean's result, with the reason why it answers."""
        return replace(result, why=UNDISTURBED)

    def _of_one_pose(self, problem: Problem) -> Result:
        mean, motion = METHODS["mean"].solve(problem, Options()), problem.motion
        detected = bool(motion.detected)
        traced = None
        if problem.accel_b is not None and problem.attitude is None and (detected or problem.sensor is None):
            traced = METHODS["inertial"].solve(problem, Options())
        disturbed = detected or (traced is not None and _noise_is_motion(problem, mean, traced))
        modelled = _modelled(problem) if detected or bool(_changes_slowly(problem)) else None
        found = None if modelled is None else modelled.disturbance
        seen = traced is not None and bool(_seen_by_the_accelerometer(problem))
        drifts = found is not None and found.drift_probability >= UNSTEADY
        # What the accelerometer sees of the motion decides, unless the model explains all of it and finds a drift too.
        if modelled is not None and found is not None and drifts and (found.explained or not seen):
            why = f"one pose: the bias settles or walks with probability {found.drift_probability:.2f}"
            return replace(modelled, why=f"{why}, which mean and inertial would take for Earth rate")
        if not disturbed:
            return replace(mean, why=UNDISTURBED)
        if traced is not None and seen:
            why = "one pose, disturbed: the accelerometer sees the motion, and gravity is traced through it"
            return replace(traced, why=why, disturbance=found)
        candidates = [result for result in (mean, traced, modelled) if result is not None]
        sigmas = ", ".join(
            f"{np.degrees(float(result.posterior.sigma)):.2f} deg by {result.method}" for result in candidates
        )
        usable = [result for result in candidates if not _refused(problem, result)]
        best = min(usable or candidates, key=lambda result: float(result.posterior.sigma))
        return replace(best, why=f"one pose, disturbed: sigma {sigmas}", disturbance=found)


def _seen_by_the_accelerometer(problem: Problem) -> Mask:
    """Where there is motion and the accelerometer explains it: methods that are blind to it have no say.

    Its tilt and the gyro's angle share most of their variance, or its trend exceeds what noise and drift leave it.
    """
    motion = problem.motion
    shared = motion.sway.tilt_variance > SEEN_SHARE * motion.sway.gyro_variance
    return np.asarray(motion.detected & (shared | (motion.tilt > motion.tilt_limit)))


def _refused(problem: Problem, result: Result) -> bool:
    gates = judge_result(problem, result, METHODS.info(result.method).gates)
    return bool(result.refusals) or any(bool(gate.failed) for gate in gates)


def _noise_is_motion(problem: Problem, mean: Result, traced: Result) -> bool:
    """Whether, without a profile, the gyro is so noisy beside gravity's trace that its noise is motion."""
    if problem.sensor is not None:
        return False
    quiet = traced.variance["noise"] < MOTION_RATIO * problem.motion.white
    return bool(quiet & (traced.posterior.sigma < mean.posterior.sigma))


def _changes_slowly(problem: Problem) -> Mask:
    if problem.sensor is None:
        return np.zeros(problem.shape, dtype=bool)
    return drift_detected(problem.gyro_b, rate_hz=problem.rate_hz, errors=problem.sensor.gyro)


def _modelled(problem: Problem) -> Result | None:
    """The method that models disturbance: learned, or bayes where it cannot run or explain the recording.

    None where neither takes the recording, or `learned` cannot explain one that is too long for `bayes`. Where
    `learned` is not installed, `bayes` sees the end of such a one, and the beginning, where a bias settles.
    """
    installed = find_spec("onnxruntime") is not None
    if installed:
        result = METHODS["learned"].solve(problem, Options())
        if result.disturbance is not None and result.disturbance.explained:
            return result
    bayes = METHODS["bayes"]
    if fits(bayes.info, problem):
        return bayes.solve(problem, Options())
    begin, end = (problem.part(seconds) for seconds in (bayes.info.longest_s, -bayes.info.longest_s))
    if fits(bayes.info, end) and not installed:
        first, last = bayes.solve(begin, Options()).disturbance, bayes.solve(end, Options())
        assert first is not None
        assert last.disturbance is not None
        worse = max(first, last.disturbance, key=lambda found: found.drift_probability)
        return replace(last, disturbance=worse)
    return None


def _counted(segments: Segments) -> str:
    """Poses and steady rotations in words."""
    spins = sum(turn.spin for turn in segments.turns)
    counts = ((segments.poses - spins, "pose"), (spins, "steady rotation"))
    return " and ".join(f"{count} {name}{'s' * (count > 1)}" for count, name in counts if count)


METHOD = Auto()
