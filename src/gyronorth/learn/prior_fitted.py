"""A prior-fitted network for the deviation of a unit: trained on simulated swings, it reads a real one at once.

The Gaussian process of `gyronorth.deviation` states a prior and works out what follows from it. A prior-fitted network
(Mueller et al., arXiv 2112.10510) learns the same from examples: swings are drawn from that prior by the thousand, the
network sees the errors of the known headings and says mean and standard deviation of the error at others. With enough
training it gives the answer of the prior itself; the Gaussian process has to approximate where noise is Student-t.

What the prior knows the network need not learn. Headings enter as differences alone, through cos(k d) in the
attention, so a swing turned or mirrored gives the same answer, as does one in another order; errors are divided by
their root mean square.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from gyronorth.deviation import FEWEST, PRIORS, DeviationPrior, error_covariance
from gyronorth.learn.recurrent import initialised
from gyronorth.learn.training import torch_threads

Array = NDArray[np.float64]

#: Widest arc without a known heading in the swings drawn, rad.
_GAP = np.radians(120.0)
#: Log standard deviation of the ratio of the surplus to the errors, whose median is 1: a bias points anywhere.
_SURPLUS = 0.6
#: Features of a recording: `_features`.
_FEATURES = 5


@dataclass(frozen=True)
class PriorFittedSettings:
    """Everything that decides the training."""

    prior: DeviationPrior = PRIORS["learned"]  # of the swings it sees
    seed: int = 0
    width: int = 32
    heads: int = 4
    layers: int = 3
    harmonics: int = 12  # of the heading differences that attention sees
    swings: int = 32  # drawn anew for each step
    asked: int = 24  # headings asked for in each
    most: int = 60  # known headings of a swing: FEWEST to this
    steps: int = 2400
    rate: float = 2e-3  # Adam, falling as a cosine to zero


@dataclass(frozen=True)
class Swings:
    """Simulated swings over the same headings; relative units."""

    heading: Array  # (known + asked,) rad
    surplus: Array  # (known + asked,)
    error: Array  # (swings, known + asked)
    known: int


def draw_swings(prior: DeviationPrior, *, swings: int, known: int, asked: int, rng: np.random.Generator) -> Swings:
    """Swings whose errors have the law that `prior` states, about 1 in size.

    In half of them the known headings are spread evenly, one in each part of the circle; in half an arc of up to
    120 deg has none.
    """
    place = (np.arange(known) + rng.random(known)) / known if rng.random() < 0.5 else rng.random(known)
    gap = _GAP * rng.random() * (rng.random() < 0.5)
    heading = 2 * np.pi * rng.random() + (2 * np.pi - gap) * place
    heading = np.append(heading, 2 * np.pi * rng.random(asked))
    surplus = np.exp(_SURPLUS * rng.standard_normal()) * rng.standard_normal(known + asked)
    law = np.array([prior.noise, prior.curve, prior.length, prior.coupling])
    settings = law[:, 0] * np.exp(law[:, 1] * rng.standard_normal((swings, 4)))
    settings[:, [1, 3]] *= rng.random((swings, 2)) >= prior.absent
    precision = rng.gamma(prior.dof / 2, 2 / prior.dof, (swings, known + asked))
    covariance = error_covariance(heading, surplus, settings, settings[:, :1] ** 2 / precision)
    drawn = np.linalg.cholesky(covariance) @ rng.standard_normal((swings, known + asked, 1))
    return Swings(heading, surplus, drawn[..., 0], known)


class _Block(nn.Module):
    """Attention of all recordings to the known ones, then a small network, each added to what came in."""

    def __init__(self, settings: PriorFittedSettings) -> None:
        super().__init__()
        width, self.heads = settings.width, settings.heads
        self.before, self.between = nn.LayerNorm(width), nn.LayerNorm(width)
        self.query, self.key, self.value = (nn.Linear(width, width) for _ in range(3))
        self.near = nn.Linear(width, settings.heads * settings.harmonics)
        self.out = nn.Linear(width, width)
        self.wide, self.back = nn.Linear(width, 2 * width), nn.Linear(2 * width, width)

    def forward(self, h: Tensor, difference: Tensor, known: int) -> Tensor:
        """`h` (swings, n, width); `difference` (n, known, harmonics): cosines, the same for all swings."""
        swings, n, width = h.shape
        x = self.before(h)
        query = self.query(x).unflatten(2, (self.heads, -1)).transpose(1, 2)
        key, value = (
            part(x[:, :known]).unflatten(2, (self.heads, -1)).transpose(1, 2) for part in (self.key, self.value)
        )
        near = self.near(x).unflatten(2, (self.heads, -1)).permute(1, 0, 2, 3).flatten(1, 2)  # (n, swings heads, k)
        near = (near @ difference.transpose(1, 2)).unflatten(1, (swings, self.heads)).permute(1, 2, 0, 3)
        weight = torch.softmax(query @ key.transpose(2, 3) / math.sqrt(width / self.heads) + near, dim=-1)
        h = h + self.out((weight @ value).transpose(1, 2).reshape(swings, n, width))
        return h + self.back(nn.functional.silu(self.wide(self.between(h))))


class PriorFitted(nn.Module):
    """Known recordings and headings asked for to mean and standard deviation of the errors there."""

    def __init__(self, settings: PriorFittedSettings) -> None:
        super().__init__()
        self.harmonics = settings.harmonics
        self.enter = nn.Linear(_FEATURES, settings.width)
        self.blocks = nn.ModuleList([_Block(settings) for _ in range(settings.layers)])
        self.last, self.leave = nn.LayerNorm(settings.width), nn.Linear(settings.width, 2)

    def forward(self, heading: Tensor, surplus: Tensor, error: Tensor) -> tuple[Tensor, Tensor]:
        """Mean and standard deviation, each (swings, asked), in the unit of `error`.

        Parameters
        ----------
        heading, surplus : Tensor, shape (n,)
            Of the known recordings and then of those asked for; rad.
        error : Tensor, shape (swings, known)
            Of the known ones.
        """
        known = error.shape[1]
        scale = torch.sqrt((error**2).mean(dim=1, keepdim=True)) + 1e-12
        order = torch.arange(1, self.harmonics + 1)
        difference = torch.cos((heading[:, None] - heading[:known])[..., None] * order).float()
        h = self.enter(_features(error / scale, surplus / scale))
        for block in self.blocks:
            h = block(h, difference, known)
        mean, width = self.leave(self.last(h[:, known:])).unbind(dim=2)
        return scale * mean, scale * torch.exp(width.clamp(-5, 3))


def _features(error: Tensor, surplus: Tensor) -> Tensor:
    """What the network sees of a recording (swings, n, 5): error twice, surplus, whether known, how many are."""
    known = error.shape[1]
    seen = nn.functional.pad(error, (0, surplus.shape[1] - known))
    flag = torch.zeros_like(surplus)
    flag[:, :known] = 1.0
    count = torch.full_like(surplus, math.log(known) - 3.0)
    return torch.stack([torch.asinh(seen), seen.clamp(-4, 4), torch.asinh(surplus), flag, count], dim=2).float()


@dataclass(frozen=True)
class Stage:
    """A training at some step: whole, so that going on from it is the same as never having stopped."""

    step: int
    arrays: Mapping[str, NDArray]  # network and optimiser
    loss: tuple[float, ...]  # mean of every hundred steps


def train_to(settings: PriorFittedSettings, step: int, start: Stage | None = None) -> Stage:
    """Train from the beginning, or from a stage, to a step; the loss is the Gaussian negative log likelihood."""
    network = built(settings)
    optimiser = torch.optim.Adam(network.parameters(), lr=settings.rate, fused=True)
    first, told = 0, []
    if start is not None:
        first, told = start.step, list(start.loss)
        _restore(network, optimiser, start.arrays)
    total = 0.0
    with torch_threads(1):
        for now in range(first, step):
            optimiser.param_groups[0]["lr"] = settings.rate * 0.5 * (1 + math.cos(math.pi * now / settings.steps))
            optimiser.zero_grad()
            loss = _loss(network, settings, now)
            loss.backward()
            nn.utils.clip_grad_norm_(network.parameters(), 1.0)
            optimiser.step()
            total += loss.item()
            if now % 100 == 99:
                told.append(total / 100)
                total = 0.0
    return Stage(step, _arrays(network, optimiser), tuple(told))


def built(settings: PriorFittedSettings) -> PriorFitted:
    """The network before any training."""
    network = initialised(lambda: PriorFitted(settings), torch.Generator().manual_seed(settings.seed))
    assert isinstance(network, PriorFitted)
    for module in network.modules():
        if isinstance(module, nn.LayerNorm):
            module.reset_parameters()
    return network


def trained(settings: PriorFittedSettings, stage: Stage) -> PriorFitted:
    """The network of a stage."""
    network = built(settings)
    _restore(network, None, stage.arrays)
    return network.eval()


def predict(
    network: PriorFitted, heading: Array, surplus: Array, error: Array, at: Array, at_surplus: Array
) -> tuple[Array, Array]:
    """Expected error of the closed form and its standard deviation, rad, each (m,): as `DeviationModel.predict`.

    Parameters
    ----------
    heading, surplus, error : ndarray, shape (n,)
        Of the known recordings: heading of the mean rate, surplus, error of the closed form; rad.
    at, at_surplus : ndarray, shape (m,)
        Of those to correct; a surplus beyond the known range is taken at its end.
    """
    at_surplus = np.clip(at_surplus, surplus.min(), surplus.max())
    both = (np.concatenate(pair) for pair in ((heading, at), (surplus, at_surplus)))
    with torch.no_grad():
        found = network(*(torch.from_numpy(one) for one in both), torch.from_numpy(error)[None])
    mean, sigma = (one[0].double().numpy() for one in found)
    return mean, sigma


def _loss(network: PriorFitted, settings: PriorFittedSettings, step: int) -> Tensor:
    rng = np.random.default_rng([settings.seed, step])
    known = int(rng.integers(FEWEST, settings.most + 1))
    drawn = draw_swings(settings.prior, swings=settings.swings, known=known, asked=settings.asked, rng=rng)
    heading, surplus, error = (torch.from_numpy(one) for one in (drawn.heading, drawn.surplus, drawn.error))
    mean, sigma = network(heading, surplus, error[:, :known])
    scale = torch.sqrt((error[:, :known] ** 2).mean(dim=1, keepdim=True))
    return (0.5 * ((error[:, known:] - mean) / sigma) ** 2 + torch.log(sigma / scale)).mean().float()


def _arrays(network: nn.Module, optimiser: torch.optim.Optimizer) -> dict[str, NDArray]:
    arrays = {}
    for name, parameter in network.named_parameters():
        arrays[f"weight {name}"] = parameter.detach().numpy().copy()
        for key, value in optimiser.state[parameter].items():
            arrays[f"{key} {name}"] = value.numpy().copy()
    return arrays


def _restore(network: nn.Module, optimiser: torch.optim.Optimizer | None, arrays: Mapping[str, NDArray]) -> None:
    with torch.no_grad():
        for name, parameter in network.named_parameters():
            parameter.copy_(torch.from_numpy(arrays[f"weight {name}"]))
            if optimiser is not None:
                keys = ("step", "exp_avg", "exp_avg_sq")
                optimiser.state[parameter] = {key: torch.tensor(arrays[f"{key} {name}"]) for key in keys}
