"""The Cramer-Rao floor that stands below a study's table of heading errors, from the study's own constants."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from gyronorth.published import LATITUDE
from gyronorth.sensor import Sensor, TriadErrors
from gyronorth.studies.methods import WINDOW
from gyronorth.studies.study import StudyPlan
from gyronorth.studies.tables import Table
from gyronorth.uncertainty import cramer_rao_floor


def floor_deg(errors: TriadErrors, duration: float, *, latitude: float = LATITUDE) -> float:
    """Floor of one still pose of `duration` s, deg."""
    return float(np.degrees(cramer_rao_floor(Sensor("simulated", errors), latitude=latitude, duration=duration)))


def at_window(plan: StudyPlan, _table: Table) -> str:
    """The line below a table of windows of `WINDOW` s."""
    return _of_white_noise(plan, [WINDOW])


def at_durations(plan: StudyPlan, table: Table) -> str:
    """The line below a table whose rows begin with their duration, s."""
    return _of_white_noise(plan, [row[0] for row in table.rows])


def _of_white_noise(plan: StudyPlan, durations: Iterable[float]) -> str:
    noise = TriadErrors(white=plan.recordings().arw)
    values = (f"{floor_deg(noise, duration):.3f} deg at {duration:g} s" for duration in durations)
    return f"Floor (Cramér-Rao, white noise alone): {', '.join(values)}."
