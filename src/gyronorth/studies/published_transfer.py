"""`benchmark published`: does the learned correction do harm where there is nothing to learn, or elsewhere?"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos

import numpy as np
from numpy.typing import NDArray

from gyronorth.angles import angle_error, wrap_heading
from gyronorth.attitude import heading_of_rate
from gyronorth.deviation import fit_deviation, rate_surplus
from gyronorth.earth import EARTH_RATE
from gyronorth.evaluation import bootstrap_ratio, coverage
from gyronorth.published import DURATION, LATITUDE, SESSION, fit_noise, model_based, published
from gyronorth.studies.methods import as_rad, bias_deviation, deg_per_hour
from gyronorth.studies.source import recordings_of
from gyronorth.studies.study import Study, StudyPlan
from gyronorth.studies.tables import StudyReport, Table
from gyronorth.studies.work import Job, Result

#: Simulated sets of each kind, and recordings tested of each.
SETS = 60
TESTED = 200
_SIZES = (12, 24, 60)


@dataclass(frozen=True)
class _Figures:
    """What is taken from the real recordings."""

    heading_mean: NDArray  # (m,) rad
    mean_rate: NDArray  # (m, 3) rad/s
    heading_true: NDArray  # (m,) rad
    duration: float  # s
    arw: float  # rad/sqrt(s)

    @property
    def bias(self) -> float:
        """Standard deviation of the horizontal bias per axis, rad/s."""
        return bias_deviation(self.heading_true, self.mean_rate)


def _figures(seed: int, data: dict | None = None) -> _Figures:
    if data is None:
        found = published()
        return _Figures(found.heading_mean, found.mean_rate, found.heading_true, DURATION, fit_noise().arw)
    own = recordings_of(seed, data)
    return _Figures(model_based(own.gyro_l), own.gyro_l.mean(axis=1), own.heading_true, own.duration, own.arw)


def _simulated(real: _Figures, count: int, rng: np.random.Generator) -> tuple[NDArray, NDArray, NDArray]:
    """Heading of the mean rate, its surplus and the true heading of recordings with random biases and white noise."""
    heading = rng.uniform(0, 2 * np.pi, count)
    rate = EARTH_RATE * cos(LATITUDE) * np.stack([np.cos(heading), -np.sin(heading)], axis=1)
    spread = np.hypot(real.bias, real.arw / np.sqrt(real.duration))
    rate = rate + spread * rng.standard_normal(rate.shape)
    return wrap_heading(heading_of_rate(rate)), rate_surplus(rate, LATITUDE), heading


def no_structure(*, known: int, tested: int, seed: int, data: dict | None = None) -> dict:
    """Learn from `known` simulated recordings with biases that cannot be learnt; apply to others with others."""
    rng, real = np.random.default_rng([seed, known]), _figures(seed, data)
    heading, surplus, truth = _simulated(real, known, rng)
    model = fit_deviation(heading, surplus, truth)
    heading, surplus, truth = _simulated(real, tested, rng)
    return _judged(angle_error(heading, truth), *model.predict(heading, surplus))


def other_set(*, declared: bool, tested: int, seed: int, data: dict | None = None) -> dict:
    """Learn from the real recordings; apply to simulated ones, with or without saying that they are others."""
    real = _figures(seed, data)
    model = fit_deviation(real.heading_mean, rate_surplus(real.mean_rate, LATITUDE), real.heading_true, session=SESSION)
    heading, surplus, truth = _simulated(real, tested, np.random.default_rng(seed))
    return _judged(angle_error(heading, truth), *model.predict(heading, surplus, in_set=not declared))


def _judged(error: NDArray, expected: NDArray, sigma: NDArray) -> dict:
    return {
        "error_deg": np.round(np.degrees(angle_error(error, expected)), 6).tolist(),
        "reference_deg": np.round(np.degrees(error), 6).tolist(),
        "sigma_deg": np.round(np.degrees(sigma), 6).tolist(),
    }


def _units(plan: StudyPlan) -> list[Job]:
    source = plan.source()
    units = [
        Job(
            f"no_structure/{known}-{i:03d}",
            no_structure,
            {"known": known, "tested": TESTED, **source, "seed": plan.seed + i},
        )
        for known in _SIZES
        for i in range(SETS)
    ]
    for declared in (True, False):
        arguments = {"declared": declared, "tested": SETS * TESTED, **source}
        units.append(Job(f"other_set/{'declared' if declared else 'undeclared'}", other_set, arguments))
    return units


def _row(label: str, parts: list[Result], seed: int) -> tuple:
    error, reference, sigma = (
        np.concatenate([as_rad(part[key]) for part in parts]) for key in ("error_deg", "reference_deg", "sigma_deg")
    )
    # What is drawn anew is the set learnt from; of a single one, the recordings tested.
    group = np.repeat(np.arange(len(parts)), len(error) // len(parts)) if len(parts) > 1 else np.arange(len(error))
    ratio = bootstrap_ratio(error, reference, group, rng=np.random.default_rng(seed), draws=1000)
    return label, ratio, coverage(error, sigma, group, rng=np.random.default_rng(seed), draws=1000)


def _report(plan: StudyPlan, results: Mapping[str, Result]) -> StudyReport:
    rows = [
        _row(
            f"random biases, learnt from {known} recordings",
            [results[f"no_structure/{known}-{i:03d}"] for i in range(SETS)],
            plan.seed,
        )
        for known in _SIZES
    ]
    for key, label in (("declared", "said to be another"), ("undeclared", "taken for the same")):
        whose = "published" if plan.data is None else "these recordings'"
        rows.append(_row(f"{whose} curve on another set, {label}", [results[f"other_set/{key}"]], plan.seed))
    real = _figures(**plan.source())
    bias = deg_per_hour(real.bias)
    text = (
        f"Simulated recordings of {real.duration:g} s with white noise and a bias of {bias:.2f} deg/h per axis drawn "
        "anew for each: nothing can be learnt, and the correction should do no harm. Then the curve of the real set on "
        "such recordings: a deviation belongs to one unit and set. A recording that is not of it is left as it is; "
        "taken for one of it by mistake, it is made worse, and no single recording can tell."
    )
    columns = ("case", "CRMSE, ratio to the closed form", "95 % interval holds")
    return StudyReport(text, (Table("Harm", columns, tuple(rows)),))


TRANSFER = Study("harm", "No harm where nothing can be learnt", "published", _units, _report)
