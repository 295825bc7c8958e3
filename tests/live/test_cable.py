"""A unit on one serial port, sentences on another, over pseudo-terminals; and a turn that the heading follows."""

from __future__ import annotations

import os
import pty
import select
import time
import tty
from dataclasses import replace
from functools import partial
from math import degrees, radians
from typing import Any

import numpy as np
import pytest
from live_stream import HEAD, Played
from pynmeagps import NMEAReader
from still import LATITUDE, rows_of
from unit_at_rest import unit

import gyronorth as gn
from gyronorth.live.nmea_out import NmeaOut, parse_target
from gyronorth.live.session import LiveSettings, Session
from gyronorth.live.sources import open_source
from gyronorth.readers import ReadOptions
from gyronorth.simulation import Motion, simulate


class Port:
    """A pseudo-terminal behind a link that stands for a device."""

    def __init__(self, link) -> None:
        self.link = link
        self.plug()

    def plug(self) -> None:
        self.ours, theirs = pty.openpty()
        tty.setraw(theirs)
        self.link.unlink(missing_ok=True)
        self.link.symlink_to(os.ttyname(theirs))
        os.close(theirs)

    def unplug(self) -> None:
        os.close(self.ours)

    def write(self, data: bytes) -> None:
        while data:
            if select.select([], [self.ours], [], 5)[1]:
                data = data[os.write(self.ours, data[:1024]) :]

    def lines(self) -> list[bytes]:
        """What has come until now."""
        data = b""
        while select.select([self.ours], [], [], 0)[0]:
            try:
                data += os.read(self.ours, 1 << 16)
            except OSError:  # nobody has opened the other end yet
                break
        return data.splitlines(keepends=True)


def until(condition) -> None:
    deadline = time.monotonic() + 300
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seconds"), [("stim", 24.0), ("kvh-C-angle", 12.0)])
def test_a_unit_in_and_sentences_out_unplugged_and_back_and_replayed(tmp_path, monkeypatch, name, seconds):
    case, options = unit(name, monkeypatch, seconds=seconds)
    inward, outward = Port(tmp_path / "unit"), Port(tmp_path / "bridge")
    source = open_source(f"serial:{inward.link}:921600", options, speed=1)
    settings = LiveSettings(options, save=tmp_path / "rec.csv", method="mean")
    session = Session(source, settings)
    out = NmeaOut(parse_target(f"serial:{outward.link}:38400"), rate_hz=10, status=lambda: session.status)
    session.start()
    out.start()
    heard: list[bytes] = []

    def hear(mode: str) -> bool:
        fresh = [line for line in outward.lines() if line.startswith(b"$HE") and line.endswith(b"\r\n")]
        heard.extend(fresh)
        return any(b"THS" in line and getattr(NMEAReader.parse(line), "mi", "") == mode for line in fresh)

    try:
        until(lambda: session.status.connected)
        until(lambda: hear("V"))
        inward.write(case.preamble + b"".join(case.frames[:6000])[:-7])
        until(lambda: hear("A"))
        first = session.status.estimate
        inward.unplug()
        until(lambda: session.status.trouble)
        until(lambda: hear("V"))
        inward.plug()
        until(lambda: session.status.counters.connections == 2)
        inward.write(b"".join(case.frames[6300:])[3:])
        until(lambda: session.status.counters.good >= 5998 + 5690)
        session.saved()
        hear("A")
        until(lambda: hear("A"))
        second = session.status.estimate
    finally:
        session.close()
        out.close()
        inward.unplug()
        outward.unplug()
    assert (tmp_path / "rec.bin").read_bytes() == case.preamble + b"".join(case.frames[:6000])[:-7]
    assert first is not None
    assert second is not None
    assert second.heading_deg is not None
    sent: list[Any] = [NMEAReader.parse(line, validate=1) for line in heard]
    assert {line.identity for line in sent} == {"HETHS", "HEHDT", "HEROT"}
    assert {round(line.headingT, 1) for line in sent if line.identity == "HEHDT"} >= {
        round(second.heading_deg, 1) % 360
    }
    for raw, live in (("rec.bin", first), ("rec.2.bin", second)):
        replayed = Session(open_source(str(tmp_path / raw), options, speed=1000), replace(settings, save=None))
        replayed.start()
        assert replayed.ended.wait(300)
        replayed.close()
        assert replayed.status.measured is not None
        offline = gn.heading(gn.read(tmp_path / raw, options), method="mean")
        assert replayed.status.measured.heading == pytest.approx(offline.heading, abs=1e-12)
        if raw == "rec.2.bin":  # the first was asked for while it still came
            assert replayed.status.measured.heading == live.heading


@pytest.mark.slow
def test_the_heading_follows_a_turn_and_says_so():
    """Estimates come once a second while it stands; then it turns, and the sentences say E."""
    moving = simulate(
        sensor="isa100c", latitude=LATITUDE, heading=radians(40.0), duration=100.0, rate_hz=100.0,
        motion=Motion(turns=((80.0, 10.0, radians(60.0)),)), rng=np.random.default_rng(5),
    )  # fmt: skip
    assert moving.accel_b is not None
    rows = rows_of([np.arange(10000) / 100, moving.gyro_b, moving.accel_b])
    seen = []

    def look(row: int, fitness: str) -> None:
        until(lambda: session.status.counters.good >= row and session.status.fitness == fitness)
        seen.append(session.status)

    paced = [piece for at in range(0, 7600, 200) for piece in (rows[at : at + 200], 0.12)]
    events = [HEAD, *paced, 1.5, rows[7600:8000], 1.5, partial(look, 8000, "valid")]
    events += [rows[8000:8500], partial(look, 8500, "held"), rows[8500:9100], partial(look, 9100, "held")]
    session = Session(Played(*events), LiveSettings(ReadOptions(), gn.read_sensor("isa100c"), method="mean"))
    session.start()
    assert session.ended.wait(300)
    session.close()
    assert session.error is None
    assert [status.fitness for status in seen] == ["valid", "held", "held"]
    for status, turned in zip(seen[1:], (30.0, 60.0), strict=True):
        assert status.estimate is not None
        assert status.estimate.heading is not None
        assert status.estimate.sigma is not None
        assert abs(status.estimate.heading - radians(40.0 + turned)) < 4 * status.estimate.sigma
    assert seen[1].rate_of_turn is not None
    assert degrees(seen[1].rate_of_turn) > 5
