"""Simulated recordings: the noise against its law, the truth against geometry and pyins.

Statistical bounds: a chi-square of k degrees of freedom (or a normal) is asked for at a probability
of 1e-5 of failing, so that some hundred such checks fail by chance once in a thousand seeds. Seeds
are fixed. Where interpolation leaves out up to 1 % of a variance the bound is widened by that 1 %.
"""

import tracemalloc
from itertools import pairwise

import numpy as np
import pytest
from flicker_fft import flicker_fft
from numpy.testing import assert_allclose, assert_array_equal
from scipy import stats
from scipy.spatial.transform import Rotation

from gyronorth import simulation
from gyronorth.angles import DEG_PER_HOUR
from gyronorth.attitude import level, mat_bn
from gyronorth.earth import EARTH_RATE, earth_rate_n, normal_gravity
from gyronorth.errors import InputError
from gyronorth.sensor import Sensor, TriadErrors, flicker_components
from gyronorth.sensor import drawing as noise
from gyronorth.sensor.drawing import draw
from gyronorth.sensor.profiles import ALLAN_MINIMUM
from gyronorth.sensor.terms import ProcessLaw
from gyronorth.simulation import Motion, sensor_errors, simulate, simulate_batch
from gyronorth.simulation.disturbance import drawn

IDEAL = Sensor("ideal", TriadErrors(), TriadErrors())
CHANCE = 1e-5
POSES = [(0.9, 0.0, 0.0, 0.4), (-0.7, 0.35, -0.61, 2.5), (0.0, -1.0, 1.2, 5.0), (-1.5, 3.0, 0.1, 3.9)]


def assert_variance(samples, expected, *, missing=0.0):
    """Independent zero-mean normal `samples` have the variance `expected`, of which `missing` may be left out."""
    low, high = stats.chi2.ppf([CHANCE / 2, 1 - CHANCE / 2], samples.size) / samples.size
    ratio = np.mean(samples**2) / expected
    assert low - missing < ratio < high, (ratio, low, high)


def assert_covariance(a, b, expected, *, slack=0.0):
    """Pairs of independent draws with covariance `expected`: normal bound from the products' own scatter."""
    products = (a * b).ravel()
    bound = stats.norm.isf(CHANCE / 2) * products.std() / np.sqrt(products.size)
    assert abs(products.mean() - expected) < bound + slack, (products.mean(), expected, bound)


def markov(variance, tau, shape, rate_hz, seed):
    law = ProcessLaw(0.0, ((variance, tau),))
    return draw(law, shape, rate_hz, constant=np.zeros((shape[0], 3)), rng=np.random.default_rng(seed))


def covariance_of_means(variance, x, lag):
    """Of interval means of a Gauss-Markov process, `lag` intervals of x time constants apart (by integration)."""
    if lag == 0:
        return 2 * variance * (x - 1 + np.exp(-x)) / x**2
    return variance * ((1 - np.exp(-x)) / x) ** 2 * np.exp(-(lag - 1) * x)


def variance_of_mean(variance, tau, duration):
    return 2 * variance * tau / duration**2 * (duration - tau * (1 - np.exp(-duration / tau)))


# --- noise ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("rate_hz", [3.0, 100.0, 600.0])
def test_white_noise_is_the_same_at_every_sample_rate(rate_hz):
    walk = 0.02 / 60  # deg/sqrt(s)
    errors = sensor_errors(TriadErrors(white=walk), (40, round(20 * rate_hz)), rate_hz, rng=np.random.default_rng(1))
    assert_variance(errors, walk**2 * rate_hz)
    assert_variance(errors.mean(axis=1), walk**2 / 20)
    assert_covariance(errors[:, 1:], errors[:, :-1], 0.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    "samples_per_tau",
    [
        0.05,
        3.0,
        49.0,
        51.0,
        900.0,
        *(pytest.param(ratio, marks=pytest.mark.long) for ratio in (0.5, 30.0, 130.0, 20000.0)),
    ],
)
def test_gauss_markov_is_stationary_from_the_first_sample(samples_per_tau):
    # From drawn sample by sample (fast) to drawn every 256 samples (slow); 12,000 values at each instant.
    samples, rate_hz, x = 290, 10.0, 1 / samples_per_tau
    errors = markov(4.0, samples_per_tau / rate_hz, (4000, samples), rate_hz, seed=round(samples_per_tau * 100))
    missing = 0.01 if samples_per_tau >= noise.KNOTS_PER_TIME_CONSTANT else 0.0
    for instant in (0, 1, 127, 128, 255, 256, 257, samples - 1):
        assert_variance(errors[:, instant], covariance_of_means(4.0, x, 0), missing=missing)
    for instant, lag in ((0, 1), (0, 17), (100, 60), (253, 5), (255, 1)):
        expected = covariance_of_means(4.0, x, lag)
        assert_covariance(errors[:, instant], errors[:, instant + lag], expected, slack=4.0 * missing)


@pytest.mark.slow
def test_first_and_last_sample_are_normal():
    errors = sensor_errors(TriadErrors(white=1e-9, flicker=2.0), (4000, 200), 10.0, rng=np.random.default_rng(5))
    variance, tau = flicker_components(TriadErrors(flicker=2.0))
    sigma = np.sqrt(covariance_of_means(variance, 1 / (10.0 * tau), 0).sum())
    for instant in (0, -1):
        assert stats.kstest(errors[:, instant].ravel() / sigma, stats.norm.cdf).pvalue > CHANCE


@pytest.mark.slow
@pytest.mark.parametrize(("samples_per_tau", "boundary"), [(5.0, 256), (60.0, 4), (300.0, 4)])
def test_a_process_runs_on_across_blocks(monkeypatch, samples_per_tau, boundary):
    # Blocks of one run and `boundary` samples: the fast process must carry its state, the slow ones their knots.
    monkeypatch.setattr(noise, "_BLOCK", 12)
    errors = markov(1.0, samples_per_tau / 10.0, (2500, boundary + 14), 10.0, seed=8)
    missing = 0.01 if samples_per_tau >= noise.KNOTS_PER_TIME_CONSTANT else 0.0
    for lag in (1, 3, 10):
        expected = covariance_of_means(1.0, 1 / samples_per_tau, lag)
        assert_covariance(errors[:, boundary - 1], errors[:, boundary - 1 + lag], expected, slack=missing)


def test_slow_processes_of_different_spacing_join_without_steps():
    # The first wants a knot per sample, the second one per 16 samples: that one must reach the first's knots as lines.
    law = ProcessLaw(0.0, ((1e-9, 6.0), (1.0, 90.0)))
    errors = draw(law, (3000, 64), 10.0, constant=np.zeros((3000, 3)), rng=np.random.default_rng(11))
    steps = np.mean(np.diff(errors, axis=1) ** 2, axis=(0, 2))
    true_step = 2 * (covariance_of_means(1.0, 1 / 900, 0) - covariance_of_means(1.0, 1 / 900, 1))
    assert steps.max() < true_step  # a line has less from sample to sample; a staircase would have 16 times as much


@pytest.mark.slow
@pytest.mark.parametrize(("rate_hz", "duration"), [(3.0, 100.0), (3.0, 230.0), (100.0, 8.0)])
def test_mean_of_the_in_run_bias_has_the_variance_of_its_law(rate_hz, duration):
    errors = TriadErrors(flicker=1.0)
    means = sensor_errors(errors, (800, round(duration * rate_hz)), rate_hz, rng=np.random.default_rng(3)).mean(axis=1)
    assert_variance(means, variance_of_mean(*flicker_components(errors)[:2], duration).sum(), missing=0.01)


@pytest.mark.slow
def test_in_run_bias_has_a_flat_allan_deviation_of_0_664_b():
    rate_hz, runs = 5.0, 400
    errors = sensor_errors(TriadErrors(flicker=1.0), (runs, 2560), rate_hz, rng=np.random.default_rng(4))
    for averaging in (16, 64, 256, 640):  # samples: 3.2 to 128 s
        means = errors.reshape(runs, -1, averaging, 3).mean(axis=2)
        # One pair of means per run and axis is one independent degree of freedom; the others add to it.
        deviation = np.sqrt(np.mean(np.diff(means, axis=1) ** 2) / 2)
        bound = stats.norm.isf(CHANCE / 2) / np.sqrt(2 * 3 * runs) + 0.02  # 2 %: the law itself
        assert abs(deviation / ALLAN_MINIMUM - 1) < bound


def test_in_run_bias_agrees_with_flicker_made_by_fft():
    ours = sensor_errors(TriadErrors(flicker=1.0), (600, 300), 3.0, rng=np.random.default_rng(6)).mean(axis=1)
    oracle = flicker_fft(1.0, (600, 300), 3.0, rng=np.random.default_rng(7)).mean(axis=1)
    # The variances of the mean over 100 s, by quadrature of the two spectra, are 1.2152 and 1.2708 B^2: they round off
    # the low-frequency corner differently. Around that, the F distribution of two variances of 1800 values.
    low, high = stats.f.ppf([CHANCE / 2, 1 - CHANCE / 2], ours.size, oracle.size) * 1.2152 / 1.2708
    assert low < np.mean(ours**2) / np.mean(oracle**2) < high


@pytest.mark.parametrize("white", [0.0, 0.5])
def test_rate_random_walk_starts_at_zero_and_grows_as_its_law(white):
    # Without white noise a knot per sample, with it a knot per 32 samples.
    walk, rate_hz, duration = 0.3, 16.0, 50.0
    rng = np.random.default_rng(9)
    errors = sensor_errors(TriadErrors(white=white, random_walk=walk), (1500, 800), rate_hz, rng=rng)
    assert_variance(errors.mean(axis=1), walk**2 * duration / 3 + white**2 / duration, missing=0.002)
    at_end = errors[:, -32:].mean(axis=1)  # mean over the last 2 s: walk to 48 s and 2/3 s more
    assert_variance(at_end, walk**2 * (48 + 2 / 3) + white**2 / 2, missing=0.002)
    if white == 0:
        assert_variance(errors[:, 0], walk**2 / rate_hz / 3, missing=0.25 + 0.05)  # a line instead of a walk: 1/4
    growth = errors[:, -1] - errors[:, 0]
    assert abs(growth.mean()) < stats.norm.isf(CHANCE / 2) * growth.std() / np.sqrt(growth.size)


def test_turn_on_bias_is_one_constant_per_run_and_axis():
    errors = sensor_errors(TriadErrors(turn_on_bias=2.0), (5000, 4), 1.0, rng=np.random.default_rng(10))
    assert_array_equal(errors, np.broadcast_to(errors[:, :1], errors.shape))
    assert_variance(errors[:, 0], 4.0)
    assert_covariance(errors[:, 0, 0], errors[:, 0, 1], 0.0)


def test_a_random_walk_of_next_to_nothing_is_next_to_nothing():
    errors = sensor_errors(TriadErrors(white=1.0, random_walk=1e-300), (1, 300), 10.0, rng=np.random.default_rng(1))
    assert_variance(errors, 10.0)


def test_no_errors_are_none():
    assert_array_equal(sensor_errors(TriadErrors(), (3, 7), 1.0, rng=np.random.default_rng(1)), np.zeros((3, 7, 3)))


def test_sdc500_residual_over_230_s_is_1_2_deg_per_hour():
    gyro, _ = simulate_batch(
        "sdc500",
        runs=2000,
        latitude=0.56,
        heading=1.0,
        duration=230,
        rate_hz=1.0,
        rng=np.random.default_rng(2),
        accel=False,
    )
    residual = gyro.mean(axis=1) - mat_bn(0, 0, 1.0) @ earth_rate_n(0.56)
    noise_part = (0.02 * 60) ** 2 / 230  # (deg/h)^2 of the mean, from the angle random walk
    assert_variance(residual / DEG_PER_HOUR, 1.2**2 + noise_part, missing=0.01)


# --- what acts on the signal ---------------------------------------------------------------------


def test_scale_factor_and_misalignment_multiply_the_signal():
    sensor = Sensor("x", TriadErrors(scale_factor=0.01, misalignment=0.002), TriadErrors(scale_factor=0.03))
    gyro, accel = simulate_batch(
        sensor, runs=4000, latitude=0.8, heading=0.0, duration=2, rate_hz=1, rng=np.random.default_rng(3)
    )
    true = earth_rate_n(0.8)
    error = gyro[:, 0] - true
    assert_variance(error[:, 0], (0.01 * true[0]) ** 2 + (0.002 * true[2]) ** 2)
    assert_covariance(error[:, 0] / true[0], error[:, 2] / true[2], 0.0)  # each axis has a scale factor of its own
    assert_variance(error[:, 1], 0.002**2 * (true[0] ** 2 + true[2] ** 2))
    assert_variance(accel[:, 0, 2] + normal_gravity(0.8), (0.03 * normal_gravity(0.8)) ** 2)
    assert_allclose(accel[:, 0, :2], 0, atol=1e-12)


def test_g_sensitivity_turns_specific_force_into_bias():
    sensor = Sensor("x", TriadErrors(), TriadErrors(), g_sensitivity=1e-6)
    gyro, _ = simulate_batch(
        sensor,
        runs=3000,
        latitude=0.8,
        heading=0.3,
        roll=0.7,
        pitch=-0.4,
        duration=1,
        rate_hz=1,
        rng=np.random.default_rng(4),
    )
    assert_variance(gyro[:, 0] - mat_bn(0.7, -0.4, 0.3) @ earth_rate_n(0.8), (1e-6 * normal_gravity(0.8)) ** 2)


@pytest.mark.slow
def test_quantisation_keeps_the_mean_and_never_loses_a_step():
    step, rate_hz, seconds, runs = 0.01, 50.0, 60, 400
    quantised = Sensor("q", TriadErrors(quantisation=step), TriadErrors(quantisation=0.7))
    arguments = {"latitude": 0.6, "heading": 1.0, "duration": seconds, "rate_hz": rate_hz, "runs": runs}
    motion = Motion(turns=((0, seconds, 6.0),))
    gyro, accel = simulate_batch(quantised, rng=np.random.default_rng(5), motion=motion, **arguments)
    truth, force = simulate_batch(IDEAL, rng=np.random.default_rng(5), motion=motion, **arguments)
    counts = gyro / (step * rate_hz)
    assert_allclose(counts, np.round(counts), atol=1e-9)
    residue = np.cumsum(gyro - truth, axis=1) / rate_hz / step
    assert np.abs(residue).max() < 1 + 1e-6  # however long
    assert np.abs(np.cumsum(accel - force, axis=1) / rate_hz).max() < 0.7 * (1 + 1e-6)
    # The residue before the start is uniform, so that floor rounds neither up nor down on average: a mean of zero at
    # every instant, with a scatter of at most 1/2.
    for instant in (0, 1000, -1):
        assert np.abs(residue[:, instant].mean(axis=0)).max() < stats.norm.isf(CHANCE / 2) / 2 / np.sqrt(runs)


def test_range_limits_the_output():
    sensor = Sensor("s", TriadErrors(white=1.0, saturation=0.5), TriadErrors(saturation=9.0))
    gyro, accel = simulate_batch(
        sensor, runs=2, latitude=0.6, heading=1.0, duration=100, rate_hz=1, rng=np.random.default_rng(5)
    )
    assert np.abs(gyro).max() == 0.5
    assert_allclose(accel[..., 2], -9.0)


# --- truth ---------------------------------------------------------------------------------------


def ideal(**arguments):
    gyro, accel = simulate_batch(IDEAL, runs=1, rng=np.random.default_rng(0), **arguments)
    return gyro[0], accel[0]


def test_east_heading_at_60_north_and_south_by_hand():
    # cos 60 = 1/2: facing east, north is to the left (-y); down the Earth turns backwards in the north only.
    for sign in (1, -1):
        gyro, accel = ideal(latitude=sign * np.pi / 3, heading=np.pi / 2, duration=2, rate_hz=2)
        assert_allclose(gyro, np.tile(EARTH_RATE * np.array([0, -0.5, -sign * np.sqrt(0.75)]), (4, 1)), atol=1e-18)
        assert_allclose(accel, np.tile([0, 0, -normal_gravity(np.pi / 3)], (4, 1)), atol=1e-14)


@pytest.mark.parametrize(("latitude", "roll", "pitch", "heading"), POSES)
def test_standing_still_agrees_with_pyins(latitude, roll, pitch, heading):
    from pyins.sim import generate_imu

    times = np.arange(5) / 2
    rph = np.tile(np.degrees([roll, pitch, heading]), (5, 1))
    lla = np.tile([np.degrees(latitude), 0.0, 0.0], (5, 1))
    _, imu = generate_imu(times, lla, rph, np.zeros((5, 3)), sensor_type="increment")
    gyro, accel = ideal(latitude=latitude, roll=roll, pitch=pitch, heading=heading, duration=2, rate_hz=2)
    increments = imu.to_numpy()[1:] * 2
    assert_allclose(gyro, increments[:, :3], atol=1e-9 * EARTH_RATE, rtol=0)
    # Two gravity formulas (Somigliana closed and pyins' series) and its splines: 3e-6 m/s^2.
    assert_allclose(accel, increments[:, 3:], atol=3e-6, rtol=0)


def integrated(rotation_nb, latitude, edges, accel_n, *, substeps=4000):
    """Mean body rate and specific force over each interval by brute force: many small rotations."""
    spin = Rotation.from_rotvec
    rates, forces = [], []
    for start, end in pairwise(edges):
        times = np.linspace(start, end, substeps + 1)
        mat_ib = spin(np.outer(times, earth_rate_n(latitude))) * rotation_nb(times)
        rates.append((mat_ib[:-1].inv() * mat_ib[1:]).as_rotvec().sum(axis=0) / (end - start))
        middles = rotation_nb((times[1:] + times[:-1]) / 2)
        forces.append(middles.inv().apply(accel_n).mean(axis=0))
    return np.array(rates), np.array(forces)


@pytest.mark.slow
@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize(("latitude", "roll", "pitch", "heading"), POSES[1:3])
def test_turning_while_tilted_agrees_with_brute_force(latitude, roll, pitch, heading, smooth):
    # Turns begin and end inside samples, and one is as fast as 1 rad per sample.
    motion = Motion(turns=((0.77, 1.6, 1.4), (3.1, 0.9, -3.0)), smooth=smooth)

    def rotation_nb(times):
        return Rotation.from_matrix(np.swapaxes(mat_bn(roll, pitch, heading + motion.turned(times)), -1, -2))

    gravity = np.array([0, 0, -normal_gravity(latitude)])
    rates, forces = integrated(rotation_nb, latitude, np.arange(11) / 2, gravity)
    gyro, accel = ideal(
        latitude=latitude, roll=roll, pitch=pitch, heading=heading, duration=5, rate_hz=2, motion=motion
    )
    assert_allclose(gyro, rates, atol=2e-7 * EARTH_RATE * 4000, rtol=0)  # 4000 steps of rounding at 1e-13
    assert_allclose(accel, forces, atol=1e-9)


def test_smooth_turn_starts_and_ends_at_rest():
    times = np.array([1.0, 1.001, 2.999, 3.0, 3.001, 4.999, 5.0])  # from 1 s to 5 s, middle at 3 s
    angle = Motion(turns=((1.0, 4.0, 2.0),), smooth=True).turned(times)
    assert_allclose(angle[[0, 3, 6]], [0.0, 1.0, 2.0])
    rate = np.diff(angle)[[0, 2, 3, 5]] / 0.001
    assert_allclose(rate, [0.0, 1.0, 1.0, 0.0], atol=1e-5)  # twice the mean rate of 0.5 rad/s in the middle


def test_turned_recording_knows_its_heading_at_the_end():
    motion = Motion(turns=((60.0, 5.0, np.radians(-450)), (10.0, 10.0, np.radians(100))))
    recording = simulate(
        IDEAL,
        latitude=-0.5,
        heading=0.2,
        roll=0.3,
        pitch=0.2,
        duration=80,
        rate_hz=7,
        rng=np.random.default_rng(1),
        motion=motion,
    )
    assert_allclose(recording.heading_true, (0.2 + np.radians(-350)) % (2 * np.pi))
    # The turn seen by the gyro about the vertical, Earth rate taken off, is the sum of the turns.
    down = mat_bn(0.3, 0.2, 0.0)[:, 2]
    turned = (recording.gyro_b @ down + EARTH_RATE * np.sin(-0.5)).sum() / 7
    assert_allclose(turned, np.radians(-350), atol=1e-12)
    assert_allclose(np.array(level(recording.accel_b.mean(axis=0))), [0.3, 0.2], atol=1e-12)
    quiet = slice(0, 69)  # still before the first turn, and still after the last
    assert_allclose(recording.gyro_b[quiet], np.tile(mat_bn(0.3, 0.2, 0.2) @ earth_rate_n(-0.5), (69, 1)), atol=1e-18)
    assert_allclose(
        recording.gyro_b[-70:],
        np.tile(mat_bn(0.3, 0.2, recording.heading_true) @ earth_rate_n(-0.5), (70, 1)),
        atol=1e-17,
    )


def coning(times, *, runs, rng):
    """A large, fast, coning disturbance: 2 deg at 0.4 Hz, all axes out of phase."""
    phase = 2 * np.pi * 0.4 * times[:, None] + np.array([0.3, 1.9, 4.0])
    return 0.035 * np.sin(phase)[None]


def test_a_disturbance_moves_gyro_and_accelerometer_as_one_body():
    latitude, roll, pitch, heading, rate_hz = 0.6, 0.4, -0.3, 2.0, 20.0
    motion = Motion(turns=((1.0, 1.0, 0.8),), disturbance=coning)

    def rotation_nb(times):
        undisturbed = np.swapaxes(mat_bn(roll, pitch, heading + motion.turned(times)), -1, -2)
        return Rotation.from_matrix(undisturbed) * Rotation.from_rotvec(coning(times, runs=1, rng=None)[0])

    gravity = np.array([0, 0, -normal_gravity(latitude)])
    rates, forces = integrated(rotation_nb, latitude, np.arange(61) / rate_hz, gravity, substeps=300)
    gyro, accel = ideal(
        latitude=latitude, roll=roll, pitch=pitch, heading=heading, duration=3, rate_hz=rate_hz, motion=motion
    )
    # Rates reach 2 x 10^4 deg/h, and 46 deg/s while turning; coning makes 300 deg/h of them. What is left out, of third
    # order in the angle, falls with the square of the interval: measured 0.033 deg/h at 10 Hz, 0.009 here.
    assert_allclose(gyro, rates, atol=0.01 * DEG_PER_HOUR, rtol=0)
    assert_allclose(accel, forces, atol=1e-7, rtol=0)


@pytest.mark.slow
def test_sway_is_drawn_from_the_stated_law():
    times = np.arange(0, 400, 0.25)
    angle = drawn("sway", times, runs=600, rng=np.random.default_rng(3))[0]
    rate = np.diff(angle, axis=1) / 0.25
    # 1.7 tones, amplitude half-normal of 0.002 deg/s: mean square rate = 1.7 x (0.002 deg/s)^2 / 2, less where the
    # difference over 0.25 s averages a tone of 0.3 Hz (3 % of it at most, 0.4 % on average).
    mean_square = np.mean(rate**2, axis=1).ravel() / np.radians(0.002) ** 2
    bound = stats.norm.isf(CHANCE / 2) * mean_square.std() / np.sqrt(mean_square.size / 3)  # axes share frequencies
    assert abs(mean_square.mean() - 0.85) < bound + 0.03
    assert np.abs(angle.mean(axis=(0, 1))).max() < 1e-4
    again = drawn("sway", times, runs=600, rng=np.random.default_rng(3))[0]
    assert_array_equal(angle, again)


def test_swaying_recording_is_consistent_between_gyro_and_accelerometer():
    recording = simulate(
        IDEAL,
        latitude=0.0,
        heading=0.0,
        duration=300,
        rate_hz=10,
        rng=np.random.default_rng(8),
        motion=Motion(disturbance="sway"),
    )
    roll, pitch = level(recording.accel_b)  # mean tilt of each interval
    spin = recording.gyro_b - recording.gyro_b.mean(axis=0)
    for tilt, rate in ((roll, spin[:, 0]), (pitch, spin[:, 1])):
        integrated_tilt = np.cumsum(rate) / 10 - rate / 20
        # Small angles: the Earth rate seen changes by less than 1e-4 of itself times the heading swing; 1e-6 rad.
        difference = (tilt - tilt.mean()) - (integrated_tilt - integrated_tilt.mean())
        difference -= np.polyval(np.polyfit(np.arange(3000), difference, 1), np.arange(3000))
        assert np.abs(difference).max() < 2e-6
        assert np.abs(tilt - tilt.mean()).max() > 2e-5
    assert recording.heading_true == 0.0


# --- recordings and batches ----------------------------------------------------------------------


def test_recording_carries_its_truth_and_depends_on_its_seed_only():
    def make(seed, **more):
        arguments = {"latitude": -0.4, "heading": 7.0, "duration": 10, "rate_hz": 25, **more}
        return simulate("stim300", rng=np.random.default_rng(seed), **arguments)

    recording = make(1)
    assert recording.gyro_b.shape == recording.accel_b.shape == (250, 3)
    assert (recording.rate_hz, recording.latitude, recording.duration) == (25.0, -0.4, 10.0)
    assert_allclose(recording.heading_true, 7.0 - 2 * np.pi)
    assert recording.source == "simulated stim300"
    assert_array_equal(recording.gyro_b, make(1).gyro_b)
    assert_array_equal(recording.accel_b, make(1).accel_b)
    assert recording.session == make(1).session != make(2).session
    assert np.abs(recording.gyro_b - make(2).gyro_b).min() > 0
    assert make(1, accel=False).accel_b is None


def test_each_run_of_a_batch_has_its_own_pose():
    heading, roll = np.array([0.1, 2.0, 4.0]), np.array([0.0, 0.5, -0.5])
    gyro, accel = simulate_batch(
        IDEAL,
        runs=3,
        latitude=[0.1, 0.2, -0.3],
        heading=heading,
        roll=roll,
        duration=1,
        rate_hz=2,
        rng=np.random.default_rng(1),
    )
    expected = np.einsum("rij,rj->ri", mat_bn(roll, 0.0, heading), earth_rate_n([0.1, 0.2, -0.3]))
    assert_allclose(gyro, np.repeat(expected[:, None], 2, axis=1), atol=1e-18)
    assert_allclose(level(accel[:, 0])[0], roll, atol=1e-12)


@pytest.mark.slow
def test_temporaries_stay_small_beside_the_result(monkeypatch):
    monkeypatch.setattr(simulation, "_CHUNK", 8_000)
    for disturbance in ("quiet", "sway"):
        tracemalloc.start()
        gyro, accel = simulate_batch(
            "sdc500",
            runs=200,
            latitude=0.5,
            heading=0.0,
            duration=100,
            rate_hz=3,
            rng=np.random.default_rng(1),
            motion=Motion(turns=((10, 5, 1.0),), disturbance=disturbance),
        )
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert peak < 1.5 * (gyro.nbytes + accel.nbytes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"latitude": 2.0}, "latitude is 114.592 deg; -90 to 90"),
        ({"latitude": np.nan}, "latitude is array(nan); finite"),
        ({"pitch": -1.7}, "pitch is 97.4"),
        ({"heading": np.inf}, "heading is array(inf); finite angles"),
        ({"duration": 0.0}, "duration is 0 s; a positive number"),
        ({"duration": 0.01}, "are 0 samples; 1 to 1e+09 are expected"),
        ({"rate_hz": -1.0}, "rate_hz is -1 Hz; a positive number"),
        ({"rate_hz": np.nan}, "rate_hz is nan Hz"),
        ({"runs": 0}, "runs is 0"),
        ({"sensor": "nothing"}, "There is no sensor 'nothing'"),
        ({"motion": Motion(turns=((2.0, 4.0, 1.0),))}, "ends at 6 s, after the recording of 5 s"),
    ],
)
def test_a_bad_argument_is_one_clear_error(changes, message):
    arguments = {"sensor": IDEAL, "runs": 1, "latitude": 0.5, "heading": 0.0, "duration": 5, "rate_hz": 10} | changes
    with pytest.raises(InputError) as caught:
        simulate_batch(**arguments, rng=np.random.default_rng(1))
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"turns": ((0, 5, 1.0), (4, 5, 1.0))}, "START of at least 5 s"),
        ({"turns": ((-1, 5, 1.0),)}, "START of at least 0 s"),
        ({"turns": ((1, 0, np.pi),)}, "START:DURATION:ANGLE = 1:0:180 does not fit"),
        ({"turns": ((1, 1, np.nan),)}, "does not fit"),
        ({"disturbance": "earthquake"}, "no disturbance 'earthquake'; known are quiet, sway"),
    ],
)
def test_a_bad_motion_is_one_clear_error(arguments, message):
    with pytest.raises(InputError) as caught:
        Motion(**arguments)
    assert message in str(caught.value)
