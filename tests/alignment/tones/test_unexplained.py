"""What neither tones nor the sensor explain: its spectrum, and that a bounded angle leaves the heading."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from gyronorth.alignment.tones.search import bayes
from gyronorth.alignment.tones.unexplained import STILL, BoundedMotion, unexplained
from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR, angle_error
from gyronorth.earth import EARTH_RATE
from gyronorth.sensor import TriadErrors

ERRORS = TriadErrors(white=0.02 * DEG_PER_SQRT_HOUR, flicker=0.3 * DEG_PER_HOUR, turn_on_bias=0.5 * DEG_PER_HOUR)
NONE, RATE_HZ, LATITUDE = np.zeros(300, dtype=bool), 3.0, np.radians(48.0)


def noise(errors, motion, samples, rng):
    """White noise and motion alone, (n, 3), rad/s."""
    root = np.linalg.cholesky(motion.covariance(samples, RATE_HZ) + errors.white**2 * RATE_HZ * np.eye(samples))
    return root @ rng.standard_normal((samples, 3))


@pytest.mark.slow
@pytest.mark.parametrize("time", [0.1, 1.0, 30.0])
def test_the_spectrum_of_the_motion_is_the_transform_of_its_covariance(time):
    motion, n = BoundedMotion(2e-5, time), 3001
    row = motion.covariance(n, RATE_HZ)[n // 2]  # a stationary rate: one row holds every lag
    f = np.array([0.02, 0.3, 1.2])
    lag = np.arange(n) - n // 2
    seen = np.cos(2 * np.pi * f[:, None] * lag / RATE_HZ) @ row / RATE_HZ
    assert_allclose(motion.spectrum(f, RATE_HZ), seen, rtol=1e-6)


def test_motion_and_noise_are_found_and_none_where_there_is_none():
    rng = np.random.default_rng(1)
    moves = BoundedMotion(np.radians(0.003), 0.5)
    _, found = unexplained(noise(ERRORS, moves, 300, rng), NONE, rate_hz=RATE_HZ, errors=ERRORS)
    # Beyond 1 / (2 pi time) only angle^2 / time is told.
    assert 0.6 < found.angle / np.sqrt(found.time) / (moves.angle / np.sqrt(moves.time)) < 1.6
    quiet, still = unexplained(noise(ERRORS, STILL, 300, rng), NONE, rate_hz=RATE_HZ, errors=ERRORS)
    assert quiet.white < 1.6 * ERRORS.white
    assert still.angle / 100 < 0.05 * DEG_PER_HOUR  # over 100 s


def test_a_shaken_unit_keeps_its_heading():
    # 0.003 deg of shaking is 60 times the noise of a sample, and 0.1 deg/h of the mean over 100 s.
    rng = np.random.default_rng(2)
    rate = EARTH_RATE * np.array([np.cos(LATITUDE) * np.cos(1.0), -np.cos(LATITUDE) * np.sin(1.0), -np.sin(LATITUDE)])
    gyro_l = rate + noise(ERRORS, BoundedMotion(np.radians(0.003), 0.3), 300, rng)
    fit = bayes(gyro_l, rate_hz=RATE_HZ, latitude=LATITUDE, errors=ERRORS)
    assert fit.noise > 5
    assert abs(angle_error(fit.heading, 1.0)) < 3 * fit.sigma
    assert fit.sigma < np.radians(6)  # scaled by the residual: more than 20
