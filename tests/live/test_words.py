"""What the officer reads: the countdown by the plan, the rate of turn, and a heading that is held."""

from __future__ import annotations

import re
import time
from dataclasses import replace
from math import pi, radians

import pytest
from live_stream import HEAD, seconds, session_of, timed_rows
from still import LATITUDE

from gyronorth.alignment.turned.bound import turned_sigma
from gyronorth.findings import Finding
from gyronorth.live.countdown import Countdown
from gyronorth.live.holding import Held
from gyronorth.live.status import NO_FIX, Status
from gyronorth.live.wording import lights, marks, targets, verdict, verdict_short
from gyronorth.planning import plan
from gyronorth.sensor import Sensor, TriadErrors, read_sensor

SENSOR = read_sensor("isa100c")


@pytest.fixture(scope="module")
def running() -> Status:
    """A heading that is being measured, of 20 s of standing still."""
    return replace(session_of(HEAD, timed_rows(seconds(0, 20))).status, state="running", unattended=0.0)


def uncertain(status: Status, limit: float) -> Status:
    """The same with a sigma above what is required."""
    assert status.found is not None
    estimate = replace(status.found.estimate, sigma=radians(5), warnings=(), reasons=())
    return replace(status, found=replace(status.found, estimate=estimate), require_sigma=limit)


def test_the_countdown_is_what_the_plan_says_less_what_it_stood(running):
    planned = plan(SENSOR, latitude=LATITUDE)
    wanted = float(planned.sigma[planned.duration > 200][0])
    said = Countdown(SENSOR, wanted).text(uncertain(running, wanted))
    left = float(planned.duration[planned.sigma <= wanted][0]) - 20.0
    assert "of standing still" in said
    minutes, _, rest = said.partition(" in ")[2].partition(" min")
    seconds_left = float(minutes) * 60 if rest else left
    assert seconds_left == pytest.approx(left, abs=60)


def test_a_sigma_that_is_never_reached_needs_a_turn(running):
    assert "turn the unit by 180°" in Countdown(SENSOR, 1e-6).text(uncertain(running, 1e-6))


def test_nothing_is_counted_where_nothing_is_wanted(running):
    assert Countdown(SENSOR, None).text(running) == ""
    assert Countdown(None, 0.01).text(uncertain(running, 0.01)) == ""
    assert Countdown(SENSOR, 0.01).text(running) == ""  # valid
    assert Countdown(SENSOR, 0.01).text(Status("waiting", "here")) == ""


@pytest.mark.parametrize(("rate", "words"), [(0.01, "34.4° a minute to starboard"), (-0.01, "to port"), (0.0, "0.0°")])
def test_the_rate_of_turn_has_a_side(running, rate, words):
    assert words in verdict(replace(running, rate_of_turn=rate))
    assert words not in verdict(replace(running, rate_of_turn=rate, state="stopped"))


def test_a_held_heading_says_so_and_for_how_long(running):
    held = replace(running, held=Held(radians(123.4), radians(0.5), 0.0, 0.0, 42.0))
    assert (held.fitness, verdict_short(held)) == ("held", "held: carried on by the gyro for 42 s")
    page = verdict(held)
    assert ">123.4°<" in page
    assert 'data-fitness="held"' in page
    beyond = replace(held, require_sigma=radians(0.1))
    assert (beyond.fitness, beyond.to_json()["valid"]) == ("degraded", False)


def test_the_verdict_looks_as_good_as_it_is(running):
    held = replace(running, held=Held(radians(123.4), radians(0.5), 0.0, 0.0, 42.0))
    lost = replace(running, trouble="stalled", findings=(Finding("stalled", "No data for 3 s."),))
    for status, look, mark in (
        (running, "verdict valid", "✓ Valid"),
        (held, "verdict held", "▲ Held"),
        (uncertain(running, radians(0.1)), "verdict invalid short", "▲ Degraded"),
        (lost, "verdict invalid", "✕ Invalid: no data"),
    ):
        assert f'class="{look}"' in verdict(status)
        assert mark in verdict(status)


def test_nothing_is_said_of_motion_without_data(running):
    assert "Motion: still" in lights(running)
    assert "Motion: not known" in lights(replace(running, trouble="stalled"))


def test_a_heading_that_moved_is_explained_once(running):
    moved = Finding("motion", "The unit turned by 12 deg.")
    text = lights(replace(running, findings=(moved,)))
    assert text.count(moved.message) == 1
    assert "Heading: must not be used" in text


def test_marks_are_listed_only_where_there_are_some(running):
    assert marks(running) == ""


def test_where_the_sentences_go_is_listed(running):
    assert targets(running) == ""
    text = targets(replace(running, targets=("tcp:0.0.0.0:10110", "serial:/dev/<b>")))
    assert "<li>tcp:0.0.0.0:10110</li><li>serial:/dev/&lt;b&gt;</li>" in text


def test_waiting_for_a_fix_is_no_lost_connection(running):
    text = lights(Status("waiting", "unit", trouble=f"{NO_FIX} from tcp:gps:10110"))
    assert "Data: waiting for a fix" in text
    assert "Waiting for a fix of the latitude from tcp:gps:10110." in text
    assert "connection lost" not in text


@pytest.mark.slow
def test_a_turn_now_is_told_where_it_is_sooner(running):
    """White noise and a turn-on bias: a turn frees the heading of the bias, standing still never does."""
    sensor = Sensor("white", TriadErrors(white=1e-5, turn_on_bias=1e-5), TriadErrors(white=1e-4))
    count = Countdown(sensor, radians(1.5))
    count.text(uncertain(running, radians(1.5)))
    deadline = time.monotonic() + 300
    while "if you turn it" not in (said := count.text(uncertain(running, radians(1.5)))):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    match = re.fullmatch(r"±1.5° is not reached by standing still; in (\d+) s if you turn it by 180° now\.", said)
    assert match is not None, said
    found = running.found
    assert found is not None
    stood = found.estimate.poses[-1].end - found.estimate.poses[-1].start
    after = int(match[1]) - 10.0
    equal = 4 / (1 / stood + 1 / after)
    bound = turned_sigma(sensor, latitude=LATITUDE, turns=(pi,), still_duration=equal, turn_duration=10.0)
    assert bound == pytest.approx(radians(1.5), rel=0.05)
