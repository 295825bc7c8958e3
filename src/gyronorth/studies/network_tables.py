"""Rows of tables from trained networks: pooled errors over splits and seeds with their intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyronorth.angles import cyclic_rmse
from gyronorth.evaluation import Interval, bootstrap_crmse, bootstrap_ratio, share_of_wins
from gyronorth.studies.networks import PARTS
from gyronorth.studies.tables import degrees
from gyronorth.studies.work import Result

#: Columns of `network_row`.
COLUMNS = (
    "variant",
    "training loss, deg",
    "train, deg",
    "validation, deg",
    "test, deg",
    "test, ratio to model-based",
    "test, median error, deg",
    "tests lost",
    "CRMSE of tests not lost, deg",
    "circle lost",
    "splits won",
    "epochs",
)
DIVERGED = "diverged"
#: An error beyond this, deg, is called lost: several times what any bias of the set explains.
LOST_DEG = 20.0
LOST = (
    f"Lost: in error by more than {LOST_DEG:g} deg. `circle lost` asks the trained networks for the heading of a "
    "clean, unbiased Earth rate all around the circle: a heading in degrees modulo 360 has to jump somewhere, and in "
    "that arc and in gaps between the training headings the network knows none."
)


#: What the paper prints over its model-based 4.5 deg, on one split: its baseline 3.9, its system 3.3.
PRINTED_RATIOS = (0.87, 0.74)


@dataclass(frozen=True)
class Pooled:
    """Errors of a method and of the model-based heading on one part of all trainings together, rad."""

    error: list[NDArray[np.float64]]  # one array a training
    reference: list[NDArray[np.float64]]
    recording: NDArray[np.int64]

    @property
    def finite(self) -> bool:
        """Whether every training gave headings."""
        return all(np.isfinite(e).all() for e in self.error)

    def crmse(self, seed: int) -> Interval:
        """Pooled CRMSE, deg."""
        return degrees(bootstrap_crmse(np.concatenate(self.error), self.recording, rng=np.random.default_rng(seed)))

    def ratio(self, seed: int) -> Interval:
        """Pooled CRMSE over that of the model-based heading."""
        error, reference = np.concatenate(self.error), np.concatenate(self.reference)
        return bootstrap_ratio(error, reference, self.recording, rng=np.random.default_rng(seed))

    def kept(self) -> float | None:
        """CRMSE, deg, of the tests that are not lost; None if all are."""
        error = np.concatenate(self.error)
        error = error[np.abs(np.degrees(error)) <= LOST_DEG]
        return float(np.degrees(cyclic_rmse(error))) if len(error) else None

    def median(self) -> float:
        """Median of the absolute error, deg."""
        return float(np.degrees(np.median(np.abs(np.concatenate(self.error)))))

    def lost(self) -> str:
        """Share of the tests in error by more than `LOST_DEG`."""
        return _percent(np.abs(np.degrees(np.concatenate(self.error))) > LOST_DEG)

    def wins(self) -> float:
        """Share of the trainings that beat the model-based heading."""
        return share_of_wins(self.error, self.reference)


def shares_of_splits(one: Pooled) -> tuple[float, str, str]:
    """Median over the splits of the ratio to the model-based CRMSE, and the shares at or below `PRINTED_RATIOS`."""
    ratio = np.array([cyclic_rmse(e) / cyclic_rmse(r) for e, r in zip(one.error, one.reference, strict=True)])
    first, second = (_percent(ratio <= limit + 1e-12) for limit in PRINTED_RATIOS)
    return float(np.median(ratio)), first, second


def pooled(results: Sequence[Result], part: str, key: str = "error_deg") -> Pooled:
    """All trainings together; `part` is train, validation or test."""
    parts = [result[part] for result in results]
    return Pooled(
        [np.radians(np.array(p[key], float)) for p in parts],
        [np.radians(np.array(p["model_based_deg"], float)) for p in parts],
        np.concatenate([p["recording"] for p in parts]),
    )


def network_row(label: str, results: Sequence[Result], seed: int) -> tuple:
    """One row: CRMSE on the three parts, ratio on test, splits won, epochs of the chosen weights."""
    by_part = {part: pooled(results, part) for part in PARTS}
    if not all(one.finite for one in by_part.values()):
        return (label, *[DIVERGED] * 4, *[None] * 6, _epochs(results))
    single = [float(np.degrees(cyclic_rmse(np.concatenate(by_part[part].error)))) for part in PARTS[:2]]
    test = by_part["test"]
    figures = (test.crmse(seed), test.ratio(seed), test.median(), test.lost(), test.kept(), circle_lost(results))
    return (label, training_loss(results), *single, *figures, test.wins(), _epochs(results))


def training_loss(results: Sequence[Result]) -> float | None:
    """Mean over the trainings of the loss, deg, in the epoch chosen: on augmented copies, with dropout, as it falls.

    It is what a training prints, and not the error of the trained network on its training recordings.
    """
    losses = [r["history"][r["best_epoch"] - 1]["loss"] for r in results if r["best_epoch"]]
    return None if None in losses or not losses else float(np.mean(losses))


def circle_lost(results: Sequence[Result]) -> str:
    """Share of all headings at which the trained networks err by more than `LOST_DEG` on a clean Earth rate."""
    return _percent(np.abs(np.concatenate([np.array(r["circle_error_deg"], float) for r in results])) > LOST_DEG)


def _percent(hits: NDArray[np.bool_]) -> str:
    return f"{100 * np.mean(hits):.1f} %"


def spread(results: Sequence[Result], part: str = "test") -> tuple[float, float]:
    """Mean and standard deviation over trainings of the CRMSE on a part, deg."""
    each = np.degrees([cyclic_rmse(e) for e in pooled(results, part).error])
    return float(each.mean()), float(each.std(ddof=1)) if len(each) > 1 else 0.0


def _epochs(results: Sequence[Result]) -> str:
    best = sorted(result["best_epoch"] for result in results)
    return f"{best[0]} to {best[-1]}" if best[0] != best[-1] else str(best[0])
