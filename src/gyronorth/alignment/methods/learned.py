"""Models that a network proposes, weighed by evidence; or the closed form with the curve that a bundle learned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gyronorth.alignment import correction
from gyronorth.alignment.error_budget import averaged_over_models
from gyronorth.alignment.networks.bundle import RecordingFacts, mismatch
from gyronorth.alignment.networks.runtime import LoadedBundle, bundle_of, mismatched, solve
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
        bundle = bundle_of("learned", options.bundle)
        if bundle.deviation is not None:
            return self._corrected(problem, bundle)
        misfits = mismatch(bundle.info, RecordingFacts(problem.rate_hz, problem.duration, problem.latitude))
        if misfits:
            return mismatched("learned", problem.mean, bundle, misfits)
        gyro_l = problem.rate_l()
        errors = None if problem.sensor is None else problem.sensor.gyro
        solved = solve(bundle, gyro_l[None], rate_hz=problem.rate_hz, latitude=problem.latitude, errors=errors)
        one = solved.found[0]
        attitude = replace(problem.mean, heading=solved.heading[0], rate_l=one.rate_l)
        posterior = Posterior(solved.sigma[0], np.minimum(solved.low[0], 0.0), np.maximum(solved.high[0], 0.0))
        slow = problem.rate_l(solved.rate_hz)
        white = np.asarray(white_of(slow) ** 2 / len(slow))
        result = averaged_over_models(problem, attitude, posterior, method="learned", white=white)
        masked, ratio = one.bumps / solved.rate_hz, float(np.sqrt(one.excess))
        found = DisturbanceFound(one.tones, one.settling, one.tilt, one.walk, masked, ratio, bool(solved.fits[0]))
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
