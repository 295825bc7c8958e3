"""Frames of a unit through a live session: the heading, the counts and the files are those of the capture."""

from __future__ import annotations

import struct
from dataclasses import replace
from math import radians

import numpy as np
import pytest
from frames import encoders
from frames.encoders import Case
from live_stream import Played, session_of
from still import LATITUDE
from unit_at_rest import HEADING, unit

import gyronorth as gn
from gyronorth.attitude import mat_bn
from gyronorth.earth import earth_rate_n
from gyronorth.errors import InputError
from gyronorth.live.events import Bytes, Connected, Lost
from gyronorth.live.frames import FrameReader
from gyronorth.live.session import LiveSettings, Session
from gyronorth.live.sources import open_source
from gyronorth.readers import ReadOptions


def damaged(case: Case, share: float = 0.01) -> bytes:
    """A capture whose ends are cut and of whose frames 1 % have a wrong byte."""
    rng, data = np.random.default_rng(11), bytearray(case.preamble)
    for i, frame in enumerate(case.frames):
        piece = bytearray(frame)
        if rng.random() < share and 0 < i < len(case.frames) - 2:
            piece[len(piece) // 2] ^= 0x15
        data += piece
    return bytes(data[0 if case.preamble else 7 : -5])


def pieces(data: bytes, size: int = 4000) -> list[Bytes]:
    """Cut anywhere."""
    return [Bytes(data[at : at + size]) for at in range(0, len(data), size)]


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["stim", "kvh-A-rate", "novatel-RAWIMUSX-text", "kvh-B-angle", "vectornav-ascii", "xbus-dq", "mip-delta"]
)
def test_a_damaged_stream_gives_the_heading_of_its_capture(name, monkeypatch, tmp_path):
    case, options = unit(name, monkeypatch)
    data = damaged(case)
    method = "auto" if name == "stim" else "mean"
    session = session_of(*pieces(data), reading=options, save=tmp_path / "rec.csv", method=method)
    status = session.status
    assert (session.error, status.protocol, status.counters.restarts) == (None, case.protocol, 0)
    assert (tmp_path / "rec.bin").read_bytes() == data
    whole = gn.read(tmp_path / "rec.bin", options)
    offline = gn.heading(whole, method=method)
    assert status.measured is not None
    assert status.measured.heading == pytest.approx(offline.heading, abs=1e-5)
    assert status.measured.sigma == pytest.approx(offline.sigma, rel=1e-3)
    assert gn.heading(gn.read(tmp_path / "rec.csv"), method=method).heading == pytest.approx(offline.heading, abs=1e-5)
    assert status.counters.lost == sum(gap.samples for gap in whole.gaps) > 0
    assert status.counters.skipped_bytes > 0
    assert status.measured.heading is not None
    assert status.measured.sigma is not None
    assert abs(status.measured.heading - HEADING) < 5 * status.measured.sigma
    assert {warning.code for warning in status.measured.warnings} == {warning.code for warning in offline.warnings} - {
        "gaps_bridged"
    }


@pytest.mark.slow
@pytest.mark.parametrize("name", ["anpp", "hg4930"])
def test_losses_that_only_the_bytes_show_hide_no_rate(name, monkeypatch, tmp_path):
    case, options = unit(name, monkeypatch)
    rng = np.random.default_rng(3)
    frames = [frame if rng.random() > 0.02 else frame[:20] + rng.bytes(rng.integers(5, 200)) for frame in case.frames]
    data = b"".join(frames)
    session = session_of(*pieces(data), reading=options, save=tmp_path / "rec.csv", method="mean")
    assert session.error is None
    assert session.status.measured is not None
    for path in (tmp_path / "rec.bin", tmp_path / "rec.csv"):
        read = gn.read(path, options if path.suffix == ".bin" else None)
        assert read.rate_hz == case.rate_hz
        assert gn.heading(read, method="mean").heading == pytest.approx(session.status.measured.heading, abs=1e-5)


def marked(case: Case, bit: int, where: int) -> list[bytes]:
    """Frames of a STIM of which one has a status bit set."""
    body = bytearray(case.frames[where][:-4])
    body[10] |= bit
    return [*case.frames[:where], encoders.stim_datagram(bytes(body)), *case.frames[where + 1 :]]


@pytest.mark.slow
@pytest.mark.parametrize(("bit", "code"), [(0x10, "saturated"), (0x40, "sensor_fault")])
def test_what_the_unit_says_of_a_sample_is_a_reason_live_and_in_both_files(bit, code, monkeypatch, tmp_path):
    case, options = unit("stim", monkeypatch, seconds=4.0)
    data = case.preamble + b"".join(marked(case, bit, 1300))
    session = session_of(*pieces(data), reading=options, save=tmp_path / "rec.csv", method="mean")
    assert session.status.measured is not None
    assert [reason.code for reason in session.status.measured.reasons] == [code]
    for name in ("rec.bin", "rec.csv"):
        found = gn.heading(gn.read(tmp_path / name, options), method="mean")
        assert [reason.code for reason in found.reasons] == [code]
        before = gn.read(tmp_path / name, replace(options, window=(0.0, 2.5)))
        assert gn.heading(before, method="mean").valid
    text = (tmp_path / "rec.csv").read_text().splitlines()
    titles = next(line for line in text if line.startswith("t,"))
    assert titles == "t,w_x,w_y,w_z,f_x,f_y,f_z,temperature_degC,saturated,sensor_fault"
    assert float(text[-1].split(",")[7]) == pytest.approx((20 + 20.00390625 + 20.0078125) / 3)


def test_a_broken_cable_of_a_unit_without_time_begins_files_that_replay_by_themselves(monkeypatch, tmp_path):
    """The unit sends its configuration once, at power-up: the second file begins with it too."""
    case, options = unit("stim", monkeypatch)
    first, second = b"".join(case.frames[:2500]), b"".join(case.frames[3000:])
    gone = [Lost("unplugged"), Connected(midway=True)]
    session = session_of(
        *pieces(case.preamble + first[:-9]), *gone, *pieces(second[5:]), reading=options, save=tmp_path / "rec.csv"
    )
    assert (session.error, session.status.counters.restarts) == (None, 1)
    assert "the gap is unknown" in session.status.message
    assert (tmp_path / "rec.2.bin").read_bytes() == case.preamble + second[5:]
    again = Session(
        open_source(str(tmp_path / "rec.2.bin"), options, speed=1000.0), replace(session.settings, save=None)
    )
    again.start()
    assert again.ended.wait(300)
    again.close()
    assert again.status.measured is not None
    assert session.status.measured is not None
    assert again.status.measured.heading == session.status.measured.heading
    assert again.status.measured.sigma == session.status.measured.sigma


def test_a_clock_that_is_set_anew_begins_a_new_stretch(monkeypatch, tmp_path):
    case, options = unit("kvh-B-angle", monkeypatch, seconds=6.0)
    data = b"".join(case.frames[3000:]) + b"".join(case.frames[:2500])
    session = session_of(*pieces(data), reading=options, save=tmp_path / "rec.csv", method="mean")
    assert session.status.counters.restarts == 1
    assert session.status.message == "Restarted: the unit's clock was reset."
    assert session.status.seconds == pytest.approx(2.5)
    assert gn.read(tmp_path / "rec.csv").duration == pytest.approx(3.0, abs=0.01)


def test_start_begins_a_capture_of_what_comes_after(monkeypatch, tmp_path):
    case, options = unit("stim", monkeypatch)
    data = case.preamble + b"".join(case.frames)
    cut = len(data) // 2 + 7
    session: list[Session] = []

    def begin() -> None:
        session[0].saved()
        session[0].command("start")
        session[0].saved()

    source = Played(*pieces(data[:cut]), 0.2, begin, *pieces(data[cut:]))
    session.append(Session(source, LiveSettings(options, method="mean", save=tmp_path / "rec.csv")))
    session[0].start()
    assert session[0].ended.wait(300)
    session[0].close()
    status = session[0].status
    assert status.measured is not None
    assert status.measured.heading == pytest.approx(
        gn.heading(gn.read(tmp_path / "rec.2.bin", options), method="mean").heading, abs=1e-9
    )


def test_datagrams_need_no_line_ends(monkeypatch):
    case, options = unit("xbus-dq", monkeypatch)
    data = [Bytes(frame, whole=True) for frame in case.frames]
    counters = session_of(*data, reading=options, method="mean").status.counters
    assert counters.good + counters.lost == len(case.frames)
    assert counters.good >= len(case.frames) - 1


@pytest.mark.parametrize(
    ("declared", "words"),
    [
        ({"accel_unit": "g"}, "--accel-unit does not apply to played"),
        ({"imu": "STIM300"}, "It is for novatel; leave it out"),
        ({"gyro_unit": "deg/s"}, "It is for kvh"),
    ],
)
def test_what_frames_state_is_not_declared(declared, words, monkeypatch):
    case, options = unit("stim", monkeypatch, seconds=1.0)
    session = session_of(*pieces(b"".join(case.frames)), reading=replace(options, **declared))
    assert isinstance(session.error, InputError)
    assert words in str(session.error)


def test_a_unit_set_to_another_rate_begins_a_new_stretch_whose_file_replays(monkeypatch, tmp_path):
    """Increments by the old rate would be wrong by two; the clock alone tells."""
    first, options = unit("novatel-RAWIMUSX-binary", monkeypatch, seconds=12.0)
    second = encoders.novatel(2400, text=False, rate=400.0)
    data = b"".join(first.frames[:1200] + second.frames)
    session = session_of(*pieces(data, 400), reading=options, save=tmp_path / "rec.csv", method="mean")
    assert (session.error, session.status.counters.restarts) == (None, 1)
    assert "another rate" in session.status.message
    assert session.status.rate_hz == 400.0
    recorded = gn.read(tmp_path / "rec.2.csv")
    assert recorded.gyro_b.mean(axis=0) == pytest.approx(gn.read(tmp_path / "rec.csv").gyro_b.mean(axis=0), abs=3e-6)
    replayed = gn.read(tmp_path / "rec.2.bin", options)
    assert len(replayed.gyro_b) == len(recorded.gyro_b) > 2000
    assert replayed.gyro_b == pytest.approx(recorded.gyro_b, abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["stim", "sbg-short"])
def test_a_wrong_rate_is_told_and_not_taken(name, monkeypatch, tmp_path):
    """A configuration and a clock know better than a declaration, in a file and on the cable."""
    case, options = unit(name, monkeypatch)
    data = case.preamble + b"".join(case.frames)
    (tmp_path / "unit.bin").write_bytes(data)
    wrong = replace(options, rate_hz=case.rate_hz / 2)
    read = gn.read(tmp_path / "unit.bin", wrong)
    status = session_of(*pieces(data), reading=wrong).status
    assert status.measured is not None
    assert (read.rate_hz, status.rate_hz) == (case.rate_hz, case.rate_hz)
    for warnings in (read.notes, status.measured.warnings):
        assert "rate_conflict" in {warning.code for warning in warnings}


@pytest.mark.slow
def test_specific_force_at_a_tenth_of_the_rate_gives_the_same_live_as_from_the_capture(tmp_path):
    """With another recording begun on the way, whose capture replays to what was live."""
    rng, n, rate_hz = np.random.default_rng(6), 6000, 200.0
    mat = mat_bn(radians(3.0), radians(-2.0), HEADING)
    rates = mat @ earth_rate_n(LATITUDE) + 2e-5 * rng.standard_normal((n, 3))
    forces = mat @ np.array([0.0, 0.0, -1.0]) + 1e-4 * rng.standard_normal((n, 3))

    def packet(i: int, *, force: bool) -> bytes:
        fields = [(0xD5, struct.pack(">Q", i * 5_000_000)), (0x05, struct.pack(">3f", *rates[i]))]
        return encoders.mip_frame([*fields, *([(0x04, struct.pack(">3f", *forces[i]))] if force else [])])

    data = b"".join(packet(i, force=i % 10 == 4) for i in range(n))
    options = ReadOptions(latitude=LATITUDE)
    session = session_of(*pieces(data), reading=options, save=tmp_path / "rec.csv", method="mean")
    (tmp_path / "full.bin").write_bytes(b"".join(packet(i, force=True) for i in range(n)))
    full = gn.heading(gn.read(tmp_path / "full.bin", options), method="mean")
    capture = gn.read(tmp_path / "rec.bin", options)
    offline, live = gn.heading(capture, method="mean"), session.status.measured
    assert live is not None
    assert live.heading == pytest.approx(offline.heading, abs=1e-12)
    assert (capture.rate_hz, [note.code for note in capture.notes]) == (rate_hz / 10, ["force_paired"])
    assert offline.heading == pytest.approx(full.heading, abs=1e-3)  # its force has three times the noise
    assert gn.heading(gn.read(tmp_path / "rec.csv"), method="mean").heading == pytest.approx(offline.heading, abs=1e-12)
    reader = FrameReader("unit", "mip", options)
    reader.push(data[: 3000 * 40])
    reader.begin_raw()
    rows = reader.push(data[3000 * 40 :]) + reader.end()
    again = FrameReader("unit", "mip", options)
    replayed = [batch for _, part in reader.raw() for batch in again.push(part)] + again.end()
    assert np.array_equal(
        np.concatenate([batch.rows.values[:, 1:] for batch in replayed]),
        np.concatenate([batch.rows.values[:, 1:] for batch in rows]),
    )
