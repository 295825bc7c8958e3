"""Data sets for training: the synthetic set, augmentation, splits."""

from __future__ import annotations

from math import radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

pytest.importorskip("torch", reason="the folder learn/ comes with the extra train")

from gyronorth.angles import DEG_PER_HOUR, angle_error
from gyronorth.earth import EARTH_RATE
from gyronorth.errors import InputError
from gyronorth.learn.data import (
    HeadingSet,
    augment,
    noise_deg_s,
    own_data,
    split_recordings,
    synthetic_set,
    turned,
)
from gyronorth.learn.settings import Settings
from gyronorth.readers import ReadOptions


def rng(seed=0):
    return np.random.default_rng(seed)


def mean_heading(data):
    mean = data.gyro_l.mean(axis=1)
    return np.arctan2(-mean[:, 1], mean[:, 0])


def noisy(n=6, sigma=1e-5, samples=300, seed=0):
    clean = synthetic_set(headings=n, latitude=radians(32.11), samples=samples)
    return HeadingSet(
        clean.gyro_l + sigma * rng(seed).standard_normal(clean.gyro_l.shape), clean.heading, clean.recording
    )


def test_the_papers_synthetic_set():
    data = synthetic_set()
    assert data.gyro_l.shape == (720, 300, 3)
    assert_allclose(np.degrees(data.heading), np.arange(720) / 2)
    east = data.gyro_l[180]  # heading 90 deg on the equator: rate x (0, -1, 0)
    assert_allclose(east, np.broadcast_to([0, -EARTH_RATE, 0], (300, 3)), atol=1e-20)
    parts = split_recordings(data, (60, 20, 20), rng=rng())
    assert [len(part) for part in parts] == [432, 144, 144]


def test_synthetic_set_at_a_site():
    data = synthetic_set(headings=4, latitude=radians(60), samples=2)
    assert_allclose(
        data.gyro_l[:, 0] / EARTH_RATE,
        [[0.5, 0, -0.866025], [0, -0.5, -0.866025], [-0.5, 0, -0.866025], [0, 0.5, -0.866025]],
        atol=1e-6,
    )


@given(seed=st.integers(0, 10_000), recordings=st.integers(3, 40), windows=st.integers(1, 3))
def test_no_recording_is_in_two_parts(seed, recordings, windows):
    ids = np.repeat(np.arange(recordings), windows)
    data = HeadingSet(np.zeros((len(ids), 2, 3)), np.zeros(len(ids)), ids)
    parts = split_recordings(data, (24, 4, 6), rng=rng(seed))
    found = [set(part.recording.tolist()) for part in parts]
    assert all(found)
    assert sum(len(part) for part in parts) == len(data)
    assert len(set.union(*found)) == recordings == sum(len(part) for part in found)


def test_34_recordings_split_24_4_6():
    data = noisy(34, samples=2)
    assert [len(part) for part in split_recordings(data, (24, 4, 6), rng=rng())] == [24, 4, 6]


def test_too_few_recordings_are_refused():
    with pytest.raises(InputError, match="hold 2 recordings; at least 3"):
        split_recordings(noisy(2), (24, 4, 6), rng=rng())


def test_turning_turns_the_heading_clockwise():
    data = noisy(8, sigma=0)
    for angle in (-0.3, 0.0, 1.2):
        more = HeadingSet(turned(data.gyro_l, np.full(8, angle)), data.heading, data.recording)
        assert_allclose(angle_error(mean_heading(more), data.heading + angle), 0, atol=1e-12)
        assert_allclose(more.gyro_l[..., 2], data.gyro_l[..., 2])


def test_faithful_copies_turn_the_recorded_samples():
    data = noisy()
    more = augment(data, copies=5, span=radians(20), rng=rng())
    assert len(more) == 30
    assert_allclose(np.degrees(angle_error(more.heading[:5], data.heading[0])), [-20, -10, 0, 10, 20], atol=1e-9)
    assert_allclose(more.gyro_l[2], data.gyro_l[0])
    assert_allclose(turned(more.gyro_l[0], radians(20)), data.gyro_l[0], atol=1e-18)
    error, own = angle_error(mean_heading(more), more.heading), angle_error(mean_heading(data), data.heading)
    assert_allclose(error, np.repeat(own, 5), atol=1e-12)


def test_redrawn_copies_keep_the_error_of_the_mean_and_nothing_of_the_noise():
    data = noisy()
    more = augment(data, copies=50, noise="redrawn", rng=rng(1))
    error, own = angle_error(mean_heading(more), more.heading), angle_error(mean_heading(data), data.heading)
    assert_allclose(error, np.repeat(own, 50), atol=1e-9)
    residual = more.gyro_l - more.gyro_l.mean(axis=1, keepdims=True)
    assert residual.std() == pytest.approx(1e-5, rel=0.1)
    flat = residual.reshape(300, -1)
    correlation = np.corrcoef(flat)[np.triu_indices(300, 1)]
    assert np.abs(correlation).max() < 6 / np.sqrt(
        flat.shape[1]
    )  # 45 000 pairs: five sigma, and room for the rank lost
    again = augment(data, copies=50, noise="redrawn", rng=rng(1))
    assert np.array_equal(again.gyro_l, more.gyro_l)


def test_noise_is_measured_in_deg_s():
    assert noise_deg_s(noisy(50, sigma=radians(5.7e-4))) == pytest.approx(5.7e-4, rel=0.02)


def test_checksum_sees_every_array():
    data = noisy()
    changed = [
        HeadingSet(data.gyro_l + 1e-12, data.heading, data.recording),
        HeadingSet(data.gyro_l, data.heading + 1e-9, data.recording),
        HeadingSet(data.gyro_l, data.heading, data.recording + 1),
    ]
    assert len({data.sha256(), *(one.sha256() for one in changed)}) == 4


def test_shapes_that_do_not_agree_are_refused():
    with pytest.raises(ValueError, match="are expected"):
        HeadingSet(np.zeros((2, 5, 3)), np.zeros(3), np.zeros(2, dtype=int))


@pytest.fixture
def folder(tmp_path):
    pytest.importorskip("gyronorth.readers", reason="reading recordings needs gyronorth.readers")
    generator = rng(7)
    for heading in (10, 200):
        angle = radians(heading)
        rate = EARTH_RATE * np.array([np.cos(angle), -np.sin(angle), 0.0])
        gyro = rate + 1 * DEG_PER_HOUR * generator.standard_normal((130, 3))
        rows = np.hstack([np.arange(130)[:, None] / 10.0, gyro, np.tile([0, 0, -9.8], (130, 1))])
        text = "# rate_hz: 10\n# gyro_unit: rad/s\n# accel_unit: m/s2\n# axes: frd\n# latitude_deg: 0\n"
        text += f"# heading_true_deg: {heading}\n"
        text += "t,w_x,w_y,w_z,f_x,f_y,f_z\n" + "".join(",".join(repr(float(v)) for v in row) + "\n" for row in rows)
        (tmp_path / f"{heading}.csv").write_text(text)
    return tmp_path


def swing_folder(path, sessions, latitudes=(0,)):
    """Twelve short level recordings with a north bias of a tenth of Earth rate."""
    for k in range(12):
        angle = radians(30 * k)
        rate = EARTH_RATE * np.array([np.cos(angle) + 0.1, -np.sin(angle), 0.0])
        text = f"# rate_hz: 2\n# gyro_unit: rad/s\n# axes: frd\n# heading_true_deg: {30 * k}\n"
        session, latitude = sessions[k % len(sessions)], latitudes[k % len(latitudes)]
        text += f"# session: {session}\n" * (session is not None)
        text += f"# latitude_deg: {latitude}\n" * (latitude is not None)
        row = ",".join(repr(float(v)) for v in rate)
        (path / f"{k:02d}.csv").write_text(text + "t,w_x,w_y,w_z\n" + "".join(f"{t / 2},{row}\n" for t in range(26)))
    return path


SHORT = Settings.model_validate({"rate_hz": 2.0, "samples": 12})


def test_own_recordings_of_one_session_hold_a_swing(tmp_path):
    data = own_data(swing_folder(tmp_path, ["monday"]), settings=SHORT)
    assert (data.session, data.latitude) == ("monday", 0.0)
    assert data.train.gyro_l.shape[1:] == (12, 3)
    assert sum(len(part) for part in (data.train, data.validation, data.test)) == 12
    known = np.unique(np.concatenate([data.train.recording, data.validation.recording]))
    assert_allclose(np.degrees(data.swing.heading_true), 30 * known, atol=1e-9)  # the test recordings stay out
    # tan psi = -w_y / w_x, and the horizontal rate exceeds Earth rate by |(cos + 0.1, sin)| - 1
    true = data.swing.heading_true
    assert_allclose(angle_error(data.swing.heading, np.arctan2(np.sin(true), np.cos(true) + 0.1)), 0, atol=1e-9)
    assert_allclose(data.swing.surplus, np.hypot(np.cos(true) + 0.1, np.sin(true)) - 1, atol=1e-9)
    assert data.swing.duration == 13.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sessions", "latitudes", "given", "session", "why"),
    [
        ([None], (0,), None, None, ""),
        (["monday", "tuesday"], (0,), None, "monday, tuesday", "the recordings are of 2 sessions"),
        (["monday"], (0, 1), None, "monday", "the recordings are of latitudes from 0.00 to 1.00 deg"),
        (["monday"], (0, None), None, "monday", "6 of 12 recordings state no latitude"),
        (["monday"], (None,), 0.0, "monday", ""),
    ],
)
def test_a_swing_needs_one_session_and_one_latitude(tmp_path, sessions, latitudes, given, session, why):
    reading = None if given is None else ReadOptions(latitude=given)
    data = own_data(swing_folder(tmp_path, sessions, latitudes), settings=SHORT, reading=reading)
    assert data.session == session
    assert (data.swing is None, data.no_swing) == (bool(why), why)


def test_too_few_recordings_train_nothing(folder):
    with pytest.raises(InputError, match="holds 2 recordings; at least 10"):
        own_data(folder, settings=SHORT)


def test_a_recording_too_short_is_refused(tmp_path):
    with pytest.raises(InputError, match="lasts 13 s; a window of 20 s"):
        own_data(swing_folder(tmp_path, ["monday"]), settings=SHORT.model_copy(update={"samples": 40}))
