"""`benchmark published`: the methods without a network on three kinds of split of the recordings."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from gyronorth.angles import cyclic_rmse
from gyronorth.evaluation import (
    Split,
    bootstrap_crmse,
    bootstrap_ratio,
    coverage,
    leave_arcs_out,
    leave_one_out,
    share_of_wins,
)
from gyronorth.published import LONGEST_PRINTED, fit_noise
from gyronorth.studies.floors import at_durations
from gyronorth.studies.methods import METHODS, MODEL_BASED, WINDOW, as_rad, floor, judge_split
from gyronorth.studies.source import recordings_of
from gyronorth.studies.study import Study, StudyPlan
from gyronorth.studies.tables import StudyReport, Table, degrees
from gyronorth.studies.work import Job, Result

#: Headings next to each other that are left out.
ARCS = (3, 5, 8)


def _within(plan: StudyPlan) -> str:
    ours = (
        "The set looks selected (one error of 60 below 2 deg), and the structure of the model itself was developed on "
        "these 60 recordings. "
    )
    return (
        "Within set: known and tested recordings are of one unit, in which the error may be smooth in heading. "
        f"{ours if plan.data is None else ''}Every setting is chosen inside the fold. "
        "Intervals are over recordings (paired bootstrap); a ratio below 1 is better than model-based."
    )


def _units(splits: list[Split], name: str, plan: StudyPlan) -> list[Job]:
    source = plan.source()
    return [
        Job(
            f"{name}/{i:03d}",
            judge_split,
            {
                "train": split.train.tolist(),
                "validation": split.validation.tolist(),
                "test": split.test.tolist(),
                **source,
            },
        )
        for i, split in enumerate(splits)
    ]


def loo_units(plan: StudyPlan) -> list[Job]:
    """Each recording tested once."""
    return _units(leave_one_out(len(plan.recordings().heading_true)), "loo", plan)


def arc_units(plan: StudyPlan) -> list[Job]:
    """Each arc of each size."""
    heading = plan.recordings().heading_true
    return [unit for arc in ARCS for unit in _units(leave_arcs_out(heading, arc), f"arcs{arc}", plan)]


def split_units(plan: StudyPlan) -> list[Job]:
    """Random 24/4/6 splits; the methods without a network learn from training and validation together."""
    return _units(plan.splits_of(plan.splits), "splits", plan)


def table_of(title: str, results: list[Result], length: str, plan: StudyPlan) -> Table:
    """One row a method: pooled CRMSE, ratio to model-based, coverage, share of splits won."""
    parts = [result[length] for result in results]
    recording = np.concatenate([part["recording"] for part in parts])
    rows = []
    for method in METHODS:
        errors = [as_rad(part["error_deg"][method]) for part in parts]
        references = [as_rad(part["error_deg"][MODEL_BASED]) for part in parts]
        error, reference = np.concatenate(errors), np.concatenate(references)
        sigma = np.concatenate([as_rad(part["sigma_deg"][method]) for part in parts])
        own = method == MODEL_BASED
        rows.append(
            (
                method,
                degrees(bootstrap_crmse(error, recording, rng=np.random.default_rng(plan.seed))),
                None if own else bootstrap_ratio(error, reference, recording, rng=np.random.default_rng(plan.seed)),
                coverage(error, sigma, recording, rng=np.random.default_rng(plan.seed)),
                None if own else share_of_wins(errors, references),
            )
        )
    recordings = plan.recordings()
    bound = floor(recordings, WINDOW if length == "windows" else recordings.duration)
    note = (
        f"{len(recording)} tests of {len(np.unique(recording))} recordings in {len(parts)} folds. "
        f"Cramer-Rao floor for a bias that cannot be learnt: {np.degrees(bound):.2f} deg; what lies below has used "
        "the structure of this set's biases."
    )
    columns = ("method", "CRMSE, deg", "ratio to model-based", "95 % interval holds", "folds won")
    return Table(title, columns, tuple(rows), note)


def _report(name: str, label: str) -> Callable[[StudyPlan, Mapping[str, Result]], StudyReport]:
    def report(plan: StudyPlan, results: Mapping[str, Result]) -> StudyReport:
        mine = [results[key] for key in sorted(results) if key.startswith(f"{name}/")]
        tables = (
            table_of(f"{label}, whole recordings", mine, "whole", plan),
            table_of(f"{label}, windows of {WINDOW:g} s", mine, "windows", plan),
        )
        return StudyReport(_within(plan), tables)

    return report


def _arc_report(plan: StudyPlan, results: Mapping[str, Result]) -> StudyReport:
    tables = []
    for arc in ARCS:
        mine = [results[key] for key in sorted(results) if key.startswith(f"arcs{arc}/")]
        tables.append(table_of(f"Arcs of {arc} headings left out, whole recordings", mine, "whole", plan))
        tables.append(table_of(f"Arcs of {arc} headings left out, windows of {WINDOW:g} s", mine, "windows", plan))
    count = len(plan.recordings().heading_true)
    text = f"{_within(plan)} Each of the {count} possible arcs is left out once: every recording is tested at every "
    text += "place in it."
    return StudyReport(text, tuple(tables))


def _split_report(plan: StudyPlan, results: Mapping[str, Result]) -> StudyReport:
    report = _report("splits", f"{plan.splits} random 24/4/6 splits")(plan, results)
    mine = [results[key]["whole"]["error_deg"] for key in sorted(results) if key.startswith("splits/")]
    rows = []
    for method in METHODS[1:]:
        gains = [1 - cyclic_rmse(as_rad(e[method])) / cyclic_rmse(as_rad(e[MODEL_BASED])) for e in mine]
        low, middle, high = np.quantile(gains, [0.025, 0.5, 0.975]) * 100
        rows.append((method, float(low), float(middle), float(high)))
    table = Table(
        "What one split of 6 test recordings can show: improvement in percent",
        ("method", "2.5 % of splits below", "median", "2.5 % of splits above"),
        tuple(rows),
        "One split of 6 recordings proves nothing.",
    )
    return StudyReport(report.text, (*report.tables, table))


def _noise_units(plan: StudyPlan) -> list[Job]:
    durations = [10.0, 15.0, 20.0, 30.0, 45.0, 60.0, 100.0, 115.0, 230.0]
    if plan.data is not None:
        whole = plan.recordings().duration
        durations = [duration for duration in durations if duration < whole] + [whole]
    return [Job("noise/curve", noise_curve, {"durations": durations, **plan.source()})]


def noise_curve(*, durations: list[float], seed: int, data: dict | None = None) -> dict:
    """Model-based CRMSE of the recordings over windows of each duration, deg."""
    from gyronorth.published import duration_curve

    curve = duration_curve(recordings_of(seed, data), np.array(durations))
    return {"duration": durations, "crmse_deg": np.round(np.degrees(curve), 6).tolist()}


def _noise_report(plan: StudyPlan, results: Mapping[str, Result]) -> StudyReport:
    if plan.data is not None:
        return _noise_of_own(plan, results["noise/curve"])
    fit = fit_noise()
    rows = tuple(
        (float(d), float(np.degrees(p)), float(np.degrees(f)))
        for d, p, f in zip(fit.duration, fit.printed, fit.fitted, strict=True)
    )
    arw = float(np.degrees(fit.arw) * 60)
    curve = results["noise/curve"]
    twin_rows = tuple(zip(curve["duration"], curve["crmse_deg"], strict=True))
    printed = Table(
        "Printed growth of the model-based CRMSE and the fit",
        ("duration, s", "printed, deg", "fitted, deg"),
        rows,
        f"Angle random walk {arw:.4f} deg/sqrt(h), {arw / 0.02:.1f} times the data sheet's 0.02. "
        f"Counted from the printed figure at {LONGEST_PRINTED:g} s; of another set than the 60 recordings.",
    )
    twin = Table("The reconstruction itself", ("window, s", "model-based CRMSE, deg"), twin_rows)
    text = (
        "The biases of the reconstruction are real (the printed mean rates), its noise is simulated: white, of the "
        "angle random walk that explains how the printed CRMSE grows from 240 s down to 10 s, with the mean over 230 s "
        "held at the printed one."
    )
    on_paper = {"duration": fit.duration.tolist(), "crmse_deg": np.degrees(fit.printed).tolist()}
    return StudyReport(text, (printed, twin), {"printed": on_paper, "twin": curve})


def _noise_of_own(plan: StudyPlan, curve: Result) -> StudyReport:
    """The same of a user's recordings: nothing printed stands beside them."""
    recordings = plan.recordings()
    arw = float(np.degrees(recordings.arw) * 60)
    count = len(recordings.heading_true)
    table = Table(
        "Growth of the model-based CRMSE towards short windows",
        ("window, s", "model-based CRMSE, deg"),
        tuple(zip(curve["duration"], curve["crmse_deg"], strict=True)),
        f"{count} recordings of {recordings.duration:g} s. Angle random walk from first differences: {arw:.4f} "
        "deg/sqrt(h).",
    )
    return StudyReport("", (table,), {"recordings": curve}, title="The noise of the recordings")


NOISE = Study(
    "noise", "The noise of the published reconstruction", "published", _noise_units, _noise_report, at_durations
)
LOO = Study(
    "leave_one_out", "Leave one recording out (within set)", "published", loo_units, _report("loo", "Leave one out")
)
ARC = Study("arcs", "Contiguous arcs of headings left out (within set)", "published", arc_units, _arc_report)
SPLITS = Study("splits", "Random splits (within set)", "published", split_units, _split_report)
