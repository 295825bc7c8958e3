"""One state: whatever happens to a session, page, JSON lines and NMEA give one and the same verdict."""

from __future__ import annotations

import time
from dataclasses import replace
from math import inf, pi, radians
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from live_stream import HEAD, Played, seconds, session_of, timed_rows
from pynmeagps import NMEAReader

from gyronorth.findings import Finding
from gyronorth.live import estimation
from gyronorth.live.events import Connected, Lost
from gyronorth.live.nmea_out import status_sentences
from gyronorth.live.session import LiveSettings, Session
from gyronorth.live.status import Status
from gyronorth.live.wording import verdict, verdict_short
from gyronorth.readers import ReadOptions

ROWS = timed_rows(seconds(0, 40))


def check_one_verdict(status: Status) -> bool:
    """Whether the heading may be used, which all outputs must agree on."""
    estimate, document = status.estimate, status.to_json()
    valid = estimate is not None and estimate.valid
    assert document.get("valid", False) is valid
    assert document["live"]["fitness"] == status.fitness
    assert (status.fitness in ("valid", "held")) is valid
    sentences: list[Any] = [
        NMEAReader.parse(line) for line in status_sentences(status).encode().splitlines(keepends=True)
    ]
    identities = [sentence.identity for sentence in sentences[:-1]]
    assert identities == ["HETHS", *(["HEHDT"] if valid and not status.replay else []), "HEROT"]
    running = "S" if status.replay else "E" if status.held else "A"
    assert sentences[0].mi == (running if valid else "V")
    assert sentences[-1].payload[0] == ("A" if valid else "V")
    assert ('class="verdict valid"' in verdict(status)) is valid
    assert (verdict_short(status) == "valid") is valid
    if not valid:
        assert sentences[0].headt == ""
        return False
    assert status.state == "running"
    assert status.unattended <= 3
    assert estimate is not None
    assert estimate.sigma is not None
    assert 0 < estimate.sigma <= (status.require_sigma or inf)
    return True


@pytest.fixture(scope="module")
def running() -> Status:
    """A valid heading that is being measured."""
    return replace(session_of(HEAD, ROWS).status, state="running", unattended=0.0)


@settings(deadline=None, max_examples=300)
@given(
    state=st.sampled_from(["waiting", "running", "stopped", "ended", "failed"]),
    found=st.booleans(),
    unattended=st.floats(0, 10),
    sigma=st.none() | st.floats(1e-4, pi),
    limit=st.none() | st.floats(1e-4, pi),
    reasons=st.lists(st.sampled_from(["stalled", "not_computed", "too_short", "motion"]), max_size=2),
    replay=st.booleans(),
)
def test_all_outputs_agree(running, state, found, unattended, sigma, limit, reasons, replay):
    live = replace(running.found, estimate=replace(running.found.estimate, sigma=sigma))
    findings = tuple(Finding(code, code) for code in reasons)
    status = Status(
        state,
        "here",
        found=live if found else None,
        unattended=unattended,
        findings=findings,
        require_sigma=limit,
        replay=replay,
    )
    if sigma is None:  # an estimate without sigma carries reasons of its own
        status = replace(status, findings=(*findings, Finding("too_short", "")))
    expected = found and state == "running" and unattended <= 3 and not status.findings
    assert check_one_verdict(status) is (expected and (limit is None or sigma <= limit))


EVENTS = st.lists(
    st.sampled_from(["rows", "rows", "rows", "garbage", "lost", "jump", "stop", "start", "mark", "pause"]), max_size=12
)


@settings(deadline=None, max_examples=15)
@given(events=EVENTS)
def test_after_any_sequence_of_events_all_outputs_agree(events):
    check_sequence(events)


@pytest.mark.long
@settings(deadline=None, max_examples=10_000)
@given(events=EVENTS)
def test_after_ten_thousand_sequences_of_events_all_outputs_agree(events):
    check_sequence(events)


def check_sequence(events: list[str]) -> None:
    """A look after each event, one at the end of the source, and one after the session."""
    seen: list[bool] = []
    at, shift = 0, 0.0

    def look() -> None:
        seen.append(check_one_verdict(session.status))

    played: list = [HEAD]
    for event in events:
        match event:
            case "rows":
                part = ROWS[at : at + 1000] if not shift else timed_rows(seconds(0, 10) + at / 100 + shift)
                played.append(part)
                at += 1000
            case "jump":
                shift += 5000.0
            case "garbage":
                played.append("#!\0\n$GPGGA,1\n")
            case "lost":
                played += [Lost("gone"), Connected()]
            case "pause":
                played.append(0.05)
            case command:
                played.append(lambda command=command: session.command(command))
        played.append(look)
    session = Session(Played(*played), LiveSettings(ReadOptions()))
    session.start()
    assert session.ended.wait(90)
    assert not check_one_verdict(session.status)
    session.close()
    assert not check_one_verdict(session.status)


def test_an_estimator_that_fails_makes_the_heading_invalid(monkeypatch):
    calls = []

    def estimate(heading):
        calls.append(heading)
        if len(calls) > 1:
            raise ZeroDivisionError("a fault")
        return once(heading)

    once = estimation.StreamingHeading.estimate
    monkeypatch.setattr(estimation.StreamingHeading, "estimate", estimate)

    def until_estimated() -> None:
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline and session.status.found is None:
            time.sleep(0.02)

    session = Session(Played(HEAD, ROWS[:3500], until_estimated, ROWS[3500:]), LiveSettings(ReadOptions()))
    session.start()
    assert session.ended.wait(90)
    session.close()
    measured = session.status.measured
    assert measured is not None
    assert [reason.code for reason in measured.reasons] == ["not_computed"]
    assert "ZeroDivisionError" in measured.reasons[0].message


def test_a_heading_less_certain_than_required_is_degraded():
    status = replace(session_of(HEAD, ROWS, require_sigma=radians(1e-4)).status, state="running", unattended=0.0)
    assert status.fitness == "degraded"
    assert "degraded: not certain enough yet" in verdict_short(status)
    assert not check_one_verdict(status)
    estimate = status.estimate
    assert estimate is not None
    assert [reason.code for reason in estimate.reasons] == ["sigma_required"]


def test_a_closed_session_is_not_running():
    session = Session(Played(HEAD, ROWS, 60), LiveSettings(ReadOptions()))
    session.start()
    deadline = time.monotonic() + 60
    while session.status.counters.good < len(ROWS) and time.monotonic() < deadline:
        time.sleep(0.02)
    session.close()
    assert session.status.state == "stopped"
    assert not check_one_verdict(session.status)
    assert session.status.measured is not None
    assert session.status.measured.valid
