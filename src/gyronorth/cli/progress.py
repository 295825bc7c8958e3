"""What is going on, on standard error, and only when that is a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def working(text: str) -> Iterator[None]:
    """A spinner with the time that has passed, gone when the block ends."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        progress.add_task(text, total=None)
        yield


@contextmanager
def share_done(text: str) -> Iterator[Callable[[float], None] | None]:
    """A bar of the share of the work that is done, with the time that remains; it is told the share."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = TextColumn("{task.description}", markup=False), BarColumn(), TaskProgressColumn(), TimeRemainingColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        from gyronorth.report.wording import printable

        task = progress.add_task(printable(text), total=None)
        yield lambda share: progress.update(task, total=1.0, completed=share)


@contextmanager
def reading_file(path: Path, *, doing: str = "reading") -> Iterator[Callable[[float], None] | None]:
    """The same for a file that is read, with its size."""
    size = path.stat().st_size / 1e6 if path.is_file() else 0.0
    with share_done(f"{doing} {path.name}" + (f", {size:.0f} MB" if size >= 10 else "")) as progress:
        yield progress


def files_done(paths: Sequence[Path]) -> Iterator[Path]:
    """The paths one by one, with a bar of how many are done."""
    if not sys.stderr.isatty():
        yield from paths
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from gyronorth.report.wording import printable

    columns = BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), TextColumn("{task.description}", markup=False)
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("", total=len(paths))
        for path in paths:
            progress.update(task, description=printable(path.name))
            yield path
            progress.advance(task)


@contextmanager
def units_done() -> Iterator[Callable[[str, int, int], None]]:
    """A bar per study; call it with the study's name, the units finished and their total."""
    if not sys.stderr.isatty():
        yield lambda *_: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

    columns = TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with Progress(*columns, console=Console(stderr=True)) as progress:
        tasks: dict[str, TaskID] = {}

        def show(study: str, finished: int, total: int) -> None:
            if study not in tasks:
                tasks[study] = progress.add_task(study, total=total)
            progress.update(tasks[study], completed=finished)

        yield show
