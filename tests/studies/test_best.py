"""Networks at their best: what they are asked for, and what is made of their members."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

torch = pytest.importorskip("torch", reason="PyTorch comes with the extra train")

from gyronorth.deviation import PRIORS  # noqa: E402
from gyronorth.learn.batched import residuals  # noqa: E402
from gyronorth.learn.settings import Settings  # noqa: E402
from gyronorth.learn.stages import heading_parts  # noqa: E402
from gyronorth.published import model_based  # noqa: E402
from gyronorth.studies import paper_best  # noqa: E402
from gyronorth.studies.methods import LEARNED, MODEL_BASED  # noqa: E402
from gyronorth.studies.networks import OWN_NETWORK, merged, split_data, split_json, splits_of  # noqa: E402
from gyronorth.studies.paper_augmentation import LIMIT  # noqa: E402
from gyronorth.studies.study import StudyPlan  # noqa: E402

PLAN = StudyPlan(network_splits=2, splits=2, epochs=2)
SMALL = {"heading": {"hidden": 3, "layers": 1, "augment": {"copies": 3}}}


def test_what_the_closed_form_leaves_is_the_same_for_every_copy_of_a_recording():
    """A copy turns the recording and its heading alike; what is left is truth less closed form of the recording."""
    settings = Settings.model_validate(merged(OWN_NETWORK, SMALL))
    split = split_json(splits_of(PLAN, 1)[0])
    data = split_data(split, PLAN.recordings(), settings)
    left = residuals(heading_parts(settings, data, None))
    expected = np.degrees(data.train.heading - model_based(data.train.gyro_l)) % 360
    off = np.radians(left.headings[0].reshape(24, 3).numpy() - expected[:, None])
    assert_allclose(np.abs(np.exp(1j * off) - 1), 0, atol=1e-4)
    assert [len(one) for one in left.headings[1:]] == [4, 6]


@pytest.mark.slow
def test_the_table_is_of_single_networks_and_of_their_means(monkeypatch):
    """The mean of the members is less in error than they are on the average (the square is convex)."""
    monkeypatch.setattr(paper_best, "OWN_NETWORK", merged(OWN_NETWORK, SMALL))
    monkeypatch.setattr(paper_best, "MEMBERS", 3)
    for name, prior in PRIORS.items():
        monkeypatch.setitem(PRIORS, name, replace(prior, log2_draws=2))
    results = {}
    for unit in paper_best.BEST.units(PLAN):
        results[unit.name] = json.loads(json.dumps(unit.function(**unit.arguments), allow_nan=False))
    (table,) = paper_best.BEST.report(PLAN, results).tables
    rows = {row[0]: row for row in table.rows}
    assert [row[0] for row in table.rows][-2:] == [LEARNED, LIMIT]
    single, mean = list(paper_best.NETWORKS)[1], f"{list(paper_best.NETWORKS)[1]}, {paper_best.ENSEMBLE}"
    assert rows[mean][1].value < rows[single][1].value
    assert rows[single][3].value == pytest.approx(rows[single][1].value / rows[LEARNED][1].value)
    assert rows[MODEL_BASED][2] is None
    assert [row[-1] is None for row in table.rows] == [True, False, False, False, False, True, True]


def test_a_network_that_says_nothing_beside_the_closed_form_has_its_error(monkeypatch):
    """No training at all, output (1, 0): the residual is zero."""
    from gyronorth.learn import batched

    def untrained(settings, parts):
        count = len(parts[0].headings[2])
        straight = torch.tensor([1.0, 0.0]).expand(len(settings), count, 2)
        none = torch.ones(len(settings), dtype=torch.int64)
        return batched.BatchedTraining(chosen={"validation": batched.Choice(none.float(), none, straight)})

    monkeypatch.setattr(batched, "train_batched", untrained)
    unit = list(paper_best.jobs_of(PLAN).values())[1][0]
    found = unit.function(**unit.arguments)
    for error in found["error_deg"]:
        assert_allclose(error, found["model_based_deg"], atol=1e-5)


@pytest.mark.parametrize("selection", ["test", "last", "leak"])
def test_another_choice_of_the_epoch_is_another_unit(monkeypatch, selection):
    monkeypatch.setattr(paper_best, "OWN_NETWORK", merged(OWN_NETWORK, SMALL))
    plan = StudyPlan(network_splits=1, epochs=2, selection=selection)
    plans = (plan, StudyPlan(network_splits=1, epochs=2))
    unit, honest = (next(iter(paper_best.jobs_of(one).values()))[0] for one in plans)
    assert unit.name != honest.name
    epochs = unit.function(**unit.arguments)["epoch"]
    assert epochs == [2] * paper_best.MEMBERS if selection == "last" else set(epochs) <= {1, 2}
