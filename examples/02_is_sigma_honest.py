"""Error over claimed sigma for many simulated power-ups: a promise, checked."""

from __future__ import annotations

from math import radians

import numpy as np

import gyronorth as gn
from gyronorth.angles import angle_error
from gyronorth.simulation import simulate_batch

RUNS, LATITUDE = 2000, radians(32.11)
rng = np.random.default_rng(2)

truth = rng.uniform(0, 2 * np.pi, RUNS)
gyro_b, accel_b = simulate_batch(
    "sdc500", runs=RUNS, latitude=LATITUDE, heading=truth, duration=100, rate_hz=3, rng=rng
)
batch = gn.heading_batch(gyro_b, accel_b, rate_hz=3, latitude=LATITUDE, sensor="sdc500")

ratio = angle_error(batch.heading, truth) / batch.sigma
print(f"error / sigma: root mean square {np.sqrt(np.mean(ratio**2)):.3f}, should be near 1")
print(f"beyond 1.96 sigma: {100 * np.mean(np.abs(ratio) > 1.96):.1f} %, should be near 5 %")
print(f"refused although they fit the profile: {100 * np.mean(~batch.valid):.2f} %, should be at most 1 %")
