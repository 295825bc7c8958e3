"""How long the unit must still stand, or be turned and stand, for the sigma that is wanted, by its profile."""

from __future__ import annotations

from functools import cache
from math import degrees
from threading import Thread

import numpy as np

from gyronorth.alignment.turned.bound import turned_sigma
from gyronorth.arrays import Array
from gyronorth.live.status import Status
from gyronorth.planning import Plan, plan
from gyronorth.report.wording import duration_text
from gyronorth.sensor import Sensor

#: Turned by so much, rad, in so long, s.
TURN, TURN_TIME = float(np.pi), 10.0
#: Times of standing still in all, s, at which the sigma of one turn is asked for; it is smooth between them.
STANDING = np.geomspace(10, 10_000, 7)
#: To stand longer than this, s, after a turn is not worth telling.
LONGEST = 3600.0


class Countdown:
    """Words for the page; empty without a profile or a sigma that is required."""

    def __init__(self, sensor: Sensor | None, wanted: float | None) -> None:
        self._sensor, self._wanted = sensor, wanted
        self._plan: Plan | None = None
        self._turned: Array | None = None  # (k,) rad, sigma of one turn after `STANDING`

    def text(self, status: Status) -> str:
        """Such as "±2° in 4 min of standing still; in 90 s if you turn it by 180° now."; empty where it will do."""
        estimate = status.measured
        if self._sensor is None or self._wanted is None or estimate is None or status.state != "running":
            return ""
        if status.fitness not in ("aligning", "degraded") or not estimate.poses:
            return ""
        if self._plan is None or self._plan.latitude != estimate.latitude:
            self._plan, self._turned = plan(self._sensor, latitude=estimate.latitude), None
            Thread(target=self._ask, args=(self._plan,), name="plan", daemon=True).start()
        wanted = f"±{degrees(self._wanted):.3g}°"
        stood = estimate.poses[-1].end - estimate.poses[-1].start
        after = self._after_a_turn(stood) if len(estimate.poses) == 1 else None
        turn = None if after is None else f"in {duration_text(float(round(after)))} if you turn it by 180° now"
        enough = np.flatnonzero(self._plan.sigma <= self._wanted)
        if len(enough) == 0:
            return f"{wanted} is not reached by standing still; {turn or 'turn the unit by 180°'}."
        left = float(self._plan.duration[enough[0]]) - stood
        if left <= 0:
            return f"{wanted} was planned by now: is it quite still? A turn by 180° helps."
        still = f"{wanted} in {duration_text(float(round(left)))} of standing still"
        return f"{still}; {turn}." if after is not None and after < left else f"{still}."

    def _ask(self, asked: Plan) -> None:
        """The sigma of one turn, which takes a second to work out."""
        assert self._sensor is not None
        found = _turned(self._sensor, asked.latitude)
        if self._plan is asked:
            self._turned = found

    def _after_a_turn(self, stood: float) -> float | None:
        """Time to turn, and to stand after it, s, where the unit has stood for `stood`; None: not soon, or not known.

        Poses of s and r seconds tell as much of a white noise as two equal ones of 4 / (1 / s + 1 / r) in all.
        """
        if self._turned is None or self._wanted is None or stood <= 0 or self._turned[-1] > self._wanted:
            return None
        in_all = float(np.exp(np.interp(np.log(self._wanted), np.log(self._turned[::-1]), np.log(STANDING[::-1]))))
        share = 4 / in_all - 1 / stood
        return TURN_TIME + 1 / share if share > 1 / LONGEST else None


@cache
def _turned(sensor: Sensor, latitude: float) -> Array:
    """Sigma of two poses with half a turn between them, rad, for each of `STANDING`."""
    sigma = [
        turned_sigma(sensor, latitude=latitude, turns=(TURN,), still_duration=time, turn_duration=TURN_TIME)
        for time in STANDING.tolist()
    ]
    return np.minimum.accumulate(sigma)
