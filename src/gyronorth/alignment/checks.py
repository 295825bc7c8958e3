"""The gates as a list to read: what each compares, by which formula, and how near it came to its limit."""

from __future__ import annotations

from collections.abc import Sequence

from gyronorth.alignment.gates import FEWEST_SAMPLES, SHORTEST, Gate
from gyronorth.conditioning import GATE_SIGMA
from gyronorth.findings import Check

#: Gates that say why one interval is too wide: they share its width and its limit.
_WIDTH = ("too_short", "near_pole", "too_noisy")
#: Code -> what is compared, unit, formula. Symbols are those of docs/theory/uncertainty.md, section "Validity".
_SHOWN = {
    "rate_norm": (
        "mean rate against Earth rate",
        "deg/h",
        "| |w| - 15.041 deg/h |; limit {gate} sqrt(cos^2(lat) var_horizontal + sin^2(lat) var_vertical) with a "
        "profile, 15.041 cos(lat) without one",
    ),
    "implied_latitude": (
        "implied latitude against the given one",
        "deg",
        "| asin(-w_down / |w|) - lat |; limit {gate} sqrt(sin^2(lat) var_horizontal + cos^2(lat) var_vertical) / "
        "15.041 deg/h with a profile, 57.3 cos(lat) without one",
    ),
    "too_noisy": (
        "half-width of the 95 % interval",
        "deg",
        "of the von Mises law with concentration |w_horizontal| 15.041 cos(lat) / var_horizontal, or of the method's "
        "posterior; beyond 90 deg north and south look alike",
    ),
    "motion": (
        "rotation about the mean attitude",
        "deg",
        "largest excursion of the integrated rate; limit of mean sqrt(sigma), sigma taken as 0.5 to 5.7 deg; of "
        "inertial 45 deg; of bayes and learned what sigma allows, at least 0.25 deg",
    ),
    "gravity": (
        "mean specific force against 1 g",
        "g",
        "of the norm of its mean; limit 0.1",
    ),
    "gimbal": (
        "pitch",
        "deg",
        "of the forward axis; limit 89 deg, or arccos(10 sigma of the direction of gravity) where that is less",
    ),
    "saturated": (
        "largest specific force",
        "g",
        "largest |component| of a sample; limit 0.999 of the sensor's range",
    ),
}


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
        if gate.code in _SHOWN:
            title, unit, formula = _SHOWN[gate.code]
            failed = width if gate.code in _WIDTH else gate.code if gate.failed else None
            value, limit = float(gate.value), float(gate.limit)
            text = formula.format(gate=GATE_SIGMA)
            if gate.code == "saturated" and gate.message.startswith("The gyro"):
                title, unit = "largest angular rate", "deg/s"
            found.append(Check(failed or gate.code, title, value, limit, unit, text, failed is None))
    return tuple(found)
