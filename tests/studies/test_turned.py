"""`benchmark turned`: its cases against the plan and closed forms, its units and its table."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from gyronorth.planning import plan_turns
from gyronorth.studies import turned as study
from gyronorth.studies.study import StudyPlan


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "turns", "column", "expected_deg"),
    [
        ("2 x 180, flicker 1 deg/h", 1, 0, 2.2),
        ("4 x 90, flicker 1 deg/h", 3, 1, 1.9),
        ("10 x 180, flicker 1 deg/h", 9, 0, 1.2),
        ("2 x 180", 1, 0, 0.54),
    ],
)
def test_bound_of_a_case_is_what_the_plan_says(name, turns, column, expected_deg):
    case = study.CASES[name]
    planned = plan_turns(case.sensor(), latitude=np.radians(32.11), turns=turns).sigma[turns, column]
    assert_allclose(case.bound(), planned, rtol=1e-12)
    assert_allclose(np.degrees(planned), expected_deg, atol=0.06)


@pytest.mark.slow
def test_units_and_report(monkeypatch):
    small = replace(study.CASES["2 x 180"], runs=6)
    tilted = replace(small, roll_deg=10.0, latitude_deg=-45.0)
    monkeypatch.setattr(study, "CASES", {"2 x 180": small, "tilted": tilted})
    monkeypatch.setattr(study, "ROWS", 4)
    units = study.TURNED.units(StudyPlan())
    assert [unit.arguments["runs"] for unit in units] == [4, 2, 4, 2]
    results = {unit.name: unit.function(**unit.arguments) for unit in units}
    assert json.loads(json.dumps(results)) == results
    assert len({json.dumps(result) for result in results.values()}) == 4  # every unit draws its own recordings
    table = study.TURNED.report(StudyPlan(), results).tables[0]
    for row, name in zip(table.rows, ("2 x 180", "tilted"), strict=True):
        assert row[:2] == (name, 6)
        assert_allclose(row[2].value, row[3] * row[4].value)
        # Root mean square of 6 errors over the bound: chi-square of 6 degrees, one in 10,000 on either side.
        assert 0.2 < row[4].value < 2.2
    assert_allclose(table.rows[0][3], 0.54, atol=0.002)
    assert_allclose(table.rows[1][3], 0.6467, atol=0.002)
