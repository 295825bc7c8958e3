"""Training of `learned`: recordings of the reference mix drawn afresh for every batch.

`python -m gyronorth.learn.disturbed [FOLDER]` makes the bundle that ships with the package again
(the default folder is `bundles/learned`); an interrupted run is continued.
"""

from __future__ import annotations

import math
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from gyronorth.alignment.proposals import frequency_grid
from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR
from gyronorth.disturbance import DEG, Draw
from gyronorth.learn.proposal import Proposal
from gyronorth.learn.training import Task, fit

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DisturbedSettings:
    """Everything that decides the training."""

    seed: int = 20240612
    rate_hz: float = 3.0
    #: Lengths of the recordings in samples, one drawn for each batch: 30 to 300 s.
    samples: tuple[int, ...] = (90, 120, 150, 200, 240, 300, 300, 300, 300, 300, 450, 600, 900)
    white: tuple[float, float] = (0.01, 0.05)  # angle random walk, log-uniform, deg/sqrt(h)
    knocks: float = 0.2  # share of the batches with knocks beside bumps
    batch: int = 48  # recordings of 300 samples; longer ones are fewer
    batches: int = 100  # an epoch
    epochs: int = 60
    rate: float = 2e-3  # Adam, falling as a cosine to zero
    hidden: int = 32


@dataclass(frozen=True)
class Batch:
    """Simulated recordings of one length with what disturbed them."""

    rate: Tensor  # (n, samples, 3) in units of noise, less the median
    index: Tensor  # (samples,)
    cycles: Tensor  # (f,)
    bump: Tensor  # (n, samples) 1 within a bump or knock
    tone: Tensor  # (n, 2) number of the nearest frequency
    present: Tensor  # (n, 2) 1 where there is that tone


def draw_batch(settings: DisturbedSettings, size: int, *, samples: int, rng: np.random.Generator) -> Batch:
    """Recordings of the reference mix with white noise and no heading: constants are taken away."""
    edges = np.arange(samples + 1) / settings.rate_hz
    draw = Draw(size, edges, rng)
    frequency = np.stack([draw.log_uniform(0.008, 0.3) for _ in range(2)], axis=1)
    present = rng.random((size, 2)) < 0.7
    angle = sum(
        draw.sine(draw.half_normal(0.002 * DEG) * present[:, [i]], frequency[:, i]) for i in range(2)
    )
    struck = draw.bumps(0)
    if rng.random() < settings.knocks:
        struck = struck + draw.knocks(0)
    low, high = np.log(settings.white)
    noise = np.exp(rng.uniform(low, high, (size, 1, 1))) * DEG_PER_SQRT_HOUR * np.sqrt(settings.rate_hz)
    settled = (rng.random((size, 1, 1)) < 0.8) * draw.warm_up()
    rate = np.diff(angle + struck + settled, axis=1) * settings.rate_hz
    rate = rate / noise + rng.standard_normal(rate.shape)
    moved = np.abs(np.diff(struck, axis=1)).max(axis=2) * settings.rate_hz
    index, cycles = frequency_grid(samples, settings.rate_hz)
    spacing = cycles[1] - cycles[0]
    cell = np.clip(np.round((frequency / settings.rate_hz - cycles[0]) / spacing), 0, len(cycles) - 1)
    return Batch(
        torch.as_tensor(rate - np.median(rate, axis=1, keepdims=True), dtype=torch.float32),
        torch.as_tensor(index),
        torch.as_tensor(cycles),
        torch.as_tensor(moved > 0.3 * noise[:, :, 0], dtype=torch.float32),
        torch.as_tensor(cell, dtype=torch.int64),
        torch.as_tensor(present, dtype=torch.float32),
    )


def loss_of(network: Proposal, batch: Batch) -> Tensor:
    """Cross entropy of the bumps plus that of each tone's cell, nats a recording and sample or tone."""
    bump, tone = network(batch.rate, batch.index, batch.cycles)
    struck = functional.binary_cross_entropy_with_logits(bump, batch.bump)
    log_weight = torch.log_softmax(tone, dim=1)
    each = -log_weight.gather(1, batch.tone) * batch.present
    return 10 * struck + each.sum() / batch.present.sum().clamp(min=1)


def train(settings: DisturbedSettings, *, checkpoint: Path | None = None, report=None) -> tuple[Proposal, object]:
    """Train the network; the weights with the lowest loss on fixed validation recordings are kept."""
    torch.manual_seed(settings.seed)
    network = Proposal(settings.hidden)
    held = [
        draw_batch(settings, 200, samples=n, rng=np.random.default_rng([settings.seed, n])) for n in (90, 300, 300, 900)
    ]

    def loss(index: Tensor, generator: torch.Generator) -> Tensor:
        seed = int(torch.randint(2**62, (1,), generator=generator))
        rng = np.random.default_rng(seed)
        samples = int(rng.choice(settings.samples))
        size = max(8, round(len(index) * 300 / max(samples, 200)))
        return loss_of(network, draw_batch(settings, size, samples=samples, rng=rng))

    def validate() -> float:
        with torch.no_grad():
            return float(np.mean([loss_of(network, batch).item() for batch in held]))

    task = Task(
        name="proposal",
        network=network,
        items=settings.batch * settings.batches,
        batch=settings.batch,
        epochs=settings.epochs,
        patience=settings.epochs,
        rate=lambda epoch: settings.rate * (0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * epoch / settings.epochs))),
        loss=loss,
        validate=validate,
    )
    generator = torch.Generator().manual_seed(settings.seed)
    progress = fit(task, generator=generator, checkpoint=checkpoint, fingerprint=repr(settings), report=report)
    return network, progress
