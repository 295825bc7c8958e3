"""A task for each of many recordings: the bar, the rows that are kept and printed, the summary, the exit code."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, TextIO

import typer

from gyronorth.cli.many_options import Place, kept_table, without_table
from gyronorth.cli.outputs import check_outputs, print_json, written
from gyronorth.cli.progress import recordings_done

TABLE_SUFFIXES = (".csv", ".parquet", ".pq")
#: Most rows that are printed; of more, the summary alone.
SHOWN = 500


def run_many(
    items: Sequence[Any],
    task: Any,
    place: Place,
    *,
    columns: Sequence[str],
    tally: Any,
    show: Callable[[Sequence[Any], TextIO], None],
    as_json: bool,
    kept: Path | None,
    resume: bool,
) -> int:
    """One row or more for each recording, one that failed with its error.

    Parameters
    ----------
    items : sequence of Item
        The recordings.
    task : HeadingTask, or one of `gyronorth.many.tasks`
        What is done with each.
    place : Place
        Where.
    columns : sequence of str
        Of the table, with `STAMPS` behind them.
    tally : Tally or Counts
        Counts what became of them.
    show : callable
        Prints the outcomes of some.
    as_json : bool
        Print all as one JSON array instead.
    kept : Path, optional
        The table that is kept.
    resume : bool
        Go on with it.
    """
    from gyronorth.many.headings import Work, outcomes_of

    if kept is not None:
        items = without_table(kept, items)
    settings = task.settings()
    work = Work(task, settings, checksums=kept is not None)
    found = []  # one document or row for each; no estimate is kept
    with ExitStack() as stack:
        rows = None if kept is None else stack.enter_context(kept_table(kept, settings, resume, columns))
        executor = stack.enter_context(place.executor())
        done = stack.enter_context(recordings_done(len(items)))
        for item, outcomes in outcomes_of(items, work, executor, None if rows is None else rows.done()):
            if rows is not None:
                rows.add(outcomes)
            tally.add(outcomes)
            if as_json or len(found) <= SHOWN:
                found += [(item.name, outcome) for outcome in outcomes]
            done(item.name)
        if rows is not None:
            rows.finish([item.name for item in items])
            tally = tally.of(rows)
    order = {item.name: number for number, item in enumerate(items)}
    shown = [outcome for _, outcome in sorted(found, key=lambda pair: order[pair[0]])]
    if as_json:
        print_json([outcome.document() for outcome in shown])
        return tally.exit_code()
    if len(shown) <= SHOWN and shown:
        show(shown, sys.stdout)
    typer.echo(tally.summary(), err=True)
    if kept is not None:
        written(kept)
    return tally.exit_code()


def several(sources: Sequence[str], *, resume: bool) -> bool:
    """Whether these are many recordings, or one is treated as many."""
    from gyronorth.sources.listing import names_one

    return len(sources) > 1 or resume or not names_one(sources[0])


def run_files(
    sources: Sequence[str],
    task: Any,
    place: Place,
    *,
    columns: Sequence[str],
    shown: Sequence[str],
    what: str,
    as_json: bool,
    out: Path | None,
    resume: bool,
) -> int:
    """`run_many` for a task with one plain row for each file, of which the columns `shown` are printed."""
    from gyronorth.errors import InputError
    from gyronorth.many.table import STAMPS
    from gyronorth.many.tally import Counts
    from gyronorth.report.terminal import print_files
    from gyronorth.sources.listing import recordings

    check_outputs({"--out": (out, TABLE_SUFFIXES)})
    if resume and (out is None or as_json):
        raise InputError("--resume goes on with a table: add --out FILE, and leave --json out.")
    items = recordings(sources)
    if hasattr(task, "check"):
        task.check(items)
    return run_many(
        items,
        task,
        place,
        columns=(*columns, *STAMPS),
        tally=Counts(what),
        show=lambda outcomes, stream: print_files(shown, outcomes, stream),
        as_json=as_json,
        kept=out,
        resume=resume,
    )
