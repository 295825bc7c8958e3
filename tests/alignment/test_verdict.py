"""The verdict: intervals on the circle, reasons in their order, one batch from many groups."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from gyronorth.alignment import registry, verdict
from gyronorth.alignment.problem import Problem
from gyronorth.alignment.result import Posterior
from gyronorth.findings import Finding
from gyronorth.sensor import read_sensor
from gyronorth.simulation import simulate

SENSOR = read_sensor("isa100c")


def problem(seed=0, *, heading=0.01):
    rng = np.random.default_rng(seed)
    made = simulate("isa100c", latitude=0.56, heading=heading, duration=100, rate_hz=5, rng=rng)
    return Problem(made.gyro_b, made.accel_b, 5.0, 0.56, SENSOR)


def solved(given, method="mean"):
    return registry.solve(method, given, registry.Options())


def test_an_interval_across_north_has_low_above_high_and_stays_skewed():
    given = problem()
    result = solved(given)
    skewed = replace(
        result,
        attitude=replace(result.attitude, heading=np.asarray(0.01)),
        posterior=Posterior(np.asarray(0.02), np.asarray(-0.03), np.asarray(0.07)),
    )
    found = verdict.estimate(given, skewed)
    assert_allclose(found.interval95, (2 * np.pi - 0.02, 0.08))
    assert found.sigma == 0.02


def test_what_the_method_refuses_comes_before_the_gates_and_notes_are_warnings():
    given = problem()
    own = Finding("motion", "It moved.", 2.0, 1.0)
    result = replace(solved(given), refusals=(own,))
    note = Finding("rows_dropped", "3 rows were left out.", 3.0)
    loud = replace(given, gyro_b=given.gyro_b * 3)
    found = verdict.estimate(loud, replace(solved(loud), refusals=(own,)), notes=(note,))
    assert [reason.code for reason in found.reasons] == ["motion", "rate_norm"]
    assert note in found.warnings
    assert not verdict.estimate(given, result).valid


def test_peaks_that_the_samples_do_not_show_saturate():
    given = problem()
    peaks = (np.asarray(2 * SENSOR.gyro.saturation), None)
    assert "saturated" in {reason.code for reason in verdict.estimate(given, solved(given), peaks=peaks).reasons}


def test_a_batch_puts_each_group_in_its_place():
    one, two = problem(1, heading=1.0), problem(2, heading=2.0)
    both = replace(one, gyro_b=np.stack([one.gyro_b, two.gyro_b]), accel_b=np.stack([one.accel_b, two.accel_b]))
    first, second = np.array([True, False]), np.array([False, True])
    found = verdict.batch(both, [(second, two, solved(two, "inertial")), (first, one, solved(one))])
    assert found.method.tolist() == ["mean", "inertial"]
    assert_allclose(found.heading, [solved(one).attitude.heading, solved(two, "inertial").attitude.heading])
    assert found.valid.all()


def test_a_refusal_says_why_and_claims_nothing():
    reason = Finding("too_short", "No sample has come yet.")
    found = verdict.refusal(reason, method="auto", latitude=0.5, duration=0.0, rate_hz=10.0, sensor=None)
    assert found.heading is found.sigma is None
    assert found.interval95 == (0.0, 2 * np.pi)
    assert found.reasons == (reason,)
