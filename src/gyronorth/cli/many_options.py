"""Options shared by the commands that take many recordings."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gyronorth.cli.options import OUTPUT
from gyronorth.frozen import frozen

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from gyronorth.many.table import TableWriter
    from gyronorth.sources.listing import Item

#: Panel of the help text.
MANY = "Many recordings"


def window_steps(text: str) -> tuple[float, float]:
    """LENGTH or LENGTH:STEP in seconds as (length, step)."""
    length_text, _, step_text = text.partition(":")
    try:
        length = float(length_text)
        step = float(step_text) if step_text else length
    except ValueError:
        length = step = inf
    if not (0 < length < inf and 0 < step < inf):
        raise typer.BadParameter(f"{text!r} is not LENGTH or LENGTH:STEP in seconds; example: 300:60")
    return length, step


def worker_count(text: str) -> int:
    """A whole number of processes, at least 1."""
    if not (text.isascii() and text.isdigit() and int(text) > 0):
        raise typer.BadParameter(f"{text!r} is not a number of processes of at least 1; example: 4")
    return int(text)


Sources = Annotated[
    list[str],
    typer.Argument(
        metavar="SOURCE...",
        help="Recordings, folders of them, patterns such as 'data/**/*.csv', URLs, lists as @files.txt.",
    ),
]
Workers = Annotated[
    Any,
    typer.Option(metavar="N", parser=worker_count, help="Work in N processes of this machine.", rich_help_panel=MANY),
]
Scheduler = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Work on the Dask cluster of this scheduler.", rich_help_panel=MANY),
]
Resume = Annotated[
    bool,
    typer.Option("--resume", help="Continue the table: compute only missing or changed files.", rich_help_panel=MANY),
]
Out = Annotated[
    Path | None,
    typer.Option(
        metavar="OUT.csv|.parquet",
        help="Write a table, one row per recording.",
        rich_help_panel=MANY,
    ),
]
Windows = Annotated[
    Any,
    typer.Option(
        metavar="LENGTH[:STEP]",
        parser=window_steps,
        help="Compute a heading for each window of LENGTH seconds, STEP apart.",
        rich_help_panel=OUTPUT,
    ),
]


@frozen
class Place:
    """Where the work is done."""

    scheduler: str | None
    workers: int | None

    @contextmanager
    def executor(self) -> Iterator[Executor | None]:
        """Local processes, a cluster, or None for this process."""
        from gyronorth.errors import InputError

        if self.scheduler is None and self.workers in (None, 1):
            yield None
            return
        if self.scheduler is not None and self.workers is not None:
            raise InputError("--workers are processes of this machine; --scheduler has its own. Give one of them.")
        from gyronorth.many.workers import executor_on

        with executor_on(self.scheduler, workers=self.workers) as executor:
            yield executor


@contextmanager
def kept_table(path: Path, settings: str, resume: bool, columns: Sequence[str]) -> Iterator[TableWriter]:
    """The table that is kept; an interruption tells how to go on."""
    from gyronorth.many.table import table

    with table(path, settings, resume=resume, columns=columns) as rows:
        try:
            yield rows
        except KeyboardInterrupt:
            typer.echo(f"{path}.partial keeps what is finished; --resume goes on with it.", err=True)
            raise


def without_table(table: Path, items: Sequence[Item]) -> list[Item]:
    """The recordings without the table that an earlier run left among them; another file in its place is refused."""
    from gyronorth.errors import InputError
    from gyronorth.sources.tables import is_table

    place = os.path.realpath(table)
    others = [
        item for item in items if Path(item.address).name != table.name or os.path.realpath(item.address) != place
    ]
    if len(others) < len(items) and not (others and is_table(table)):
        raise InputError(f"{table} is one of the recordings that are read; choose another name.")
    return others
