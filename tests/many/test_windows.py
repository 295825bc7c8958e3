"""Headings of windows: each is that of the same window read alone, and the file is read once."""

from __future__ import annotations

from math import radians

import numpy as np
import pytest

import gyronorth as gn
from gyronorth.errors import InputError
from gyronorth.many import Request
from gyronorth.many import windows as module
from gyronorth.many.windows import window_outcomes
from gyronorth.readers import ReadOptions

RATE_HZ, DURATION = 10.0, 60.0


@pytest.fixture
def path(tmp_path):
    recording = gn.simulate(
        "hg9900", latitude=radians(32.0), heading=1.0, duration=DURATION, rate_hz=RATE_HZ, rng=np.random.default_rng(1)
    )
    gn.write(recording, tmp_path / "x.csv")
    return tmp_path / "x.csv"


def request(**reading) -> Request:
    return Request(ReadOptions(latitude=radians(32.0), **reading), gn.read_sensor("hg9900"))


@pytest.mark.slow
@pytest.mark.parametrize("chunk", [7, 64, 1000])
@pytest.mark.parametrize(("length", "step"), [(20.0, 20.0), (20.0, 7.5), (3.3, 25.0), (60.0, 1.0)])
def test_each_window_is_what_it_is_alone(path, monkeypatch, chunk, length, step):
    monkeypatch.setattr(module, "CHUNK_SAMPLES", chunk)
    found = list(window_outcomes(request(), "x", path, (length, step)))
    assert len(found) == int((DURATION - length) / step) + 1
    for number, outcome in enumerate(found):
        start, end = outcome.window
        assert start == pytest.approx(number * step, abs=0.5 / RATE_HZ)
        assert end - start == pytest.approx(length)
        alone = request(window=outcome.window).read(path)
        assert outcome.estimate == request().heading(alone)


def test_a_window_of_the_file_counts_from_its_start(path):
    found = list(window_outcomes(request(window=(10.0, 50.0)), "x", path, (20.0, 10.0)))
    assert [outcome.window for outcome in found] == [(10.0, 30.0), (20.0, 40.0), (30.0, 50.0)]


def test_gaps_belong_to_their_windows(path, monkeypatch):
    lines = path.read_text().splitlines(keepends=True)
    data = next(i for i, line in enumerate(lines) if line[0].isdigit())
    del lines[data + 195 : data + 205]  # samples 195 to 204, in two chunks of 200
    path.write_text("".join(line for line in lines if not line.startswith("# samples")))
    monkeypatch.setattr(module, "CHUNK_SAMPLES", 200)
    found = list(window_outcomes(request(), "x", path, (10.0, 5.0)))
    assert len(found) == 11
    missing = {
        outcome.window[0]: round(100 * note.value)
        for outcome in found
        for note in outcome.estimate.warnings
        if note.code == "gaps_bridged"
    }
    assert missing == {10.0: 5, 15.0: 10, 20.0: 5}


@pytest.mark.slow
@pytest.mark.parametrize("pause", [0.0, 50.0])
@pytest.mark.parametrize("cuts", [[(12, 17), (33, 38)], [(21, 38)]])
def test_windows_beside_gaps_answer_and_those_with_gaps_say_so(path, monkeypatch, pause, cuts):
    """Much is missing in all, or more at once than may be; behind it the clock may have gone on for longer still."""
    whole = {outcome.window: outcome for outcome in window_outcomes(request(), "x", path, (10.0, 10.0))}
    kept = []
    for line in path.read_text().splitlines(keepends=True):
        time = float(line.split(",")[0]) if line[0].isdigit() else -1.0
        if not any(begin <= time < end for begin, end in cuts) and not line.startswith("# samples"):
            later = time + pause * (time > 39.95)
            kept.append(line if time < 0 else f"{later!r}{line[line.index(',') :]}")
    path.write_text("".join(kept))
    monkeypatch.setattr(module, "CHUNK_SAMPLES", 64)
    monkeypatch.setattr("gyronorth.readers.gaps.PIECE", 97)
    found = {outcome.window: outcome for outcome in window_outcomes(request(), "x", path, (10.0, 10.0))}
    assert len(found) == 6 + pause / 10
    for (start, end), outcome in found.items():
        before, after = start >= 40 + pause, end <= 40
        untouched = before or (after and not any(begin < end and start < stop for begin, stop in cuts))
        if untouched:
            shift = pause if before else 0.0
            assert outcome.estimate.heading == pytest.approx(whole[start - shift, end - shift].estimate.heading)
        else:
            assert "of 100 samples of this window are missing" in outcome.message


def test_a_window_without_a_heading_says_why_and_the_others_go_on(path, monkeypatch):
    heading = Request.heading

    def refusing(self, recording):
        if recording.start_time_utc is None and next(calls) == 1:
            raise InputError("not this one")
        return heading(self, recording)

    calls = iter(range(9))
    monkeypatch.setattr(Request, "heading", refusing)
    found = list(window_outcomes(request(), "x", path, (20.0, 20.0)))
    assert [outcome.message for outcome in found] == ["", "not this one", ""]


def test_too_short_is_refused(path):
    with pytest.raises(InputError, match="lasts 60 s, less than one window of 61 s"):
        list(window_outcomes(request(), "x", path, (61.0, 1.0)))


def test_windows_before_the_damage_stay(path, monkeypatch):
    monkeypatch.setattr(module, "CHUNK_SAMPLES", 100)
    monkeypatch.setattr("gyronorth.readers.text.BLOCK_BYTES", 1 << 14)
    lines = path.read_text().splitlines(keepends=True)
    lines[-50] = "damaged\n"
    path.write_text("".join(lines))
    *found, last = window_outcomes(request(), "x", path, (10.0, 10.0))
    assert found
    assert all(outcome.estimate is not None and outcome.window is not None for outcome in found)
    assert last.estimate is None
    assert last.window is None
    assert "found" in last.message


def test_a_step_below_a_sample_is_refused(path):
    with pytest.raises(InputError, match="less than a sample"):
        window_outcomes(request(), "x", path, (10.0, 0.001))
