"""A conditional flow over the error of a level recording's rate, trained on simulation: diffusion where it could help.

Of a recording the median of each axis is taken off. What is left, x, does not know the heading; it knows the
disturbance, and with it something of the error v of that median. The law p(v | x) is learned as the flow of a
differential equation from a normal law to it (flow matching: Lipman et al., arXiv 2210.02747), which is the
deterministic form of a diffusion model, and which gives densities, not samples alone. Where v is known in law so is
the heading psi: the Earth's horizontal rate lies on a circle, and p(psi | recording) is p(median - E(psi) | x).

The flow runs in coordinates that a first network, with a normal law, has centred and scaled.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR, mean_direction
from gyronorth.earth import EARTH_RATE
from gyronorth.learn.recurrent import initialised
from gyronorth.learn.training import torch_threads
from gyronorth.simulation.disturbance import draw_disturbance

Array = NDArray[np.float64]

#: Steps of the differential equation, by the midpoint rule, and headings at which the density is asked for.
STEPS, HEADINGS = 10, 360
#: Standard deviations at which what the flow learns from is cut.
_FINITE = 30.0


@dataclass(frozen=True)
class FlowSettings:
    """Everything that decides the training."""

    seed: int = 0
    samples: int = 300
    rate_hz: float = 3.0
    white: float = 0.02  # angle random walk, deg/sqrt(h)
    bias: float = 0.1  # residual bias of a recording, deg/h per axis
    mixed: int = 24000  # recordings of the reference mix
    quiet: int = 4800
    batch: int = 256
    steps: int = 1500  # of the first network
    flow_steps: int = 6000
    rate: float = 1e-3  # Adam, falling as a cosine to zero
    features: int = 128

    @property
    def unit(self) -> float:
        """White noise of a sample, rad/s: the unit of all rates here."""
        return self.white * DEG_PER_SQRT_HOUR * math.sqrt(self.rate_hz)


class Encoder(nn.Module):
    """What a recording (n, samples, 3), less its median and in units of noise, says: features, centre and scale."""

    def __init__(self, samples: int, features: int) -> None:
        super().__init__()
        self.convolve = nn.Sequential(
            nn.Conv1d(6, 48, 7, stride=3, padding=3),
            nn.SiLU(),
            nn.Conv1d(48, 48, 5, stride=2, padding=2),
            nn.SiLU(),
            nn.Conv1d(48, 64, 5, stride=2, padding=2),
            nn.SiLU(),
        )
        size = samples
        for stride in (3, 2, 2):
            size = -(-size // stride)
        self.read = nn.Sequential(nn.Linear(64 * size, 256), nn.SiLU(), nn.Linear(256, features), nn.SiLU())
        self.head = nn.Linear(features, 4)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Features (n, features), centre (n, 2) and scale (n, 2) of v."""
        both = torch.cat([torch.asinh(x), torch.clamp(x, -5, 5) / 3], dim=2).transpose(1, 2)
        features = self.read(self.convolve(both).flatten(1))
        centre, width = self.head(features).chunk(2, dim=1)
        return features, centre, torch.exp(width.clamp(-6, 4))


class Flow(nn.Module):
    """Velocity of a point z (..., 2) at the time t from 0, the normal law, to 1, given the features."""

    def __init__(self, features: int, hidden: int = 64) -> None:
        super().__init__()
        self.given = nn.Linear(features, hidden)
        self.enter = nn.Linear(6, hidden)
        self.middle = nn.Linear(hidden, hidden)
        self.leave = nn.Linear(hidden, 2)

    def forward(self, z: Tensor, t: Tensor, given: Tensor) -> Tensor:
        """`given` is `self.given(features)`, worked out once for all points of a recording."""
        near = z / (1 + z.abs())
        h = torch.cat([z, near, t, t * t], dim=-1)
        h = nn.functional.silu(self.enter(h) + given)
        return self.leave(nn.functional.silu(self.middle(h)))

    def with_divergence(self, z: Tensor, t: Tensor, given: Tensor) -> tuple[Tensor, Tensor]:
        """Velocity (..., 2) and its divergence (...), by the chain rule."""
        near, slope = z / (1 + z.abs()), (1 + z.abs()) ** -2
        first = self.enter(torch.cat([z, near, t, t * t], dim=-1)) + given
        second = self.middle(nn.functional.silu(first))
        bent = nn.functional.silu(second)
        divergence = torch.zeros(z.shape[:-1])
        for axis in range(2):
            moved = self.enter.weight[:, axis] + slope[..., axis, None] * self.enter.weight[:, 2 + axis]
            moved = _silu_slope(second) * ((_silu_slope(first) * moved) @ self.middle.weight.T)
            divergence = divergence + moved @ self.leave.weight[axis]
        return self.leave(bent), divergence


def _silu_slope(x: Tensor) -> Tensor:
    """Derivative of x sigmoid(x)."""
    rise = torch.sigmoid(x)
    return rise * (1 + x * (1 - rise))


@dataclass(frozen=True)
class TrainedFlow:
    """Both networks and what they were trained with."""

    encoder: Encoder
    flow: Flow
    settings: FlowSettings
    loss: dict[str, list[float]]  # of each network, every hundred steps

    def log_density(self, gyro_l: Array, latitude: float, *, normal: bool = False) -> Array:
        """Logarithm of the density of the heading at `headings()`, up to a constant, shape (n, HEADINGS).

        Parameters
        ----------
        gyro_l : ndarray, shape (n, samples, 3)
            Level angular rate, rad/s.
        latitude : float
            rad
        normal : bool
            By the first network's normal law alone, without the flow.
        """
        rate, median = _noise_units(gyro_l, self.settings)
        psi, circle = headings(), EARTH_RATE * math.cos(latitude) / self.settings.unit
        earth = circle * np.stack([np.cos(psi), -np.sin(psi)], axis=1)
        v = torch.from_numpy(median[:, None, :2] - earth).float()
        with torch.no_grad():
            features, centre, scale = self.encoder(rate)
            z = (v - centre[:, None]) / scale[:, None]
            if normal:
                return (-0.5 * (z**2).sum(dim=2)).double().numpy()
            return flow_log_density(self.flow, z, features).double().numpy()


def headings() -> Array:
    """The headings, rad, at which a density is asked for: the middles of even steps around the circle."""
    return np.asarray((np.arange(HEADINGS) + 0.5) * (2 * np.pi / HEADINGS), dtype=np.float64)


def read_headings(log_density: Array) -> tuple[Array, Array, Array]:
    """Mean direction of each density (n, HEADINGS), and the ends, from it, of the shortest arc with 95 %; all rad."""
    mass = np.exp(log_density - log_density.max(axis=1, keepdims=True))
    mass /= mass.sum(axis=1, keepdims=True)
    psi, step = headings(), 2 * np.pi / HEADINGS
    mean = mean_direction(psi, mass)
    # From the point opposite the mean once around: no arc need cross it.
    first = np.floor((mean + np.pi) / step).astype(int) % HEADINGS
    turned = np.take_along_axis(mass, (first[:, None] + np.arange(HEADINGS)) % HEADINGS, axis=1)
    edges = np.concatenate([np.zeros((len(mass), 1)), np.cumsum(turned, axis=1)], axis=1)
    low, high = np.empty(len(mass)), np.empty(len(mass))
    for k, edge in enumerate(edges):
        end = np.interp(edge + 0.95, edge, np.arange(HEADINGS + 1), right=np.inf)
        best = int(np.argmin(end - np.arange(HEADINGS + 1)))
        low[k], high[k] = best, end[best]
    start = first * step - np.pi - mean  # of the first edge, from the mean and between -pi - step and pi
    start = -np.pi + (start + np.pi) % step - step
    return mean, low * step + start, high * step + start


def flow_log_density(flow: Flow, z: Tensor, features: Tensor) -> Tensor:
    """Logarithm of the flow's density at the points z (n, k, 2): back to the normal law, with the trace on the way."""
    given = flow.given(features)[:, None]
    moved, change = z, torch.zeros(z.shape[:-1])
    step = 1.0 / STEPS
    for k in range(STEPS):
        t = 1.0 - (k + 0.5) * step
        velocity = flow(moved, torch.full((*z.shape[:-1], 1), t + 0.5 * step), given)
        middle, time = moved - 0.5 * step * velocity, torch.full((*z.shape[:-1], 1), t)
        velocity, trace = flow.with_divergence(middle, time, given)
        moved, change = moved - step * velocity, change - step * trace
    return change - 0.5 * (moved**2).sum(dim=-1) - math.log(2 * math.pi)


def train_flow(settings: FlowSettings) -> TrainedFlow:
    """Train the encoder with its normal law, then, with the encoder as it is, the flow."""
    generator = torch.Generator().manual_seed(settings.seed)
    encoder = initialised_all(lambda: Encoder(settings.samples, settings.features), generator)
    flow = initialised_all(lambda: Flow(settings.features), generator)
    assert isinstance(encoder, Encoder)
    assert isinstance(flow, Flow)
    rate, error = draw_recordings(settings)

    def of_law() -> Tensor:
        x, v = _some(rate, error, settings.batch, generator)
        _, centre, scale = encoder(x)
        return (0.5 * ((v - centre) / scale) ** 2 + torch.log(scale)).sum(dim=1).mean()

    with torch_threads(1):
        loss = {"normal law": _descended(encoder, of_law, settings, settings.steps)}
        with torch.no_grad():
            read = [encoder(part) for part in rate.split(settings.batch)]
        features, centre, scale = (torch.cat(part) for part in zip(*read, strict=True))
        ends = ((error - centre) / scale).clamp(-_FINITE, _FINITE)

        def of_flow() -> Tensor:
            rows = torch.randint(len(ends), (settings.batch,), generator=generator)
            start, end = torch.randn((len(rows), 2), generator=generator), ends[rows]
            t = torch.rand((len(rows), 1), generator=generator)
            velocity = flow((1 - t) * start + t * end, t, flow.given(features[rows]))
            return ((velocity - (end - start)) ** 2).sum(dim=1).mean()

        loss["flow"] = _descended(flow, of_flow, settings, settings.flow_steps)
    return TrainedFlow(encoder.eval(), flow.eval(), settings, loss)


def initialised_all(build: Callable[[], nn.Module], generator: torch.Generator) -> nn.Module:
    """`recurrent.initialised` for networks with convolutions: uniform in +-1/sqrt(inputs) as well."""
    network = initialised(build, generator)
    for module in network.modules():
        if isinstance(module, nn.Conv1d):
            bound = (module.in_channels * module.kernel_size[0]) ** -0.5
            with torch.no_grad():
                for parameter in module.parameters():
                    parameter.uniform_(-bound, bound, generator=generator)
    return network


def draw_recordings(settings: FlowSettings) -> tuple[Tensor, Tensor]:
    """Rates less their medians (n, samples, 3) and errors of the medians (n, 2), both in units of noise."""
    rng, parts = np.random.default_rng([settings.seed, 1]), []
    for kind, count in (("mixed", settings.mixed), ("quiet", settings.quiet)):
        for first in range(0, count, 1000):
            runs = min(1000, count - first)
            made = draw_disturbance(kind, samples=settings.samples, rate_hz=settings.rate_hz, rng=rng, runs=runs)
            gyro = made.rate_b + made.bias_b + settings.bias * DEG_PER_HOUR * rng.standard_normal((runs, 1, 3))
            rate, median = _noise_units(gyro + settings.unit * rng.standard_normal(gyro.shape), settings)
            parts.append((rate, torch.from_numpy(median[:, :2]).float()))
    return torch.cat([rate for rate, _ in parts]), torch.cat([error for _, error in parts])


def _noise_units(gyro_l: Array, settings: FlowSettings) -> tuple[Tensor, Array]:
    """Rates less their medians, and the medians (n, 3), in units of noise."""
    scaled = gyro_l / settings.unit
    median = np.median(scaled, axis=1)
    return torch.from_numpy(scaled - median[:, None]).float(), np.asarray(median, dtype=np.float64)


def _some(rate: Tensor, error: Tensor, count: int, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """Recordings drawn at random, each axis with a random sign and x and y swapped in half: the mix is the same."""
    rows = torch.randint(len(rate), (count,), generator=generator)
    sign = 1.0 - 2.0 * torch.randint(2, (count, 3), generator=generator)
    swap = torch.rand((count, 1), generator=generator) < 0.5
    v = error[rows] * sign[:, :2]
    x = rate[rows] * sign[:, None]
    v = torch.where(swap, v.flip(1), v)
    return torch.where(swap[:, None], x[:, :, [1, 0, 2]], x), v


def _descended(network: nn.Module, loss: Callable[[], Tensor], settings: FlowSettings, steps: int) -> list[float]:
    """Train a network; the mean loss of every hundred steps."""
    optimiser = torch.optim.Adam(network.parameters(), lr=settings.rate, fused=True)
    told, total = [], 0.0
    for step in range(steps):
        optimiser.param_groups[0]["lr"] = settings.rate * 0.5 * (1 + math.cos(math.pi * step / steps))
        optimiser.zero_grad()
        found = loss()
        found.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 5.0)
        optimiser.step()
        total += found.item()
        if step % 100 == 99:
            told.append(total / 100)
            total = 0.0
    return told
