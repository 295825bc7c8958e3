"""One state: whatever happens to a session, page, JSON lines and NMEA give one and the same verdict."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from errno import ENOSPC
from math import inf, pi, radians
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from live_stream import HEAD, Played, seconds, session_of, timed_rows
from pynmeagps import NMEAReader
from still import rows_of, still

from gyronorth.findings import Finding
from gyronorth.live import estimation
from gyronorth.live.estimation import Estimation
from gyronorth.live.events import Bytes, Connected, Ended, Lost
from gyronorth.live.nmea_out import status_sentences
from gyronorth.live.recorder import Recorder
from gyronorth.live.session import Command, LiveSettings, Session
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


@pytest.mark.slow
@settings(deadline=None, max_examples=100)
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


#: Rows of each stretch of an event, in so many s at this rate: the outputs do not know how many there are.
SLOW_HZ, LASTS = 5.0, 15.0
KINDS = "rows rows rows turn garbage lost jump stall freeze stop start mark disk crash end"
EVENTS = st.lists(st.sampled_from(KINDS.split()), max_size=12)


class AtOnce(Estimation):
    """Estimates in the thread that hands over the samples, with each piece of them."""

    def put(self, gyro_b, accel_b):
        if self._present is not None:
            self._add(self._present, [(gyro_b, accel_b)])
            self._estimate(self._present)

    def flush(self):
        """Nothing waits."""

    end = flush


class Scripted(Session):
    """A session that runs in the thread of its test, event by event; `ahead` is how far its clock was set forward."""

    def __init__(self, events: list[str], save: Path) -> None:
        super().__init__(Played(), LiveSettings(ReadOptions(), method="mean", save=save))
        self._estimation = AtOnce(self._estimated)
        self._script = iter(["begin", *events])
        self._at = 0.0
        self.ahead = 0.0
        self.seen: list[bool] = []

    def look(self) -> bool:
        self.seen.append(check_one_verdict(self.status))
        return self.seen[-1]

    def _waiting(self, *, timeout: float = 0.1) -> list:
        """The next event; before it, all outputs are looked at as they are after the last."""
        self.look()
        match next(self._script, None):
            case "begin":
                return [Connected(), Bytes(HEAD.encode())]
            case "rows" | "turn" as event:
                times = self._at + np.arange(round(LASTS * SLOW_HZ)) / SLOW_HZ
                self._at += LASTS
                gyro, accel = still(len(times))
                gyro[:, 2] += 0.2 * (event == "turn")
                return [Bytes("".join(rows_of([times, gyro, accel])).encode())]
            case "garbage":
                return [Bytes(b"#!\0\n$GPGGA,1\n")]
            case "lost":
                return [Lost("gone"), Connected()]
            case "jump":
                self._at += 5000.0
            case "stall":  # nothing comes, and the session sees it
                self.ahead += 2.5
            case "freeze":  # the session itself does not look
                self.ahead += 4.0
                assert not self.look()
            case "disk":
                assert self._recorder is not None
                self._recorder.fail(OSError(ENOSPC, "No space left on device"))
            case "crash":
                self._recorder = CrashingRecorder()
            case "end":
                return [Ended()]
            case None:
                self._stop.set()
            case command:
                return [Command(command)]
        return []


class CrashingRecorder(Recorder):
    """A recorder with a fault of its own."""

    def __init__(self) -> None:
        super().__init__(Path("nowhere.csv"))

    def rows(self, rows):
        raise ZeroDivisionError("a fault")

    def _open(self):
        """No file."""


@pytest.fixture
def run_sequence(monkeypatch, tmp_path) -> Callable[[list[str]], list[bool]]:
    """Whether the heading was valid after each event and after the session."""

    def run(events: list[str]) -> list[bool]:
        session = Scripted(events, tmp_path / "north.csv")
        clock = SimpleNamespace(monotonic=lambda: time.monotonic() + session.ahead)
        monkeypatch.setattr("gyronorth.live.session.time", clock)
        monkeypatch.setattr("gyronorth.live.session.BATCH", 0.0)
        session.run()
        assert not session.look()
        for path in tmp_path.iterdir():
            path.unlink()
        return session.seen

    return run


@pytest.mark.slow
@settings(deadline=None, max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(events=EVENTS)
@example(["rows"] * 3 + ["turn", "rows", "rows", "stall", "rows", "end", "rows", "start", "rows"])
def test_after_any_sequence_of_events_all_outputs_agree(run_sequence, events):
    run_sequence(events)


@pytest.mark.long
@settings(deadline=None, max_examples=10_000, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(events=EVENTS)
def test_after_ten_thousand_sequences_of_events_all_outputs_agree(run_sequence, events):
    run_sequence(events)


@pytest.mark.parametrize("last", ["end", "stop", "crash", "stall", "freeze"])
def test_a_valid_heading_does_not_outlive_what_happens(run_sequence, last):
    # begin, three stretches, the event, and another look where the clock stood still
    seen = run_sequence(["rows", "rows", "rows", last, "rows" if last == "crash" else "mark"])
    assert seen[4]
    assert not seen[5 + (last == "crash")]


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
        deadline = time.monotonic() + 300
        while time.monotonic() < deadline and session.status.found is None:
            time.sleep(0.02)

    session = Session(
        Played(HEAD, ROWS[:3500], until_estimated, ROWS[3500:]), LiveSettings(ReadOptions(), method="mean")
    )
    session.start()
    assert session.ended.wait(300)
    session.close()
    measured = session.status.measured
    assert measured is not None
    assert [reason.code for reason in measured.reasons] == ["not_computed"]
    assert "ZeroDivisionError" in measured.reasons[0].message


def test_samples_that_cannot_be_taken_up_make_the_heading_invalid(monkeypatch):
    """Neither they nor a first run that fails end the thread: without it rows would wait, and nothing be recorded."""
    calls = []

    def add(heading, *samples):
        calls.append(heading)
        if len(calls) > 1:
            raise MemoryError("none left")
        once(heading, *samples)

    def fails():
        raise ImportError("failed to map segment")

    once = estimation.StreamingHeading.add
    monkeypatch.setattr(estimation.StreamingHeading, "add", add)
    monkeypatch.setattr(estimation, "_warm", fails)
    monkeypatch.setattr(estimation, "INTERVAL", 0.05)

    def until_taken_up() -> None:
        deadline = time.monotonic() + 300
        while time.monotonic() < deadline and not calls:
            time.sleep(0.02)

    session = Session(Played(HEAD, ROWS[:3500], until_taken_up, ROWS[3500:]), LiveSettings(ReadOptions()))
    session.start()
    assert session.ended.wait(300)
    session.close()
    status = session.status
    assert len(calls) > 1
    assert status.measured is None or not status.measured.valid
    assert any(finding.code == "not_computed" and "none left" in finding.message for finding in status.findings)


def test_a_heading_less_certain_than_required_is_degraded():
    status = replace(session_of(HEAD, ROWS, require_sigma=radians(1e-4)).status, state="running", unattended=0.0)
    assert status.fitness == "degraded"
    assert "degraded: not certain enough yet" in verdict_short(status)
    assert not check_one_verdict(status)
    estimate = status.estimate
    assert estimate is not None
    assert [reason.code for reason in estimate.reasons] == ["sigma_required"]


def test_a_closed_session_is_not_running():
    session = Session(Played(HEAD, ROWS, 60), LiveSettings(ReadOptions(), method="mean"))
    session.start()
    deadline = time.monotonic() + 300
    while session.status.counters.good < len(ROWS) and time.monotonic() < deadline:
        time.sleep(0.02)
    session.close()
    assert session.status.state == "stopped"
    assert not check_one_verdict(session.status)
    assert session.status.measured is not None
    assert session.status.measured.valid
