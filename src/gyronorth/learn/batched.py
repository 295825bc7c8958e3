"""Many heading networks trained at once, one on each split: for studies over many splits.

The networks are those of `learn.stages.train_heading` in the flattened layout, with the same first weights,
order of the examples, dropout and validation, each drawn from its own generator; their weights are stacked, so
that one product serves all. Every network runs through all epochs, and three of them are kept of each.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from gyronorth.learn.recurrent import BiLSTM
from gyronorth.learn.regressor import HeadingNetwork, heading_deg
from gyronorth.learn.settings import Settings
from gyronorth.learn.stages import HeadingParts, TrainedDenoiser, heading_generator, new_heading
from gyronorth.learn.training import decay, torch_threads

#: What chooses the epoch: the validation part, with early stopping as `training.fit` does; the test part, of all
#: epochs; nothing, the last one of all.
CHOICES = ("validation", "test", "last")


#: Recordings that are denoised together at least: products of fewer than four rows are rounded otherwise.
PILE = 8


@dataclass
class Choice:
    """The outputs of every network at the epoch chosen so far."""

    best: Tensor  # (g,) lowest CRMSE, deg
    epoch: Tensor  # (g,) counted from 1
    test: Tensor  # (g, n, outputs) raw output for the test recordings


@dataclass(frozen=True)
class RememberingDenoiser(TrainedDenoiser):
    """A denoiser that cleans no recording twice: the copies of a recording are the same in every split.

    In the flattened layout, which is all that is trained here, what it makes of a recording depends on that
    recording alone, bit by bit in piles of `PILE` and more.
    """

    known: dict[bytes, NDArray[np.float64]] = field(default_factory=dict)

    def clean(self, gyro_l: NDArray[np.float64]) -> NDArray[np.float64]:
        """Denoised angular rate (n, samples, 3), rad/s."""
        keys = [hashlib.sha256(np.ascontiguousarray(one).tobytes()).digest() for one in gyro_l]
        new = {key: row for row, key in enumerate(keys) if key not in self.known}
        if new:
            rows = list(new.values())
            rows += rows[-1:] * (-len(rows) % PILE)
            self.known.update(zip(new, super().clean(gyro_l[rows]), strict=False))
        return np.stack([self.known[key] for key in keys])


@dataclass
class BatchedTraining:
    """What becomes of the networks: one row each."""

    loss: list[list[float]] = field(default_factory=list)  # by epoch, deg
    validation: list[list[float]] = field(default_factory=list)
    test: list[list[float]] = field(default_factory=list)
    chosen: dict[str, Choice] = field(default_factory=dict)  # by `CHOICES`


def train_batched(settings: Sequence[Settings], parts: Sequence[HeadingParts]) -> BatchedTraining:
    """Train a heading network on each of the prepared data sets.

    Parameters
    ----------
    settings : sequence of Settings
        One a network; they may differ in the seed only.
    parts : sequence of HeadingParts
        Network inputs with their headings, of equal sizes, each with a test part.

    Raises
    ------
    ValueError
        If the layout is not flattened, or settings or sizes differ.
    """
    one = settings[0]
    if one.layout != "flattened" or any(s.model_copy(update={"seed": one.seed}) != one for s in settings):
        raise ValueError("Only flattened networks whose settings differ in the seed alone are trained together.")
    generators = [heading_generator(s) for s in settings]
    weights = _stacked([new_heading(s, g) for s, g in zip(settings, generators, strict=True)])
    x, y = _data(parts, 0)
    watched = {"validation": _data(parts, 1), "test": _data(parts, 2)}
    part, out = one.heading, BatchedTraining()
    rate = decay(part.rate, part.rate_end, part.epochs)
    optimiser = torch.optim.Adam(weights, lr=part.rate, fused=True)
    row = torch.arange(len(settings))[:, None]
    with torch_threads(one.threads):
        for epoch in range(part.epochs):
            optimiser.param_groups[0]["lr"] = rate(epoch)
            order = torch.stack([torch.randperm(x.shape[1], generator=g) for g in generators])
            total = torch.zeros(len(settings))
            for index in order.split(part.batch, dim=1):
                optimiser.zero_grad()
                loss = _crmse(forward(weights, x[row, index], part.dropout, generators), y[row, index])
                loss.sum().backward()  # each network's own loss: no gradient crosses
                optimiser.step()
                total += loss.detach() * index.shape[1]
            with torch.inference_mode():
                raw = {name: forward(weights, data[0]) for name, data in watched.items()}
            found = {name: _crmse(raw[name], data[1]) for name, data in watched.items()}
            out.loss.append((total / x.shape[1]).tolist())
            out.validation.append(found["validation"].tolist())
            out.test.append(found["test"].tolist())
            _choose(out, epoch, {**found, "last": torch.full_like(total, -epoch)}, raw["test"], part.patience)
    return out


def residuals(parts: HeadingParts) -> HeadingParts:
    """The same data with what the closed form leaves in place of the heading: truth less heading of the mean, deg."""
    mean = [inputs.double().mean(dim=1) for inputs in parts.inputs]
    closed_form = [torch.rad2deg(torch.atan2(-one[:, 1], one[:, 0])) for one in mean]
    left = [torch.remainder(h - c, 360.0).float() for h, c in zip(parts.headings, closed_form, strict=True)]
    return replace(parts, headings=left)


def forward(weights: Sequence[Tensor], x: Tensor, p: float = 0.0, generators: Sequence[torch.Generator] = ()) -> Tensor:
    """Raw outputs (g, n, outputs) of g networks for flattened inputs (g, n, width); with generators: dropout."""
    *layers, head, head_bias = weights
    h = x
    for weight, bias, more in zip(layers[::3], layers[1::3], layers[2::3], strict=True):
        opening, output, cell = torch.baddbmm(bias + more, h, weight).chunk(3, dim=2)
        h = torch.sigmoid(output) * torch.tanh(torch.sigmoid(opening) * torch.tanh(cell))
        if generators and p > 0:
            keep = torch.stack([torch.rand(h.shape[1:], generator=g) for g in generators]) >= p
            h = h * keep / (1 - p)
    return torch.baddbmm(head_bias, h, head)


def _stacked(networks: Sequence[HeadingNetwork]) -> list[Tensor]:
    """Weights (g, inputs, outputs) and biases (g, 1, outputs) of every layer, the gates as `BiLSTM` orders them.

    An LSTM has two biases that are added; the optimiser moves each, so that both are kept.
    """
    layers: list[list[Tensor]] = []
    for network in networks:
        own = []
        for layer in network.recurrent:
            assert isinstance(layer, BiLSTM)
            weight, *biases = layer.gates()
            own += [weight.T, *(bias[None] for bias in biases)]
        layers.append([*own, network.head.weight.T, network.head.bias[None]])
    return [torch.stack(one).detach().contiguous().requires_grad_() for one in zip(*layers, strict=True)]


def _data(parts: Sequence[HeadingParts], which: int) -> tuple[Tensor, Tensor]:
    """Flattened inputs (g, n, width), channel-major, and headings (g, n), deg."""
    x = torch.stack([part.inputs[which].transpose(1, 2).flatten(1) for part in parts])
    return x, torch.stack([part.headings[which] for part in parts])


def _crmse(raw: Tensor, truth: Tensor) -> Tensor:
    """Cyclic root mean square error, deg, of each network, shape (g,): `regressor.crmse_deg`."""
    heading = heading_deg(raw.flatten(0, 1)).unflatten(0, truth.shape)
    wrapped = torch.remainder(heading - truth + 180.0, 360.0) - 180.0
    return torch.sqrt(torch.mean(wrapped**2, dim=1) + 1e-12)


def _choose(out: BatchedTraining, epoch: int, score: dict[str, Tensor], test: Tensor, patience: int) -> None:
    """Keep the outputs of networks that are better than before."""
    if not out.chosen:
        for name in CHOICES:
            worst, none = torch.full_like(score[name], torch.inf), torch.zeros(len(test), dtype=torch.int64)
            out.chosen[name] = Choice(worst, none, torch.full_like(test, torch.nan))
    for name, kept in out.chosen.items():
        better = score[name] < kept.best
        if name == "validation":
            better &= epoch - kept.epoch < patience
        kept.best = torch.where(better, score[name], kept.best)
        kept.epoch = torch.where(better, epoch + 1, kept.epoch)
        kept.test = torch.where(better[:, None, None], test, kept.test)
