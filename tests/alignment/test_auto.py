"""The choice of auto: poses or one posterior, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from gyronorth.alignment import registry
from gyronorth.alignment.problem import Problem
from gyronorth.errors import InputError
from gyronorth.sensor import read_sensor
from gyronorth.simulation import Motion, simulate

LATITUDE = 0.56


def problem(sensor="isa100c", *, seed=0, motion=None, duration=100.0, accel=True):
    rng = np.random.default_rng(seed)
    made = simulate(
        sensor, latitude=LATITUDE, heading=1.0, duration=duration, rate_hz=3, rng=rng, motion=motion, accel=accel
    )
    return Problem(made.gyro_b, made.accel_b, 3.0, LATITUDE, read_sensor(sensor))


def chosen(given, **options):
    return registry.solve("auto", given, registry.Options(**options))


def rolling(times, *, runs, rng):
    """5 arcmin rms about every axis, each with a frequency of its own: more than two tones."""
    frequency = np.exp(rng.uniform(np.log(0.02), np.log(0.5), (runs, 1, 3)))
    phase = rng.uniform(0, 2 * np.pi, (runs, 1, 3))
    return np.radians(5 / 60) * np.sqrt(2) * np.sin(2 * np.pi * frequency * times[:, None] + phase)


def test_one_pose_has_one_posterior():
    result = chosen(problem(seed=1))
    assert (result.method, result.why) == ("posterior", "one pose, undisturbed")


def test_two_poses_are_turned():
    assert chosen(problem(motion=Motion(turns=((45.0, 10.0, np.pi),)))).method == "turned"


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_what_the_accelerometer_sees_is_no_earth_rate(seed):
    result = chosen(problem("hg9900", seed=seed, motion=Motion(disturbance=rolling)))
    assert "sway" in result.why
    assert_allclose(result.attitude.heading, 1.0, atol=4 * float(result.posterior.sigma))
    assert result.posterior.sigma < np.radians(1.0)


@pytest.mark.slow
def test_bayes_says_where_it_does_not_explain_a_recording():
    explained = registry.solve("bayes", problem(seed=1), registry.Options()).disturbance
    wild = problem("hg9900", seed=1, motion=Motion(disturbance=rolling))
    unexplained = registry.solve("bayes", wild, registry.Options()).disturbance
    assert explained is not None
    assert explained.explained
    assert unexplained is not None
    assert not unexplained.explained


def test_turn_angles_of_one_pose_are_refused():
    with pytest.raises(InputError, match="one pose only"):
        chosen(problem(), turn_angles=(np.pi,))
