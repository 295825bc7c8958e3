"""The spectrum of the report: white noise stands at its angle random walk, a tone at its frequency."""

import numpy as np
import pytest

from gyronorth.report.spectrum import POINTS, SHORTEST, spectrum

RATE_HZ = 20.0


def test_white_noise_stands_at_its_angle_random_walk():
    arw, n = 3e-5, 40_000
    noise = arw * np.sqrt(RATE_HZ) * np.random.default_rng(3).standard_normal((n, 3))
    found = spectrum(noise, rate_hz=RATE_HZ)
    assert found.density.shape == (len(found.frequency), 3)
    assert len(found.frequency) <= POINTS
    # At 3 Hz a bin holds 94 frequencies of eight segments; a Hann window leaves some 470 of them independent, so that a
    # density scatters by 1 / (2 sqrt(470)) = 2.3 %, and less above. Their mean scatters by less than 0.2 %.
    high = found.frequency > 3
    np.testing.assert_allclose(found.density[high], arw, rtol=0.10)
    np.testing.assert_allclose(found.density[high].mean(), arw, rtol=0.01)


def test_a_tone_stands_at_its_frequency_and_a_constant_nowhere():
    t = np.arange(8000) / RATE_HZ
    rate = 7.0 + 1e-3 * np.stack([np.sin(2 * np.pi * f * t) for f in (0.3, 1.0, 4.0)], axis=-1)
    found = spectrum(rate, rate_hz=RATE_HZ)
    peaks = found.frequency[np.argmax(found.density, axis=0)]
    np.testing.assert_allclose(peaks, [0.3, 1.0, 4.0], rtol=0.05)


@pytest.mark.parametrize("n", [SHORTEST, 65, 501])
def test_every_length_gives_finite_numbers(n):
    found = spectrum(np.random.default_rng(n).standard_normal((n, 3)), rate_hz=RATE_HZ)
    assert np.isfinite(found.density).all()
    assert (np.diff(found.frequency) > 0).all()
    assert found.frequency[-1] <= RATE_HZ / 2 + 1e-9
