"""The heading of a vehicle in which the unit is mounted turned, set while it runs."""

from __future__ import annotations

from dataclasses import replace
from math import degrees, pi, radians

import numpy as np
import pytest
from live_stream import HEAD, Played, rows_in, seconds, session_of, timed_rows
from pynmeagps import NMEAReader

from gyronorth.attitude import mat_bn
from gyronorth.errors import InputError
from gyronorth.live.holding import Held
from gyronorth.live.nmea_out import status_sentences
from gyronorth.live.session import LiveSettings, Session
from gyronorth.live.status import Status
from gyronorth.readers import ReadOptions

ROWS = timed_rows(seconds(0, 20))


@pytest.fixture(scope="module")
def running() -> Status:
    return replace(session_of(HEAD, ROWS, method="mean").status, state="running", unattended=0.0)


@pytest.mark.parametrize("offset", [radians(90.0), radians(-2.5), pi])
def test_the_attitude_is_that_of_the_turned_axes(running, offset):
    """With the tilt of a slope, in which heading, roll and pitch mix: the direction of the vehicle's own axes."""
    plain = replace(running.found.estimate, roll=radians(8.0), pitch=radians(-5.0))
    found = replace(running, found=replace(running.found, estimate=plain), alignment=offset).estimate
    forward_v = np.array([np.cos(offset), np.sin(offset), 0.0])  # in the axes of the unit
    right_v = np.array([-np.sin(offset), np.cos(offset), 0.0])
    mat = mat_bn(plain.roll, plain.pitch, plain.heading)
    turned = mat_bn(found.roll, found.pitch, found.heading)
    np.testing.assert_allclose(turned[0], forward_v @ mat, atol=1e-12)
    np.testing.assert_allclose(turned[1], right_v @ mat, atol=1e-12)
    width = [(high - low) % (2 * pi) for low, high in (plain.interval95, found.interval95)]
    assert width[1] == pytest.approx(width[0])
    assert (found.heading - found.interval95[0]) % (2 * pi) == pytest.approx(
        (plain.heading - plain.interval95[0]) % (2 * pi)
    )
    assert (found.sigma, found.valid) == (plain.sigma, plain.valid)


def test_every_output_tells_it(running):
    level = replace(running.found.estimate, roll=0.0, pitch=0.0)
    status = replace(running, found=replace(running.found, estimate=level), alignment=radians(-100.0))
    expected = (level.heading_deg - 100.0) % 360
    document = status.to_json()
    assert document["heading_deg"] == pytest.approx(expected)
    assert document["live"]["alignment_deg"] == pytest.approx(-100.0)
    assert [warning["code"] for warning in document["warnings"]][-1] == "alignment_offset"
    said = [NMEAReader.parse(line.encode(), validate=1) for line in status_sentences(status).splitlines(keepends=True)]
    told = [str(line) for line in said if getattr(line, "identity", "") in ("HETHS", "HEHDT")]
    assert [f"={expected:.1f}" in text for text in told] == [True] * 2
    held = replace(status, held=Held(radians(30.0), 0.001, 0.0, 0.0, 5.0)).estimate
    assert degrees(held.heading) == pytest.approx(290.0)


def test_it_is_set_while_it_runs_and_noted_in_every_recording(tmp_path):
    again = timed_rows(seconds(1000, 1020))
    session: list[Session] = []
    source = Played(HEAD, ROWS, lambda: session[0].align(radians(1.5)), again)
    session.append(Session(source, LiveSettings(ReadOptions(), save=tmp_path / "rec.csv", method="mean")))
    with pytest.raises(InputError, match="-180 to 180 deg are expected"):
        session[0].align(radians(181))
    session[0].start()
    assert session[0].ended.wait(300)
    session[0].close()
    assert session[0].status.to_json()["live"]["alignment_deg"] == pytest.approx(1.5)
    for name, rows in (("rec.csv", ROWS), ("rec.2.csv", again)):
        assert "alignment offset +1.50 deg" in (tmp_path / name).read_text()
        assert rows_in(tmp_path / name) == rows
