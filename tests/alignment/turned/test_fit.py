"""Turned alignment: segmentation, the law and its bound, the fit and what it claims."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from gyronorth.alignment.turned.bound import turned_sigma
from gyronorth.alignment.turned.fit import turned
from gyronorth.alignment.turned.segments import find_segments
from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR, angle_error
from gyronorth.attitude import mean_rotation, rotation, rotation_vector
from gyronorth.earth import EARTH_RATE
from gyronorth.errors import InputError
from gyronorth.sensor import Sensor, TriadErrors
from gyronorth.sensor.law import NoiseLaw
from gyronorth.simulation import Motion, sensor_errors, simulate_batch
from gyronorth.uncertainty import rate_variance

DEG, PI = np.pi / 180, np.pi
LATITUDE = 32.11 * DEG
#: The sensor of issue 4: angle random walk 0.02 deg/sqrt(h), turn-on bias 1 deg/h.
WHITE = Sensor(
    "white",
    TriadErrors(white=0.02 * DEG_PER_SQRT_HOUR, turn_on_bias=DEG_PER_HOUR),
    TriadErrors(white=1e-3, turn_on_bias=5e-3),
)
FLICKER = replace(WHITE, gyro=replace(WHITE.gyro, flicker=DEG_PER_HOUR))
#: White noise over Earth rate: the floor of 100 s at 32.11 N, 0.54 deg.
FLOOR = 0.02 * DEG_PER_SQRT_HOUR / np.sqrt(100) / (EARTH_RATE * np.cos(LATITUDE))
IDEAL = Sensor("ideal", TriadErrors(), TriadErrors())


def plan_of(turns, still=100.0, length=10.0, **more):
    """Motion with equal poses between the turns, and its duration."""
    pose = still / (len(turns) + 1)
    starts = [pose * (k + 1) + length * k for k in range(len(turns))]
    return Motion(
        turns=tuple((s, length, a) for s, a in zip(starts, turns, strict=True)), **more
    ), still + length * len(turns)


def runs_of(sensor, turns, runs, *, latitude=LATITUDE, rate_hz=10.0, seed=1, still=100.0, length=10.0, **more):
    """Recordings and true headings at the end."""
    rng = np.random.default_rng(seed)
    motion, duration = plan_of(turns, still, length)
    start = rng.uniform(0, 2 * PI, runs)
    gyro, accel = simulate_batch(
        sensor,
        runs=runs,
        latitude=latitude,
        heading=start,
        duration=duration,
        rate_hz=rate_hz,
        rng=rng,
        motion=motion,
        **more,
    )
    return gyro, accel, start + sum(turns)


@cache
def errors_and_sigmas(sensor, turns, runs, *, profile=True, latitude=LATITUDE, rate_hz=10.0, **more):
    gyro, accel, heading = runs_of(sensor, turns, runs, latitude=latitude, rate_hz=rate_hz, **more)
    fits = [
        turned(
            gyro[k],
            None if accel is None else accel[k],
            rate_hz=rate_hz,
            latitude=latitude,
            errors=sensor if profile else None,
        )
        for k in range(runs)
    ]
    return angle_error([fit.heading for fit in fits], heading), np.array([fit.sigma for fit in fits])


def assert_calibrated(error, sigma):
    """Sum of squared error over sigma within the central 99.8 % of chi-square."""
    low, high = stats.chi2.ppf([0.001, 0.999], df=len(error))
    assert low < np.sum((error / sigma) ** 2) < high


# --- rotations and covariance --------------------------------------------------------------------


def test_mean_rotation_is_the_average_along_the_turn():
    rng = np.random.default_rng(0)
    for size in (1e-6, 0.3, 3.0):
        vector = rng.normal(size=3) * size
        share, weight = np.polynomial.legendre.leggauss(30)
        expected = np.einsum("k,kij->ij", weight / 2, rotation(vector * ((share + 1) / 2)[:, None]))
        assert_allclose(mean_rotation(vector), expected, atol=1e-12)
        assert_allclose(rotation_vector(rotation(vector / 3)), vector / 3, atol=1e-12)


def test_covariance_of_one_mean_is_that_of_the_uncertainty_room():
    errors = TriadErrors(white=2e-6, flicker=5e-6, random_walk=3e-8)
    parts = rate_variance(errors, 50.0)
    ours = NoiseLaw(errors).mean_covariance([0], [500], rate_hz=10.0)[0, 0]
    assert_allclose(ours, parts["noise"] + parts["drift"], rtol=1e-6)


@pytest.mark.slow
def test_covariance_between_means_is_that_of_simulated_errors():
    errors = TriadErrors(white=2e-6, flicker=5e-6, random_walk=2e-7)
    first, last = np.array([0, 100, 300, 700]), np.array([100, 200, 600, 1200])
    drawn = sensor_errors(errors, (1500, 1200), 10.0, rng=np.random.default_rng(3))
    means = np.stack([drawn[:, a:b].mean(axis=1) for a, b in zip(first, last, strict=True)], axis=1)
    sample = np.einsum("rik,rjk->ij", means, means) / (3 * len(means))
    expected = NoiseLaw(errors).mean_covariance(first, last, rate_hz=10.0)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert np.abs((sample - expected) / scale).max() < 4.5 * np.sqrt(2 / 4500)  # 16 entries, 4500 draws


# --- segmentation --------------------------------------------------------------------------------


@pytest.mark.parametrize("rate_hz", [3.0, 10.0, 200.0])
@pytest.mark.parametrize("turns", [(PI,), (PI / 2,) * 3, (-PI / 3, 0.1)])
def test_poses_and_turns_are_found_and_no_turn_leaks_into_a_pose(rate_hz, turns):
    gyro, _, _ = runs_of(WHITE, turns, 1, rate_hz=rate_hz)
    segments = find_segments(gyro[0], rate_hz=rate_hz)
    motion, _ = plan_of(turns)
    assert segments.poses == len(segments.stretches) == len(turns) + 1
    moving = [(start, start + length) for start, length, _ in motion.turns]
    for first, last in segments.stretches:
        assert all(last / rate_hz <= a or first / rate_hz >= b for a, b in moving)
    # At most 1.1 s is lost on either side: edges of 0.4 s and the chunks they fall in.
    still = sum(last - first for first, last in segments.stretches) / rate_hz
    assert 100 - 2.2 * len(turns) < still <= 100
    assert_allclose([turn.angle for turn in segments.turns], turns, atol=0.003)  # with 15 deg/h for 12 s, 0.05 deg


def test_a_knock_parts_stretches_but_not_poses():
    gyro, _, _ = runs_of(WHITE, (), 1, rate_hz=50.0)
    knocked = gyro[0].copy()
    knocked[2000:2020, 1] += 2 * DEG * np.sin(np.arange(20) / 20 * 2 * PI)
    segments = find_segments(knocked, rate_hz=50.0)
    assert len(segments.stretches) == 2
    assert segments.poses == 1


@pytest.mark.parametrize("disturbance", ["quiet", "sway", "shock", "warmup", "mixed"])
def test_disturbance_is_no_second_pose(disturbance):
    gyro, _ = simulate_batch(
        WHITE,
        runs=20,
        latitude=LATITUDE,
        heading=1.0,
        duration=100,
        rate_hz=10,
        rng=np.random.default_rng(5),
        motion=Motion(disturbance=disturbance),
    )
    assert {find_segments(one, rate_hz=10.0).poses for one in gyro} == {1}


# --- the bound -----------------------------------------------------------------------------------


def test_bound_is_known_by_hand_for_white_noise():
    # Two poses half a turn apart remove the bias at no cost: the floor. A turn a leaves 2 sin(a / 2) of 2.
    assert_allclose(FLOOR / DEG, 0.54, atol=0.002)
    for angle in (PI, PI / 2, PI / 3):
        bound = turned_sigma(WHITE, latitude=LATITUDE, turns=(angle,), bias_known=False)
        assert_allclose(bound, FLOOR / np.sin(angle / 2), rtol=0.005)
    assert_allclose(turned_sigma(WHITE, latitude=LATITUDE, turns=()), np.hypot(FLOOR, DEG_PER_HOUR / (
        EARTH_RATE * np.cos(LATITUDE))), rtol=0.003)  # fmt: skip


@pytest.mark.parametrize(("turns", "expected"), [((PI,), 2.2), ((PI / 2,) * 3, 1.9), ((PI,) * 9, 1.2)])
def test_bound_with_flicker_has_the_figures_of_the_issue(turns, expected):
    assert_allclose(turned_sigma(FLICKER, latitude=LATITUDE, turns=turns) / DEG, expected, atol=0.06)


def test_bound_grows_with_an_unknown_scale_factor():
    scaled = replace(WHITE, gyro=replace(WHITE.gyro, scale_factor=3e-3))
    bound = turned_sigma(scaled, latitude=LATITUDE, turns=(PI,))
    # The first pose sees the heading 0.54 deg off, the second does not; their mean carries half of it.
    assert_allclose(bound, np.hypot(FLOOR, 3e-3 * PI / 2), rtol=0.01)


# --- the fit -------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("turns", [(PI,), (PI / 2,) * 3, (-1.0, 2.3), (4 * PI + 0.5,)])
@pytest.mark.parametrize(("latitude", "roll", "pitch"), [(0.5, 0, 0), (-0.8, 0.15, -0.1), (0.0, -0.1, 0.17)])
def test_noise_free_recording_returns_heading_bias_and_attitude(turns, latitude, roll, pitch):
    gyro, accel, heading = runs_of(IDEAL, turns, 1, latitude=latitude, roll=roll, pitch=pitch, rate_hz=20.0)
    bias = np.array([3.0, -2.0, 1.0]) * DEG_PER_HOUR
    free = replace(WHITE, gyro=replace(WHITE.gyro, turn_on_bias=0.0))  # any bias
    fit = turned(gyro[0] + bias, accel[0], rate_hz=20.0, latitude=latitude, errors=free)
    assert abs(angle_error(fit.heading, heading[0])) < 2e-4
    assert_allclose(fit.gyro_bias, bias, atol=0.003 * DEG_PER_HOUR)
    assert_allclose([fit.roll, fit.pitch], [roll, pitch], atol=2e-5)
    start = fit.poses[0].heading - fit.poses[-1].heading
    assert abs(angle_error(start, -sum(turns))) < 1e-4
    assert_allclose(sum(part**2 for part in fit.sigma_parts.values()), fit.sigma**2, rtol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sensor", "turns", "accel"),
    [(WHITE, (PI,), True), (WHITE, (PI,), False), (WHITE, (PI / 3,), True), (FLICKER, (PI,), True)],
)
def test_error_is_what_sigma_and_bound_say(sensor, turns, accel):
    error, sigma = errors_and_sigmas(sensor, turns, 16, latitude=LATITUDE, roll=0.0, accel=accel)
    assert_calibrated(error, sigma)
    bound = turned_sigma(sensor, latitude=LATITUDE, turns=turns, accel=accel)
    assert 0.98 < np.median(sigma) / bound < 1.15  # the bound knows that the bias does not scatter, the fit does not


@pytest.mark.slow
def test_scale_factor_misalignment_and_tilt_are_covered():
    rough = TriadErrors(**{**vars(WHITE.gyro), "scale_factor": 3e-3, "misalignment": 1e-3})
    sensor = Sensor("rough", rough, replace(WHITE.accel, misalignment=1e-3))
    assert_calibrated(*errors_and_sigmas(sensor, (PI, -PI, PI), 10, roll=10 * DEG))


def test_given_turn_angles_show_the_scale_factor():
    scaled = replace(WHITE, gyro=replace(WHITE.gyro, scale_factor=3e-3))
    gyro, accel, heading = runs_of(IDEAL, (PI,), 1)
    fit = turned(
        gyro[0] * 1.002,
        accel[0],
        rate_hz=10.0,
        latitude=LATITUDE,
        errors=scaled,
        turn_angles=[PI],
        turn_angle_sigma=1e-4,
    )
    assert_allclose(fit.scale_factor[2], 0.002, atol=1e-4)
    assert abs(angle_error(fit.heading, heading[0])) < 3e-4
    assert fit.scale_factor_sigma[2] < 1.2e-4


@pytest.mark.slow
def test_carousel_reaches_the_floor_without_any_still_pose():
    gyro, accel, heading = runs_of(WHITE, (10 * PI,), 2, still=1e-3, length=100.0)
    fits = [turned(g, a, rate_hz=10.0, latitude=LATITUDE, errors=WHITE) for g, a in zip(gyro, accel, strict=True)]
    error, sigma = angle_error([fit.heading for fit in fits], heading), np.array([fit.sigma for fit in fits])
    assert_calibrated(error, sigma)
    assert_allclose(sigma, FLOOR, rtol=0.02)
    assert fits[0].poses == ()
    assert fits[0].turns[0].spin


@pytest.mark.slow
def test_without_a_profile_noise_is_inferred_and_covered():
    error, sigma = errors_and_sigmas(WHITE, (PI,), 6, profile=False)
    assert np.mean(np.abs(error) < 1.96 * sigma) > 0.6  # of 6 runs at 95 %, 3 or fewer: 2 in 1000
    assert 0.8 * FLOOR < np.median(sigma) < 1.6 * FLOOR


def test_bias_beyond_the_profile_is_not_pulled():
    gyro, accel, heading = runs_of(WHITE, (PI / 3,), 1)
    fit = turned(gyro[0] + [30 * DEG_PER_HOUR, 0, 0], accel[0], rate_hz=10.0, latitude=LATITUDE, errors=WHITE)
    assert fit.bias_rejected
    assert abs(angle_error(fit.heading, heading[0])) < 4 * fit.sigma
    assert abs(fit.gyro_bias[0] / DEG_PER_HOUR - 30) < 4


def test_a_profile_that_is_too_good_widens_sigma():
    gyro, accel, _ = runs_of(WHITE, (PI,), 1)
    good = replace(WHITE, gyro=replace(WHITE.gyro, white=WHITE.gyro.white / 5))
    fit = turned(gyro[0], accel[0], rate_hz=10.0, latitude=LATITUDE, errors=good)
    assert fit.inflation > 2
    assert fit.sigma > 0.5 * FLOOR


def test_wrong_number_of_turn_angles_is_told():
    gyro, accel, _ = runs_of(WHITE, (PI,), 1)
    with pytest.raises(InputError, match=r"2 turn angles were given, but the recording holds 1 turns"):
        turned(gyro[0], accel[0], rate_hz=10.0, latitude=LATITUDE, errors=WHITE, turn_angles=[PI, PI])


def test_nothing_but_motion_is_told():
    gyro = np.random.default_rng(0).normal(0, 1, (300, 3)).cumsum(axis=0)
    with pytest.raises(InputError, match="No still pose of 3 s"):
        turned(gyro, None, rate_hz=10.0, latitude=LATITUDE, errors=WHITE)


# --- the figures of the issue --------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("runs", [16, pytest.param(2000, marks=pytest.mark.long)])
@pytest.mark.parametrize(
    ("sensor", "turns", "latitude", "roll", "most"),
    [
        (WHITE, (PI,), LATITUDE, 0.0, 0.58),
        pytest.param(WHITE, (PI / 2,) * 3, LATITUDE, 0.0, 0.58, marks=pytest.mark.long),
        pytest.param(WHITE, (PI / 3,), LATITUDE, 0.0, 1.15, marks=pytest.mark.long),
        pytest.param(WHITE, (PI,), 0.0, 0.0, 1.08 * 0.4573, marks=pytest.mark.long),
        pytest.param(WHITE, (PI,), 60 * DEG, 0.0, 1.08 * 0.9146, marks=pytest.mark.long),
        (WHITE, (PI,), -45 * DEG, 10 * DEG, 1.08 * 0.6467),
        (FLICKER, (PI,), LATITUDE, 0.0, 1.03 * 2.17),
    ],
)
def test_figures_of_the_issue(sensor, turns, latitude, roll, most, runs):
    """The root mean square is known to 1 / sqrt(2 runs): to 1.6 % with 2000; coverage to 0.5 %."""
    error, sigma = errors_and_sigmas(sensor, turns, runs, latitude=latitude, roll=roll, accel=True)
    chance = 3.3 / np.sqrt(2 * runs) if runs < 2000 else 0.0  # the figures themselves are held by many runs only
    assert np.sqrt(np.mean(error**2)) / DEG < most * (1 + chance)
    assert abs(np.mean(np.abs(error) < 1.96 * sigma) - 0.95) < max(0.02, 3.3 * np.sqrt(0.95 * 0.05 / runs))


def test_one_pose_of_an_unknown_sensor_is_refused_and_a_second_one_cures_it():
    """Also of a record without noise, whose inferred noise is rounding."""
    (gyro,), (accel,), (truth,) = runs_of(IDEAL, (PI,), 1)
    with pytest.raises(InputError, match="one pose, which cannot tell"):
        turned(gyro[:400], accel[:400], rate_hz=10.0, latitude=LATITUDE)
    found = turned(gyro, accel, rate_hz=10.0, latitude=LATITUDE)
    assert abs(angle_error(found.heading, truth)) < 1e-6
    assert found.sigma < 0.01
