"""Two poses remove the bias: the same sensor and the same time of standing still, with and without a turn."""

from __future__ import annotations

from math import degrees, radians

import numpy as np

import gyronorth as gn
from gyronorth.angles import DEG_PER_HOUR, angle_error
from gyronorth.simulation import Motion

RUNS = 10
scene = {"latitude": radians(48), "heading": radians(120), "rate_hz": 10}
half_turn = Motion(turns=((100.0, 10.0, np.pi),))  # after 100 s, within 10 s, clockwise

for name, duration, motion in (("one pose", 200, Motion()), ("two poses", 210, half_turn)):
    error, sigma = [], []
    for child in np.random.default_rng(6).spawn(RUNS):
        recording = gn.simulate("stim300", **scene, duration=duration, motion=motion, rng=child)
        estimate = gn.heading(recording, sensor="stim300")  # auto finds the poses
        error.append(angle_error(estimate.heading, recording.heading_true))
        sigma.append(estimate.sigma)
    rms_error, rms_sigma = (degrees(np.sqrt(np.mean(np.square(values)))) for values in (error, sigma))
    print(
        f"{name}: root mean square error {rms_error:5.2f} deg, claimed sigma {rms_sigma:5.2f} deg ({estimate.method})"
    )

# The bias that a turned recording finds may be given to later recordings of the same power-up.
print("bias of the last one, deg/h:", ", ".join(f"{bias / DEG_PER_HOUR:.2f}" for bias in estimate.gyro_bias))
