"""`benchmark paper`: a prior-fitted network on simulated swings against the Gaussian process, in all kinds of split."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from gyronorth.angles import angle_error
from gyronorth.deviation import FEWEST, PRIORS, fit_deviation
from gyronorth.evaluation import Split, bootstrap_crmse, bootstrap_ratio, coverage, share_of_wins
from gyronorth.studies.methods import (
    DEVIATIONS,
    GP,
    LEARNED,
    MODEL_BASED,
    WINDOW,
    Array,
    Predictor,
    as_rad,
    floor,
    judged,
    rounded,
)
from gyronorth.studies.networks import digest, pack, unpack
from gyronorth.studies.published_splits import ARCS, arc_units, loo_units, split_units
from gyronorth.studies.source import recordings_of
from gyronorth.studies.study import Study, StudyPlan
from gyronorth.studies.tables import StudyReport, Table, degrees, verdict
from gyronorth.studies.work import Job, Result

if TYPE_CHECKING:
    from gyronorth.learn.prior_fitted import Stage

NETWORK = "prior-fitted network"
METHODS = (MODEL_BASED, GP, LEARNED, NETWORK)
#: Steps of the training.
STEPS = 2400
#: Pieces of the training, each a unit of work: what a run that was ended has finished is kept.
STAGES = 4
#: Known headings of the simulated swings it is judged on, how many swings of each size, headings asked for in each.
SIZES, SWINGS, ASKED = (FEWEST, 12, 24, 59), 40, 20
#: Size of the errors of the simulated swings, rad: that of the recordings. The methods take any.
_SCALE = np.radians(4.0)


def prior_fitted_stage(*before: Result, settings: dict, step: int) -> Result:
    """Train the network to a step, from the stage before it if there is one."""
    from gyronorth.learn.prior_fitted import PriorFittedSettings, train_to

    found = train_to(PriorFittedSettings(**settings), step, _stage(before[0]) if before else None)
    loss = [float(f"{value:.5g}") for value in found.loss]
    return {"settings": settings, "step": step, "loss": loss, "arrays": pack(dict(found.arrays))}


def _stage(result: Result) -> Stage:
    from gyronorth.learn.prior_fitted import Stage

    return Stage(result["step"], unpack(result["arrays"]), tuple(result["loss"]))


def _network(result: Result, heading: Array, surplus: Array, error: Array) -> Predictor:
    """The trained network given a swing."""
    from gyronorth.learn.prior_fitted import PriorFittedSettings, predict, trained

    network = trained(PriorFittedSettings(**result["settings"]), _stage(result))
    return lambda at, at_surplus: predict(network, heading, surplus, error, at, at_surplus)


def _corrections(result: Result, heading: Array, surplus: Array, truth: Array) -> dict[str, Predictor]:
    """Both Gaussian processes and the network, each given the same swing."""
    found = {
        name: fit_deviation(heading, surplus, truth, prior=PRIORS[DEVIATIONS[name]]).predict for name in (GP, LEARNED)
    }
    return found | {NETWORK: _network(result, heading, surplus, angle_error(heading, truth))}


def judge_prior_fitted(network: Result, *, splits: list[dict], seed: int, data: dict | None = None) -> Result:
    """Errors and sigmas, deg, of `METHODS` on the tests of each split: see `methods.judged`."""
    twin = recordings_of(seed, data)
    named = [{part: np.array(index, int) for part, index in split.items()} for split in splits]
    return {"folds": [judged(twin, Split(**split), lambda *given: _corrections(network, *given)) for split in named]}


def judge_simulated(network: Result, *, known: int, swings: int, seed: int) -> Result:
    """The same on swings drawn from the prior itself, where nothing can be better than what follows from it."""
    from gyronorth.learn.prior_fitted import draw_swings

    folds = []
    for number in range(swings):
        rng = np.random.default_rng([seed, known, number, 2])
        drawn = draw_swings(PRIORS["learned"], swings=1, known=known, asked=ASKED, rng=rng)
        heading, surplus, error = drawn.heading, _SCALE * drawn.surplus, _SCALE * drawn.error[0]
        corrections = _corrections(network, heading[:known], surplus[:known], heading[:known] - error[:known])
        at = {name: one(heading[known:], surplus[known:]) for name, one in corrections.items()}
        spread = float(np.sqrt(np.mean(error[:known] ** 2)))
        at[MODEL_BASED] = (np.zeros(ASKED), np.full(ASKED, spread))
        folds.append(
            {
                "recording": [number] * ASKED,
                "error_deg": {name: rounded(angle_error(error[known:], e)) for name, (e, _) in at.items()},
                "sigma_deg": {name: rounded(s) for name, (_, s) in at.items()},
            }
        )
    return {"folds": [{"whole": fold} for fold in folds]}


def training_of(plan: StudyPlan) -> Job:
    """The last stage of the training, which needs the others."""
    steps = STEPS if plan.epochs is None else min(STEPS, 120 * plan.epochs)
    settings = {"seed": plan.seed, "steps": steps}
    last: Job | None = None
    for stage in range(1, STAGES + 1):
        name = f"prior_fitted/training-{steps}-{plan.seed}-{stage}"
        arguments = {"settings": settings, "step": steps * stage // STAGES}
        last = Job(name, prior_fitted_stage, arguments, () if last is None else (last,))
    assert last is not None
    return last


def jobs_of(plan: StudyPlan) -> dict[str, Job]:
    """A unit for each kind of split and each size of simulated swings, by the title of its table."""
    training, source = training_of(plan), plan.source()
    kinds = {"One recording left out": loo_units(plan), f"{plan.splits} random 24/4/6 splits": split_units(plan)}
    arcs = arc_units(plan)
    kinds |= {f"Arcs of {arc} headings left out": [u for u in arcs if u.name.startswith(f"arcs{arc}/")] for arc in ARCS}
    jobs = {}
    for title, units in kinds.items():
        splits = [{part: unit.arguments[part] for part in ("train", "validation", "test")} for unit in units]
        arguments = {"splits": splits, **source}
        name = f"prior_fitted/{digest([training.name, arguments])}"
        jobs[title] = Job(name, judge_prior_fitted, arguments, (training,))
    for known in SIZES:
        arguments = {"known": known, "swings": SWINGS, "seed": plan.seed}
        name = f"prior_fitted/simulated-{known}-{digest([training.name, arguments])}"
        jobs[f"Simulated swings of {known} headings"] = Job(name, judge_simulated, arguments, (training,))
    return jobs


def _rows(where: str, folds: Sequence[Result], seed: int) -> list[tuple]:
    """A row of each method: its errors, the same against the closed form and `learned`, its intervals."""
    recording = np.concatenate([fold["recording"] for fold in folds])
    errors = {name: [as_rad(fold["error_deg"][name]) for fold in folds] for name in METHODS}
    rows = []
    for name in METHODS:
        error = np.concatenate(errors[name])
        sigma = np.concatenate([as_rad(fold["sigma_deg"][name]) for fold in folds])
        ratios = {
            other: bootstrap_ratio(error, np.concatenate(errors[other]), recording, rng=np.random.default_rng(seed))
            for other in (MODEL_BASED, LEARNED)
            if name not in (MODEL_BASED, other)
        }
        rows.append(
            (
                where,
                name,
                degrees(bootstrap_crmse(error, recording, rng=np.random.default_rng(seed))),
                ratios.get(MODEL_BASED),
                ratios.get(LEARNED),
                coverage(error, sigma, recording, rng=np.random.default_rng(seed)),
                float(np.degrees(np.median(1.96 * sigma))),
                share_of_wins(errors[name], errors[LEARNED]) if name == NETWORK else None,
                verdict(ratios[LEARNED], high=1.0) if name == NETWORK else None,
            )
        )
    return rows


def _report(plan: StudyPlan, results: Mapping[str, Result]) -> StudyReport:
    from gyronorth.learn.prior_fitted import PriorFittedSettings

    of_recordings, windows, simulated = [], [], []
    for title, job in jobs_of(plan).items():
        folds = results[job.name]["folds"]
        if title.startswith("Simulated"):
            simulated += _rows(title, [fold["whole"] for fold in folds], plan.seed)
        else:
            of_recordings += _rows(title, [fold["whole"] for fold in folds], plan.seed)
            windows += _rows(title, [fold["windows"] for fold in folds], plan.seed)
    columns = (
        "split",
        "method",
        "CRMSE, deg",
        "ratio to model-based",
        f"ratio to {LEARNED}",
        "95 % interval holds",
        "half-width of it, median deg",
        f"folds better than {LEARNED}",
        f"errs less than {LEARNED}",
    )
    count = len(plan.recordings().heading_true)
    note = f"Within set; intervals are over the {count} recordings."
    own = "Swings drawn from the prior of the network and of `learned + deviation`; intervals are over swings."
    tables = (
        Table("Prior-fitted network, whole recordings", columns, tuple(of_recordings), note),
        Table(f"Prior-fitted network, windows of {WINDOW:g} s", columns, tuple(windows), note),
        Table("Prior-fitted network, simulated swings", columns, tuple(simulated), own),
    )
    last = training_of(plan)
    settings = PriorFittedSettings(**last.arguments["settings"])
    shown = f"{settings.swings * settings.steps:,}".replace(",", " ")
    return StudyReport(TEXT.replace("SHOWN", shown), tables, {"loss": results[last.name]["loss"]})


def _floor(plan: StudyPlan, table: Table) -> str:
    if "simulated" in table.title:
        return "Floor: none of its own; a prior-fitted network can at best give what the prior says."
    recordings = plan.recordings()
    bound = floor(recordings, WINDOW if "windows" in table.title else recordings.duration)
    return f"Floor (Cramér-Rao, noise and a bias that cannot be learnt): {np.degrees(bound):.2f} deg."


TEXT = (
    "A network with attention, of some 31 000 weights, is shown SHOWN simulated swings: headings of 6 to 60 known "
    "recordings, their errors, and the surplus of their rates, drawn from the prior of `learned + deviation`: curve, "
    "coupling to the rate or neither, Student-t noise. It is trained to say mean and standard deviation of the error "
    "at other headings, and has never seen a real recording. A swing that is turned, mirrored or in another order "
    "gives the same answer by construction. The Gaussian process works out the same prior for each swing anew, with an "
    "approximation for the noise; the network learns what follows from it. Everybody knows the same recordings."
)
PRIOR_FITTED = Study(
    "prior_fitted",
    "A prior-fitted network against the Gaussian process",
    "paper",
    lambda plan: list(jobs_of(plan).values()),
    _report,
    _floor,
)
