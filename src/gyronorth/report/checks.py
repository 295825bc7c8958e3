"""The checks of a heading as text: value against limit, and the formula of both."""

from __future__ import annotations

import textwrap
from math import isfinite
from typing import TYPE_CHECKING, TextIO

from gyronorth.report.wording import fixed_text, verdict_text

if TYPE_CHECKING:
    from gyronorth.estimate import HeadingEstimate
    from gyronorth.findings import Check

#: Decimals of a value and its limit, by unit.
DECIMALS = {"s": 1, "g": 4}
#: Width of the explanation, columns.
WIDTH = 100


def value_text(check: Check) -> str:
    """What was measured, with its unit."""
    return _in_words(check.value, check)


def limit_text(check: Check) -> str:
    """What it was held against: a least length, else a largest value; no angle is beyond half a turn."""
    if check.unit == "deg" and check.limit > 180:
        return "none"
    return ("≥ " if check.unit == "s" else "≤ ") + _in_words(check.limit, check)


def share(check: Check) -> float:
    """How much of its limit a value uses: above 1 the check fails. A least length counts the other way round."""
    if not (isfinite(check.value) and isfinite(check.limit)):
        return 0.0 if check.passed else 2.0
    used, allowed = (check.limit, check.value) if check.unit == "s" else (check.value, check.limit)
    return used / allowed if allowed > 0 else 2.0


def print_checks(estimate: HeadingEstimate, stream: TextIO) -> None:
    """Print the verdict, every check, and the reasons that no check stands for."""
    doc = estimate.to_json()
    stream.write(f"{verdict_text(doc)}; method {estimate.method} ({estimate.method_reason})\n")
    for check in estimate.checks:
        stream.write(f"\n{'passed' if check.passed else 'FAILED'}  {check.title}  ({check.code})\n")
        stream.write(f"        value {value_text(check)}, limit {limit_text(check)}\n")
        stream.write(textwrap.fill(check.formula, WIDTH, initial_indent=" " * 8, subsequent_indent=" " * 8) + "\n")
    told = {check.code for check in estimate.checks if not check.passed}
    for finding in estimate.reasons:
        if finding.code not in told:
            stream.write(f"\nFAILED  {finding.code}\n")
            stream.write(
                textwrap.fill(finding.message, WIDTH, initial_indent=" " * 8, subsequent_indent=" " * 8) + "\n"
            )
    if not estimate.checks and not estimate.reasons:
        stream.write("\nThe method checks its own result: no gate applies.\n")


def _in_words(value: float, check: Check) -> str:
    """With the decimals of its unit, or as many more as tell a failed value from its limit."""
    if not isfinite(value):
        return "no finite value"
    decimals = DECIMALS.get(check.unit, 2) if abs(value) < 10_000 else 0
    while not check.passed and decimals < 9 and round(check.value, decimals) == round(check.limit, decimals):
        decimals += 1
    return f"{fixed_text(value, decimals=decimals)} {check.unit}"
