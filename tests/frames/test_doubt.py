"""Frames whose checksum holds by chance: their neighbours tell."""

from __future__ import annotations

import binascii
import struct
from functools import cache

import numpy as np
import pytest
from frames.encoders import CASES, Case, G, anpp_frame, sbg_frame, xbus_frame

from gyronorth.frames import FrameStream, decode
from gyronorth.frames.clock import rate_of_clock
from gyronorth.frames.framing import Framer
from gyronorth.frames.protocol import Fields
from gyronorth.frames.registry import protocol_of

SUMMED = [name for name in CASES if protocol_of(CASES[name](1).protocol).doubt == "always"]
SHORT = [name for name in CASES if protocol_of(CASES[name](1).protocol).doubt == "beside damage"]
N = 3000
#: Shares of the noise of one sample: what is wrong by less cannot be told from it.
TOLD = 20.0


@cache
def made(name: str) -> Case:
    return CASES[name](N)


def spoiled(case: Case, share: float, rng: np.random.Generator) -> tuple[list[bytes], np.ndarray]:
    """The frames, some with two to four wrong bits that the checksum does not show; and which."""
    frames, hit, framer = list(case.frames), np.zeros(N, bool), protocol_of(case.protocol)
    for place in np.flatnonzero(rng.random(N) < share):
        for _ in range(2000):
            frame = bytearray(frames[place])
            bit = rng.integers(8)
            for _ in range(2 * rng.integers(1, 3)):
                frame[rng.integers(len(frame))] ^= 1 << bit
            if frame != frames[place] and len(Framer(framer).feed(bytes(frame), last=True)) == 1:
                frames[place], hit[place] = bytes(frame), True
                break
    return frames, hit


@pytest.mark.slow
def test_protocols_with_a_sum_are_those():
    assert {made(name).protocol for name in SUMMED} == {
        "hg4930", "vectornav-ascii", "mip", "xbus", "inertial-labs", "anello", "anello-x3"
    }  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", SUMMED)
def test_errors_that_undo_each_other_in_the_sum_invent_no_sample(name):
    case = made(name)
    frames, hit = spoiled(case, 0.01, np.random.default_rng(3))
    hit[:100] = False
    frames[:100] = case.frames[:100]
    assert hit.sum() > 10
    samples, report = decode(b"".join(frames), case.protocol, case.options)
    starts = np.cumsum([0, *map(len, frames)])[:-1]
    sent = np.searchsorted(starts, samples.start, side="right") - 1
    assert samples.accel is not None
    wrong = np.abs(samples.gyro - case.gyro[sent]).max(axis=1) > TOLD * 1e-4
    wrong |= np.abs(samples.accel - case.accel[sent]).max(axis=1) > TOLD * 1e-2
    assert not wrong.any()
    assert np.isin(np.flatnonzero(~hit), sent).all()
    if case.knows_lost != "bytes":
        assert np.array_equal(samples.number, sent)
        assert (report.lost, report.clock_jumps, report.settings) == (N - len(samples), 0, 0)


@pytest.mark.parametrize("name", SUMMED)
def test_what_the_unit_itself_does_is_left(name):
    """Gaps at the source, a restart, a frame that is sent twice: no sample is taken away."""
    case = made(name)
    frames = [*case.frames[:300], *case.frames[340:500], case.frames[499], *case.frames[500:700], *case.frames[:300]]
    samples, report = decode(b"".join(frames), case.protocol, case.options)
    assert (len(samples), report.unusable) == (len(frames), 0)


#: Where the first rate stands in a frame, as a little-endian float or, of "sbg-short", a whole number.
RATE_AT = {"sbg-short": 24, "sbg-data": 52, "anpp": 17, "vectornav-delta": 58, "vectornav-raw": 38}


def of_another_rate(name: str, frame: bytes, rate: bytes) -> bytes:
    """The frame with another rate, and a CRC that holds."""
    spoiled = frame[: RATE_AT[name]] + rate + frame[RATE_AT[name] + 4 :]
    if name == "anpp":
        return anpp_frame(spoiled[1], spoiled[5:])
    if name.startswith("sbg"):
        return sbg_frame(spoiled[2], spoiled[6:-3])
    return spoiled[:-2] + struct.pack(">H", binascii.crc_hqx(spoiled[1:-2], 0))


@pytest.mark.parametrize("name", SHORT)
def test_a_wrong_sample_whose_crc_holds_is_left_out_beside_damage_and_kept_in_a_clean_stream(name):
    """It stands for the one damaged frame of 65,536 whose CRC-16 holds."""
    case = made(name)
    frames = list(case.frames)
    rate = struct.pack("<i", 1 << 26) if name == "sbg-short" else struct.pack("<f", 1.0)  # 1 rad/s, or 100 deg/s
    frames[1500] = of_another_rate(name, frames[1500], rate)
    samples, report = decode(b"".join(frames), case.protocol, case.options)
    assert (len(samples), report.unusable, report.lost) == (N, 0, 0)
    assert samples.gyro[1500, 0] > 0.1
    frames[1400] = frames[1400][:-4] + bytes(4)
    samples, report = decode(b"".join(frames), case.protocol, case.options)
    assert (len(samples), report.unusable, report.lost) == (N - 2, 1, 2)
    assert np.abs(samples.gyro).max() < 0.1


@pytest.mark.parametrize("name", SHORT)
def test_two_wrong_samples_in_a_row_are_left_out_beside_damage(name):
    case = made(name)
    frames = list(case.frames)
    rates = [(1 << 26, 1.0), (-(1 << 25), -0.7)]
    for place, (whole, rate) in zip((1500, 1501), rates, strict=True):
        sent = struct.pack("<i", whole) if name == "sbg-short" else struct.pack("<f", rate)
        frames[place] = of_another_rate(name, frames[place], sent)
    frames[1400] = frames[1400][:-4] + bytes(4)
    samples, report = decode(b"".join(frames), case.protocol, case.options)
    assert (len(samples), report.unusable, report.lost) == (N - 3, 2, 3)


def fast(values: np.ndarray) -> bytes:
    force = (0x4020, np.array([0, 0, G], ">f4").tobytes())
    return b"".join(
        xbus_frame(
            [(0x1060, int(100 * i).to_bytes(4, "big")), (0x8020, np.array([value, 0, 0], ">f4").tobytes()), force]
        )
        for i, value in enumerate(values)
    )


def test_motion_is_left_and_one_sample_alone_is_not():
    rng = np.random.default_rng(5)
    rest = 1e-5 * rng.standard_normal(900)
    moved = rest.copy()
    moved[200:] += 1.0  # a turn
    moved[400:500] += 0.5 * (-1.0) ** np.arange(100)  # as fast as it can be sampled
    moved[600:602] += 2.0  # a knock
    samples, report = decode(fast(moved), "xbus")
    assert (len(samples), report.unusable, report.lost) == (900, 0, 0)
    moved[700] = 40.0
    samples, report = decode(fast(moved), "xbus")
    assert (len(samples), report.unusable, report.lost) == (899, 1, 1)


@pytest.mark.slow
@pytest.mark.parametrize("name", SUMMED)
def test_frames_in_doubt_do_not_hang_on_the_pieces(name):
    case = made(name)
    frames, _ = spoiled(case, 0.1, np.random.default_rng(6))
    data = b"".join(frames[:250])
    expected, report = decode(data, case.protocol, case.options)
    stream, rng, at, got, starts = FrameStream(case.protocol, case.options), np.random.default_rng(7), 0, [], []
    while at < len(data):
        step = int(rng.integers(1, 300))
        got.append(stream.feed(data[at : at + step]))
        at += step
        assert data[:at].translate(None, b"\r\n").endswith(stream.pending.translate(None, b"\r\n"))
        starts.append(min(at, len(data)) - stream.undecided)
    got = [part for part in (*got, stream.finish()) if part is not None]
    assert np.array_equal(np.concatenate([part.gyro for part in got]), expected.gyro)
    assert np.array_equal(np.concatenate([part.number for part in got]), expected.number)
    assert stream.report == report
    assert starts == sorted(starts)


def test_the_next_sample_frees_one_in_doubt():
    rates = 1e-5 * np.random.default_rng(8).standard_normal(200)
    rates[150:] += 1.0
    stream, size, data = FrameStream("xbus"), len(fast(rates[:1])), fast(rates)
    stream.feed(data[: 150 * size])
    given = [stream.feed(data[i * size : (i + 1) * size]) for i in range(150, 160)]
    assert [0 if part is None else len(part) for part in given] == [0, 2, *[1] * 8]


@pytest.mark.parametrize("rate_hz", [246.3, 1000.0])
@pytest.mark.parametrize("tick", [1e-6, 1e-3])
@pytest.mark.parametrize("off_s", [2e-3, 14e-3, 0.13, 4.295, 50.0])
def test_a_damaged_time_stamp_at_the_start_changes_no_rate(rate_hz, tick, off_s):
    ticks = np.floor(np.arange(64) / rate_hz / tick + 0.5).astype(np.int64)
    for place in (0, 20, 63):
        spoiled = ticks.copy()
        spoiled[place] += round(off_s / tick)
        found = rate_of_clock(Fields(gyro=np.zeros((64, 3)), accel=None, ticks=spoiled, tick=tick))
        within = 1e-4 if tick < 1e-5 else 0.03  # of ticks of 1 ms, two over 64 samples
        assert found == pytest.approx(rate_hz, rel=within), (place, off_s)


@pytest.mark.parametrize("name", ["sbg-data", "anpp", "vectornav-delta", "vectornav-raw"])
def test_a_signalling_nan_makes_no_warning_and_no_sample(name):
    case = made(name)
    frames = list(case.frames[:200])
    frames[150] = of_another_rate(name, frames[150], b"\x01\x00\x80\x7f")
    samples, report = decode(b"".join(frames), case.protocol, case.options)
    assert (len(samples), report.unusable) == (199, 1)


@pytest.mark.parametrize(
    ("torn", "flagged", "told"), [(True, [200], []), (False, [200], [200]), (True, [200, 201], [200, 201])]
)
def test_a_status_bit_of_one_sample_alone_is_an_error_of_a_line_that_makes_some(torn, flagged, told):
    def frame(i: int) -> bytes:
        blocks = [(0x1020, struct.pack(">H", i)), (0x1060, struct.pack(">I", 100 * i))]
        blocks += [(0x8020, struct.pack(">3f", *case.gyro[i])), (0x4020, struct.pack(">3f", *case.accel[i]))]
        return xbus_frame([*blocks, (0xE020, struct.pack(">I", 0x3 | (0x0800 if i in flagged else 0)))])

    case = CASES["xbus-dq"](400)
    data = b"".join(b"\xfa torn" * torn if i == 150 else frame(i) for i in range(400))
    samples, report = decode(data, "xbus")
    number = samples.number
    assert number[samples.saturated].tolist() == told
    assert set(range(400)) - set(number.tolist()) == {150, *(flagged if not told else ())}
    assert report.saturated == len(told)
