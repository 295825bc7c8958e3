"""`benchmark paper`: networks at their best, as ensembles and beside the closed form, against `learned + deviation`."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gyronorth.angles import angle_error, circular_mean
from gyronorth.evaluation import bootstrap_ratio
from gyronorth.published import model_based
from gyronorth.studies.floors import at_window
from gyronorth.studies.methods import LEARNED, MODEL_BASED, WINDOW, rounded
from gyronorth.studies.network_tables import DIVERGED, LOST_DEG, Pooled
from gyronorth.studies.networks import OWN_NETWORK, digest, heading_settings, merged, split_data, split_json, splits_of
from gyronorth.studies.paper_augmentation import HOW, LIMIT, limit_of_splits
from gyronorth.studies.paper_table_2 import without_network
from gyronorth.studies.published_splits import split_units
from gyronorth.studies.source import recordings_of
from gyronorth.studies.study import Selection, Study, StudyPlan
from gyronorth.studies.tables import StudyReport, Table, verdict
from gyronorth.studies.work import Job, Result

#: Networks of an ensemble: other first weights, order, dropout and redrawn noise.
MEMBERS = 3
#: Splits at most: each trains the members twice.
SPLITS = 6
#: Epochs of each training, the decay of the rate fitted to them.
EPOCHS = 60
#: Rows: whether the network is asked for what the closed form leaves, and what is made of its members.
NETWORKS = {
    "network, (cos, sin) output, noise redrawn": False,
    "the same, asked for the error of the closed form": True,
}
ENSEMBLE = f"mean of {MEMBERS}"


def best_unit(
    *,
    settings: dict,
    split: dict,
    residual: bool,
    seed: int,
    data: dict | None = None,
    selection: Selection = "validation",
) -> Result:
    """Train the members of an ensemble on one split; the error of each on the tests, deg."""
    from gyronorth.alignment.networks.runtime import decode
    from gyronorth.learn.batched import residuals, train_batched
    from gyronorth.learn.settings import Settings
    from gyronorth.learn.stages import heading_parts

    own = [Settings.model_validate({**settings, "seed": settings["seed"] + k}) for k in range(MEMBERS)]
    parts = split_data(split, recordings_of(seed, data), own[0], leak=selection == "leak")
    prepared = [heading_parts(one, parts, None) for one in own]
    test = parts.test
    assert test is not None
    closed_form = angle_error(model_based(test.gyro_l), test.heading)
    trained = train_batched(own, [residuals(one) for one in prepared] if residual else prepared)
    kept = trained.chosen["validation" if selection == "leak" else selection]
    wanted = -closed_form if residual else test.heading
    heading = [decode(raw.double().numpy(), own[0].heading.output) for raw in kept.test]
    return {
        "recording": test.recording.tolist(),
        "model_based_deg": rounded(closed_form),
        "epoch": kept.epoch.tolist(),
        "error_deg": [rounded(angle_error(one, wanted)) for one in heading],
    }


def _splits(plan: StudyPlan) -> int:
    return min(plan.network_splits, SPLITS)


def jobs_of(plan: StudyPlan) -> dict[str, list[Job]]:
    """A unit for each split."""
    jobs: dict[str, list[Job]] = {}
    variant = merged(OWN_NETWORK, {"heading": {"epochs": EPOCHS}})
    for label, residual in NETWORKS.items():
        for i, split in enumerate(splits_of(plan, _splits(plan))):
            settings = heading_settings(variant, plan, seed=plan.seed + MEMBERS * i)
            arguments = {"settings": settings, "split": split_json(split), "residual": residual, **plan.source()}
            if plan.selection != "validation":
                arguments["selection"] = plan.selection
            jobs.setdefault(label, []).append(Job(f"best/{digest(arguments)}", best_unit, arguments))
    return jobs


def _units(plan: StudyPlan) -> list[Job]:
    others = split_units(plan)[: _splits(plan)]
    return [*others, *(job for jobs in jobs_of(plan).values() for job in jobs)]


def _single(found: list[Result]) -> Pooled:
    """Every member by itself."""
    return Pooled(
        [np.radians(error) for one in found for error in one["error_deg"]],
        [np.radians(one["model_based_deg"]) for one in found for _ in one["error_deg"]],
        np.concatenate([one["recording"] for one in found for _ in one["error_deg"]]),
    )


def _together(found: list[Result]) -> Pooled:
    """The mean direction of the members: its error is that of their errors."""
    return Pooled(
        [circular_mean(np.radians(one["error_deg"]), axis=0) for one in found],
        [np.radians(one["model_based_deg"]) for one in found],
        np.concatenate([one["recording"] for one in found]),
    )


def _report(plan: StudyPlan, results: Mapping[str, Result]) -> StudyReport:
    others = [results[unit.name] for unit in split_units(plan)[: _splits(plan)]]
    found = {MODEL_BASED: without_network(others, MODEL_BASED)}
    for label, jobs in jobs_of(plan).items():
        mine = [results[job.name] for job in jobs]
        found |= {label: _single(mine), f"{label}, {ENSEMBLE}": _together(mine)}
    found[LEARNED] = without_network(others, LEARNED)
    found[LIMIT] = limit_of_splits(plan, splits_of(plan, _splits(plan)))[0]
    rows = [(label, *_row(label, one, found[LEARNED], plan.seed)) for label, one in found.items()]
    columns = (
        "method",
        "CRMSE, deg",
        "ratio to model-based",
        f"ratio to {LEARNED}",
        "tests lost",
        "CRMSE of tests not lost, deg",
        "splits won",
        f"errs no more than {LEARNED}",
    )
    note = (
        f"{_splits(plan)} random 24/4/6 splits, windows of {WINDOW:g} s, within set; intervals are over "
        f"recordings. A row without *mean* is its {MEMBERS} networks one by one, each trained for {EPOCHS} epochs. "
        f"Lost: in error by more than {LOST_DEG:g} deg."
    )
    text = (
        "What lifts most networks: the mean of several, and a physical model that leaves the network the rest alone. "
        "The network is the paper's without what does not help: (cos, sin) output, noise redrawn, no denoiser. Asked "
        "for the error of the closed form, it need not learn to find north, but the deviation alone, which is all "
        f"that *{LEARNED}* learns. {HOW}"
    )
    return StudyReport(text, (Table("Networks at their best", columns, tuple(rows), note),))


def _row(label: str, one: Pooled, learned: Pooled, seed: int) -> tuple:
    if not one.finite:
        return (DIVERGED, *[None] * 6)
    own, network = label == MODEL_BASED, label.startswith(tuple(NETWORKS))
    each = len(one.error) // len(learned.error)
    other = np.concatenate([error for error in learned.error for _ in range(each)])
    rng = np.random.default_rng(seed)
    to_learned = None if label == LEARNED else bootstrap_ratio(np.concatenate(one.error), other, one.recording, rng=rng)
    reaches = verdict(to_learned, high=1.0) if network and to_learned is not None else None
    figures = (one.crmse(seed), None if own else one.ratio(seed), to_learned, one.lost(), one.kept())
    return (*figures, None if own else one.wins(), reaches)


BEST = Study("best", "Networks at their best", "paper", _units, _report, at_window)
