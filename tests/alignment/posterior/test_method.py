"""The method posterior through the public door: refusals, words, and the parts of sigma."""

from dataclasses import replace

import numpy as np
import pytest

from gyronorth.angles import DEG_PER_HOUR
from gyronorth.pipeline import heading
from gyronorth.simulation import simulate


def recording(sensor, latitude_deg, seed, duration=100.0):
    made = simulate(
        sensor,
        latitude=np.radians(latitude_deg),
        heading=1.0,
        duration=duration,
        rate_hz=10,
        rng=np.random.default_rng(seed),
    )
    return replace(made, latitude=None)


@pytest.mark.parametrize("seed", range(4))
def test_a_broken_unit_and_a_wrong_latitude_are_no_scale_of_the_profile(seed):
    made = recording("stim300", 45, seed)
    made = replace(made, gyro_b=made.gyro_b + np.array([250.0, 0.0, 0.0]) * DEG_PER_HOUR)
    found = heading(made, latitude=np.radians(45), sensor="stim300", method="posterior")
    assert "rate_norm" in {reason.code for reason in found.reasons}
    for sensor in ("hg9900", "isa100c", "sdc500"):
        found = heading(recording(sensor, 20, seed), latitude=np.radians(70), sensor=sensor, method="posterior")
        codes = {reason.code for reason in found.reasons}
        # Of sdc500 the interval may be wider than what tells north from south as well, or instead.
        assert "implied_latitude" in codes or (sensor == "sdc500" and codes & {"near_pole", "too_noisy"})


def test_the_parts_of_sigma_are_its_root_sum_square():
    for sensor in ("isa100c", None):
        found = heading(recording("isa100c", 48, 3), latitude=np.radians(48), sensor=sensor, method="posterior")
        assert found.valid
        whole = np.sqrt(sum(part**2 for part in found.sigma_parts.values()))
        assert whole == pytest.approx(found.sigma, rel=1e-6)
        assert found.method_reason.startswith("one pose")


def test_it_says_how_far_a_unit_is_from_its_profile():
    made = recording("isa100c", 48, 5)
    made = replace(made, gyro_b=made.gyro_b + np.array([0.2, -0.3, 0.3]) * DEG_PER_HOUR)
    found = heading(made, latitude=np.radians(48), sensor="isa100c", method="posterior")
    told = {warning.code: warning for warning in found.warnings}
    assert "profile_scaled" in told
    assert "times its profile" in told["profile_scaled"].message
    assert "times its profile" in found.method_reason
    low, high = found.interval95
    assert (1.0 - low) % (2 * np.pi) <= (high - low) % (2 * np.pi)
