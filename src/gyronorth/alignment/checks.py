"""The gates as a list to read: what each compares, by which formula, and how near it came to its limit."""

from __future__ import annotations

from collections.abc import Sequence

from gyronorth.alignment.gates import FEWEST_SAMPLES, SHORTEST, Gate
from gyronorth.findings import Check

#: Gates that say why one interval is too wide: they share its width and its limit.
_WIDTH = ("too_short", "near_pole", "too_noisy")


def checks_of(gates: Sequence[Gate], *, samples: int, duration: float) -> tuple[Check, ...]:
    """Every gate that checked one recording, in the order of the gates, the length first.

    Parameters
    ----------
    gates : sequence of Gate
        Of one recording; none if there is no heading to judge.
    samples : int
        Length of the recording.
    duration : float
        The same, s.
    """
    if not gates:
        return ()
    shortest = max(SHORTEST, FEWEST_SAMPLES * duration / samples)
    found = [
        Check(
            "too_short",
            "length",
            duration,
            shortest,
            "s",
            f"{SHORTEST:g} s and {FEWEST_SAMPLES} samples, from which a noise level can be read",
            duration >= shortest,
        )
    ]
    # Of the gates on the width at most one failed; its code is the check's.
    width = next((gate.code for gate in gates if gate.code in _WIDTH and gate.failed), None)
    for gate in gates:
        if gate.shown is not None:
            failed = width if gate.code in _WIDTH else gate.code if gate.failed else None
            shown, value, limit = gate.shown, float(gate.value), float(gate.limit)
            found.append(
                Check(failed or gate.code, shown.title, value, limit, shown.unit, shown.formula, failed is None)
            )
    return tuple(found)
