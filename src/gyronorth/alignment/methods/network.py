"""The paper's networks: denoiser and heading network (`paper`), and the heading network alone (`baseline`)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gyronorth import catalogue
from gyronorth.alignment.error_budget import horizontal_earth_rate
from gyronorth.alignment.judging import judge_claim
from gyronorth.alignment.networks.runtime import (
    LoadedBundle,
    bundle_of,
    last_window,
    misfits,
    mismatched,
    run,
)
from gyronorth.alignment.problem import Problem
from gyronorth.alignment.registry import METHODS, Options
from gyronorth.alignment.result import Posterior, Result
from gyronorth.angles import angle_error
from gyronorth.conditioning import GATE_SIGMA
from gyronorth.errors import InputError
from gyronorth.findings import Finding
from gyronorth.uncertainty import NORMAL_975, SIGMA_UNKNOWN, von_mises


class NetworkMethod:
    """A trained heading network, with the error it had on recordings it had not seen."""

    def __init__(self, name: str) -> None:
        self.info = catalogue.method_info(name)

    def solve(self, problem: Problem, options: Options) -> Result:
        """Heading of the bundle's last window.

        A network claims no uncertainty of its own. Its sigma is the cyclic root mean square error on
        the bundle's test recordings, or its validation ones, or none at all, widened by Student's t for
        their number. A recording whose mean is not Earth rate, or that moved, is refused as it is for the closed form.
        """
        name = self.info.name
        bundle = bundle_of(name, options.bundle)
        trained = {info.name for info in catalogue.METHODS if info.takes_bundle}
        if bundle.info.method in trained - {name}:
            raise InputError(
                f"The bundle {bundle.name} is one of method {bundle.info.method}, but method {name} was asked for. "
                f"Use --method {bundle.info.method} with it."
            )
        findings = _own_error(bundle)
        gyro_l = problem.rate_l()
        sensor = None if problem.sensor is None else problem.sensor.name
        off = misfits(bundle, gyro_l, rate_hz=problem.rate_hz, latitude=problem.latitude, sensor=sensor)
        if off:
            return replace(mismatched(name, problem.mean, bundle, off), findings=findings)
        heading = run(bundle, last_window(bundle, gyro_l[None], rate_hz=problem.rate_hz))[0]
        posterior = _posterior(bundle)
        signal = horizontal_earth_rate(problem.latitude)
        return Result(
            name,
            replace(problem.mean, heading=np.asarray(heading)),
            posterior,
            {"network": np.asarray((posterior.sigma * signal) ** 2)},
            np.asarray(signal),
            judged=METHODS["mean"].solve(problem, Options()).judged,
            refusals=_contradiction(problem, float(heading), posterior, bundle.name),
            findings=findings,
            bundle=bundle.name,
        )


def _posterior(bundle: LoadedBundle) -> Posterior:
    """Sigma and interval that the errors of a bundle on its own test recordings deserve."""
    from scipy.special import stdtrit

    metrics = bundle.info.metrics
    part = "test" if metrics.get("test_network_crmse_deg") else "validation"
    error, count = metrics.get(f"{part}_network_crmse_deg"), metrics.get(f"{part}_recordings") or 1.0
    if error is None or not (error > 0 and count >= 1):
        return Posterior.unknown()
    sigma = min(float(np.radians(error) * stdtrit(count, 0.975) / NORMAL_975), SIGMA_UNKNOWN)
    return Posterior.symmetric(*von_mises(np.asarray(1 / sigma**2)))


def _contradiction(problem: Problem, heading: float, posterior: Posterior, bundle: str) -> tuple[Finding, ...]:
    """A heading further from a closed form that can be believed than both sigmas explain."""
    beside = METHODS["mean"].solve(problem, Options())
    closed = float(beside.attitude.heading)
    off = abs(float(angle_error(heading, closed)))
    limit = GATE_SIGMA * float(np.hypot(posterior.sigma, beside.posterior.sigma))
    believed = not any(gate.failed for gate in judge_claim(problem, beside))
    if not (believed and off > limit):
        return ()
    message = (
        f"The bundle {bundle} says {np.degrees(heading):.1f} deg, the mean rate {np.degrees(closed):.1f} deg: "
        f"{np.degrees(off):.1f} deg apart, where both sigmas allow {np.degrees(limit):.1f} deg. Likely the network was "
        "trained for another unit or place."
    )
    return (Finding("network_contradicts", message, float(np.degrees(off)), float(np.degrees(limit))),)


def _own_error(bundle: LoadedBundle) -> tuple[Finding, ...]:
    """That a network has learned one unit's own error with everything else."""
    domain = bundle.info.domain
    if domain.unit is None and domain.session is None:
        return ()
    unit, session = domain.unit or "not stated", domain.session or "not stated"
    message = (
        f"The bundle {bundle.name} was trained on unit {unit}, session {session}: part of what it learned is that "
        "unit's own error and holds for no other."
    )
    return (Finding("deviation_applied", message),)


def method(name: str) -> NetworkMethod:
    """The method of a name."""
    return NetworkMethod(name)
