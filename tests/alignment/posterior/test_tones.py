"""Lines of sway: found where they are, also side by side on several axes; they are no drift of the gyro."""

import numpy as np
from numpy.testing import assert_allclose

from gyronorth.alignment.posterior.tones import LINES, strongest
from gyronorth.pipeline import heading_batch
from gyronorth.simulation import Motion, simulate_batch

RATE_HZ, SAMPLES, LATITUDE = 3.0, 300, np.radians(32.11)
#: A line for each axis, Hz: the last two are a cycle and a half in 100 s apart.
SLOW = np.array([0.151, 0.055, 0.04])


def test_lines_of_three_axes_are_found_where_they_are():
    time = np.arange(SAMPLES)[:, None] / RATE_HZ
    rate = 1e-3 * np.array([3.0, 2.0, 1.0]) * np.sin(2 * np.pi * SLOW * time + [0.3, 1.7, 4.0])
    rate += np.random.default_rng(1).normal(scale=1e-6, size=rate.shape)
    frequency, size = np.array(strongest(rate, rate_hz=RATE_HZ)).T
    assert len(frequency) == LINES
    assert_allclose(frequency[:3] * SAMPLES / RATE_HZ, SLOW * SAMPLES / RATE_HZ, atol=0.08)
    assert_allclose(size[:3], 1e-3 * np.array([3, 2, 1]) / np.sqrt(6), rtol=0.02)
    assert size[3] < 0.02 * size[2]


def test_slow_sway_of_three_axes_is_no_drift():
    """Its tilt is seen by the accelerometer: the interval stays next to that of a unit that stands still."""
    lines = [(0.177, 0.021, 0.054), (0.299, 0.029, 0.14), (0.022, 0.055, 0.055), (0.204, 0.495, 0.411)]

    def swaying(times, *, runs, rng):
        phase = rng.uniform(0, 2 * np.pi, (runs, 1, 3))
        return np.radians(0.1) * np.sin(2 * np.pi * np.array(lines)[:, None] * times[:, None] + phase)

    def sigma(motion):
        options = {"runs": len(lines), "latitude": LATITUDE, "heading": 1.0, "duration": 100.0, "rate_hz": RATE_HZ}
        gyro, accel = simulate_batch("sdc500", **options, rng=np.random.default_rng(2), motion=motion)
        found = heading_batch(gyro, accel, rate_hz=RATE_HZ, latitude=LATITUDE, sensor="sdc500", method="auto")
        assert found.valid.all()
        return np.median(found.sigma)

    assert sigma(Motion(disturbance=swaying)) < 1.5 * sigma(Motion())
