"""`benchmark paper`: what both stages of the training cost, by layout."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import numpy as np

from gyronorth.studies.networks import WITHOUT_DENOISER, merged, split_data, split_json, splits_of
from gyronorth.studies.source import recordings_of
from gyronorth.studies.study import Study, StudyPlan
from gyronorth.studies.tables import StudyReport, Table
from gyronorth.studies.work import Job, Result

_LAYOUTS = ("flattened", "temporal")
#: Recordings that are denoised to know the cost of one.
_TIMED = 24


def cost_unit(*, layout: str, split: dict, seed: int, data: dict | None = None) -> Result:
    """CPU seconds of an epoch of each stage, and of denoising its inputs: of this machine, unlike all else here."""
    from gyronorth.learn.settings import Settings
    from gyronorth.learn.stages import train_denoiser, train_heading
    from gyronorth.learn.training import torch_threads

    one_epoch = {"layout": layout, "seed": seed, "denoiser": {"epochs": 1}, "heading": {"epochs": 1}}
    settings = Settings.model_validate(one_epoch)
    alone = Settings.model_validate(merged(one_epoch, WITHOUT_DENOISER))
    parts = split_data(split, recordings_of(seed, data), settings)
    copies = settings.heading.augment.copies
    with torch_threads(1):
        denoiser, denoiser_s = _timed(lambda: train_denoiser(settings))
        _, heading_s = _timed(lambda: train_heading(alone, parts, None))
        _, clean_s = _timed(lambda: denoiser.clean(parts.train.rows(np.arange(_TIMED)).gyro_l))
    full = Settings()
    return {
        "denoiser_epoch_s": denoiser_s,
        "heading_epoch_s": heading_s,
        "denoise_s": round(clean_s * (len(parts.train) * copies) / _TIMED, 3),
        "denoiser_epochs": full.denoiser.epochs,
        "heading_epochs": full.heading.epochs,
    }


def _timed(work: Callable) -> tuple:
    start = time.process_time()
    result = work()
    return result, round(time.process_time() - start, 3)


def _by_layout(plan: StudyPlan) -> dict[str, Job]:
    split = split_json(splits_of(plan, 1)[0])
    return {
        layout: Job(f"cost/{layout}", cost_unit, {"layout": layout, "split": split, **plan.source()})
        for layout in _LAYOUTS
    }


def _report(plan: StudyPlan, results: Mapping[str, Result]) -> StudyReport:
    rows = []
    for layout, unit in _by_layout(plan).items():
        r = results[unit.name]
        most = r["denoiser_epochs"] * r["denoiser_epoch_s"] + r["heading_epochs"] * r["heading_epoch_s"]
        rows.append((layout, r["denoiser_epoch_s"], r["denoise_s"], r["heading_epoch_s"], (most + r["denoise_s"]) / 60))
    columns = (
        "layout",
        "an epoch of the denoiser, s",
        "denoising the training set, s",
        "an epoch of the heading network, s",
        "both stages at most, minutes",
    )
    most = results["cost/flattened"]
    note = (
        f"CPU seconds of one thread. At most: {most['denoiser_epochs']} epochs of the denoiser, the denoising of the "
        f"augmented training set once, {most['heading_epochs']} epochs of the heading network, of which early "
        "stopping leaves out some."
    )
    return StudyReport(
        "Measured on the machine that ran this.", (Table("Cost of training", columns, tuple(rows), note),)
    )


COST = Study("cost", "Cost of training", "paper", lambda plan: list(_by_layout(plan).values()), _report)
