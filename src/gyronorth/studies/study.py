"""What a study is, how much of it is run, and what it leaves."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from gyronorth.errors import InputError
from gyronorth.evaluation import Split, random_splits
from gyronorth.files import write_text
from gyronorth.published import Twin
from gyronorth.studies.source import about, described, recordings_of
from gyronorth.studies.tables import StudyReport, Table
from gyronorth.studies.work import Job, Result, commit, data_sha256, write_json

SCHEMA = "gyronorth.study/1"
#: Epochs of the baseline, the most that any settings ask for, and fewer than which no network is trained.
FULL_EPOCHS = 500
HARDLY_TRAINED = 30
Selection = Literal["validation", "test", "last", "leak"]
#: What chooses the epoch of a network, and the label that every output carries where that is not honest.
SELECTIONS: Mapping[str, str] = {
    "validation": "",
    "test": "**Networks: the epoch is CHOSEN ON TEST; these figures say nothing of new recordings.**",
    "last": "**Networks: no choice, the LAST EPOCH is taken.**",
    "leak": "**Networks: ANOTHER WINDOW OF THE TESTED RECORDINGS is in training (a leak); these figures say nothing "
    "of new recordings.**",
}


@dataclass(frozen=True)
class StudyPlan:
    """How much is run. The defaults are those of the results page.

    Raises
    ------
    InputError
        If a count is not positive.
    """

    seed: int = 0  # of the reconstruction's noise, of the splits and of the first training
    splits: int = 200  # random 24/4/6 splits of the methods without a network
    network_splits: int = 10  # the same for the networks, each trained anew
    seeds: int = 3  # trainings of each variant of a network on its split
    epochs: int | None = None  # of any training, at most; None: as the settings say
    data: str | None = None  # folder of the public recordings; None: the published reconstruction
    selection: Selection = "validation"  # what chooses the epoch of a network; anything else is labelled

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name not in ("seed", "data", "selection") and value is not None and value < 1:
                raise InputError(f"{name} is {value}; a positive number is expected.")
        if self.selection not in SELECTIONS:
            raise InputError(f"selection is {self.selection!r}; one of {', '.join(SELECTIONS)} is expected.")

    def source(self) -> dict[str, Any]:
        """The arguments of a unit that say which recordings it is about."""
        return {"seed": self.seed} if self.data is None else {"seed": self.seed, "data": described(self.data)}

    def about(self) -> str:
        """What the recordings are, and what is unusual about the choice of the epochs: a study's text begins so."""
        return " ".join(text for text in (about(self.data), SELECTIONS[self.selection], self.cut_short()) if text)

    def cut_short(self) -> str:
        """The note where the trainings end before their settings let them; empty where they do not."""
        if self.epochs is None or self.epochs >= FULL_EPOCHS:
            return ""
        what = "are **not trained**: their figures only show that the command runs"
        if self.epochs >= HARDLY_TRAINED:
            what = "that need more epochs, the baseline above all, are **not trained to the end**"
        return f"Trainings end after {self.epochs} epochs (the settings: up to 300, 150 and 500): networks {what}."

    def recordings(self) -> Twin:
        """The recordings themselves."""
        return recordings_of(**self.source())

    def splits_of(self, count: int) -> list[Split]:
        """The first of the random 24/4/6 splits: networks and other methods see the same.

        Raises
        ------
        InputError
            If there are fewer recordings than a split needs.
        """
        recordings, needed = len(self.recordings().heading_true), 34
        if recordings < needed:
            raise InputError(
                f"{self.data} holds {recordings} recordings; a 24/4/6 split needs {needed}. Bring the whole clone, or "
                "run `benchmark published` with --study leave_one_out or arcs."
            )
        return random_splits(recordings, count, rng=np.random.default_rng([self.seed, 1]))

    def options(self) -> str:
        """What differs from the defaults, as command line options."""
        default = StudyPlan()
        changed = [(k, v) for k, v in vars(self).items() if v != getattr(default, k)]
        return "".join(f" --{name.replace('_', '-')} {value}" for name, value in changed)


@dataclass(frozen=True)
class Study:
    """One table or figure: its units of work and what is made of their results."""

    name: str  # of its files
    title: str
    benchmark: str  # the command that it belongs to: paper, published, turned, disturbed, stress or real
    units: Callable[[StudyPlan], list[Job]]
    report: Callable[[StudyPlan, Mapping[str, Result]], StudyReport]  # of the results by unit name
    floor: Callable[[StudyPlan, Table], str] = lambda _plan, _table: ""  # a line below a table of heading errors
    described: Callable[[StudyPlan], Any] | None = None  # what it was run on, where that does not ship
    simulates: bool = False  # recordings of its own, in a benchmark whose other studies are about the plan's
    by_name: bool = False  # takes so long that a whole benchmark leaves it out; `--study` runs it
    epochs: int | None = None  # of its trainings at most, where the plan says nothing

    def plan_of(self, plan: StudyPlan) -> StudyPlan:
        """The plan that it is run with."""
        return replace(plan, epochs=self.epochs) if plan.epochs is None else plan

    @property
    def on_recordings(self) -> bool:
        """Whether it is about the plan's recordings; the others simulate their own."""
        return self.benchmark in ("paper", "published") and not self.simulates

    def recordings(self, plan: StudyPlan) -> Any:
        """What it is run on, for its file.

        Raises
        ------
        InputError
            If the recordings are not there.
        """
        if self.described is not None:
            return self.described(plan)
        return plan.source().get("data", "published reconstruction")

    def markdown(self, table: Table, plan: StudyPlan) -> str:
        """A table of the report as a reader sees it, with the floor of its heading errors below."""
        lines = [SELECTIONS[plan.selection], self.floor(plan, table)]
        return table.to_markdown() + "".join(f"\n{line}\n" for line in lines if line)


def write_study(
    study: Study, plan: StudyPlan, results: Mapping[str, Result], folder: Path, *, command: str
) -> StudyReport:
    """Write `<name>.json` and `<name>.md` and give what they hold."""
    report = study.report(plan, results)
    title, text = report.title or study.title, f"{plan.about()} {report.text}" if study.on_recordings else report.text
    content: dict[str, Any] = {
        "schema": SCHEMA,
        "study": study.name,
        "title": title,
        "seed": plan.seed,
        "commit": commit(),
        "data_sha256": data_sha256(),
        "command": command,
        "plan": asdict(plan),
        "recordings": study.recordings(plan),
        "text": text,
        "tables": [table.to_json() for table in report.tables],
        "curves": report.curves,
    }
    write_json(folder / f"{study.name}.json", content)
    origin = f"`{command}`, seed {plan.seed}, commit {commit()[:12]}, data {data_sha256()[:12]}"
    parts = [
        f"## {title}",
        "",
        text,
        "",
        *(study.markdown(table, plan) for table in report.tables),
        f"Made by {origin}.",
        "",
    ]
    write_text(folder / f"{study.name}.md", "\n".join(parts))
    return report
