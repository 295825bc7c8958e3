"""The estimate of a running unit beside that of the finished recording, and what it costs."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from gyronorth import streaming
from gyronorth.angles import angle_error
from gyronorth.attitude import rotation
from gyronorth.deviation import fit_deviation
from gyronorth.earth import EARTH_RATE
from gyronorth.errors import InputError
from gyronorth.pipeline import METHODS, heading
from gyronorth.readers import read
from gyronorth.recording import Recording
from gyronorth.sensor import Sensor, TriadErrors, read_sensor
from gyronorth.simulation import Motion, simulate
from gyronorth.streaming import MOST_POSES, MOST_ROWS, TRACE_POINTS, WAITING, StreamingHeading, merged_rows

DEG = np.pi / 180
LATITUDE = 48 * DEG
SENSOR = read_sensor("isa100c")


def wind(times, *, runs, rng):
    """Roll and pitch of 3 arcmin at 0.03 to 0.2 Hz, (runs, k, 3) rad."""
    frequency, phase = rng.uniform(0.03, 0.2, (runs, 1, 2)), rng.uniform(0, 2 * np.pi, (runs, 1, 2))
    angle = np.zeros((runs, len(times), 3))
    angle[..., :2] = 3 / 60 * DEG * np.sin(2 * np.pi * frequency * times[:, None] + phase)
    return angle


def coning(times, *, runs, rng):
    """Roll and pitch of 0.3 deg at 4.3 Hz, a quarter of a period apart: rates that do not commute."""
    phase = 2 * np.pi * 4.3 * times
    angle = np.zeros((runs, len(times), 3))
    angle[..., 0], angle[..., 1] = 0.3 * DEG * np.sin(phase), 0.3 * DEG * np.cos(phase)
    return angle


def knocked(recording):
    """With a knock of 0.05 rad/s there and back, 0.1 s in all, in the middle."""
    gyro_b, middle, step = recording.gyro_b.copy(), len(recording.gyro_b) // 2, round(0.05 * recording.rate_hz)
    gyro_b[middle : middle + step] += 0.05
    gyro_b[middle + step : middle + 2 * step] -= 0.05
    return replace(recording, gyro_b=gyro_b)


@cache
def scene(name, duration=100.0, rate_hz=600.0):
    """A simulated recording of that name."""
    motion = {
        "sway": Motion(disturbance=wind),
        "coning": Motion(disturbance=coning),
        "turned": Motion(turns=((0.45 * duration + 0.07, 10.0, np.pi / 2),)),
    }.get(name)
    attitude = {"roll": 8 * DEG, "pitch": -12 * DEG} if name == "tilted" else {}
    made = simulate(
        SENSOR,
        latitude=LATITUDE,
        heading=1.0,
        duration=duration,
        rate_hz=rate_hz,
        rng=np.random.default_rng(3),
        motion=motion,
        **attitude,
    )
    if name == "gyro only":
        return replace(made, accel_b=None)
    return knocked(made) if name == "knocked" else made


def stream_of(recording, *, blocks=(997,), **settings):
    """A stream that was given the recording in blocks of these sizes, again and again."""
    stream = StreamingHeading(
        rate_hz=recording.rate_hz,
        latitude=recording.latitude,
        accelerometer=recording.accel_b is not None,
        **settings,
    )
    first, number = 0, 0
    while first < len(recording.gyro_b):
        last = first + blocks[number % len(blocks)]
        accel = None if recording.accel_b is None else recording.accel_b[first:last]
        stream.add(recording.gyro_b[first:last], accel)
        first, number = last, number + 1
    return stream


def assert_same(ours, offline):
    """0.01 deg of heading; sigma to three thousandths; the same verdict by the same method.

    The posterior weighs hypotheses by rows and their noise at short lags, which differ where rows are longer than the
    samples: it agrees to a fraction of sigma.
    """
    weighs = ours.method == "posterior" and ours.duration * ours.rate_hz > MOST_ROWS
    if offline.heading is None:
        assert (ours.heading, ours.sigma) == (None, None)
    else:
        assert abs(angle_error(ours.heading, offline.heading)) < (0.3 * offline.sigma if weighs else 0.01 * DEG)
        assert ours.sigma == pytest.approx(offline.sigma, rel=0.3 if weighs else 3e-3)
    assert (ours.method, ours.valid, ours.rate_hz) == (offline.method, offline.valid, offline.rate_hz)
    assert [f.code for f in ours.reasons] == [f.code for f in offline.reasons]
    assert [f.code for f in ours.warnings] == [f.code for f in offline.warnings]
    assert len(ours.poses) == len(offline.poses)


# --- the same as offline --------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("profile", [SENSOR, None], ids=["profile", "unknown"])
@pytest.mark.parametrize("name", ["still", "tilted", "turned", "sway", "coning", "knocked", "gyro only"])
def test_stream_gives_the_heading_of_the_recording(name, profile):
    recording = scene(name)
    # Fast coning: the means of a file leave out what the rotations of rows hold; the inertial frame follows both.
    method = "inertial" if name == "coning" else "auto"
    ours = stream_of(recording, sensor=profile, method=method).estimate()
    assert_same(ours, heading(recording, sensor=profile, method=method))


@pytest.mark.slow
@pytest.mark.parametrize("method", ["mean", "inertial", "bayes", "learned", "paper"])
def test_stream_gives_the_heading_of_each_method(method):
    recording = scene("sway")
    ours = stream_of(recording, sensor=SENSOR, method=method).estimate()
    assert_same(ours, heading(recording, sensor=SENSOR, method=method))


@pytest.mark.parametrize(("session", "applied"), [("s", True), (None, False), ("another", False)])
def test_a_deviation_curve_corrects_a_stream_of_its_session(session, applied):
    recording = replace(scene("still"), session=session)
    around = 1.0 + np.arange(-6, 6) * 0.2
    curve = fit_deviation(around, 0.01 * np.cos(7 * around), around - 0.1, session="s", latitude=LATITUDE)
    how = {"sensor": SENSOR, "method": "mean", "deviation": curve}
    ours, offline = stream_of(recording, session=session, **how).estimate(), heading(recording, **how)
    assert_same(ours, offline)
    assert ours.warnings[-1].code == ("deviation_applied" if applied else "deviation_unused")
    plain = heading(recording, sensor=SENSOR, method="mean").heading
    assert (abs(angle_error(plain, ours.heading)) > 0.05) == applied


@pytest.mark.slow
@pytest.mark.parametrize("rate_hz", [565.0, 128.0, 10.0, 2.5])
@pytest.mark.parametrize("name", ["still", "turned"])
def test_any_rate(name, rate_hz):
    """565 Hz: a chunk of 113 samples, a prime; 128 Hz: 25.6 samples; 2.5 Hz: slower than the chunks."""
    recording = scene(name, rate_hz=rate_hz)
    assert_same(stream_of(recording, sensor=SENSOR).estimate(), heading(recording, sensor=SENSOR))


def test_known_attitude_stands_in_for_levelling():
    recording, attitude = replace(scene("tilted"), accel_b=None), (8 * DEG, -12 * DEG)
    ours = stream_of(recording, sensor=SENSOR, attitude=attitude).estimate()
    assert_same(ours, heading(recording, sensor=SENSOR, attitude=attitude))


@pytest.mark.long  # the same over a minute: above
@pytest.mark.parametrize("name", ["still", "turned", "sway"])
def test_half_an_hour_at_600_hz(name):
    recording = scene.__wrapped__(name, duration=1800.0)
    assert_same(stream_of(recording, sensor=SENSOR, blocks=(4096,)).estimate(), heading(recording, sensor=SENSOR))


@pytest.mark.slow
def test_real_swaying_vehicle(real_data):
    recording = read(real_data / "lasergyro.imu")
    assert_same(stream_of(recording).estimate(), heading(recording))


@pytest.mark.slow
def test_estimates_on_the_way_change_nothing():
    recording = scene("turned")
    stream = StreamingHeading(rate_hz=600, latitude=LATITUDE, accelerometer=True, sensor=SENSOR)
    for first in range(0, len(recording.gyro_b), 6007):
        stream.add(recording.gyro_b[first : first + 6007], recording.accel_b[first : first + 6007])
        stream.estimate()
    assert_same(stream.estimate(), heading(recording, sensor=SENSOR))


# --- blocks ---------------------------------------------------------------------------------------


@cache
def in_one_block(name):
    """A stream that got all of a scene at once."""
    return stream_of(scene(name), blocks=(10**6,), sensor=SENSOR, method="mean")


@pytest.mark.slow
@settings(max_examples=8)
@given(
    blocks=st.lists(st.integers(1, 5000), min_size=1, max_size=8).filter(lambda sizes: sum(sizes) > 100 * len(sizes))
)
def test_blocks_of_any_size_give_the_same(blocks):
    """The same rows, to rounding, and so the same estimate of every method."""
    parts = stream_of(scene("turned"), blocks=blocks, sensor=SENSOR, method="mean")
    whole = in_one_block("turned")
    ours, theirs = parts.estimate(), whole.estimate()
    assert parts.store.size == whole.store.size == 5
    assert parts.store.count == whole.store.count
    assert_allclose(parts.store.rows[: parts.store.count], whole.store.rows[: whole.store.count], atol=1e-12)
    assert (ours.heading, ours.sigma) == pytest.approx((theirs.heading, theirs.sigma), abs=1e-9)
    assert ours.valid == theirs.valid


@pytest.mark.slow
def test_sample_by_sample():
    recording = scene("sway", duration=30.0, rate_hz=100.0)
    assert_same(stream_of(recording, blocks=(1,)).estimate(), heading(recording))


@settings(max_examples=40)
@given(
    rate=st.lists(st.floats(-5, 5), min_size=36, max_size=36),
    first=st.sampled_from([1, 2, 3, 4, 6, 12]),
)
def test_merged_rows_turn_as_their_samples(rate, first):
    """Product of the rotations one by one; and in two steps or in one, whatever the step."""
    rows = np.array(rate).reshape(12, 3)
    product = np.eye(3)
    for step in rotation(rows / 10.0):
        product = product @ step
    at_once = merged_rows(rows, 12, rate_hz=10.0)
    assert_allclose(rotation(at_once[0] * 1.2), product, atol=1e-9)
    two_steps = merged_rows(merged_rows(rows, first, rate_hz=10.0), 12 // first, rate_hz=10.0 / first)
    assert_allclose(rotation(two_steps[0] * 1.2), product, atol=1e-9)


def test_many_revolutions_in_a_row_are_kept():
    """A steady 3 revolutions per second: 9 of them in 3 s, not none."""
    rows = np.tile([0.0, 0.0, 6 * np.pi], (300, 1))
    assert_allclose(merged_rows(rows, 300, rate_hz=100.0), [[0.0, 0.0, 6 * np.pi]], rtol=1e-9)


# --- memory and work ------------------------------------------------------------------------------


def long_stream(minutes, monkeypatch, *, rate_hz=600.0, every=1, **settings):
    """A still stream of that many minutes, and the most samples, of any kind, that one estimate worked on."""
    handled = []
    solved = streaming.registry.solve
    monkeypatch.setattr(
        streaming.registry, "solve", lambda name, p, more: handled.append(len(p.gyro_b)) or solved(name, p, more)
    )
    stream = StreamingHeading(rate_hz=rate_hz, latitude=LATITUDE, accelerometer=True, sensor=SENSOR, **settings)
    rng = np.random.default_rng(5)
    piece = scene("still", duration=60.0, rate_hz=rate_hz)
    for minute in range(1, minutes + 1):
        order = rng.permutation(len(piece.gyro_b))
        stream.add(piece.gyro_b[order], piece.accel_b[order])
        if minute % every == 0:
            stream.estimate()
    return stream, max(handled)


def memory_of(stream):
    """Bytes of all arrays that the stream holds."""
    return sum(part.nbytes for part in vars(stream.store).values() if isinstance(part, np.ndarray))


@pytest.mark.slow
def test_memory_and_work_do_not_grow_with_time(monkeypatch):
    short, of_short = long_stream(6, monkeypatch, every=2)
    long, of_long = long_stream(16, monkeypatch, every=4)
    assert memory_of(short) == memory_of(long) < 2e6
    assert max(of_short, of_long) <= MOST_ROWS
    assert short.store.count <= MOST_ROWS
    assert MOST_ROWS / 5 < long.store.count <= MOST_ROWS  # and the time is still resolved
    assert long.duration == 960.0
    assert long.store.count * long.store.size + long.store.waiting == 960 * 600  # no sample is lost


@pytest.mark.slow
def test_rows_merged_do_not_grow_with_time(monkeypatch):
    """Samples pass once; rows once per doubling of the time: fewer in all than there were samples."""
    counted = []
    merged = streaming.merged_rows
    monkeypatch.setattr(
        streaming, "merged_rows", lambda rows, *a, **k: counted.append(len(rows)) or merged(rows, *a, **k)
    )
    stream = StreamingHeading(rate_hz=600, latitude=LATITUDE, accelerometer=False)
    work = []
    for _ in range(8):
        counted.clear()
        for _ in range(5):
            stream.add(np.full((60 * 600, 3), 1e-5))
        work.append(sum(counted))
    assert max(work) <= 5 * 60 * 600 + 3 * MOST_ROWS
    assert max(work[1:]) <= 5 * 60 * 600 + MOST_ROWS + WAITING  # at most one doubling in five minutes


@pytest.mark.long  # an hour: above
def test_a_day(monkeypatch):
    """86,400 s, at 10 Hz to be quick: rows, waiting samples and trace stay within bounds."""
    stream, rows = long_stream(24 * 60, monkeypatch, rate_hz=10.0, every=20, method="mean")
    assert rows <= MOST_ROWS
    assert memory_of(stream) < 2e6
    assert len(stream.trace) <= TRACE_POINTS
    times, norm = stream.rate_norm()
    assert len(times) <= TRACE_POINTS
    assert np.median(norm) == pytest.approx(EARTH_RATE, rel=0.1)
    assert "older_merged" in {f.code for f in stream.estimate().warnings}


@pytest.mark.slow
def test_only_the_newest_poses_are_fitted():
    """Twenty turns of 90 deg: the newest 16 poses, a warning, and the heading of the recording."""
    still = Sensor("white", TriadErrors(white=1e-6), TriadErrors(white=1e-4))
    turns = tuple((20.0 + 30.0 * k, 10.0, np.pi / 2) for k in range(20))
    recording = simulate(
        still,
        latitude=LATITUDE,
        heading=1.0,
        duration=630.0,
        rate_hz=20.0,
        rng=np.random.default_rng(1),
        motion=Motion(turns=turns),
    )
    ours = stream_of(recording, sensor=still).estimate()
    offline = heading(recording, sensor=still)
    assert len(offline.poses) == 21
    assert len(ours.poses) == MOST_POSES
    assert "older_dropped" in {f.code for f in ours.warnings}
    assert abs(angle_error(ours.heading, offline.heading)) < 2 * offline.sigma


@pytest.mark.parametrize("method", [pytest.param("bayes", marks=pytest.mark.long), "learned"])
def test_what_looks_at_its_last_window_only_drops_the_rest(method):
    recording = scene("sway", duration=330.0, rate_hz=5.0)
    ours = stream_of(recording, sensor=SENSOR, method=method).estimate()
    if method == "bayes":
        assert_same(
            replace(ours, warnings=[f for f in ours.warnings if f.code != "older_dropped"]),
            heading(recording.window(30.0, 330.0), sensor=SENSOR, method=method),
        )
        assert "older_dropped" in {f.code for f in ours.warnings}
    else:
        assert_same(ours, heading(recording, sensor=SENSOR, method=method))


# --- input ----------------------------------------------------------------------------------------


def fed(seconds=0.0):
    stream = StreamingHeading(rate_hz=100, latitude=LATITUDE, accelerometer=True, method="mean")
    recording = scene("still", duration=30.0, rate_hz=100.0)
    count = round(seconds * 100)
    stream.add(recording.gyro_b[:count], recording.accel_b[:count])
    return stream


@pytest.mark.parametrize(
    ("gyro", "accel", "said"),
    [
        (np.full((5, 3), np.nan), np.ones((5, 3)), "not finite at sample 0"),
        (np.ones((5, 3)), [[1, 1, 1]] * 4 + [[1, np.inf, 1]], "not finite at sample 4"),
        (np.ones((5, 2)), np.ones((5, 3)), r"\(n, 3\)"),
        (np.ones(3), np.ones(3), r"\(n, 3\)"),
        (np.ones((5, 3)), np.ones((4, 3)), "must match"),
        (np.empty((0, 3)), np.ones((4, 3)), r"n > 0"),
        (np.ones((5, 3)), None, "without specific force"),
        ([["a", "b", "c"]], np.ones((1, 3)), "not an array of numbers"),
    ],
)
def test_bad_pieces_are_refused_and_nothing_of_them_is_taken(gyro, accel, said):
    stream, clean = fed(20), fed(20)
    with pytest.raises(InputError, match=said):
        stream.add(gyro, accel)
    assert stream.duration == 20.0
    assert stream.estimate() == clean.estimate()


def test_specific_force_that_was_not_announced_is_refused():
    stream = StreamingHeading(rate_hz=100, latitude=LATITUDE, accelerometer=False)
    with pytest.raises(InputError, match="came with specific force"):
        stream.add(np.ones((5, 3)), np.ones((5, 3)))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"rate_hz": 0}, "rate_hz"),
        ({"rate_hz": np.nan}, "rate_hz"),
        ({"latitude": 48.0}, "latitude"),
        ({"method": "magnet"}, "not known"),
        ({"method": "inertial", "accelerometer": False}, "specific force"),
        ({"sensor": "no such sensor"}, "no such sensor"),
        ({"method": "mean", "model": "some.onnx"}, "bundle"),
        ({"method": "bayes", "rate_hz": 1.0}, "bayes"),
    ],
)
def test_wrong_settings_are_refused_at_once(change, said):
    with pytest.raises(InputError, match=f"(?i){said}"):
        StreamingHeading(**{"rate_hz": 100, "latitude": LATITUDE, "accelerometer": True, **change})


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_too_short_is_said_and_not_raised(method):
    stream = StreamingHeading(rate_hz=100, latitude=LATITUDE, accelerometer=True, method=method)
    assert [f.code for f in stream.estimate().reasons] == ["too_short"]  # no sample at all
    assert len(stream.rate_norm()[0]) == 0
    stream.add(np.empty((0, 3)), np.empty((0, 3)))
    assert stream.duration == 0
    stream.add(np.full((100, 3), 1e-5), np.tile([0.0, 0.0, -9.8], (100, 1)))
    found = stream.estimate()
    assert "too_short" in {f.code for f in found.reasons}
    assert not found.valid


def test_long_motion_is_not_called_short():
    """Method turned and no pose in ten minutes of rolling about."""
    stream = StreamingHeading(rate_hz=10, latitude=LATITUDE, accelerometer=False, method="turned")
    stream.add(np.sin(np.arange(6000)[:, None] / 10 * [1.0, 1.3, 1.7]))
    found = stream.estimate()
    assert not found.valid
    assert not any("short" in reason.message for reason in found.reasons)


def test_saturation_of_one_sample_is_seen_though_rows_are_means():
    recording = scene("still")
    gyro_b = recording.gyro_b.copy()
    gyro_b[200, 1] = -SENSOR.gyro.saturation
    recording = replace(recording, gyro_b=gyro_b)
    ours, offline = stream_of(recording, sensor=SENSOR).estimate(), heading(recording, sensor=SENSOR)
    assert "saturated" in {f.code for f in offline.reasons}
    assert {f.code for f in ours.reasons} == {f.code for f in offline.reasons}


def test_restart_forgets():
    stream = fed(10)
    stream.add(np.ones((100, 3)), np.ones((100, 3)))
    stream.estimate()
    stream.restart()
    assert (stream.duration, stream.trace) == (0, [])
    recording = scene("still", duration=30.0, rate_hz=100.0)
    stream.add(recording.gyro_b, recording.accel_b)
    assert stream.estimate() == fed(30).estimate()
    assert_array_equal(np.array(stream.trace), np.array([(30.0, *np.array(stream.trace)[0, 1:])]))


def test_trace_thins_itself_and_keeps_its_ends():
    stream = StreamingHeading(rate_hz=10, latitude=LATITUDE, accelerometer=False)
    unit = Recording(np.tile([EARTH_RATE, 0.0, 0.0], (5, 1)), None, 10.0)
    stream.solve = lambda: heading_of_nothing  # the trace alone is looked at
    heading_of_nothing = fed(20).estimate()
    for _ in range(5000):
        stream.add(unit.gyro_b)
        stream.estimate()
    times = np.array([entry[0] for entry in stream.trace])
    assert len(times) <= TRACE_POINTS
    assert (times[0], times[-1]) == (0.5, 2500.0)
    assert np.diff(times).max() < 4 * 2500 / TRACE_POINTS
