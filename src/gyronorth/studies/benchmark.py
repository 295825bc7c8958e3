"""Run the studies of a benchmark: units on an executor, then JSON and Markdown per study."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from pathlib import Path

from gyronorth.errors import InputError, did_you_mean
from gyronorth.studies.disturbed import DISTURBED
from gyronorth.studies.disturbed_long import LONG
from gyronorth.studies.paper_augmentation import AUGMENTATION
from gyronorth.studies.paper_best import BEST
from gyronorth.studies.paper_cost import COST
from gyronorth.studies.paper_curves import DURATION, SCALE, SWEEP
from gyronorth.studies.paper_flow import FLOW
from gyronorth.studies.paper_prior_fitted import PRIOR_FITTED
from gyronorth.studies.paper_protocol import PROTOCOL, PROTOCOL_DENOISED, PROTOCOL_LEAK
from gyronorth.studies.paper_table_2 import TABLE_2
from gyronorth.studies.paper_variants import SPREAD, VARIANTS
from gyronorth.studies.published_splits import ARC, LOO, NOISE, SPLITS
from gyronorth.studies.published_transfer import TRANSFER
from gyronorth.studies.real import REAL
from gyronorth.studies.stress import STRESS
from gyronorth.studies.study import FULL_EPOCHS, Study, StudyPlan, write_study
from gyronorth.studies.turned import TURNED
from gyronorth.studies.work import Job, run_units

DEFAULT = StudyPlan()
STUDIES: tuple[Study, ...] = (
    NOISE,
    LOO,
    ARC,
    SPLITS,
    TRANSFER,
    TABLE_2,
    AUGMENTATION,
    PROTOCOL,
    PROTOCOL_DENOISED,
    PROTOCOL_LEAK,
    SCALE,
    SWEEP,
    DURATION,
    SPREAD,
    COST,
    *VARIANTS,
    BEST,
    PRIOR_FITTED,
    FLOW,
    TURNED,
    DISTURBED,
    LONG,
    STRESS,
    REAL,
)


def studies_of(benchmark: str, only: tuple[str, ...] = ()) -> list[Study]:
    """The studies of a benchmark but for those that run by name only, or some by name.

    Raises
    ------
    InputError
        If there is no such benchmark or study.
    """
    found = [study for study in STUDIES if study.benchmark == benchmark]
    if not found:
        names = list(dict.fromkeys(study.benchmark for study in STUDIES))
        hint = did_you_mean(benchmark, names)
        raise InputError(f"There is no benchmark {benchmark!r} here; known are {', '.join(names)}.{hint}")
    unknown = [name for name in only if name not in {study.name for study in found}]
    if unknown:
        names = [study.name for study in found]
        hint = did_you_mean(unknown[0], names)
        raise InputError(f"Benchmark {benchmark} has no study {unknown[0]!r}; it has {', '.join(names)}.{hint}")
    return [study for study in found if (study.name in only if only else not study.by_name)]


def left_out(benchmark: str, only: tuple[str, ...] = ()) -> list[str]:
    """Names of the studies that a whole benchmark leaves out for their cost."""
    return [] if only else [study.name for study in STUDIES if study.benchmark == benchmark and study.by_name]


def shortened(studies: Sequence[Study], plan: StudyPlan) -> str:
    """The note about studies that end their trainings early of themselves; empty if none does."""
    cut = [f"{study.name} ({study.epochs} epochs)" for study in studies if study.plan_of(plan) != plan]
    if not cut:
        return ""
    return f"Trainings end early in {', '.join(cut)}; with --epochs {FULL_EPOCHS} they go on to their end."


def run_benchmark(
    benchmark: str,
    out: str | Path,
    executor: Executor,
    *,
    only: tuple[str, ...] = (),
    plan: StudyPlan = DEFAULT,
    progress: Callable[[str, int, int], None] = lambda _study, _finished, _total: None,
    spent: Callable[[Job, float], None] = lambda _unit, _seconds: None,
) -> list[Path]:
    """Run a benchmark into the folder `out`, continuing what is there; give the Markdown files written.

    Parameters
    ----------
    benchmark : str
        `paper`, `published`, `turned`, `disturbed`, `stress` or `real`.
    out : str or Path
        Folder of the results; it is made.
    executor : Executor
        Who does the units.
    only : tuple of str
        Names of studies; by default all that do not run by name only.
    progress : callable
        Called with the study's name, the units finished and their total.
    spent : callable
        Called with each unit that was run and its CPU time, s.
    """
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for study in studies_of(benchmark, only):
        own = study.plan_of(plan)
        command = f"gyronorth benchmark {benchmark} --study {study.name}{own.options()} -o FOLDER"
        results = run_units(
            study.units(own),
            folder,
            executor,
            command=command,
            done=lambda finished, total, name=study.name: progress(name, finished, total),
            spent=spent,
        )
        write_study(study, own, results, folder, command=command)
        written.append(folder / f"{study.name}.md")
    return written
