"""Findings and checks as JSON."""

from __future__ import annotations

import json
from math import inf, nan

import pytest

from gyronorth.findings import Check, Finding


@pytest.mark.parametrize("number", [inf, -inf, nan])
def test_a_number_that_json_cannot_hold_is_null(number):
    finding = Finding("gaps", "m", number, number).to_json()
    check = Check("gaps", "t", number, number, "deg", "f", False).to_json()
    json.dumps([finding, check], allow_nan=False)
    assert finding["value"] is finding["limit"] is check["value"] is check["limit"] is None
