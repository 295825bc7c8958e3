"""What is going on, on standard error: a display where that is a terminal, or the time of each step."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

QUIET, NORMAL, VERBOSE = range(3)
#: Verbosity; the options -q and -v of every command set it.
level = NORMAL


def _displayed() -> bool:
    return level == NORMAL and sys.stderr.isatty()


@contextmanager
def _timed(text: str) -> Iterator[None]:
    """One line with the time of a step when it is done, with -v."""
    start = time.perf_counter()
    yield
    if level == VERBOSE:
        print(f"{text}: {time.perf_counter() - start:.3f} s", file=sys.stderr)


@contextmanager
def working(text: str) -> Iterator[None]:
    """A spinner with the time that has passed, gone when the block ends."""
    if not _displayed():
        with _timed(text):
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
    """A bar of the share of the work that is done, with the time that remains; call it with the share."""
    if not _displayed():
        with _timed(text):
            yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = TextColumn("{task.description}", markup=False), BarColumn(), TaskProgressColumn(), TimeRemainingColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        from gyronorth.errors import printable

        task = progress.add_task(printable(text), total=None)
        yield lambda share: progress.update(task, total=1.0, completed=share)


@contextmanager
def reading_file(path: Path, *, doing: str = "reading") -> Iterator[Callable[[float], None] | None]:
    """The same for a file that is read, with its size."""
    size = path.stat().st_size / 1e6 if path.is_file() else 0.0
    with share_done(f"{doing} {path.name}" + (f", {size:.0f} MB" if size >= 10 else "")) as progress:
        yield progress


@contextmanager
def recordings_done(total: int) -> Iterator[Callable[[str], None]]:
    """A bar of how many recordings are done, with their rate and the time that remains; call it with each name."""
    if not _displayed():
        yield lambda _name: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from gyronorth.errors import printable

    rate, name = TextColumn("{task.fields[rate]}"), TextColumn("{task.description}", markup=False)
    columns = BarColumn(), MofNCompleteColumn(), rate, TimeRemainingColumn(), name
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("", total=total, rate="")

        def show(file: str) -> None:
            speed = progress.tasks[0].speed
            told = "" if speed is None else f"{speed:.3g}/s"
            progress.update(task, advance=1, description=printable(file), rate=told)

        yield show


@contextmanager
def units_done() -> Iterator[Callable[[str, int, int], None]]:
    """A bar per study; call it with the study's name, the units finished and their total."""
    if not _displayed():
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
