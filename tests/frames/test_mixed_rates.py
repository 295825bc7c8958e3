"""Streams whose frames differ: specific force at a lower rate, clocks that are set, other messages between."""

from __future__ import annotations

import struct
from itertools import pairwise

import numpy as np
import pytest
from frames import encoders

from gyronorth.errors import InputError
from gyronorth.frames import FrameStream, Report, Samples, StreamOptions, decode
from gyronorth.frames.samples import joined

N, RATE_HZ = 200, 500.0
RATES, FORCES = encoders.signal(N, encoders.FRD)
AS_SENT = RATES.astype(np.float32).astype(float)


def codes(report: Report) -> list[str]:
    return [finding.code for finding in report.findings]


def big(values: np.ndarray) -> bytes:
    return struct.pack(">3f", *values)


def mip(i: int, *, delta: bool, force: bool, over: int = 1) -> bytes:
    """`over`: samples over which the velocity was gained."""
    gyro = (0x07, big(RATES[i % N] / RATE_HZ)) if delta else (0x05, big(RATES[i % N]))
    accel = (
        (0x08, big(FORCES[i % N] / encoders.G / RATE_HZ * over)) if delta else (0x04, big(FORCES[i % N] / encoders.G))
    )
    return encoders.mip_frame([(0xD5, struct.pack(">Q", i * 2_000_000)), gyro, *([accel] if force else [])])


def xbus(i: int, *, force: bool, late: int = 0) -> bytes:
    blocks = [(0x1020, struct.pack(">H", 65500 + i & 0xFFFF)), (0x1060, struct.pack(">I", 20 * i + late))]
    return encoders.xbus_frame(
        [*blocks, (0x8020, big(RATES[i])), *([(0x4020, big(FORCES[i]))] if force else [])],
    )


def slower_vectornav(i: int, every: int) -> bytes:
    time = struct.pack("<Q", i * 2_000_000)
    gyro = encoders.vectornav_frame(0b110, (1, 1 << 3), time + struct.pack("<3f", *RATES[i]))
    accel = encoders.vectornav_frame(0b110, (1, 1 << 2), time + struct.pack("<3f", *FORCES[i]))
    return gyro + (accel if i % every == 0 else b"")


def inertial_labs(i: int, every: int) -> bytes:
    time, angle = (
        struct.pack("<I", 604_799_900 + 2 * i if i < 50 else 2 * i - 100),
        np.round(np.degrees(RATES[i]) * 1e5),
    )
    gyro = encoders.inertial_labs_frame(b"\x01\x21", time + struct.pack("<3i", *angle.astype(int)))
    force = np.round(FORCES[i] / encoders.G * 1e6).astype(int)
    return gyro + (encoders.inertial_labs_frame(b"\x23", struct.pack("<3i", *force)) if i % every == 0 else b"")


SLOWER = {
    "mip": lambda i, every: mip(i, delta=False, force=i % every == 0),
    "mip-delta": lambda i, every: mip(i, delta=True, force=i % every == 0, over=every),
    "xbus": lambda i, every: xbus(i, force=i % every == 0),
    "vectornav": slower_vectornav,
    "inertial-labs": inertial_labs,
}


@pytest.mark.parametrize("every", [1, 2, 5])
@pytest.mark.parametrize("name", list(SLOWER))
def test_rate_is_averaged_to_specific_force_that_comes_less_often(name, every):
    frames = [SLOWER[name](i, every) for i in range(N)]
    samples, report = decode(b"".join(frames), name.removesuffix("-delta"))
    assert (report.rate_hz, report.samples, report.lost) == (RATE_HZ / every, N, 0)
    assert codes(report) == (["force_paired"] if every > 1 else [])
    assert samples.accel is not None
    first = np.flatnonzero(np.arange(N) % every == 0)[-len(samples) :] - every // 2  # the force comes in the middle
    if every > 1:
        means = np.array([RATES[at : at + every].mean(axis=0) for at in first if at + every <= N])
        assert samples.gyro[: len(means)] == pytest.approx(means, abs=2e-7)  # 1e-5 deg/s is the coarsest step
        assert len(samples) in (len(means), len(means) + 1)
    assert samples.accel == pytest.approx(FORCES[first + every // 2], rel=1e-6, abs=1e-5)
    assert samples.number.tolist() == list(range(len(samples)))
    assert samples.t is not None
    assert samples.t == pytest.approx(samples.t[0] + np.arange(len(samples)) * every / RATE_HZ)


def fed(data: bytes, cuts: list[int]) -> Samples:
    stream = FrameStream("mip")
    edges = [0, *cuts, len(data)]
    parts = [stream.feed(data[first:last]) for first, last in pairwise(edges)]
    return joined([part for part in (*parts, stream.finish()) if part is not None])


@pytest.mark.slow
def test_means_are_the_same_however_the_stream_is_cut():
    data = b"".join(mip(i, delta=False, force=i % 7 == 3) for i in range(3 * N))
    whole, cuts = fed(data, []), np.sort(np.random.default_rng(4).integers(0, len(data), 60)).tolist()
    for name in ("gyro", "accel", "number", "t", "start"):
        assert getattr(fed(data, cuts), name) == pytest.approx(getattr(whole, name), abs=1e-12)


def test_lost_frames_leave_means_of_what_came():
    rng = np.random.default_rng(9)
    keep = rng.random(4000) > 0.01
    data = b"".join(mip(i, delta=False, force=i % 50 == 0) for i in range(4000) if keep[i])
    samples, report = decode(data)
    assert report.rate_hz == RATE_HZ / 50
    assert samples.t is not None
    forces = int(keep[::50].sum())
    assert forces - 2 <= len(samples) <= forces  # none left out for a lost rate, none made up
    assert np.diff(samples.t) == pytest.approx(np.diff(samples.number) * 0.1, abs=1e-9)


def test_stream_whose_specific_force_stops_goes_on_without_it():
    data = b"".join(mip(i, delta=False, force=i % 5 == 0 and i < 500) for i in range(2000))
    samples, report = decode(data)
    assert codes(report) == ["force_paired", "layout_changed"]
    assert [kind.accel for kind in report.kinds] == [True, False]
    assert len(samples) > 1400


@pytest.mark.parametrize("every", [2.5, 0.5])
def test_other_ratios_use_each_sample_once(every):
    gyro = [(0x05, big(RATES[i])) for i in range(N)]
    force = [(0x04, big(row / encoders.G)) for row in np.repeat(FORCES, 3, axis=0)]
    data, done = b"", 0
    for i in range(N):
        data += encoders.mip_frame([(0xD5, struct.pack(">Q", i * 2_000_000)), gyro[i]])
        while done * every <= i:
            data, done = data + encoders.mip_frame([force[done]]), done + 1
    samples, report = decode(data)
    per = int(np.ceil(every))
    assert report.rate_hz == RATE_HZ / per
    assert samples.accel is not None
    assert samples.t is not None
    assert len(samples) >= N // per - 2
    assert samples.gyro.mean(axis=0) == pytest.approx(RATES.mean(axis=0), abs=5e-6)


def test_specific_force_that_is_switched_on_is_taken_from_there():
    data = b"".join(mip(i, delta=True, force=i >= N) for i in range(2 * N))
    _, report = decode(data)
    assert codes(report) == ["layout_changed"]
    assert [(kind.rate_hz, kind.accel) for kind in report.kinds] == [(RATE_HZ, False), (RATE_HZ, True)]


def kvh_b(late: int) -> list[bytes]:
    frames = []
    for i in range(N):
        body = b"\xfe\x81\xff\x56" + big(RATES[i] / RATE_HZ) + big(FORCES[i] / encoders.G)
        body += struct.pack(">IBBh", 2000 * i + (late if i >= 120 else 0), 0x77, i & 127, 25)
        frames.append(body + encoders.crc32_msb(body).to_bytes(4, "big"))
    return frames


SET_FORWARD = {
    "kvh": kvh_b(5_000_000), "xbus": [xbus(i, force=True, late=50_000 * (i >= 120)) for i in range(N)]
}  # fmt: skip


@pytest.mark.parametrize("name", list(SET_FORWARD))
def test_a_clock_that_is_set_forward_is_no_loss_where_the_counter_goes_on(name):
    frames = SET_FORWARD[name]
    samples, report = decode(b"".join(frames))
    assert (len(samples), report.lost, report.clock_jumps) == (N, 0, 1)
    assert samples.t == pytest.approx(np.arange(N) / RATE_HZ)
    lost = frames[:60] + frames[100:]
    assert decode(b"".join(lost))[1].lost == 40


@pytest.mark.parametrize("field", [b"", b"\1\0\2\0\3\0"], ids=["44", "50"])
@pytest.mark.parametrize("kinds", [(0x04, 0x05), (0x0C, 0x0D)])
def test_inertial_messages_of_the_hg1120(kinds, field):
    control = encoders.sum16_frame(bytes((0x0E, kinds[0])) + bytes(12) + field + bytes(4))
    angle, speed = np.round(RATES / 100 * 2.0**34), np.round(FORCES / 100 / 0.3048 * 2.0**28)
    data = b""
    for i in range(80):
        numbers = struct.pack("<6i", *angle[i].astype(int), *speed[i].astype(int))
        head = bytes((0x0E, kinds[1])) + bytes(12) + field + bytes(4)
        data += encoders.sum16_frame(head + numbers) + control * 5
    samples, report = decode(data, "hg4930")
    assert samples.gyro == pytest.approx(angle[:80] * 2.0**-34 * 100)
    assert samples.accel == pytest.approx(speed[:80] * 2.0**-28 * 0.3048 * 100)
    assert (report.lost, report.other, report.skipped, report.rate_hz) == (0, 400, 0, 100.0)


def test_lines_between_binary_frames_of_vectornav_are_no_lost_samples():
    line = encoders.xor_line("$VNYPR,+010.071,+000.278,-002.026")
    one = [encoders.vectornav_frame(0b100, (0b1100,), struct.pack("<6f", *FORCES[i], *RATES[i])) for i in range(N)]
    data = b"".join(frame + (line if i % 9 == 4 else b"") for i, frame in enumerate(one))
    samples, report = decode(data, options=StreamOptions(rate_hz=400.0))
    assert (len(samples), report.lost, report.skipped) == (N, 0, 0)


def apimu(i: int, tail: str) -> bytes:
    force = ",".join(f"{value:.4f}" for value in FORCES[i] / encoders.G)
    return encoders.xor_line(f"#APIMU,{1000 + 5 * i:.3f},0.000,{force},0.1,0.2,0.3,{tail}")


@pytest.mark.parametrize("tail", ["", ",43.0675"])
def test_short_lines_of_anello_with_three_optical_gyros(tail):
    rates = np.degrees(RATES)
    lines = [apimu(i, ",".join(f"{value:.5f}" for value in rates[i]) + tail) for i in range(N)]
    samples, report = decode(b"".join(lines))
    assert samples.gyro == pytest.approx(np.radians(np.round(rates, 5)), abs=1e-12)
    assert (report.lost, report.rate_hz, samples.temperature is None) == (0, 200.0, not tail)
    one = [apimu(i, f"{rates[i, 2]:.5f},0.0000,{1001 + 5 * i:.3f}{tail}") for i in range(N)]
    with pytest.raises(InputError, match="one optical gyro"):
        decode(b"".join(one))
