"""Closed-form evidence against a brute-force marginal likelihood."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import multivariate_normal

from gyronorth.alignment.tones.evidence import (
    WALK_MODES,
    WALK_RATE,
    columns,
    evidence,
    law,
    log_kinds,
    time_constant_bins,
)
from gyronorth.alignment.tones.search import SETTLING_RATE, TIME_CONSTANT_BINS, TONE_RATE
from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR
from gyronorth.sensor import TriadErrors
from gyronorth.sensor.law import NoiseLaw

N, RATE_HZ = 90, 3.0
WHITE = TriadErrors(white=0.02 * DEG_PER_SQRT_HOUR)
COLOURED = TriadErrors(white=0.02 * DEG_PER_SQRT_HOUR, flicker=1 * DEG_PER_HOUR)
#: So wide a prior of the constant that its evidence is that of a flat one; what is divided out is its density.
FLAT = 1e4 * DEG_PER_HOUR


def brute_force(errors, x, masked, frequencies, decay):
    """Log evidence of each axis with the covariance of everything unknown written out, mask by leaving out."""
    edges = np.arange(N + 1)
    time = (edges[:-1] + 0.5) / RATE_HZ
    cov = NoiseLaw(errors).mean_covariance(edges[:-1], edges[1:], rate_hz=RATE_HZ) + FLAT**2
    for f in frequencies:
        wave = np.exp(2j * np.pi * f * time)
        cov = cov + TONE_RATE**2 / 2 * (np.outer(wave, wave.conj())).real
    if decay == "walk":
        for wave in np.pi * (np.arange(WALK_MODES) + 0.5):
            mode = WALK_RATE * np.sqrt(2) / wave * np.sin(wave * time * RATE_HZ / N)
            cov = cov + np.outer(mode, mode)
    elif isinstance(decay, str):  # a tilt: two horizontal axes of TILT_ANGLE sqrt(3 / 2), here three of less
        tau = float(decay.removeprefix("tilt "))
        cov = cov + (np.radians(0.01) / tau) ** 2 * 2 / 3 * np.outer(np.exp(-time / tau), np.exp(-time / tau))
    elif decay is not None:
        cov = cov + SETTLING_RATE**2 * np.outer(np.exp(-time / decay), np.exp(-time / decay))
    keep = ~masked
    return sum(multivariate_normal(np.zeros(keep.sum()), cov[np.ix_(keep, keep)]).logpdf(x[keep, i]) for i in range(3))


@pytest.mark.slow
@pytest.mark.parametrize("errors", [WHITE, COLOURED], ids=["white", "coloured"])
@pytest.mark.parametrize("bumped", [False, True])
def test_evidence_of_every_model_is_the_marginal_likelihood(errors, bumped):
    rng = np.random.default_rng(3)
    x = rng.normal(0, 3 * DEG_PER_HOUR, (N, 3))
    masked = np.zeros(N, bool)
    masked[20:27] = bumped
    frequency = np.array([0.02, 0.05, 0.21])
    known = law(N, RATE_HZ, errors)
    models = evidence(known, columns(known, known.whitened(x), masked, frequency), np.zeros(3))
    kinds = log_kinds(known.share, bumped=bumped)
    bins = np.array(TIME_CONSTANT_BINS)
    middle = (bins[1:] + bins[:-1]) / 2
    found, expected = [], []
    tilt = f"tilt {np.sqrt(30 * 60)}"
    for slow, decay in ((0, None), (1, middle[0]), (len(middle), middle[-1]), (len(middle) + 1, tilt)):
        for which in range(7):
            tones = [t for t in (models.first[which], models.second[which]) if t >= 0]
            prior = kinds[slow, len(tones)] + (np.log(2) if len(tones) == 2 else 0)
            whole = models.log_weight[slow, which] - 1.5 * np.log(models.information[slow, which])
            found.append(whole - prior)
            expected.append(brute_force(errors, x, masked, frequency[tones], decay))
    # Both up to one constant: the flat prior and the noise determinant. The prior of 1e4 deg/h leaves 1e-6.
    assert_allclose(np.array(found) - found[0], np.array(expected) - expected[0], atol=2e-4)


def test_walk_is_the_slow_part_of_a_random_walk():
    # Its modes must be those of min(t, t'): eigenvectors of that matrix, and 1 - 2 / pi^2 sum over m > 6 of
    # 1 / (m - 1/2)^2 = 96.6 % of its trace.
    known = law(N, RATE_HZ, WHITE)
    modes = known.settling[:, len(known.share) :] / known.whiten[:, None] / WALK_RATE
    middle = (np.arange(N) + 0.5) / N
    walk = np.minimum.outer(middle, middle)
    assert_allclose(np.trace(modes @ modes.T) / np.trace(walk), 0.966, atol=0.002)
    size, vectors = np.linalg.eigh(walk)
    assert_allclose(np.linalg.norm(modes, axis=0) ** 2, size[::-1][: modes.shape[1]], rtol=0.02)
    overlap = np.abs(vectors[:, ::-1][:, : modes.shape[1]].T @ (modes / np.linalg.norm(modes, axis=0)))
    assert_allclose(overlap, np.eye(modes.shape[1]), atol=0.02)


def test_evidence_of_a_walk_is_the_marginal_likelihood():
    x = np.outer(np.arange(N) / N, [3, -2, 1]) * DEG_PER_HOUR
    known, none = law(N, RATE_HZ, WHITE), np.zeros(N, bool)
    models = evidence(known, columns(known, known.whitened(x), none, np.array([0.1, 0.2])), np.zeros(2))
    kinds = log_kinds(known.share, bumped=False)
    whole = models.log_weight[:, 0] - 1.5 * np.log(models.information[:, 0]) - kinds[:, 0]
    expected = brute_force(WHITE, x, none, [], "walk") - brute_force(WHITE, x, none, [], None)
    assert_allclose(whole[-1] - whole[0], expected, atol=2e-4)


def test_estimate_is_generalised_least_squares():
    rng = np.random.default_rng(4)
    x = rng.normal(0, 3 * DEG_PER_HOUR, (N, 3))
    known = law(N, RATE_HZ, WHITE)
    models = evidence(known, columns(known, known.whitened(x), np.zeros(N, bool), np.array([0.1, 0.2])), np.zeros(2))
    assert_allclose(models.rate[:, 0, 0], x.mean(axis=0), rtol=1e-9)
    assert_allclose(1 / models.information[0, 0], WHITE.white**2 * RATE_HZ / N, rtol=1e-9)


def test_priors_are_a_distribution():
    share = law(N, RATE_HZ, WHITE).share
    settles = slice(1, 1 + len(TIME_CONSTANT_BINS) - 1)
    for bumped in (False, True):
        assert_allclose(np.exp(log_kinds(share, bumped=bumped)).sum(), 1.0, rtol=1e-12)
    # A bump tells of a unit that is handled: settling and tones are then more likely than without.
    quiet, struck = (np.exp(log_kinds(share, bumped=bumped)) for bumped in (False, True))
    assert struck[settles].sum() > quiet[settles].sum()
    assert struck[:, 1:].sum() > quiet[:, 1:].sum()


def test_a_longer_recording_allows_for_a_slower_warm_up():
    assert_allclose(time_constant_bins(300.0), TIME_CONSTANT_BINS)
    for duration in (301.0, 900.0, 28_800.0):
        edges = time_constant_bins(duration)
        assert_allclose(edges[: len(TIME_CONSTANT_BINS)], TIME_CONSTANT_BINS)
        assert 2 * duration <= edges[-1] < 2 * duration * 4 / 3
        known = law(900, 900 / duration, WHITE)
        assert known.settling.shape[1] - WALK_MODES == len(known.share)
        share = known.share[: len(edges) - 1]
        assert_allclose(share.sum(), 1.0)
        # The density of the time constant is continuous at 120 s, and bins beyond are of equal weight.
        density, first = share / np.diff(edges), len(TIME_CONSTANT_BINS) - 1
        assert_allclose(share[first:], share[first])
        assert_allclose(density[first] * 40 / np.log(4 / 3) / 120, density[first - 1])


@pytest.mark.parametrize("flicker", [0.0, 1.0])
def test_the_determinant_is_that_of_the_samples_that_are_not_masked(flicker):
    errors = TriadErrors(white=0.02 * DEG_PER_SQRT_HOUR, flicker=flicker * DEG_PER_HOUR)
    edges, masked = np.arange(91), np.arange(90) % 17 < 3
    covariance = NoiseLaw(errors).mean_covariance(edges[:-1], edges[1:], rate_hz=3.0)
    wanted = -np.linalg.slogdet(covariance[np.ix_(~masked, ~masked)])[1] / 2
    assert_allclose(law(90, 3.0, errors).log_det(masked), wanted, rtol=1e-9)
