"""Logs of a training: JSON lines, TensorBoard, and a progress bar."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from gyronorth.files import write_text
from gyronorth.learn.training import Progress


@contextmanager
def training_log(folder: Path | None, name: str, *, epochs: int, bar: bool) -> Iterator[Callable[[Progress], None]]:
    """What `fit` reports to, for the stage `name`.

    Writes `<name>.jsonl` and TensorBoard events in `folder`, one entry an epoch; a resumed
    training first brings both back to the epochs of its checkpoint. Shows a bar with the
    remaining time on the terminal if `bar`.
    """
    with ExitStack() as stack:
        reports = []
        if folder is not None:
            reports.append(stack.enter_context(_files(folder, name)))
        if bar:
            reports.append(stack.enter_context(_bar(name, epochs)))

        def report(progress: Progress) -> None:
            for one in reports:
                one(progress)

        yield report


@contextmanager
def _files(folder: Path, name: str) -> Iterator[Callable[[Progress], None]]:
    from torch.utils.tensorboard import SummaryWriter

    path = folder / f"{name}.jsonl"
    started = time.monotonic()
    writer: SummaryWriter | None = None
    before: dict[int, str] = {}

    def line(epoch: int, progress: Progress) -> str:
        entry = {"epoch": epoch, **progress.history[epoch - 1], "seconds": round(time.monotonic() - started, 3)}
        return json.dumps(entry) + "\n"

    def report(progress: Progress) -> None:
        nonlocal writer
        if writer is None:  # first call: before the first epoch, or resumed
            if path.is_file() and progress.epoch:
                before.update(_complete_lines(path))
            kept = [before.get(epoch) or line(epoch, progress) for epoch in range(1, progress.epoch + 1)]
            write_text(path, "".join(kept))
            writer = SummaryWriter(str(folder / "tensorboard" / name), purge_step=progress.epoch + 1)
            return
        with open(path, "a", encoding="utf-8") as handle:
            handle.write(line(progress.epoch, progress))
        for key, value in progress.history[-1].items():
            writer.add_scalar(f"{name}/{key}", value, progress.epoch)

    try:
        yield report
    finally:
        if writer is not None:
            writer.close()


def _complete_lines(path: Path) -> dict[int, str]:
    """Lines of a log by epoch; a line cut short by a kill is left out."""
    found = {}
    for text in path.read_text(encoding="utf-8").splitlines(keepends=True):
        if text.endswith("}\n"):
            found[int(json.loads(text)["epoch"])] = text
    return found


@contextmanager
def _bar(name: str, epochs: int) -> Iterator[Callable[[Progress], None]]:
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as RichProgress

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with RichProgress(*columns) as rich:
        task = rich.add_task(name, total=epochs)

        def report(progress: Progress) -> None:
            text = name
            if progress.history:
                last = progress.history[-1]
                text = f"{name}: loss {last['loss']:.4g}, validation {last['validation']:.4g}, best {progress.best:.4g}"
            total = progress.epoch if progress.finished else epochs
            rich.update(task, completed=progress.epoch, total=total, description=text)

        yield report
