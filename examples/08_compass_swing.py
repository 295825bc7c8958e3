"""A compass swing: recordings at known headings in one power-up give the unit's deviation curve."""

from __future__ import annotations

from math import degrees, radians

import numpy as np

import gyronorth as gn
from gyronorth.angles import DEG_PER_HOUR, cyclic_rmse
from gyronorth.calibration import calibrate

LATITUDE = radians(32.11)
rng = np.random.default_rng(8)
bias = rng.normal(0, 1.0, 3) * DEG_PER_HOUR  # the turn-on bias of this power-up, unknown to us


def record(heading: float, session: str) -> gn.Recording:
    """One recording of the unit, with its true heading and the name of its power-up."""
    drawn = gn.simulate("isa100c", latitude=LATITUDE, heading=heading, duration=100, rate_hz=5, rng=rng)
    return gn.Recording(
        drawn.gyro_b + bias, drawn.accel_b, 5.0, latitude=LATITUDE, heading_true=heading, session=session
    )


swing = calibrate([record(radians(angle), "monday") for angle in range(0, 360, 20)])
print(f"error of the closed form: {degrees(cyclic_rmse(swing.error)):.2f} deg")
print(f"each left out in turn, corrected by the others: {degrees(cyclic_rmse(swing.left_out)):.2f} deg")

for session in ("monday", "tuesday"):  # switched off over night: another bias, so nothing is corrected
    new = record(radians(133), session)
    estimate = gn.heading(new, sensor="sdc500", method="mean", deviation=swing.model)
    print(f"{session}: {degrees(estimate.heading):.2f} deg, sigma {degrees(estimate.sigma):.2f} deg, truth 133 deg")
    print(f"  {estimate.warnings[-1].message}")
