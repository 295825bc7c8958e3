"""Checks in words: decimals go by the unit, and a failed value is never printed as its limit."""

import pytest

from gyronorth.findings import Check
from gyronorth.report.checks import limit_text, value_text


def check(value, limit, unit="deg", passed=True):
    return Check("motion", "rotation", value, limit, unit, "", passed)


@pytest.mark.parametrize(
    ("found", "value", "limit"),
    [
        (check(0.0071, 5), "0.01 deg", "≤ 5.00 deg"),
        (check(0.00065, 0.1, "g"), "0.0006 g", "≤ 0.1000 g"),
        (check(100, 2, "s"), "100.0 s", "≥ 2.0 s"),
        (check(5.0001, 5, passed=False), "5.0001 deg", "≤ 5.0000 deg"),
        (check(0.22, 30134.29, "deg/h"), "0.22 deg/h", "≤ 30134 deg/h"),
        (check(2.3, 72524.06), "2.30 deg", "none"),
        (check(float("nan"), 5, passed=False), "no finite value", "≤ 5.00 deg"),
    ],
)
def test_words(found, value, limit):
    assert value_text(found) == value
    assert limit_text(found) == limit
