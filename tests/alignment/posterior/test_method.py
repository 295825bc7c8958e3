"""The method posterior through the public door: refusals, words, and the parts of sigma."""

from dataclasses import replace

import numpy as np
import pytest

from gyronorth.angles import DEG_PER_HOUR
from gyronorth.pipeline import heading
from gyronorth.recording import Recording
from gyronorth.sensor import read_sensor
from gyronorth.simulation import Motion, simulate, simulate_batch


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


@pytest.mark.slow
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
    honest = heading(made, latitude=np.radians(48), sensor="isa100c", method="posterior")
    assert "profile_scaled" not in {warning.code for warning in honest.warnings}
    made = replace(made, gyro_b=made.gyro_b + np.array([0.2, -0.3, 0.3]) * DEG_PER_HOUR)
    found = heading(made, latitude=np.radians(48), sensor="isa100c", method="posterior")
    told = {warning.code: warning for warning in found.warnings}
    assert "profile_scaled" in told
    assert "times its profile" in told["profile_scaled"].message
    assert "times its profile" in found.method_reason
    # 5.4 times the turn-on bias, root mean square; a bias that settles over more than the recording is counted in.
    assert 3.5 < told["profile_scaled"].value < 11
    low, high = found.interval95
    assert (1.0 - low) % (2 * np.pi) <= (high - low) % (2 * np.pi)


def test_the_density_is_handed_on_and_holds_what_the_interval_says():
    found = heading(recording("isa100c", 48, 4), latitude=np.radians(48), sensor="isa100c")
    angle = np.unwrap(found.posterior.heading) - found.heading
    angle -= 2 * np.pi * np.round(np.mean(angle) / (2 * np.pi))
    step = np.diff(angle)
    np.testing.assert_allclose(step, step[0], rtol=1e-6)
    mass = found.posterior.density * step[0]
    assert mass.sum() == pytest.approx(1, rel=1e-9)
    assert mass @ np.sin(angle) == pytest.approx(0, abs=1e-3 * found.sigma)
    # Sigma also counts what lies beyond the grid, a thousandth of the mass at most.
    assert 0.95 * found.sigma < np.sqrt(mass @ angle**2) <= found.sigma * (1 + 1e-3)
    low, high = (end - found.heading for end in found.interval95)
    assert np.interp(high, angle, np.cumsum(mass)) - np.interp(low, angle, np.cumsum(mass)) == pytest.approx(
        0.95, abs=0.02
    )
    asked = found.to_json(posterior=True)["posterior"]
    np.testing.assert_allclose(asked["heading_deg"], np.degrees(found.posterior.heading), atol=1e-6)
    np.testing.assert_allclose(asked["density_per_deg"], np.radians(found.posterior.density), rtol=1e-5)
    assert "posterior" not in found.to_json()
    mean = heading(recording("isa100c", 48, 4), latitude=np.radians(48), sensor="isa100c", method="mean")
    assert mean.to_json(posterior=True)["posterior"] is None


@pytest.mark.slow
@pytest.mark.parametrize("accel", [True, False])
def test_a_nudge_in_azimuth_refuses_nothing_and_the_heading_is_that_at_the_end(accel):
    """The step of the yaw is no vertical rate: as a mean it would be 0.3 deg in 300 s, a quarter of Earth rate."""
    latitude, rate_hz, nudge = np.radians(48), 2.0, np.radians(0.3)

    def moves(times, *, runs, rng):
        angle = np.zeros((runs, len(times), 3))
        angle[:, times > 140, 2] = nudge
        return angle

    gyro_b, accel_b = simulate_batch(
        read_sensor("isa100c"), runs=12, latitude=latitude, heading=np.full(12, 1.0), duration=300.0, rate_hz=rate_hz,
        rng=np.random.default_rng(8), motion=Motion(disturbance=moves), accel=accel,
    )  # fmt: skip
    records = [Recording(g, None if accel_b is None else accel_b[i], rate_hz) for i, g in enumerate(gyro_b)]
    found = [heading(one, latitude=latitude, sensor="isa100c") for one in records]
    assert all(one.valid for one in found)
    arcs = [(one.interval95[0], np.diff(one.interval95)[0] % (2 * np.pi)) for one in found]
    assert sum((1.0 + nudge - low) % (2 * np.pi) <= wide for low, wide in arcs) >= 9
    assert np.mean([one.sigma for one in found]) < np.radians(1.0)


def test_a_force_without_gravity_is_refused():
    """As logged by programs that take gravity out: what is left has any direction."""
    rng = np.random.default_rng(3)
    gyro_b, accel_b = simulate_batch(
        "hg9900", runs=1, latitude=np.radians(48.0), heading=1.0, duration=100.0, rate_hz=10.0, rng=rng
    )
    bare = Recording(gyro_b=gyro_b[0], accel_b=accel_b[0] - accel_b[0].mean(axis=0), rate_hz=10.0)
    estimate = heading(bare, latitude=np.radians(48.0), sensor="hg9900", method="posterior")
    assert "gravity" in [reason.code for reason in estimate.reasons]
