"""Identify a sensor from a recording at rest: Allan deviation, then the terms that fit it."""

from __future__ import annotations

import numpy as np

import gyronorth as gn
from gyronorth.allan import identify
from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR

sensor = gn.read_sensor("sdc500")
recording = gn.simulate(sensor, latitude=0.5, heading=0.0, duration=3600, rate_hz=20, rng=np.random.default_rng(4))

octaves = 2.0 ** np.arange(-3, 10)
deviation = gn.allan_deviation(recording.gyro_b[:, 0], rate_hz=recording.rate_hz, taus=octaves)
for tau, value, low, high in zip(deviation.tau, deviation.deviation, deviation.low, deviation.high, strict=True):
    print(
        f"tau {tau:8.2f} s: {value / DEG_PER_HOUR:7.3f} deg/h ({low / DEG_PER_HOUR:.3f} to {high / DEG_PER_HOUR:.3f})"
    )

found = identify(recording.gyro_b, rate_hz=recording.rate_hz)
for name, term, unit, unit_name, true in (
    ("angle random walk", found.angle_random_walk, DEG_PER_SQRT_HOUR, "deg/sqrt(h)", sensor.gyro.white),
    ("bias instability", found.bias_instability, DEG_PER_HOUR, "deg/h", sensor.gyro.flicker),
    ("rate random walk", found.rate_random_walk, DEG_PER_HOUR / 60, "deg/h/sqrt(h)", sensor.gyro.random_walk),
):
    print(
        f"{name}: {term.status}, {term.value / unit:.4f} {unit_name} "
        f"({term.low / unit:.4f} to {term.high / unit:.4f}); the profile says {true / unit:.4f}"
    )
