"""What holds for every protocol: cut ends, damage, noise, other messages, pieces, recognition, mutation."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from frames.encoders import CASES, Case, anpp_frame
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gyronorth.errors import InputError
from gyronorth.frames import NAMES, FrameStream, Samples, StreamOptions, decode, recognise
from gyronorth.frames.clock import NOMINAL_HZ, rate_of_clock
from gyronorth.frames.framing import Framer
from gyronorth.frames.protocol import Fields
from gyronorth.frames.registry import protocol_of

CASE = pytest.mark.parametrize("name", list(CASES))
N = 400


@cache
def made(name: str, n: int = N) -> Case:
    return CASES[name](n)


def assert_are(samples: Samples, case: Case, index: np.ndarray) -> None:
    """The samples are exactly those sent as frames `index`, within half a step of the quantisation."""
    assert len(samples) == len(index)
    assert np.abs(samples.gyro - case.gyro[index]).max() <= 0.501 * case.gyro_step + 1e-15
    assert samples.accel is not None
    assert np.abs(samples.accel - case.accel[index]).max() <= 0.501 * case.accel_step + 1e-11


def test_every_protocol_has_a_case():
    assert {made(name).protocol for name in CASES} == set(NAMES)


@pytest.mark.slow
@CASE
def test_a_damaged_capture_gives_what_was_sent_and_counts_what_is_lost(name):
    case, rng = CASES[name](1500), np.random.default_rng(7)
    hit = np.sort(rng.choice(np.arange(1, 1499), 15, replace=False))
    frames = list(case.frames)
    for i in hit:
        frame = bytearray(frames[i])
        body = len(bytes(frame).rstrip(b"\r\n")) if frame.endswith(b"\r\n") else len(frame)
        frame[rng.integers(body)] ^= 1 << rng.integers(8)
        frames[i] = bytes(frame)
    whole = case.preamble + b"".join(frames)
    cut_start = len(case.preamble) + len(frames[0]) // 2 if not case.preamble else 0
    data = whole[cut_start : -(len(frames[-1].rstrip(b"\r\n")) // 2)]
    samples, report = decode(data, case.protocol, case.options)
    good = np.setdiff1d(np.arange(1 if cut_start else 0, 1499), hit)
    assert_are(samples, case, good)
    assert np.array_equal(samples.number, good - good[0])
    assert report.lost == good[-1] - good[0] + 1 - len(good)
    assert report.lost_from == case.knows_lost
    assert report.rate_hz == pytest.approx(case.rate_hz, rel=1e-6)
    assert samples.t == pytest.approx((good - good[0]) / case.rate_hz, abs=2e-3 if name == "inertial-labs" else 1e-6)
    assert report.samples == len(good)
    assert report.unusable == report.clock_jumps == 0


@CASE
def test_noise_between_frames_adds_and_takes_nothing(name):
    case, rng = made(name), np.random.default_rng(8)
    data, noise = case.preamble, 0
    for frame in case.frames:
        if rng.random() < 0.2:
            piece = (
                bytes(rng.integers(0, 256, rng.integers(1, 30), dtype=np.uint8))
                .replace(b"\r", b"x")
                .replace(b"\n", b"x")
            )
            data, noise = data + piece, noise + len(piece)
        data += frame
    samples, report = decode(data, case.protocol, case.options)
    assert_are(samples, case, np.arange(N))
    assert report.skipped == noise
    if case.knows_lost != "bytes":
        assert report.lost == 0


@pytest.mark.parametrize("period", [1, 5])
def test_a_damaged_message_without_samples_is_no_lost_sample(period):
    case = made("anpp")  # it sends neither a counter nor a time
    state = anpp_frame(20, bytes(range(100)))
    damaged = state[:40] + bytes((state[40] ^ 1,)) + state[41:]
    frames = [frame + (state if i % period == 0 else b"") for i, frame in enumerate(case.frames)]
    frames[200] = case.frames[200] + damaged
    frames[300] = frames[300][:20] + bytes((frames[300][20] ^ 1,)) + frames[300][21 : -len(state)] + damaged
    samples, report = decode(b"".join(frames), case.protocol, case.options)
    assert np.array_equal(samples.number, np.delete(np.arange(N), 300))
    assert report.lost == 1


@CASE
def test_other_messages_between_are_passed_over(name):
    case, data = made(name), made(name).preamble
    for i, frame in enumerate(case.frames):
        data += frame + (case.others[i // 5 % len(case.others)] if i % 5 == 0 and case.others else b"")
    samples, report = decode(data, case.protocol, case.options)
    assert_are(samples, case, np.arange(N))
    assert report.lost == report.skipped == 0
    assert report.other == (N // 5 if case.others else 0) + bool(case.preamble)


@CASE
def test_only_other_messages_are_an_input_error(name):
    case = made(name)
    if case.others and name != "hg4930":  # its control messages hold rates too
        with pytest.raises(InputError, match=r"no raw rates|cannot find north"):
            decode(b"".join(case.others) * 20, case.protocol, case.options)


@pytest.mark.slow
@CASE
@pytest.mark.parametrize("size", [1, None, pytest.param(97, marks=pytest.mark.long)])
def test_pieces_give_what_the_whole_gives(name, size):
    case, rng = made(name, 80), np.random.default_rng(9)
    frames = [frame if i % 31 else b"\x00noise" + frame[:-3] for i, frame in enumerate(case.frames)]
    data = case.preamble + b"".join(frames)
    expected, report = decode(data, case.protocol, case.options)
    stream, got, at = FrameStream(case.protocol, case.options), [], 0
    if size == 1:  # byte by byte from the middle of a frame at the end of those that are held back
        at = len(case.preamble) + sum(map(len, frames[:62])) + 5
        got.append(stream.feed(data[:at]))
        data = data[: at + sum(map(len, frames[62:67]))]
        expected, report = decode(data, case.protocol, case.options)
    while at < len(data):
        step = size or int(rng.integers(1, 400))
        got.append(stream.feed(data[at : at + step]))
        at += step
    got = [part for part in (*got, stream.finish()) if part is not None]
    for field in ("gyro", "accel", "number", "t", "saturated", "sensor_fault", "start"):
        parts = [getattr(part, field) for part in got]
        assert np.array_equal(np.concatenate(parts), getattr(expected, field)), field
    assert stream.report == report


@pytest.mark.slow
@CASE
def test_a_sample_comes_with_the_last_byte_of_its_frame(name):
    """After the first frames nothing is held back: a live heading is not late by a buffer."""
    case = made(name, 150)
    stream = FrameStream(case.protocol, case.options)
    stream.feed(case.preamble + b"".join(case.frames[:120]))
    for frame in case.frames[120:]:
        samples = stream.feed(frame)
        assert samples is not None
        assert len(samples) == 1


@CASE
def test_a_protocol_is_recognised_by_its_frames(name):
    case = made(name, 40)
    data = case.preamble + b"".join(case.frames)
    assert recognise(data[3:-2]) == case.protocol


def test_a_few_frames_are_no_protocol():
    frames = made("sbg-short").frames
    assert recognise(b"".join(frames[:3])) is None
    assert recognise(b"".join(frames[:4])) == "sbg"


def test_nothing_is_recognised_in_noise_and_text():
    rng = np.random.default_rng(10)
    assert recognise(rng.bytes(1 << 16)) is None
    assert recognise(bytes(1 << 16)) is None
    rows = "\n".join(",".join(f"{value:.6f}" for value in row) for row in rng.standard_normal((500, 7)))
    assert recognise(f"# rate_hz: 100\nt,w_x,w_y,w_z,f_x,f_y,f_z\n{rows}\n".encode()) is None
    with pytest.raises(InputError, match="wrong baud rate"):
        decode(rng.bytes(5000))


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_random_bytes_hold_no_more_frames_than_the_checksums_allow(name):
    """Of 2^20 positions each shows a false frame with a chance below 2^-24: two or more with one below 0.2 %."""
    frames = Framer(protocol_of(name)).feed(np.random.default_rng(11).bytes(1 << 20), last=True)
    assert len(frames) <= 1
    stream = FrameStream(name, StreamOptions(rate_hz=100.0, imu="isa100c"))
    assert stream.feed(np.random.default_rng(12).bytes(1 << 20)) is None
    assert stream.finish() is None


@CASE
def test_frames_with_another_identifier_are_no_samples(name):
    """A wrong identifier makes the checksum fail: nothing comes out, instead of numbers that mean nothing."""
    case = made(name, 60)
    spoiled = b"".join(frame[:5].swapcase()[:1] + bytes((frame[1] ^ 1,)) + frame[2:] for frame in case.frames)
    assert recognise(spoiled) is None


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_a_mutated_stream_raises_nothing_else_and_gives_finite_numbers(data):
    case = made(data.draw(st.sampled_from(list(CASES))), 80)
    stream = bytearray(case.preamble + b"".join(case.frames))
    for _ in range(data.draw(st.integers(1, 40))):
        at = data.draw(st.integers(0, len(stream) - 1))
        kind = data.draw(st.sampled_from(["set", "cut", "insert", "repeat"]))
        piece = data.draw(st.binary(min_size=1, max_size=12))
        end = at + (len(piece) if kind in ("set", "cut") else 0)
        new = {"set": piece, "cut": b"", "insert": piece, "repeat": bytes(stream[max(at - 70, 0) : at])}[kind]
        stream[at:end] = new
        if not stream:
            return
    try:
        samples, report = decode(bytes(stream), data.draw(st.sampled_from([None, case.protocol])), case.options)
    except InputError:
        return
    assert np.isfinite(samples.gyro).all()
    assert samples.accel is None or np.isfinite(samples.accel).all()
    assert samples.t is None or np.isfinite(samples.t).all()
    assert (np.diff(samples.number) > 0).all()
    assert report.samples == len(samples)


@settings(max_examples=60, deadline=None)
@given(
    rate=st.sampled_from([rate for rate in NOMINAL_HZ if rate <= 900]),
    tick=st.sampled_from([1e-3, 1e-4, 1e-6, 1e-9]),
    lost=st.sets(st.integers(1, 62), max_size=3),
    wrap=st.booleans(),
)
def test_the_rate_is_found_with_a_coarse_clock(rate, tick, lost, wrap):
    number = np.setdiff1d(np.arange(64), list(lost))
    ticks = np.round(number / rate / tick).astype(np.int64) + (2**32 - 50 if wrap else 0)
    fields = Fields(np.zeros((len(ticks), 3)), None, ticks % 2**32, tick, 2**32)
    found = rate_of_clock(fields)
    assert found is not None
    assert abs(found / rate - 1) < 4 * tick * rate / 63 + 1e-6


def test_an_odd_rate_of_a_good_clock_is_kept():
    ticks = np.round(np.arange(64) / 997.0 * 1e6).astype(np.int64)
    assert rate_of_clock(Fields(np.zeros((64, 3)), None, ticks, 1e-6)) == pytest.approx(997.0, rel=1e-4)


def test_an_unknown_protocol_lists_the_known_ones():
    with pytest.raises(InputError, match="stim, novatel, kvh"):
        FrameStream("stim3000")
