"""Captures of frames as files: recognised, with gaps, units and the rate that the frames tell."""

from __future__ import annotations

from math import radians

import numpy as np
import pytest
from frames.encoders import CASES

import gyronorth as gn
from gyronorth.errors import InputError
from gyronorth.readers.axes import in_axes, mat_bf


def capture(tmp_path, name: str, n: int = 400, without: slice = slice(0, 0)):
    case = CASES[name](n)
    frames = list(case.frames)
    del frames[without]
    path = tmp_path / "unit.bin"
    path.write_bytes(b"\x00\x01" + case.preamble + b"".join(frames))
    return case, path


@pytest.mark.parametrize("name", ["stim", "novatel-RAWIMUSX-text", "novatel-RAWIMUX-binary", "sbg-short", "xbus-dq"])
def test_a_capture_is_recognised_and_read(tmp_path, name):
    case, path = capture(tmp_path, name)
    recording = gn.read(path, axes="frd")
    assert recording.rate_hz == pytest.approx(case.rate_hz)
    assert recording.gyro_b == pytest.approx(case.gyro, abs=case.gyro_step)
    assert recording.accel_b == pytest.approx(case.accel, abs=case.accel_step)


def test_the_axes_are_those_of_the_protocol(tmp_path):
    case, path = capture(tmp_path, "xbus-16.32")
    recording = gn.read(path)
    assert recording.gyro_b == pytest.approx(in_axes(case.gyro, mat_bf("flu")), abs=1e-9)


@pytest.mark.parametrize("name", ["stim", "sbg-short"])
def test_lost_frames_are_a_bridged_gap(tmp_path, name):
    case, path = capture(tmp_path, name, without=slice(200, 220))
    recording = gn.read(path, axes="frd")
    assert len(recording.gyro_b) == 400
    assert [(round(gap.start * case.rate_hz), gap.samples) for gap in recording.gaps] == [(200, 20)]


def test_a_protocol_without_time_needs_a_rate(tmp_path):
    case, path = capture(tmp_path, "anpp")
    with pytest.raises(InputError, match="--rate HZ"):
        gn.read(path)
    assert gn.read(path, rate_hz=100.0).gyro_b == pytest.approx(case.gyro, abs=1e-9)


def test_what_the_frames_assume_is_a_note(tmp_path):
    case, path = capture(tmp_path, "kvh-A-angle")
    recording = gn.read(path, axes="frd")
    assert "units_assumed" in {note.code for note in recording.notes}
    assert recording.gyro_b == pytest.approx(case.gyro, abs=1e-9)
    assert gn.heading(recording, latitude=radians(48), method="mean").duration == pytest.approx(0.4)


def test_messages(tmp_path):
    _, path = capture(tmp_path, "stim")
    with pytest.raises(InputError, match="state what it says"):
        gn.read(path, gyro_unit="deg/s")
    with pytest.raises(InputError, match="no sample of protocol kvh"):
        gn.read(path, protocol="kvh")
    with pytest.raises(InputError, match="one of stim"):
        gn.read(path, protocol="stim3000")
    (tmp_path / "noise.bin").write_bytes(np.random.default_rng(1).bytes(3000))
    with pytest.raises(InputError, match="no frames of a known protocol"):
        gn.read(tmp_path / "noise.bin", format="frames")
