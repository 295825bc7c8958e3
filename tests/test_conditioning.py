"""Decimation, noise and sway."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.strategies import floats, integers
from numpy.testing import assert_allclose
from scipy import special, stats

from gyronorth.conditioning import (
    GATE_SIGMA,
    decimate,
    decimated,
    fisher_upper,
    incomplete_beta,
    noise_density,
    slope_variance,
    sway,
)
from gyronorth.errors import InputError
from gyronorth.recording import Recording
from gyronorth.simulation import Motion, simulate


@settings(max_examples=60)
@given(n=integers(10, 700), rate=floats(1.0, 700.0), share=floats(0.02, 1.0), seed=integers(0, 2**32 - 1))
def test_decimation_keeps_the_mean_at_any_ratio(n, rate, share, seed):
    to = max(rate * share, 1.001 * rate / n)
    x = np.random.default_rng(seed).standard_normal((n, 3)) + 1e3
    out = decimate(x, rate_hz=rate, to_hz=to)
    # Over the time that whole output samples cover, by an integral done another way: each input
    # sample counts with the share of it that is covered.
    covered = np.clip(len(out) / to * rate - np.arange(n), 0, 1)
    expected = covered @ x / covered.sum()
    assert_allclose(out.mean(axis=0), expected, rtol=1e-12)


def test_decimation_by_an_integer_is_the_block_mean():
    x = np.arange(24.0).reshape(8, 3)
    assert_allclose(decimate(x, rate_hz=4, to_hz=1), x.reshape(2, 4, 3).mean(axis=1))


def test_100_to_3_hz_has_300_samples_and_white_noise_of_the_right_size():
    x = np.random.default_rng(1).standard_normal((10000, 3))
    out = decimate(x, rate_hz=100, to_hz=3)
    assert out.shape == (300, 3)
    # Mean of 33.3 samples; fractional edges keep 1/3 of a sample's variance at most: see the band.
    low, high = stats.chi2.ppf([0.001, 0.999], df=900) / 900 * 3 / 100
    assert low * 0.98 < out.var() < high


@pytest.mark.parametrize(("rate", "to"), [(3.0, 5.0), (3.0, 0.0), (3.0, 0.01)])
def test_impossible_decimation_is_refused(rate, to):
    with pytest.raises(InputError, match=r"Hz"):
        decimate(np.zeros((10, 3)), rate_hz=rate, to_hz=to)


def test_decimated_recording_keeps_truth_and_changes_rate():
    recording = Recording(np.ones((100, 3)), None, 10.0, latitude=0.5, heading_true=1.0)
    slow = decimated(recording, 3.0)
    assert (slow.rate_hz, slow.latitude, slow.heading_true, len(slow.gyro_b)) == (3.0, 0.5, 1.0, 30)


def test_noise_density_of_white_noise():
    x = np.random.default_rng(2).standard_normal((200, 300, 3)) * 5e-5 * np.sqrt(3.0)
    noise = noise_density(x, rate_hz=3.0)
    # Taking the smaller of two estimates, of 198 and 18 degrees of freedom, costs a few per cent.
    assert_allclose(np.sqrt(np.mean(noise.density**2)), 5e-5, rtol=0.12)
    assert np.mean(noise.excess > noise.excess_limit) < 0.02


def test_flicker_does_not_look_like_sway_but_bounded_noise_does():
    rng = np.random.default_rng(3)
    walk = np.cumsum(rng.standard_normal((100, 300, 3)), axis=1) * 0.2 + rng.standard_normal((100, 300, 3))
    assert not np.any(noise_density(walk, rate_hz=3.0).excess > noise_density(walk, rate_hz=3.0).excess_limit)
    bounded = np.diff(rng.standard_normal((100, 301, 3)), axis=1)
    shaken = noise_density(bounded, rate_hz=3.0)
    assert np.all(shaken.excess > shaken.excess_limit)


def test_sway_measures_the_tilt_it_is_given():
    # 1 arcmin rms about x at 0.05 Hz: five cycles in 100 s, in both sensors.
    recording = simulate(
        _noise_free(),
        latitude=0.56,
        heading=1.0,
        duration=100,
        rate_hz=20,
        rng=np.random.default_rng(4),
        motion=Motion(disturbance=_rolling(np.radians(1 / 60) * np.sqrt(2), 0.05)),
    )
    moved = sway(recording.gyro_b, recording.accel_b, mat_lb=np.eye(3), rate_hz=20)
    # Pooled over two axes, of which one moves; a line fitted to five cycles takes 6 / (5 pi)^2 = 2.4 %.
    expected = np.radians(1 / 60) ** 2 / 2
    assert_allclose(moved.gyro_variance, expected, rtol=0.03)
    assert_allclose(moved.tilt_variance, expected, rtol=0.03)
    assert_allclose(moved.excursion, np.radians(1 / 60) * np.sqrt(2), rtol=0.15)


def test_sway_covariance_is_free_of_noise():
    rng = np.random.default_rng(5)
    gyro = rng.standard_normal((300, 200, 3)) * 1e-4
    accel = rng.standard_normal((300, 200, 3)) * 1e-2 + [0, 0, -9.8]
    moved = sway(gyro, accel, mat_lb=np.eye(3), rate_hz=2)
    scatter = moved.tilt_variance.std() / np.sqrt(300)
    assert abs(moved.tilt_variance.mean()) < 3.3 * scatter
    assert np.all(moved.gyro_variance > 0)


@pytest.mark.parametrize(("kind", "low", "high"), [("white", 0.945, 0.965), ("walk", 0.80, 0.86)])
def test_slope_variance_covers_the_scatter_of_slopes(kind, low, high):
    # Two parameters from 16 degrees of freedom: 95 % in white noise, 83 % in a pure random walk, whose
    # slope lives where the residual shows nothing. Four standard errors of 4000 slopes are 1.5 %.
    rng = np.random.default_rng(6)
    x = rng.standard_normal((2000, 200, 2))
    if kind == "walk":
        x = np.cumsum(x, axis=1)
    time = np.arange(200) - 99.5
    slope = np.einsum("t,rtc->rc", time, x) / (time @ time)
    residual = x - x.mean(axis=1, keepdims=True) - time[:, None] * slope[:, None]
    sigma = np.sqrt(slope_variance(residual, duration=200.0))
    assert low < np.mean(np.abs(slope) < 1.96 * sigma[:, None]) < high


@pytest.mark.slow
@given(dof_1=floats(1, 2000), dof_2=floats(1, 2000))
def test_fisher_point_is_the_exact_one(dof_1, dof_2):
    """scipy is the oracle; the approximation that stood here was 1 to 4 % off, and infinite for 2 degrees."""
    probability = stats.norm.sf(GATE_SIGMA)
    assert_allclose(fisher_upper(dof_1, dof_2), stats.f.isf(probability, dof_1, dof_2), rtol=1e-7)


@given(a=floats(0.5, 1e4), b=floats(0.5, 1e4), x=floats(0, 1))
def test_incomplete_beta_is_that_of_scipy(a, b, x):
    assert_allclose(incomplete_beta(a, b, x), special.betainc(a, b, x), rtol=1e-7, atol=1e-12)


def _noise_free():
    from gyronorth.sensor import Sensor, TriadErrors

    return Sensor("ideal", TriadErrors())


def _rolling(amplitude, frequency):
    def rotation(times, *, runs, rng):
        angle = np.zeros((runs, len(times), 3))
        angle[..., 0] = amplitude * np.sin(2 * np.pi * frequency * times)
        return angle

    return rotation
