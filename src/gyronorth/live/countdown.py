"""How long the unit must still stand for the sigma that is wanted, by the plan of its profile."""

from __future__ import annotations

from math import degrees

import numpy as np

from gyronorth.live.status import Status
from gyronorth.planning import Plan, plan
from gyronorth.report.wording import duration_text
from gyronorth.sensor import Sensor


class Countdown:
    """Words for the page; empty without a profile or a sigma that is required."""

    def __init__(self, sensor: Sensor | None, wanted: float | None) -> None:
        self._sensor, self._wanted = sensor, wanted
        self._plan: Plan | None = None

    def text(self, status: Status) -> str:
        """Such as "±1° in 4 min of standing still.", while the heading is not good enough."""
        estimate = status.measured
        if self._sensor is None or self._wanted is None or estimate is None or status.state != "running":
            return ""
        if status.fitness not in ("aligning", "degraded") or not estimate.poses:
            return ""
        if self._plan is None or self._plan.latitude != estimate.latitude:
            self._plan = plan(self._sensor, latitude=estimate.latitude)
        wanted = f"±{degrees(self._wanted):.3g}°"
        enough = np.flatnonzero(self._plan.sigma <= self._wanted)
        if len(enough) == 0:
            return f"{wanted} is not reached by standing still: turn the unit by 180°."
        stood = estimate.poses[-1].end - estimate.poses[-1].start
        left = float(self._plan.duration[enough[0]]) - stood
        if left <= 0:
            return f"{wanted} was planned by now: is it quite still? A turn by 180° helps."
        return f"{wanted} in {duration_text(float(round(left)))} of standing still, sooner if you turn it by 180° now."
