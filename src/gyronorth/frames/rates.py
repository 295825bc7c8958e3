"""The rate of a stream that is told several times: by its clock, its configuration, the user, a table."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gyronorth.arrays import Array
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.findings import Finding
from gyronorth.frames.clock import NOMINAL_HZ

#: Where a rate comes from that is only usual for the unit.
USUAL = "usual for the unit"
#: Rates differ, where they are told twice, by more than this share.
RATE_CONFLICT = 0.02
#: Specific force is gravity within these, in g, as for files; a rate makes it gravity to this share.
GRAVITY_LOW, GRAVITY_HIGH, NEAR = 0.7, 1.4, 0.05
_ASSUMED = "The frames carry no time: their rate is taken as {:g} Hz, which is usual for the unit. Declare --rate HZ."


def findings_of_rates(known: Sequence[tuple[float, str]]) -> list[Finding]:
    """What there is to say where the first of these rates, Hz, each with where it is from, is taken.

    What is usual says nothing against a declaration, nor against a clock that agrees with one.
    """
    rate, source = known[0]
    if len(known) == 1:
        return [Finding("rate_assumed", _ASSUMED.format(rate), value=rate)] if source == USUAL else []
    findings = []
    declared = any(each == "declared" for _, each in known)
    for other, other_source in known[1:]:
        if not (declared and other_source == USUAL) and abs(other / rate - 1) > RATE_CONFLICT:
            message = f"The rate is {rate:g} Hz ({source}), but {other:g} Hz ({other_source}); {rate:g} Hz is taken."
            findings.append(Finding("rate_conflict", message, value=rate, limit=other))
    return findings


def rate_by_gravity(force: Array, rate_hz: float) -> float | None:
    """The usual rate, Hz, at which increments are gravity, where `rate_hz` makes something else of them.

    `force` (n, 3), m/s^2, is what they are at `rate_hz`. None where that is gravity, or no rate makes it so.
    """
    share = float(np.linalg.norm(np.median(force, axis=0))) / STANDARD_GRAVITY
    if GRAVITY_LOW <= share <= GRAVITY_HIGH:
        return None
    return next((float(rate) for rate in NOMINAL_HZ if abs(rate * share / rate_hz - 1) < NEAR), None)
