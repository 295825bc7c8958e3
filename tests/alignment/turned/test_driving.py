"""Standing and driving straight on: what the accelerometer shows of the speed."""

from __future__ import annotations

import numpy as np
import pytest

from gyronorth.alignment.turned.driving import standing
from gyronorth.alignment.turned.segments import find_segments
from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY

RATE_HZ = 20.0


def straight_on(accelerations, *, noise, seed=0):
    """Specific force of a level vehicle: (seconds, forward acceleration m/s^2, vibration factor) one after another."""
    rng, pieces = np.random.default_rng(seed), []
    for seconds, forward, vibration in accelerations:
        force = np.tile([forward, 0.0, -STANDARD_GRAVITY], (round(seconds * RATE_HZ), 1))
        pieces.append(force + rng.normal(0, noise * vibration, force.shape))
    return np.concatenate(pieces)


@pytest.mark.parametrize("forward", [0.4, 2.0])
@pytest.mark.parametrize("noise", [0.002, 0.05])
def test_cruise_between_two_stops_is_no_pose(forward, noise):
    seconds = 10 / forward
    drive = [(60, 0, 1), (seconds, forward, 3), (40, 0, 3), (seconds, -forward, 3), (30, 0, 1)]
    accel = straight_on(drive, noise=noise)
    gyro = np.random.default_rng(1).normal(EARTH_RATE, 1e-5, accel.shape)
    blind = find_segments(gyro, rate_hz=RATE_HZ)
    assert len(blind.stretches) == 1  # the gyro takes all of it for standing still
    found = find_segments(gyro, accel, rate_hz=RATE_HZ).stretches
    assert len(found) == 2
    (a, b), (c, d) = (np.array(stretch) / RATE_HZ for stretch in found)
    assert a == 0
    assert 56 < b <= 60
    assert 100 + 2 * seconds <= c < 104 + 2 * seconds
    assert d == len(accel) / RATE_HZ


def test_braking_before_a_stop_leaves_the_stop_alone():
    accel = straight_on([(20, 0, 3), (5, -2, 3), (10, 0, 1)], noise=0.01)
    (stop,) = standing(accel, [(0, len(accel))], rate_hz=RATE_HZ)
    assert 25 <= stop[0] / RATE_HZ < 28
    assert stop[1] == len(accel)


@pytest.mark.parametrize("vibration", [0.0, 0.3, 3.0])
def test_standing_with_vibration_or_a_bump_stays_one_pose(vibration):
    """An idling engine is no driving; a bump that leaves no speed behind parts the stretch at most."""
    accel = straight_on([(60, 0, 1)], noise=vibration)
    assert standing(accel, [(0, len(accel))], rate_hz=RATE_HZ) == [(0, len(accel))]
    accel[600:610, 0] += 0.8
    accel[610:620, 0] -= 0.8
    kept = sum(last - first for first, last in standing(accel, [(0, len(accel))], rate_hz=RATE_HZ))
    assert kept >= len(accel) - 6 * RATE_HZ
