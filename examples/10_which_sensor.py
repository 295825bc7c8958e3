"""Which built-in sensor reaches a heading of 1 deg at 50 N, in one pose or with turns, and how long it takes."""

from __future__ import annotations

from math import degrees, radians

import numpy as np

from gyronorth.planning import plan, plan_turns
from gyronorth.report.wording import duration_text
from gyronorth.sensor import sensor_names

GOAL_DEG, LATITUDE, PATIENCE = 1.0, radians(50), 3600.0
times = np.geomspace(10, PATIENCE, 200)

for name in sensor_names():
    planned = plan(name, latitude=LATITUDE, durations=times)
    reached = np.degrees(planned.sigma) <= GOAL_DEG
    if reached.any():
        print(f"{name:12s} one pose, {duration_text(times[np.argmax(reached)])}")
        continue
    turned = plan_turns(name, latitude=LATITUDE, turns=2, still_duration=600.0)
    sigma_deg = np.degrees(turned.sigma[:, 0])  # half turns
    best = int(np.argmin(sigma_deg))
    if sigma_deg[best] <= GOAL_DEG:
        number = int(np.argmax(sigma_deg <= GOAL_DEG))
        print(f"{name:12s} {number} half turn(s) within 10 min of standing still")
    else:
        print(
            f"{name:12s} not within an hour: {degrees(planned.sigma[-1]):.1f} deg in one pose, "
            f"{sigma_deg[best]:.1f} deg with {best} half turns in 10 min"
        )
