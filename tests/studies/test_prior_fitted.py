"""The study of the prior-fitted network: its units, what it judges, and what its tables say."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

pytest.importorskip("torch", reason="PyTorch comes with the extra train")

from gyronorth.deviation import PRIORS
from gyronorth.studies import paper_prior_fitted as study
from gyronorth.studies.methods import LEARNED, MODEL_BASED, judge_split
from gyronorth.studies.published_splits import arc_units, loo_units, split_units
from gyronorth.studies.study import StudyPlan
from gyronorth.studies.work import with_needs

PLAN = StudyPlan(splits=2, epochs=1)


@pytest.fixture
def small(monkeypatch):
    for name, prior in PRIORS.items():
        monkeypatch.setitem(PRIORS, name, replace(prior, log2_draws=2))
    monkeypatch.setattr(study, "loo_units", lambda plan: loo_units(plan)[1:3])
    monkeypatch.setattr(study, "arc_units", lambda plan: [u for u in arc_units(plan) if u.name.startswith("arcs5")][:1])
    monkeypatch.setattr(study, "split_units", lambda plan: split_units(plan)[:1])
    monkeypatch.setattr(study, "ARCS", (5,))
    monkeypatch.setattr(study, "SIZES", (6,))
    monkeypatch.setattr(study, "SWINGS", 2)
    monkeypatch.setattr(study, "STEPS", 4)


def results(plan):
    """Every unit in turn, as its file would give it."""
    found = {}
    for unit in with_needs(study.PRIOR_FITTED.units(plan)):
        result = unit.function(*(found[need.name] for need in unit.needs), **unit.arguments)
        found[unit.name] = json.loads(json.dumps(result, allow_nan=False))
    return found


@pytest.mark.slow
def test_the_same_recordings_are_known_and_tested_as_in_the_study_of_the_published(small):
    """The closed form and `learned` give what `benchmark published` has, to the last digit."""
    found = results(PLAN)
    report = study.PRIOR_FITTED.report(PLAN, found)
    jobs = study.jobs_of(PLAN)
    unit = loo_units(PLAN)[2]
    expected = judge_split(**unit.arguments)
    mine = found[jobs["One recording left out"].name]["folds"][1]
    for length in ("whole", "windows"):
        for method in (MODEL_BASED, study.GP, LEARNED):
            assert mine[length]["error_deg"][method] == expected[length]["error_deg"][method]
            assert mine[length]["sigma_deg"][method] == expected[length]["sigma_deg"][method]
    whole, windows, simulated = report.tables
    assert [row[:2] for row in whole.rows[:4]] == [("One recording left out", name) for name in study.METHODS]
    assert len(whole.rows) == len(windows.rows) == 12
    assert [row[0] for row in simulated.rows] == ["Simulated swings of 6 headings"] * 4
    size = simulated.rows[0][2].value
    assert 1 < size < 12  # deg: that of the recordings is 4
    for row in whole.rows:
        assert (row[-1] is not None) == (row[1] == study.NETWORK)
    text = "\n".join(study.PRIOR_FITTED.markdown(table, PLAN) for table in report.tables)
    assert text.count("Floor") == 3


def test_the_training_is_units_that_go_on_from_each_other():
    last = study.training_of(StudyPlan())
    steps, names = [], []
    while last is not None:
        steps.append(last.arguments["step"])
        names.append(last.name)
        last = last.needs[0] if last.needs else None
    assert steps == [2400, 1800, 1200, 600]
    assert len(set(names)) == study.STAGES
