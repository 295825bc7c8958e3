"""A swaying body: averaging mistakes a net change of tilt for rotation, tracing gravity does not."""

from __future__ import annotations

from math import degrees, radians

import numpy as np

import gyronorth as gn
from gyronorth.angles import angle_error
from gyronorth.simulation import Motion


def wind(times, *, runs, rng):
    """Roll and pitch of a parked vehicle in the wind: one tone of some 3 arcmin for each, (runs, k, 3) rad."""
    frequency = rng.uniform(0.03, 0.2, (runs, 1, 2))
    phase = rng.uniform(0, 2 * np.pi, (runs, 1, 2))
    angle = np.zeros((runs, len(times), 3))
    angle[..., :2] = radians(3 / 60) * np.sin(2 * np.pi * frequency * times[:, None] + phase)
    return angle


sensor = gn.read_sensor("isa100c")  # a fibre-optic gyro: sway, not the sensor, limits the mean
scene = {"latitude": radians(48), "heading": radians(200), "duration": 300, "rate_hz": 10}
error = {"mean": [], "inertial": [], "auto": []}
sigma = {"mean": [], "inertial": [], "auto": []}
for child in np.random.default_rng(3).spawn(5):
    recording = gn.simulate(sensor, **scene, motion=Motion(disturbance=wind), rng=child)
    for method in error:
        estimate = gn.heading(recording, sensor=sensor, method=method)
        error[method].append(degrees(angle_error(estimate.heading, recording.heading_true)))
        sigma[method].append(degrees(estimate.sigma))

for method in error:
    rms_error, rms_sigma = (np.sqrt(np.mean(np.square(row))) for row in (error[method], sigma[method]))
    print(f"{method:9s} root mean square error {rms_error:5.2f} deg, claimed sigma {rms_sigma:5.2f} deg")
