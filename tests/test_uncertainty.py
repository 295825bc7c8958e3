"""Each formula of the error budget against another route to the same number."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.strategies import floats
from numpy.testing import assert_allclose
from scipy import integrate, stats

from gyronorth.alignment.gates import WIDEST_CONCENTRATION, WIDEST_HALF_WIDTH
from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR
from gyronorth.earth import EARTH_RATE
from gyronorth.sensor import Sensor, TriadErrors, read_sensor
from gyronorth.sensor.gauss_markov import gauss_markov_variance
from gyronorth.sensor.law import NoiseLaw
from gyronorth.simulation import sensor_errors
from gyronorth.uncertainty import (
    NORMAL_975,
    STUDENT1_975,
    STUDENT2_975,
    STUDENT14_975,
    cramer_rao_floor,
    heading_sigma_parts,
    rate_variance,
    von_mises,
)

LATITUDE = np.radians(32.11)
SIGNAL = EARTH_RATE * np.cos(LATITUDE)
WEIGHTS = {  # weight of the sample at time x T, normalised as the docstring says
    "mean": lambda x, T: np.ones_like(x),
    "slope": lambda x, T: 6 * x * (1 - x),
    "ramp": lambda x, T: 12 * (x - 0.5) / T,
}


def test_quantiles_are_those_of_their_laws():
    assert_allclose(NORMAL_975, stats.norm.ppf(0.975), atol=1e-6)
    assert_allclose([STUDENT1_975, STUDENT2_975, STUDENT14_975], stats.t.ppf(0.975, [1, 2, 14]), atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("weighting", list(WEIGHTS))
@settings(max_examples=5)
@given(ratio=floats(0.01, 2000))
def test_gauss_markov_variance_is_the_double_integral(weighting, ratio):
    # E[(integral of w b)^2] with E[b(t) b(t')] = v exp(-|t - t'| / tau), integrated on a triangle.
    duration, tau, v = 7.0, 7.0 / ratio, 3.0
    weight = WEIGHTS[weighting]

    def inner(u):  # autocorrelation of the weights at lag u
        node, w = np.polynomial.legendre.leggauss(8)
        x = (node + 1) / 2 * (1 - u)
        return (weight(x, duration) * weight(x + u, duration)) @ w / 2 * (1 - u)

    points = [p for p in (1 / ratio, 5 / ratio, 30 / ratio) if p < 1]
    value, _ = integrate.quad(
        lambda u: 2 * v * inner(u) * np.exp(-ratio * u), 0, 1, points=points or None, limit=200, epsabs=0, epsrel=1e-11
    )
    assert_allclose(gauss_markov_variance(v, tau, duration, weighting), value, rtol=1e-8)


@pytest.mark.parametrize("weighting", list(WEIGHTS))
def test_white_noise_and_random_walk_by_their_integrals(weighting):
    # White noise: integral of w^2. Random walk from switch-on: a step at time s is weighted by all of w behind s.
    duration = 7.0
    node, step = np.polynomial.legendre.leggauss(8)  # exact for these polynomials
    x = (node + 1) / 2

    def behind(s):
        return WEIGHTS[weighting](s + (1 - s) * x, duration) @ step / 2 * (1 - s)

    white = WEIGHTS[weighting](x, duration) ** 2 @ step / 2 / duration
    walk = np.array([behind(s) for s in x]) ** 2 @ step / 2 * duration
    assert_allclose(rate_variance(TriadErrors(white=3.0), duration, weighting=weighting)["noise"], 9 * white)
    assert_allclose(rate_variance(TriadErrors(random_walk=3.0), duration, weighting=weighting)["drift"], 9 * walk)


def test_quantisation_of_the_mean_is_that_of_its_two_ends():
    step, duration = 0.3, 7.0
    ends = np.random.default_rng(20240501).uniform(0, 1000, (100_000, 2))
    error = np.diff(step * np.round(ends / step) - ends, axis=1) / duration
    claimed = rate_variance(TriadErrors(quantisation=step), duration)["noise"]
    assert_allclose(np.var(error), claimed, rtol=0.02)  # 5 sigma: a triangular law has kurtosis 2.4


def test_mean_of_gauss_markov_is_the_issue_formula():
    v, tau, duration = 2.0, 30.0, 100.0
    expected = 2 * v * tau / duration**2 * (duration - tau * (1 - np.exp(-duration / tau)))
    assert_allclose(gauss_markov_variance(v, tau, duration, "mean"), expected, rtol=1e-14)


def test_known_costs_of_the_inertial_frame():
    # Gyro white noise sqrt(1.2) of the floor; accelerometer white noise sqrt(12) N / (g Omega cos lat T^1.5):
    # 0.32 deg at 100 s for 100 ug/sqrt(Hz); flicker 2.3 deg at 100 s and 0.22 at 1000 s for 0.15 mg.
    white = Sensor("white", TriadErrors(white=0.02 * DEG_PER_SQRT_HOUR))
    floor = cramer_rao_floor(white, latitude=LATITUDE, duration=100.0)
    inertial = heading_sigma_parts(white, latitude=LATITUDE, duration=100.0, method="inertial")
    assert_allclose(inertial["noise"] / floor, np.sqrt(1.2), rtol=1e-12)
    accel = TriadErrors(white=100e-6 * 9.80665, flicker=0.15e-3 * 9.80665)
    slope = rate_variance(accel, np.array([100.0, 1000.0]), weighting="ramp")
    cost = {name: np.degrees(np.sqrt(value)) / 9.80665 / SIGNAL for name, value in slope.items()}
    assert_allclose(cost["noise"][0], 0.32, atol=0.005)
    assert_allclose(cost["drift"], [2.3, 0.22], atol=0.05)


def test_constant_bias_costs_both_methods_the_same():
    biased = Sensor("biased", TriadErrors(turn_on_bias=DEG_PER_HOUR))
    both = [
        heading_sigma_parts(biased, latitude=LATITUDE, duration=100.0, method=m)["turn_on_bias"]
        for m in ("mean", "inertial")
    ]
    assert_allclose(np.degrees(both), 4.50, atol=0.005)


@pytest.mark.parametrize(
    ("sensor", "part", "rate"),
    [
        (Sensor("g", TriadErrors(), g_sensitivity=1e-6), "turn_on_bias", 1e-6 * 9.795),  # g at 32 N
        (Sensor("s", TriadErrors(scale_factor=2e-3)), "turn_on_bias", 2e-3 * EARTH_RATE),
        (Sensor("m", TriadErrors(misalignment=3e-3)), "turn_on_bias", 3e-3 * EARTH_RATE),
        (Sensor("a", TriadErrors(), TriadErrors(misalignment=4e-3)), "levelling", 4e-3 * EARTH_RATE * np.sin(LATITUDE)),
    ],
)
def test_what_is_constant_in_one_pose_is_in_sigma(sensor, part, rate):
    parts = heading_sigma_parts(sensor, latitude=LATITUDE, duration=100.0)
    assert_allclose(parts.pop(part), rate / SIGNAL, rtol=1e-4)
    assert not any(parts.values())


def test_levelling_error_costs_tan_latitude():
    tilted = Sensor("tilted", TriadErrors(), TriadErrors(turn_on_bias=1e-3 * 9.7954))
    part = heading_sigma_parts(tilted, latitude=LATITUDE, duration=100.0)["levelling"]
    assert_allclose(part, 1e-3 * np.tan(LATITUDE), rtol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("term", ["white", "flicker", "random_walk", "quantisation"])
def test_variance_of_the_mean_is_that_of_simulated_errors(term):
    errors = TriadErrors(**{term: 1.0})
    runs = 4000
    means = sensor_errors(errors, (runs, 200), 2.0, rng=np.random.default_rng(11)).mean(axis=1)
    expected = sum(rate_variance(errors, 100.0).values())
    low, high = stats.chi2.ppf([0.0005, 0.9995], df=3 * runs) / (3 * runs)
    assert low < means.var() / expected < high or (term == "quantisation" and means.var() <= expected)


def test_detrended_angle_variance_is_that_of_simulated_drift():
    errors = read_sensor("sdc500").gyro
    rate = sensor_errors(errors, (3000, 100), 1.0, rng=np.random.default_rng(12))
    angle = np.cumsum(rate, axis=1) - rate / 2
    time = np.arange(100) - 49.5
    slope = np.einsum("t,rtc->rc", time, angle) / (time @ time)
    bent = angle - angle.mean(axis=1, keepdims=True) - time[:, None] * slope[:, None]
    measured = np.mean(bent[..., :2] ** 2, axis=(1, 2))
    mean, limit = NoiseLaw(errors).detrended_angle_variance(100.0)
    assert_allclose(measured.mean(), mean, atol=4 * measured.std() / np.sqrt(3000))
    # A sum of few squares has a heavier tail than the normal law: 3.29 sigma is passed by up to 1 %.
    assert np.mean(measured > limit) < 0.015


@pytest.mark.slow
@given(floats(0.01, 5e4))
def test_von_mises_table_agrees_with_scipy(kappa):
    sigma, half = von_mises(kappa)
    assert_allclose(half, stats.vonmises.ppf(0.975, kappa), rtol=3e-3)
    grid = np.linspace(-np.pi, np.pi, 20001)
    weight = np.exp(kappa * (np.cos(grid) - 1))
    assert_allclose(sigma, np.sqrt((weight * grid**2).sum() / weight.sum()), rtol=3e-3)


def test_von_mises_ends():
    sigma, half = von_mises(np.array([0.0, 1e12]))
    assert_allclose(sigma, [np.pi / np.sqrt(3), 1e-6], rtol=1e-3)
    # Nothing known: 95 % of a flat law.
    assert_allclose(half, [0.95 * np.pi, NORMAL_975 * 1e-6], rtol=1e-3)


def test_widest_concentration_is_the_one_of_that_half_width():
    assert_allclose(von_mises(WIDEST_CONCENTRATION)[1], WIDEST_HALF_WIDTH, rtol=2e-3)


def test_floor_of_the_paper():
    # PAPER.md, "The limits": 0.54 deg at 100 s from N = 0.02 deg/sqrt(h), 4.50 deg per deg/h.
    errors = TriadErrors(white=0.02 * DEG_PER_SQRT_HOUR)
    assert_allclose(
        np.degrees(cramer_rao_floor(Sensor("n", errors), latitude=LATITUDE, duration=100.0)), 0.54, atol=0.003
    )
