"""Units that are reset while they run, and streams whose frames do not all hold the same."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from frames import encoders

import gyronorth as gn
from gyronorth.errors import InputError
from gyronorth.frames import FrameStream, StreamOptions, decode
from gyronorth.frames.clock import WATCHED, of_several_units
from gyronorth.frames.protocol import Fields

#: Two settings of each unit whose clock tells the rate.
AT_RATE = {
    "novatel-text": lambda n, rate: encoders.novatel(n, rate=rate),
    "novatel-binary": lambda n, rate: encoders.novatel(n, rate=rate, text=False),
    "vectornav": lambda n, rate: encoders.vectornav(n, rate=rate),
    "inertial-labs": lambda n, rate: encoders.inertial_labs(n, rate=rate),
    "anello": lambda n, rate: encoders.anello(n, rate=rate),
    "anello-x3": lambda n, rate: encoders.anello_x3(n, rate=rate),
}


@pytest.mark.slow
@pytest.mark.parametrize("rates", [(200.0, 400.0), (400.0, 100.0), (200.0, 250.0)])
@pytest.mark.parametrize("name", list(AT_RATE))
def test_another_rate_is_taken_from_where_it_begins(name, rates):
    first, second = (AT_RATE[name](200, rate) for rate in rates)
    samples, report = decode(b"".join(first.frames + second.frames), first.protocol, first.options)
    sent = np.concatenate([first.gyro, second.gyro])
    assert np.abs(samples.gyro - sent).max() <= max(first.gyro_step, second.gyro_step)
    assert (report.rate_hz, report.settings, report.lost) == (rates[1], 1, 0)
    assert np.flatnonzero(samples.jumped).tolist() == [200]
    assert "rate_changed" in {finding.code for finding in report.findings}


@pytest.mark.slow
def test_a_running_unit_at_another_rate_is_found_within_a_few_frames():
    first, second = (encoders.novatel(300, rate=rate, text=False) for rate in (200.0, 400.0))
    stream = FrameStream("novatel")
    for i, frame in enumerate(first.frames + second.frames):
        stream.feed(frame)
        if stream.report.settings:
            assert 300 < i <= 300 + WATCHED
            break
    else:
        pytest.fail("the other rate is not found")


@pytest.mark.parametrize("share", [0.02, 0.1])
@pytest.mark.parametrize("name", ["inertial-labs", "novatel-binary", "anello"])
def test_lost_frames_are_no_other_rate(name, share):
    case, rng = AT_RATE[name](1000, 200.0), np.random.default_rng(1)
    kept = np.flatnonzero(rng.random(1000) > share)
    samples, report = decode(b"".join(case.frames[i] for i in kept), case.protocol, case.options)
    assert (report.rate_hz, report.settings, report.clock_jumps) == (200.0, 0, 0)
    assert np.array_equal(samples.number, kept - kept[0])


def test_a_coarse_clock_invents_no_loss():
    case = encoders.inertial_labs(600, rate=2000.0)  # ms
    samples, report = decode(b"".join(case.frames))
    assert (report.rate_hz, report.lost, report.settings) == (2000.0, 0, 0)
    assert np.array_equal(samples.number, np.arange(600))


def test_stim_configuration_of_another_rate_counts_from_there():
    first = encoders.stim(100, increments=True)
    second = encoders.stim(100, increments=True, rate=1000.0)
    again = encoders.stim_configuration(3, 1, 1, 0b0100)
    samples, report = decode(first.preamble + b"".join(first.frames) + again + b"".join(second.frames))
    assert samples.gyro == pytest.approx(np.concatenate([first.gyro, second.gyro]))
    assert report.rate_hz == 1000.0
    assert samples.t is not None
    assert np.diff(samples.t[-100:]) == pytest.approx(np.full(99, 1e-3))
    assert np.diff(samples.t).max() < 0.0021


def test_stim_that_starts_anew_counts_no_loss_and_says_so():
    case = encoders.stim(90)
    samples, report = decode((case.preamble + b"".join(case.frames)) * 2)
    assert (len(samples), report.lost) == (180, 0)
    assert np.flatnonzero(samples.jumped).tolist() == [90]


@pytest.mark.parametrize("rate", [125.0, 250.0, 500.0, 1000.0, 2000.0])
@pytest.mark.parametrize("increments", [True, False])
def test_stim_without_configuration_is_told_by_gravity(increments, rate):
    case = encoders.stim(80, increments=increments, rate=rate)
    samples, report = decode(b"".join(case.frames), options=StreamOptions(rate_hz=rate))
    assert samples.gyro == pytest.approx(case.gyro)
    assert samples.accel == pytest.approx(case.accel)
    assert {finding.code for finding in report.findings} == {"units_assumed", "range_assumed"}


@pytest.mark.parametrize("every", [3, 10])
def test_mip_packets_with_more_in_every_nth_are_all_read(every):
    case, rate = encoders.mip(300), 250.0
    frames = []
    for i in range(300):
        fields = [(0xD5, struct.pack(">Q", 4_000_000 * i)), (0x08, (case.accel[i] / rate / encoders.G).astype(">f4"))]
        fields = [(name, bytes(data)) for name, data in fields]
        fields.append((0x07, (case.gyro[i] / rate).astype(">f4").tobytes()))
        if i % every == 0:
            fields = [(0x06, bytes(12)), *fields, (0x14, struct.pack(">3f", 20, 21, 20.5))]
        if i % 100 == 0:
            fields.append((0x12, struct.pack(">dHH", i / rate, 2300, 7)))
        frames.append(encoders.mip_frame(fields))
    samples, report = decode(b"".join(frames))
    assert samples.gyro == pytest.approx(case.gyro, rel=1e-6)
    assert (report.other, report.lost, report.rate_hz) == (0, 0, rate)


def test_xbus_messages_with_more_in_every_nth_are_all_read():
    case, frames = encoders.xbus(200), []
    for i in range(200):
        blocks = [(0x1060, struct.pack(">I", 100 * i)), (0x8020, case.gyro[i].astype(">f4").tobytes())]
        blocks.append((0x4020, case.accel[i].astype(">f4").tobytes()))
        if i % 5 == 0:
            blocks = [(0x0810, struct.pack(">f", 20.0)), *blocks, (0x7010, bytes(94))]
        frames.append(encoders.xbus_frame(blocks))
    samples, report = decode(b"".join(frames))
    assert samples.gyro == pytest.approx(case.gyro, rel=1e-6)
    assert samples.accel == pytest.approx(case.accel, rel=1e-6)
    assert (report.other, report.lost, report.rate_hz) == (0, 0, 100.0)


def test_a_cut_xbus_message_and_the_next_are_no_message():
    """Its sum of one byte lets every 256th pair of them pass; here one is made so."""
    case = encoders.xbus(300, form="12.20")
    first, second = case.frames[100], case.frames[101]
    for size in range(30, len(first)):
        cut = bytearray(first[:size])
        false = bytes(cut) + second[: len(first) - size]
        cut[-1] = (cut[-1] - sum(false[1:])) & 0xFF
        data = b"".join(case.frames[:100]) + bytes(cut) + b"".join(case.frames[101:])
        samples, report = decode(data, "xbus")
        assert (len(samples), report.lost, report.other) == (299, 1, 0), size


def test_kvh_time_since_the_pulse_is_no_break():
    case, frames = encoders.kvh(2100, form="B"), []
    for i, frame in enumerate(case.frames):
        body = frame[:28] + struct.pack(">I", 1000 * (i % 1000)) + frame[32:-4]
        frames.append(body + encoders.crc32_msb(body).to_bytes(4, "big"))
    samples, report = decode(b"".join(frames), "kvh", case.options)
    assert not samples.jumped.any()
    assert report.lost == 0


def test_vectornav_increments_tell_their_rate_without_a_clock():
    case = encoders.vectornav(80, rate=400.0)
    frames = [encoders.vectornav_frame(0b100, (0x00DC,), frame[26:-2]) for frame in case.frames]
    samples, report = decode(b"".join(frames))
    assert samples.gyro == pytest.approx(case.gyro)
    assert (report.rate_hz, report.rate_from) == (400.0, "its increments")


def test_a_break_of_unknown_length_in_a_capture_is_a_note(tmp_path):
    case, path = encoders.stim(500), tmp_path / "stim.bin"
    path.write_bytes((case.preamble + b"".join(case.frames)) * 2)
    notes = {note.code: note for note in gn.read(path, axes="frd").notes}
    assert notes["clock_set"].value == 1


def test_a_capture_of_two_rates_is_refused_with_a_cut_that_works(tmp_path):
    first, second = (encoders.novatel(2000, rate=rate, text=False) for rate in (200.0, 400.0))
    whole = b"".join(first.frames + second.frames)
    path = tmp_path / "imu.gps"
    path.write_bytes(whole)
    at = sum(map(len, first.frames))
    with pytest.raises(InputError, match=f"at byte {at} the unit was reset, from 200 to 400 Hz"):
        gn.read(path)
    path.write_bytes(whole[:at])
    assert gn.read(path).rate_hz == 200.0
    path.write_bytes(whole[at:])
    assert gn.read(path).rate_hz == 400.0


@pytest.mark.parametrize("units", [2, 3])
@pytest.mark.parametrize("name", ["kvh-A-rate", "stim", "xbus-12.20", "novatel-RAWIMUSX-text", "mip-scaled"])
def test_frames_of_several_units_in_turn_are_refused(name, units):
    """As two units on one RS-422 line, or two ports merged into one file: one heading of both would mean nothing."""
    case = encoders.CASES[name](200)
    shifted = [case.frames[37 * k :] + case.frames[: 37 * k] for k in range(units)]
    with pytest.raises(InputError, match="several units in turn"):
        decode(b"".join(b"".join(frames) for frames in zip(*shifted, strict=True)), case.protocol, case.options)


@pytest.mark.parametrize("moves", [(1,), (4,), (2, 3), (1, 1, 2)])
def test_a_counter_that_skips_numbers_is_of_one_unit(moves):
    counters = np.cumsum(np.resize(moves, 100)) % 256
    fields = Fields(np.zeros((100, 3)), None, counter=np.delete(counters, [20, 41]), counter_wrap=256)
    assert of_several_units(fields) == ""


def test_a_long_counter_that_goes_back_is_a_restart_and_no_loss():
    rates = 1e-5 * np.random.default_rng(1).standard_normal((300, 3))
    blocks = [(struct.pack(">H", i), rate.astype(">f4").tobytes()) for i, rate in enumerate(rates)]
    frames = [encoders.xbus_frame([(0x1020, counter), (0x8020, rate)]) for counter, rate in blocks]
    samples, report = decode(b"".join(frames + frames), options=StreamOptions(rate_hz=400.0))
    assert (len(samples), report.lost) == (600, 0)
    assert np.flatnonzero(samples.jumped).tolist() == [300]
    wrapped = [encoders.xbus_frame([(0x1020, struct.pack(">H", (65400 + i) & 0xFFFF)), (0x8020, blocks[i][1])])
               for i in range(300)]  # fmt: skip
    samples, report = decode(b"".join(wrapped[:90] + wrapped[100:]), options=StreamOptions(rate_hz=400.0))
    assert (report.lost, samples.jumped.any()) == (10, False)


@pytest.mark.parametrize("damaged", [(2, 6), (4, 200), (300,)])
def test_losses_between_five_control_messages_are_counted_though_the_first_frames_are_damaged(damaged):
    """HG4930: no counter, no clock; the bytes from sample to sample tell, of whole samples and of control messages."""
    case = encoders.CASES["hg4930"](400)
    (control,) = case.others
    parts = [bytearray(5 * control + frame) for frame in case.frames]
    parts[0] = parts[0][50:]
    for place in damaged:
        parts[place][-10] ^= 4  # of the sample
        parts[place + 2][30] ^= 4  # of two control messages
        parts[place + 2][50] ^= 4
    samples, report = decode(b"".join(parts), "hg4930")
    assert (len(samples), report.lost) == (400 - len(damaged), len(damaged))
    assert np.array_equal(samples.number, np.delete(np.arange(400), damaged))
