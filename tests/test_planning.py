"""Planning: expected sigma against time, and when it levels off."""

from __future__ import annotations

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR
from gyronorth.earth import EARTH_RATE
from gyronorth.errors import InputError
from gyronorth.pipeline import heading
from gyronorth.planning import LONGEST, NEAR_ENOUGH, plan
from gyronorth.sensor import Sensor, TriadErrors, read_sensor
from gyronorth.simulation import simulate

LATITUDE = np.radians(32.11)
SIGNAL = EARTH_RATE * np.cos(LATITUDE)
ARW, BIAS = 0.02 * DEG_PER_SQRT_HOUR, 1.0 * DEG_PER_HOUR


def white_and_bias() -> Sensor:
    return Sensor("test", TriadErrors(white=ARW, turn_on_bias=BIAS))


def test_parts_are_noise_over_root_time_and_a_constant_bias():
    found = plan(white_and_bias(), latitude=LATITUDE, durations=[100.0, 400.0])
    assert_allclose(found.parts["noise"], ARW / np.sqrt([100.0, 400.0]) / SIGNAL)
    assert_allclose(found.parts["turn_on_bias"], BIAS / SIGNAL)
    # 1 deg/h costs 4.5 deg; small angles: the von Mises law adds under 1 % to the root sum square.
    assert_allclose(found.sigma, np.hypot(found.parts["noise"], found.parts["turn_on_bias"]), rtol=0.01)
    assert_allclose(found.half_width, 1.96 * found.sigma, rtol=0.02)


def test_waiting_is_useless_where_noise_is_a_tenth_of_the_variance():
    # s^2 = a^2 / T + b^2 <= 1.05^2 (b^2 + a^2 / day): T = a^2 / (1.05^2 (b^2 + a^2 / day) - b^2).
    found = plan(white_and_bias(), latitude=LATITUDE)
    least = BIAS**2 + ARW**2 / LONGEST
    expected = ARW**2 / (NEAR_ENOUGH**2 * least - BIAS**2)
    assert found.useful_duration == pytest.approx(expected, rel=0.01)  # the grid's step is 0.6 %
    assert_allclose(found.least_sigma, np.sqrt(least) / SIGNAL)


def test_white_noise_alone_is_always_worth_waiting_for():
    assert plan(Sensor("white", TriadErrors(white=ARW)), latitude=LATITUDE).useful_duration is None


def test_a_random_walk_makes_waiting_harmful():
    # N^2 / T + K^2 T / 3 is least at T0 = sqrt(3) N / K = 100 s, and within 1.05 of it where
    # T / T0 + T0 / T = 2 x 1.05^2.
    found = plan(Sensor("walk", TriadErrors(white=ARW, random_walk=np.sqrt(3) * ARW / 100)), latitude=LATITUDE)
    ratio = NEAR_ENOUGH**2 - np.sqrt(NEAR_ENOUGH**4 - 1)
    assert found.useful_duration == pytest.approx(100 * ratio, rel=0.01)
    assert found.sigma[-1] > 5 * found.sigma[np.argmin(np.abs(found.duration - 100))]


def test_heading_can_be_told_once_the_interval_is_below_a_half_turn():
    noisy = Sensor("noisy", TriadErrors(white=3 * DEG_PER_SQRT_HOUR))
    found = plan(noisy, latitude=LATITUDE)
    assert found.shortest_duration is not None
    around = plan(noisy, latitude=LATITUDE, durations=[found.shortest_duration * 0.98, found.shortest_duration * 1.02])
    assert around.half_width[1] <= np.pi / 2 < around.half_width[0]


def test_a_sensor_with_too_large_a_bias_never_gets_there():
    found = plan(Sensor("poor", TriadErrors(white=ARW, turn_on_bias=200 * DEG_PER_HOUR)), latitude=LATITUDE)
    assert found.shortest_duration is None
    assert_allclose(found.sigma, np.pi / np.sqrt(3), rtol=0.01)


def test_latitudes_are_those_of_single_plans():
    found = plan("sdc500", latitude=LATITUDE, durations=[30.0, 300.0])
    assert found.sigma_by_latitude.shape == (len(found.latitudes), 2)
    k = int(np.argmin(np.abs(found.latitudes - np.radians(60))))
    assert_allclose(found.sigma_by_latitude[k], plan("sdc500", latitude=np.radians(60), durations=[30.0, 300.0]).sigma)
    assert (np.diff(found.sigma_by_latitude, axis=0) > 0).all()
    assert_allclose(plan("sdc500", latitude=-LATITUDE, durations=[30.0, 300.0]).sigma, found.sigma)


@pytest.mark.parametrize("method", ["mean", "inertial"])
def test_plan_promises_what_heading_claims(method):
    # The rate that is measured enters the claim: its size differs from Earth rate by the bias, 8 % 1 sigma.
    sensor = read_sensor("sdc500")
    recording = simulate(
        sensor, latitude=LATITUDE, heading=1.0, duration=100.0, rate_hz=10.0, rng=np.random.default_rng(1)
    )
    claimed = heading(recording, sensor=sensor, method=method).sigma
    promised = plan(sensor, latitude=LATITUDE, durations=[100.0], method=method).sigma[0]
    assert claimed == pytest.approx(promised, rel=0.2)


def test_json_is_plain():
    document = json.loads(json.dumps(plan("stim300", latitude=LATITUDE).to_json(), allow_nan=False))
    assert document["schema"] == "gyronorth.plan/1"
    assert document["sensor"] == "stim300"
    assert document["latitude_deg"] == pytest.approx(32.11)
    assert len(document["duration_s"]) == len(document["sigma_deg"]) == len(document["sigma_parts_deg"]["drift"])
    assert document["duration_s"][0] == 10
    assert document["duration_s"][-1] == 86400
    assert len(document["sigma_by_latitude_deg"]) == len(document["latitudes_deg"])


def test_at_the_pole_nothing_is_known():
    found = plan("hg9900", latitude=np.pi / 2)
    assert_allclose(found.sigma, np.pi / np.sqrt(3), rtol=1e-3)
    json.dumps(found.to_json(), allow_nan=False)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"latitude": np.radians(91)}, "91 deg"),
        ({"latitude": LATITUDE, "durations": [10.0, -1.0]}, "durations"),
        ({"latitude": LATITUDE, "durations": []}, "durations"),
    ],
)
def test_refusals(arguments, words):
    with pytest.raises(InputError, match=words):
        plan("sdc500", **arguments)
