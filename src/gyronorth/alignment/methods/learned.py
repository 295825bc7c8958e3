"""Models that a network proposes, weighed by evidence; or the closed form with the curve that a bundle learned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gyronorth.alignment import correction
from gyronorth.alignment.error_budget import averaged_over_models
from gyronorth.alignment.networks.bundle import RecordingFacts, mismatch
from gyronorth.alignment.networks.runtime import LearnedHeadings, LoadedBundle, bundle_of, mismatched, solve
from gyronorth.alignment.problem import Problem
from gyronorth.alignment.registry import METHODS, Options
from gyronorth.alignment.result import Posterior, Result
from gyronorth.alignment.tones.search import white_of
from gyronorth.catalogue import method_info
from gyronorth.estimate import DisturbanceFound
from gyronorth.findings import Finding

#: Said where `learned` cannot explain the recording.
UNEXPLAINED = "The disturbance is of no kind that was learned; sigma is widened by what stays unexplained."


class Learned:
    """Proposals of a network, weighed by closed-form evidence."""

    info = method_info("learned")

    def solve(self, problem: Problem, options: Options) -> Result:
        """Heading of a disturbed recording and what disturbs it; or the correction that the bundle carries."""
        return self.solve_many([problem], options)[0]

    def solve_many(self, problems: Sequence[Problem], options: Options) -> list[Result]:
        """The same of several recordings of one length, rate and latitude, side by side."""
        bundle = bundle_of("learned", options.bundle)
        if bundle.deviation is not None:
            return [self._corrected(problem, bundle) for problem in problems]
        first = problems[0]
        misfits = mismatch(bundle.info, RecordingFacts(first.rate_hz, first.duration, first.latitude))
        if misfits:
            return [mismatched("learned", problem.mean, bundle, misfits) for problem in problems]
        gyro_l = np.stack([problem.rate_l() for problem in problems])
        errors = None if first.sensor is None else first.sensor.gyro
        solved = solve(bundle, gyro_l, rate_hz=first.rate_hz, latitude=first.latitude, errors=errors)
        return [self._result(problem, solved, number, bundle) for number, problem in enumerate(problems)]

    def _result(self, problem: Problem, solved: LearnedHeadings, number: int, bundle: LoadedBundle) -> Result:
        """The result of one of the recordings."""
        one = solved.found[number]
        attitude = replace(problem.mean, heading=solved.heading[number], rate_l=one.rate_l)
        low, high = np.minimum(solved.low[number], 0.0), np.maximum(solved.high[number], 0.0)
        slow = problem.rate_l(solved.rate_hz)
        white = np.asarray(white_of(slow) ** 2 / len(slow))
        posterior = Posterior(solved.sigma[number], low, high)
        result = averaged_over_models(problem, attitude, posterior, method="learned", white=white)
        masked, ratio = one.bumps / solved.rate_hz, float(np.sqrt(one.excess))
        found = DisturbanceFound(one.tones, one.settling, one.tilt, one.walk, masked, ratio, bool(solved.fits[number]))
        findings = () if found.explained else (Finding("swaying", UNEXPLAINED),)
        return replace(result, bundle=bundle.name, disturbance=found, findings=findings)

    def _corrected(self, problem: Problem, bundle: LoadedBundle) -> Result:
        """The closed form with the correction that a bundle learned from its unit's own recordings."""
        assert bundle.deviation is not None
        sensor = None if problem.sensor is None else problem.sensor.name
        facts = RecordingFacts(problem.rate_hz, problem.duration, problem.latitude, sensor)
        misfits = mismatch(bundle.info, facts)
        if misfits:
            return mismatched("learned", problem.mean, bundle, misfits)
        closed = replace(METHODS["mean"].solve(problem, Options()), bundle=bundle.name)
        return replace(correction.corrected(closed, problem, bundle.deviation), method="learned")


METHOD = Learned()
