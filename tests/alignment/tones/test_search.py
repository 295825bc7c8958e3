"""Model averaging over tones and settling: evidence by another route, errors and what is claimed of them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from gyronorth.alignment.tones import search as room
from gyronorth.alignment.tones.search import bayes
from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR, angle_error, cyclic_rmse
from gyronorth.attitude import mat_bn
from gyronorth.earth import EARTH_RATE, earth_rate_n
from gyronorth.sensor import TriadErrors
from gyronorth.sensor.law import NoiseLaw
from gyronorth.simulation.disturbance import reference_set

DEG = np.pi / 180
WHITE = TriadErrors(white=0.02 * DEG_PER_SQRT_HOUR, turn_on_bias=0.1 * DEG_PER_HOUR)


def estimates(kind, runs, *, errors=WHITE, **more):
    """Errors and fits of the first recordings of a reference set, and the errors of the plain mean."""
    data = reference_set(kind, runs=runs, **more)
    fits = [bayes(gyro, rate_hz=data.rate_hz, latitude=data.latitude, errors=errors) for gyro in data.gyro_b]
    mean = data.gyro_b.mean(axis=1)
    plain = angle_error(np.arctan2(-mean[:, 1], mean[:, 0]), data.heading)
    return angle_error([fit.heading for fit in fits], data.heading), fits, plain


@pytest.mark.parametrize("flicker", [0.0, 0.5 * DEG_PER_HOUR])
def test_evidence_and_estimate_agree_with_the_dense_gaussian(flicker):
    # Every model, once more, as one covariance matrix over the samples that are not masked.
    errors = TriadErrors(white=WHITE.white, flicker=flicker)
    samples, rate_hz = 60, 3.0
    gyro = reference_set("mixed", runs=1, duration=20.0).gyro_b[0]
    masked = np.zeros(samples, dtype=bool)
    masked[[7, 8, 30]] = True
    grid = room.grid_of(samples, rate_hz, errors)
    models = room.scan(grid, gyro, masked)
    edges, time = np.arange(samples + 1), (np.arange(samples) + 0.5) / rate_hz
    noise = NoiseLaw(errors).mean_covariance(edges[:-1], edges[1:], rate_hz=rate_hz)
    bins = np.array(room.TIME_CONSTANT_BINS)
    tau = (bins[1:] + bins[:-1]) / 2
    one, seen = np.ones(samples - 3), gyro[~masked]
    rows, columns = models.log_weight.shape
    picked = np.random.default_rng(0).integers(0, [rows, columns], (40, 2))
    ours, dense = [], []
    for settling, k in [(0, 0), (0, 1), *picked.tolist()]:
        covariance = noise.copy()
        for tone in models.tones[:, k]:
            if tone >= 0:
                lag = np.subtract.outer(time, time)
                covariance += room.TONE_RATE**2 / 2 * np.cos(2 * np.pi * grid.frequency[tone] * lag)
        prior = np.log(room.TONES[(models.tones[:, k] >= 0).sum()])
        prior += sum(grid.log_prior[t] for t in models.tones[:, k] if t >= 0)
        prior += np.log(2) if (models.tones[:, k] >= 0).all() else 0.0
        if settling > 0:
            decay = np.exp(-time / tau[settling - 1])
            covariance += room.SETTLING_RATE**2 * np.outer(decay, decay)
            prior += np.log(room.SETTLING * np.diff(bins)[settling - 1] / (bins[-1] - bins[0]))
        else:
            prior += np.log(1 - room.SETTLING)
        inverse = np.linalg.inv(covariance[np.ix_(~masked, ~masked)])
        information = one @ inverse @ one
        rate = one @ inverse @ seen / information
        left = seen - rate
        dense.append(
            prior
            - 0.5 * np.einsum("ta,ts,sa", left, inverse, left)
            - 1.5 * np.linalg.slogdet(covariance[np.ix_(~masked, ~masked)])[1]
        )
        ours.append(models.log_weight[settling, k])
        assert_allclose(models.information[settling, k], information, rtol=1e-7)
        assert_allclose(models.rate[:, settling, k], rate, rtol=1e-6, atol=1e-12)
    assert_allclose(np.diff(ours), np.diff(dense), atol=1e-5)  # up to one constant


def test_one_concentrated_law_and_no_law_at_all():
    heading, sigma, (low, high) = room.mixture(np.array([6.2]), np.array([1e4]), np.array([1.0]))
    assert_allclose([heading, sigma], [6.2, 0.01], rtol=1e-3)
    # The grid has 1440 cells over 20 sigma: 1.4e-4 rad each.
    assert_allclose([low, high], [6.2 - 0.0196, (6.2 + 0.0196) % (2 * np.pi)], atol=3e-4)
    _, sigma, interval = room.mixture(np.array([1.0]), np.array([1e-9]), np.array([1.0]))
    assert_allclose(sigma, np.pi / np.sqrt(3), rtol=0.01)
    assert_allclose((interval[1] - interval[0]) % (2 * np.pi), 0.95 * 2 * np.pi, rtol=1e-3)  # 95 % of the circle


@pytest.mark.slow
def test_quiet_recordings_lose_nothing():
    error, fits, plain = estimates("quiet", 15)
    assert cyclic_rmse(error) < 1.1 * cyclic_rmse(plain)
    assert np.mean([fit.tones for fit in fits]) < 0.1
    assert max(fit.bumps for fit in fits) == 0


def test_noise_free_tone_and_settling_leave_the_heading():
    heading, latitude = 2.0, 0.7
    time = (np.arange(300) + 0.5)[:, None] / 3
    gyro = np.tile(mat_bn(0.0, 0.0, heading) @ earth_rate_n(latitude), (300, 1))
    gyro += 7 * DEG_PER_HOUR * np.sin(2 * np.pi * 0.0213 * time + [0.3, 1.0, 2.0])
    gyro += 2 * DEG_PER_HOUR * np.exp(-time / 40) * [1.0, -1.0, 0.5]
    fit = bayes(gyro, rate_hz=3.0, latitude=latitude, errors=WHITE)
    assert abs(angle_error(fit.heading, heading)) < 2 * fit.sigma
    assert_allclose(fit.frequency, [0.0213], atol=0.0005)
    assert fit.settling > 0.9
    assert_allclose(fit.rate_l[2], -EARTH_RATE * np.sin(latitude), atol=0.5 * DEG_PER_HOUR)


def test_a_bump_is_left_out_and_nothing_else():
    data = reference_set("quiet", runs=1)
    bumped = data.gyro_b[0].copy()
    bumped[100:104] += 0.02 * DEG * np.array([1.0, -1.0, 0.5])
    fit = bayes(bumped, rate_hz=3.0, latitude=data.latitude, errors=WHITE)
    assert fit.bumps == 6  # the four and one on either side
    assert abs(angle_error(fit.heading, data.heading[0])) < 3 * fit.sigma
    assert fit.sigma < 1.2 * DEG


def test_a_noise_law_that_is_too_good_is_scaled_up():
    data = reference_set("quiet", runs=1)
    good = TriadErrors(white=WHITE.white / 3, turn_on_bias=WHITE.turn_on_bias)
    fit = bayes(data.gyro_b[0], rate_hz=3.0, latitude=data.latitude, errors=good)
    honest = bayes(data.gyro_b[0], rate_hz=3.0, latitude=data.latitude, errors=WHITE)
    assert 2.5 < fit.noise < 3.5
    assert fit.sigma > 0.7 * honest.sigma


@pytest.mark.slow
def test_mixed_disturbance_costs_less_than_half_of_what_it_costs_the_mean():
    # 20 recordings; in 400 of them the ratio is 0.31.
    error, fits, plain = estimates("mixed", 20)
    assert cyclic_rmse(error) < 0.5 * cyclic_rmse(plain)
    sigma = np.array([fit.sigma for fit in fits])
    # A mixture's squared error over sigma has heavier tails than chi-square: the band is that of 20 / 1.5 degrees.
    low, high = stats.chi2.ppf([0.001, 0.999], df=13)
    assert low / 13 < np.mean((error / sigma) ** 2) < high / 13


@pytest.mark.long  # its small form stands above
@pytest.mark.parametrize(("kind", "most"), [("mixed", 0.38), ("quiet", 1.03)])
def test_ratio_to_the_mean_and_coverage(kind, most):
    error, fits, plain = estimates(kind, 250)
    assert cyclic_rmse(error) < most * cyclic_rmse(plain)
    low, high = np.array([fit.interval95 for fit in fits]).T
    truth = np.array([fit.heading for fit in fits]) - error
    assert 0.91 < np.mean((truth - low) % (2 * np.pi) < (high - low) % (2 * np.pi)) < 0.99  # 95 % +- 3 sigma of 250
