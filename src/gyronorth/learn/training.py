"""The training loop: epochs, early stopping, checkpoints that a kill at any moment cannot harm."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from gyronorth.errors import InputError
from gyronorth.files import written_beside
from gyronorth.learn.recurrent import held_gates


@dataclass(frozen=True)
class Task:
    """What the loop needs to know of one training."""

    name: str
    network: nn.Module
    items: int  # training examples
    batch: int
    epochs: int  # at most
    patience: int  # epochs without a better validation loss before it stops
    rate: Callable[[int], float]  # learning rate of an epoch, 0, 1, ...
    loss: Callable[[Tensor, torch.Generator], Tensor]  # of the examples with these indices
    validate: Callable[[], float]  # validation loss
    watch: Callable[[], dict[str, float]] = dict  # more figures for the history; nothing is decided by them
    last: bool = False  # all epochs are run and the last one is kept, whatever the validation loss


@dataclass
class Progress:
    """State of a training beside the weights: epochs done, the history, the best epoch."""

    history: list[dict[str, float]] = field(default_factory=list)  # one entry an epoch
    best: float = math.inf  # lowest validation loss
    best_epoch: int = 0  # counted from 1; 0 is before the first
    finished: bool = False

    @property
    def epoch(self) -> int:
        """Epochs done."""
        return len(self.history)


def fit(
    task: Task,
    *,
    generator: torch.Generator,
    checkpoint: Path | None = None,
    fingerprint: str = "",
    report: Callable[[Progress], None] | None = None,
) -> Progress:
    """Train until the validation loss has stopped falling; leave the best weights in the network.

    Or, where the task says `last`, through all epochs.

    Every draw, of the order of the data, noise and dropout, comes from `generator`. Network,
    optimiser, generator and history are saved after each epoch, so that a run that was killed
    and continued from its checkpoint ends in the same weights, bit by bit, on the same machine
    and number of threads; at most the running epoch is lost. A checkpoint there is continued.
    A loss that is no longer finite ends the training.

    Raises
    ------
    InputError
        If the checkpoint belongs to other settings or data (`fingerprint`).
    """
    network, progress, state = task.network, Progress(), None
    best = _weights(network)
    if checkpoint is not None and checkpoint.is_file():
        state = read_checkpoint(checkpoint, fingerprint)
        network.load_state_dict(state["network"])
        generator.set_state(state["generator"])
        best, progress = state["best_network"], Progress(**state["progress"])
    if report is not None:
        report(progress)
    with held_gates(network) as (trained, settle):
        # Fused: one pass over the weights, which otherwise costs more than the gradients.
        optimiser = torch.optim.Adam(trained, lr=task.rate(0), fused=True)
        if state is not None:
            optimiser.load_state_dict(state["optimiser"])
        while not progress.finished:
            loss = _epoch(task, optimiser, task.rate(progress.epoch), generator)
            settle()
            validation = task.validate()
            if task.last or validation < progress.best:
                progress.best, progress.best_epoch = validation, progress.epoch + 1
                best = _weights(network)
            entry = {"loss": loss, "validation": validation, **task.watch(), "rate": task.rate(progress.epoch)}
            progress.history.append(entry)
            waited = progress.epoch - progress.best_epoch
            finite = math.isfinite(loss) and math.isfinite(validation)
            progress.finished = progress.epoch >= task.epochs or waited >= task.patience or not finite
            if checkpoint is not None:
                state = {
                    "network": network.state_dict(),
                    "optimiser": optimiser.state_dict(),
                    "generator": generator.get_state(),
                    "best_network": best,
                    "progress": vars(progress),
                    "fingerprint": fingerprint,
                }
                held = io.BytesIO()  # PyTorch tells a full disk as a fault of its own
                torch.save(state, held)
                with written_beside(checkpoint, durable=True) as beside:
                    beside.write_bytes(held.getbuffer())
            if report is not None:
                report(progress)
    network.load_state_dict(best)
    return progress


def _weights(network: nn.Module) -> dict[str, Tensor]:
    return {name: value.clone() for name, value in network.state_dict().items()}


def _epoch(task: Task, optimiser: torch.optim.Optimizer, rate: float, generator: torch.Generator) -> float:
    for group in optimiser.param_groups:
        group["lr"] = rate
    total = 0.0
    for index in torch.randperm(task.items, generator=generator).split(task.batch):
        optimiser.zero_grad()
        loss = task.loss(index, generator)
        loss.backward()
        optimiser.step()
        total += loss.item() * len(index)
    return total / task.items


def decay(start: float, end: float | None, epochs: int) -> Callable[[int], float]:
    """Learning rate start gamma^t with gamma = (end / start)^(1 / epochs) (eq:23, eq:24); constant if `end` is None."""
    if end is None:
        return lambda _epoch: start
    return lambda epoch: start * (end / start) ** (epoch / epochs)


def read_checkpoint(path: Path, fingerprint: str) -> dict[str, Any]:
    """A checkpoint of `fit`; tensors and plain values only, never code.

    Raises
    ------
    InputError
        If it is damaged, or belongs to other settings or data.
    """
    try:
        state = torch.load(path, weights_only=True)
        written = state["fingerprint"]
    except Exception as error:  # of a damaged file PyTorch raises almost any
        raise InputError(
            f"{path} cannot be read ({type(error).__name__}): it is damaged, or no checkpoint of gyronorth. "
            "Remove it and train again."
        ) from None
    if written != fingerprint:
        raise InputError(
            f"{path} belongs to a training with other settings, data or code. Resume with the same ones, or give "
            "another output folder."
        )
    return state


@contextmanager
def torch_threads(count: int) -> Iterator[None]:
    """Let PyTorch use `count` threads, then as many as before."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)
