"""A heading that is carried on while the unit moves: where it points, and by how much its sigma grows."""

from __future__ import annotations

from dataclasses import replace
from math import radians

import numpy as np
import pytest

import gyronorth as gn
from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR
from gyronorth.attitude import mat_bn, quaternion_nb, rotate
from gyronorth.live.holding import GUARD, LARGEST_SIGMA, Holding
from gyronorth.sensor import Sensor, read_sensor
from gyronorth.sensor.model import TriadErrors
from gyronorth.simulation import Motion, simulate

LATITUDE, RATE_HZ, STAND = radians(48.0), 20.0, 120.0
TURN = radians(75.0)
WHITE = Sensor("white", TriadErrors(white=0.02 * DEG_PER_SQRT_HOUR, turn_on_bias=0.05 * DEG_PER_HOUR))


def recording(sensor, *, turn=TURN, after=60.0, seed=0):
    """A stand, a turn of 5 s, and a second stand."""
    motion = Motion(turns=((STAND, 5.0, turn),))
    return simulate(
        sensor=sensor, latitude=LATITUDE, heading=radians(350.0), roll=radians(2.0), pitch=radians(-3.0),
        duration=STAND + 5.0 + after, rate_hz=RATE_HZ, motion=motion, rng=np.random.default_rng(seed),
    )  # fmt: skip


def stood(recording, sensor, *, until=STAND, profile=WHITE):
    """Holding that has seen the stand and two estimates of it, and the second of these."""
    holding = Holding(RATE_HZ, LATITUDE, profile and sensor)
    early, late = (round((until - wait) * RATE_HZ) for wait in (GUARD + 1, 0))
    for first, last in ((0, early), (early, late)):
        holding.add(recording.gyro_b[first:last])
        found = gn.heading(recording.window(0, last / RATE_HZ), sensor=sensor, method="mean")
        assert found.valid
        holding.found(found, last)
    return holding, found


def test_the_quaternion_is_the_matrix():
    angles = np.random.default_rng(1).uniform(-3, 3, (3, 20))
    vector = np.random.default_rng(2).standard_normal((20, 3))
    expected = (np.swapaxes(mat_bn(*angles), -1, -2) @ vector[..., None])[..., 0]
    assert rotate(quaternion_nb(*angles), vector) == pytest.approx(expected, abs=1e-12)


def test_the_heading_follows_the_turn():
    held_up = recording(WHITE)
    holding, found = stood(held_up, WHITE)
    assert holding.held(found, limit=None) is None  # nothing moves: the estimate says it all
    assert holding.rate_of_turn == pytest.approx(0, abs=radians(0.05))
    at = round(STAND * RATE_HZ)
    for first in range(at, at + round(2.5 * RATE_HZ), 5):
        holding.add(held_up.gyro_b[first : first + 5])
    assert holding.rate_of_turn is not None
    assert holding.rate_of_turn > radians(10)  # 15 deg/s on average, to starboard
    holding.add(held_up.gyro_b[at + round(2.5 * RATE_HZ) : at + round(10 * RATE_HZ)])
    held = holding.held(found, limit=None)
    assert held is not None
    assert held.heading == pytest.approx(radians(350.0 + 75.0 - 360.0), abs=4 * held.sigma)
    assert held.since == pytest.approx(10 + GUARD + 1)


def test_an_estimate_that_grows_more_certain_is_no_motion():
    """The unit stands; its estimate moves by more than the gyro could have turned meanwhile."""
    still = recording(WHITE, turn=0.0)
    holding, found = stood(still, WHITE)
    assert found.heading is not None
    better = replace(found, heading=found.heading + radians(3.0))
    assert holding.held(better, limit=None) is None


def test_sigma_grows_as_the_bias_is_known_and_by_the_random_walk():
    """N^2 (t + t^2 / T): the bias is a mean over T, with N / sqrt(T); a turn-on bias cancels."""
    long = recording(WHITE, after=600.0)
    holding, found = stood(long, WHITE)
    white, stand = WHITE.gyro.white, STAND - GUARD - 1
    before = gn.heading(long.window(0, stand), sensor=WHITE, method="mean").sigma
    assert before is not None
    at = round(STAND * RATE_HZ)
    holding.add(long.gyro_b[at:])
    held = holding.held(found, limit=None)
    time = GUARD + 1 + 605.0
    assert held is not None
    assert held.since == pytest.approx(time)
    assert held.sigma**2 == pytest.approx(before**2 + white**2 * (time + time**2 / stand), rel=1e-6)


def test_what_was_turned_counts_by_the_scale_factor():
    sensor = Sensor("scaled", TriadErrors(white=0.002 * DEG_PER_SQRT_HOUR, scale_factor=3e-3))
    turned = recording(sensor, turn=radians(150.0), after=1.0)
    holding, found = stood(turned, sensor)
    holding.add(turned.gyro_b[round(STAND * RATE_HZ) :])
    held = holding.held(found, limit=None)
    assert held is not None
    assert found.sigma is not None
    assert np.sqrt(held.sigma**2 - found.sigma**2) == pytest.approx(3e-3 * radians(150.0), rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["stim300", pytest.param("isa100c", marks=pytest.mark.long)])
def test_errors_are_as_large_as_sigma_says(name):
    """Over 25 units, from the attitude they have: what grows is judged, not where it began."""
    sensor, early = read_sensor(name), round((STAND - 4) * RATE_HZ)
    found = replace(gn.heading(recording(WHITE).window(0, STAND - 4), sensor=WHITE, method="mean"), sigma=0.0)
    found = replace(found, heading=radians(350.0), roll=radians(2.0), pitch=radians(-3.0))
    ratio = []
    for seed in range(25):
        unit = recording(sensor, seed=seed)
        holding = Holding(RATE_HZ, LATITUDE, sensor)
        holding.add(unit.gyro_b[:early])
        mean = unit.gyro_b[:early].mean(axis=0)
        holding.found(replace(found, rate_mean=tuple(mean.tolist())), early)
        holding.add(unit.gyro_b[early:])
        holding.found(found, len(unit.gyro_b))
        held = holding.held(found, limit=np.pi)
        assert held is not None
        error = (held.heading - radians(350.0 + 75.0) + np.pi) % (2 * np.pi) - np.pi
        ratio.append(error / held.sigma)
    assert 0.3 < float(np.mean(np.square(ratio))) < 2.0  # chi square of 25: 0.35 to 1.96 at three sigma


def test_it_ends_where_nothing_is_known_any_more():
    unit = recording(WHITE)
    at = round(STAND * RATE_HZ)
    refused = gn.heading(unit, sensor=WHITE, method="mean")
    assert not refused.valid
    holding, _ = stood(unit, WHITE)
    holding.add(unit.gyro_b[at:])
    assert holding.held(refused, limit=None) is not None
    assert holding.held(refused, limit=radians(1e-3)) is None
    holding.add(unit.gyro_b[:5], broken=True)  # a gap hides how it turned
    assert holding.held(refused, limit=None) is None
    assert holding.rate_of_turn is None
    without, _ = stood(unit, WHITE, profile=None)  # how sigma grows is not known
    without.add(unit.gyro_b[at:])
    assert without.held(refused, limit=None) is None
    assert without.rate_of_turn is not None
    assert pytest.approx(radians(3.0)) == LARGEST_SIGMA


def test_without_a_level_nothing_is_held():
    unit = recording(WHITE)
    flat = gn.Recording(unit.gyro_b, None, RATE_HZ, latitude=LATITUDE)
    found = gn.heading(flat.window(0, STAND), sensor=WHITE, method="mean")
    holding = Holding(RATE_HZ, LATITUDE, WHITE)
    for last in (100, 200, 300):
        holding.add(flat.gyro_b[:100])
        holding.found(found, last)
    assert holding.rate_of_turn is None
