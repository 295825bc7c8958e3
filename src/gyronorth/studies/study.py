"""What a study is, how much of it is run, and what it leaves."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from gyronorth.errors import InputError
from gyronorth.files import write_text
from gyronorth.published import Twin
from gyronorth.studies.source import described, recordings_of
from gyronorth.studies.tables import Report, Table
from gyronorth.studies.work import Job, Result, commit, data_sha256, write_json

SCHEMA = "gyronorth.study/1"


@dataclass(frozen=True)
class StudyPlan:
    """How much is run. The defaults are those of the results page.

    Raises
    ------
    InputError
        If a count is not positive.
    """

    seed: int = 0  # of the twin's noise, of the splits and of the first training
    splits: int = 200  # random 24/4/6 splits of the methods without a network
    network_splits: int = 10  # the same for the networks, each trained anew
    seeds: int = 3  # trainings of each variant of a network on its split
    epochs: int | None = None  # of any training, at most; None: as the settings say
    data: str | None = None  # folder of the public recordings; None: the published twin

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name not in ("seed", "data") and value is not None and value < 1:
                raise InputError(f"{name} is {value}; a positive number is expected.")

    def source(self) -> dict[str, Any]:
        """The arguments of a unit that say which recordings it is about."""
        return {"seed": self.seed} if self.data is None else {"seed": self.seed, "data": described(self.data)}

    def recordings(self) -> Twin:
        """The recordings themselves."""
        return recordings_of(**self.source())

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
    benchmark: str  # the command that it belongs to: paper, published, turned or disturbed
    units: Callable[[StudyPlan], list[Job]]
    report: Callable[[StudyPlan, Mapping[str, Result]], Report]  # of the results by unit name
    floor: Callable[[StudyPlan, Table], str] = lambda _plan, _table: ""  # a line below a table of heading errors

    def markdown(self, table: Table, plan: StudyPlan) -> str:
        """A table of the report as a reader sees it, with the floor of its heading errors below."""
        line = self.floor(plan, table)
        return table.to_markdown() + (f"\n{line}\n" if line else "")


def write_study(study: Study, plan: StudyPlan, results: Mapping[str, Result], folder: Path, *, command: str) -> Report:
    """Write `<name>.json` and `<name>.md` and give what they hold."""
    report = study.report(plan, results)
    content: dict[str, Any] = {
        "schema": SCHEMA,
        "study": study.name,
        "title": study.title,
        "seed": plan.seed,
        "commit": commit(),
        "data_sha256": data_sha256(),
        "command": command,
        "plan": asdict(plan),
        "recordings": plan.source().get("data", "published twin"),
        "text": report.text,
        "tables": [table.to_json() for table in report.tables],
        "curves": report.curves,
    }
    write_json(folder / f"{study.name}.json", content)
    origin = f"`{command}`, seed {plan.seed}, commit {commit()[:12]}, data {data_sha256()[:12]}"
    parts = [
        f"## {study.title}",
        "",
        report.text,
        "",
        *(study.markdown(table, plan) for table in report.tables),
        f"Made by {origin}.",
        "",
    ]
    write_text(folder / f"{study.name}.md", "\n".join(parts))
    return report
