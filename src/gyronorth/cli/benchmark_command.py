"""gyronorth benchmark: the studies behind every figure that the project claims."""

from __future__ import annotations

import sys
from dataclasses import fields
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from gyronorth.cli import completion
from gyronorth.cli.app import app
from gyronorth.cli.progress import units_done


class Selection(StrEnum):
    """What chooses the epoch of a network."""

    validation = "validation"
    test = "test"
    last = "last"
    leak = "leak"


@app.command()
def benchmark(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            autocompletion=completion.benchmark,
            help="paper, published, turned, disturbed, stress or real.",
        ),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FOLDER", help="Folder of the results; existing ones are kept.")
    ],
    study: Annotated[
        list[str] | None,
        typer.Option(metavar="STUDY", autocompletion=completion.study, help="Run only this study; repeatable."),
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Your recordings: a clone of the published ones (else their reconstruction), or those of real.",
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Address of a Dask scheduler; by default local processes work."),
    ] = None,
    workers: Annotated[int | None, typer.Option(min=1, metavar="N", help="Number of local processes.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, metavar="N", help="Seed of noise, splits and trainings.")] = None,
    splits: Annotated[int | None, typer.Option(min=1, metavar="N", help="Random splits without networks.")] = None,
    network_splits: Annotated[int | None, typer.Option(min=1, metavar="N", help="Random splits with networks.")] = None,
    seeds: Annotated[int | None, typer.Option(min=1, metavar="N", help="Trainings of each variant.")] = None,
    epochs: Annotated[int | None, typer.Option(min=1, metavar="N", help="Maximum epochs of a training.")] = None,
    selection: Annotated[
        Selection,
        typer.Option(help="How the epoch of a network is chosen; all but validation are labelled in the results."),
    ] = Selection.validation,
) -> None:
    """Run the studies of a benchmark: one result file per unit of work, then JSON, Markdown and figures.

    An interrupted run is continued; a unit that is finished is not run again.
    """
    from gyronorth.cli.outputs import check_drawing
    from gyronorth.files import no_empty_folder
    from gyronorth.many.workers import executor_on
    from gyronorth.report.study_figures import write_study_figures
    from gyronorth.studies.benchmark import left_out, run_benchmark, shortened, studies_of
    from gyronorth.studies.expected import Remaining
    from gyronorth.studies.expected import told as told_before
    from gyronorth.studies.source import passed_over_text
    from gyronorth.studies.study import SELECTIONS, StudyPlan

    check_drawing("gyronorth benchmark")
    values: dict[str, Any] = {
        "seed": seed,
        "splits": splits,
        "network_splits": network_splits,
        "seeds": seeds,
        "epochs": epochs,
        "selection": selection.value,
    }
    values["data"] = None if data is None else str(data)
    plan = StudyPlan(
        **{field.name: values[field.name] for field in fields(StudyPlan) if values[field.name] is not None}
    )
    chosen = studies_of(name, tuple(study or ()))
    for one in chosen:
        one.recordings(plan)  # both refuse before any work
    passed_over = plan.source().get("data", {}).get("passed_over") if chosen[0].on_recordings else None
    told = [passed_over_text(passed_over) if passed_over else ""]
    told += [SELECTIONS[plan.selection], plan.cut_short(), shortened(chosen, plan)] if name == "paper" else []
    for line in filter(None, told):
        typer.echo(line.replace("**", ""), err=True)
    jobs = {}
    if name == "paper":
        jobs = {one.name: one.units(one.plan_of(plan)) for one in chosen}
        typer.echo(told_before([job for some in jobs.values() for job in some], output, workers), err=True)
        if others := left_out(name, tuple(study or ())):
            typer.echo(f"Left out for their cost; --study NAME runs them: {', '.join(others)}.", err=True)
    with (
        no_empty_folder(output),
        executor_on(scheduler, workers=workers) as executor,
        units_done() as display,
    ):
        remaining = Remaining(jobs, output) if name == "paper" else None

        def progress(of: str, finished: int, total: int) -> None:
            display(of, finished, total)
            line = remaining.line(of, finished, total) if remaining and not sys.stderr.isatty() else None
            if line:
                typer.echo(line, err=True)

        try:
            spent = {"spent": remaining.spent} if remaining else {}
            written = run_benchmark(
                name, output, executor, only=tuple(study or ()), plan=plan, progress=progress, **spent
            )
        except KeyboardInterrupt:
            if (output / "units").is_dir():
                typer.echo(f"{output} keeps what is finished; the same command goes on with it.", err=True)
            raise
        finally:
            if remaining and (balance := remaining.balance()):
                typer.echo(balance, err=True)
    for path in (*written, *write_study_figures(output)):
        typer.echo(str(path))
