"""What a benchmark of the paper will cost, printed before it starts."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from gyronorth.studies.paper_best import MEMBERS
from gyronorth.studies.paper_prior_fitted import STAGES
from gyronorth.studies.work import Job, finished_units, with_needs

#: CPU seconds of one thread, by layout, as the study `cost` measures them: an epoch of the denoiser, denoising the
#: augmented recordings of a split, an epoch of the heading network.
FLATTENED = (0.103, 8.0, 0.19)
TEMPORAL = (6.6, 290.0, 5.8)
#: An epoch of one of many heading networks trained at once, per 32 examples of a batch; a start of anything; all else.
TOGETHER = 0.10
START = 1.0
OTHERS = 2.0
#: Denoising for a split whose copies are mostly known from the splits before, and the share that is new of single ones.
ALL_CLEANED, CLEANED_ANEW = 0.5, 0.77
#: A step of the flow; a recording judged.
FLOW_STEP, FLOW_JUDGED = 0.1, 0.1
#: A step of the prior-fitted network; a swing judged with both Gaussian processes.
PRIOR_STEP, PRIOR_JUDGED = 0.055, 0.35
#: Seconds between two lines of what remains.
EVERY = 60.0
#: Early stopping leaves out these shares of the epochs, with the denoiser and without: of 65 and 18 trainings recorded.
STOPPED, STOPPED_ALONE = 0.4, 0.5


def expected_seconds(job: Job) -> float:
    """CPU seconds of a unit, from its settings; good to a factor of two."""
    settings: dict[str, Any] = job.arguments.get("settings", {})
    denoiser, denoise, heading = TEMPORAL if settings.get("layout") == "temporal" else FLATTENED
    length = settings.get("samples", 300) / 300
    kind, part = job.function.__name__, settings.get("heading", {})
    epochs = part.get("epochs", 150)
    denoised = part.get("denoised", True)
    cleaned = denoise * length * denoised * (CLEANED_ANEW if denoise == FLATTENED[1] else 1)
    if kind == "train_denoiser_unit":
        return START + denoiser * length * (1 - STOPPED) * settings.get("denoiser", {}).get("epochs", 300)
    if kind == "train_heading_unit":
        return START + cleaned + heading * length * (1 - (STOPPED if denoised else STOPPED_ALONE)) * epochs
    if kind == "protocol_unit":
        count = len(job.arguments["splits"])
        return START + count * (ALL_CLEANED * (cleaned > 0) + TOGETHER * epochs * min(1.0, 40 / part.get("batch", 32)))
    if kind == "best_unit":
        return START + MEMBERS * TOGETHER * epochs
    if kind == "train_flow_unit":
        return START + FLOW_STEP * settings.get("steps", 1500)
    if kind == "judge_flow_unit":
        return START + FLOW_JUDGED * job.arguments["runs"]
    if kind == "prior_fitted_stage":
        return START + PRIOR_STEP * settings.get("steps", 2400) / STAGES
    if kind == "judge_prior_fitted":
        return START + PRIOR_JUDGED * len(job.arguments["splits"])
    if kind == "judge_simulated":
        return START + PRIOR_JUDGED * job.arguments["swings"]
    return OTHERS


def told(jobs: Iterable[Job], folder: Path, workers: int | None) -> str:
    """How much there is to do: units, those done, CPU time, and time with so many local processes."""
    order = with_needs(list(jobs))
    done = finished_units(order, folder)
    left = sum(expected_seconds(job) for job in order if job.name not in done)
    processes = min(workers or os.cpu_count() or 1, max(len(order) - len(done), 1))
    clock = f"{_time(left / processes)} with {processes} local process{'es' if processes > 1 else ''}"
    return (
        f"{len(order)} units of work, {len(done)} of them done; about {_time(left)} of CPU left, {clock}. "
        "What is finished is kept."
    )


class Remaining:
    """How long the rest of a benchmark will take, from what its finished units took.

    Parameters
    ----------
    studies : mapping
        Jobs of each study by its name, in the order in which they are run.
    folder : Path
        Where finished units are kept; those that are there take no time.
    clock : callable
        Seconds of some clock.
    """

    def __init__(
        self, studies: Mapping[str, Iterable[Job]], folder: Path, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._clock, self._start, self._told = clock, clock(), clock()
        self._units, self._expected, self._spent = 0, 0.0, 0.0
        self._left: dict[str, float] = {}
        self._first: dict[str, int] = {}
        known: set[str] = set()
        for name, jobs in studies.items():
            order = with_needs(list(jobs))
            known |= finished_units(order, folder)
            self._first[name] = sum(job.name in known for job in order)
            self._left[name] = sum(expected_seconds(job) for job in order if job.name not in known)
            known |= {job.name for job in order}
        self._whole = sum(self._left.values())

    def spent(self, unit: Job, seconds: float) -> None:
        """Note the CPU time that a unit took."""
        self._units += 1
        self._expected += expected_seconds(unit)
        self._spent += seconds

    def balance(self) -> str:
        """What was told of the units that were run, beside what they took; empty if none was."""
        if not self._units:
            return ""
        units = f"{self._units} unit{'s' if self._units > 1 else ''}"
        return f"{units} run: {_time(self._expected)} of CPU told, {_time(self._spent)} spent."

    def line(self, study: str, finished: int, total: int) -> str | None:
        """What to tell when so many of a study's units are finished; None within a minute of the last line."""
        now = self._clock()
        names = list(self._left)
        later = sum(self._left[name] for name in names[names.index(study) + 1 :])
        new = max(total - self._first[study], 1)
        left = later + self._left[study] * min((total - finished) / new, 1.0)
        if now - self._told < EVERY or self._whole - left <= 0:
            return None
        self._told = now
        pace = (now - self._start) / (self._whole - left)
        return f"{study}: {finished} of {total} units; about {_time(left * pace)} left for all."


def _time(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
