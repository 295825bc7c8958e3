"""Bidirectional LSTM layers, the three layouts, and randomness from a generator only.

Layouts of a batch x (n, samples, 3), as (batch, steps, width) of the recurrence:

- `temporal`: (n, samples, 3), one step per time sample;
- `flattened`: (n, 1, 3 samples), one step per recording, channel-major (all x, then y, then z);
- `across_batch`: (1, n, 3 samples), the public baseline's: the recurrence runs over the
  recordings of a batch, so that a prediction depends on its neighbours. For reproduction only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import torch
from torch import Tensor, nn


def to_layout(x: Tensor, layout: str) -> Tensor:
    """Lay out x (n, samples, 3) for the recurrence."""
    if layout == "temporal":
        return x
    flat = x.transpose(1, 2).flatten(1)
    return flat[:, None] if layout == "flattened" else flat[None]


def from_layout(h: Tensor, layout: str) -> Tensor:
    """Undo `to_layout`: (n, samples, 3)."""
    if layout == "temporal":
        return h
    flat = h[:, 0] if layout == "flattened" else h[0]
    return flat.unflatten(1, (3, -1)).transpose(1, 2)


def width(layout: str, samples: int) -> int:
    """Input width of the recurrence."""
    return 3 if layout == "temporal" else 3 * samples


class BiLSTM(nn.Module):
    """One bidirectional LSTM layer, (batch, steps, inputs) -> (batch, steps, 2 hidden).

    With `single_step` the sequence is known to be one step long: the state before it is zero,
    so that recurrent weights and forget gate have no effect, and the layer is computed as the
    gated feed-forward layer that it then is. Same weights, same output, a quarter less work.
    """

    def __init__(self, inputs: int, hidden: int, *, single_step: bool) -> None:
        super().__init__()
        self.lstm = nn.LSTM(inputs, hidden, batch_first=True, bidirectional=True)
        self.single_step = single_step
        self.held: tuple[Tensor, Tensor, Tensor] | None = None  # by `held_gates`, during a training

    def forward(self, x: Tensor) -> Tensor:
        """Output of the network."""
        if not self.single_step:
            return self.lstm(x)[0]
        # Input, output and cell gates of both directions: one product, one sigmoid, one tanh.
        weight, bias, more = self.gates()
        gates = nn.functional.linear(x, weight, bias + more)
        wide = 2 * self.lstm.hidden_size
        opening, cell = torch.sigmoid(gates[..., : 2 * wide]), torch.tanh(gates[..., 2 * wide :])
        return opening[..., wide:] * torch.tanh(opening[..., :wide] * cell)

    def gates(self) -> tuple[Tensor, Tensor, Tensor]:
        """What a single step uses: weights of the input (6 hidden, inputs) and both biases (6 hidden,)."""
        if self.held is not None:
            return self.held
        weight, bias, more = (torch.cat(self._parts(name)) for name in _USED)
        return weight, bias, more

    def settle(self) -> None:
        """Write the gates that are held into the parameters that they were taken from."""
        for held, name in zip(self.held or (), _USED, strict=False):
            parts = self._parts(name)
            for part, value in zip(parts, held.chunk(len(parts)), strict=True):
                part.data.copy_(value.data)

    def _parts(self, name: str) -> list[Tensor]:
        """Views of parameter `name` in the order input, output, cell gate, each forward then backward."""
        # torch orders them input, forget, cell, output.
        forward, backward = getattr(self.lstm, name).chunk(4), getattr(self.lstm, name + "_reverse").chunk(4)
        return [part[gate] for gate in (0, 3, 2) for part in (forward, backward)]


#: Parameters of an LSTM that a single step uses.
_USED = ("weight_ih_l0", "bias_ih_l0", "bias_hh_l0")


@contextmanager
def held_gates(network: nn.Module) -> Iterator[tuple[list[Tensor], Callable[[], None]]]:
    """For a training: what is to be optimised, and a function that brings it into the network's own parameters.

    The gates of a single step are put together from its parameters once, not in every step of the optimiser, which
    takes a fifth off a training. The weights are the same bit by bit where `hidden` is a multiple of 8 (else the fused
    optimiser rounds the ends of a parameter in another way). At the end they are in the parameters.
    """
    layers = [m for m in network.modules() if isinstance(m, BiLSTM) and m.single_step]
    own = {id(parameter) for layer in layers for parameter in layer.parameters()}
    trained: list[Tensor] = [p for p in network.parameters() if id(p) not in own]
    for layer in layers:
        weight, bias, more = (gate.detach().requires_grad_() for gate in layer.gates())
        layer.held = weight, bias, more
        trained += layer.held

    def settle() -> None:
        for layer in layers:
            layer.settle()

    try:
        yield trained, settle
    finally:
        settle()
        for layer in layers:
            layer.held = None


def dropout(x: Tensor, p: float, generator: torch.Generator | None) -> Tensor:
    """Inverted dropout by a generator of one's own; `torch.nn.Dropout` draws from the global one."""
    if generator is None or p == 0:
        return x
    keep = torch.rand(x.shape, generator=generator, dtype=x.dtype) >= p
    return x * keep / (1 - p)


def initialised(build: Callable[[], nn.Module], generator: torch.Generator) -> nn.Module:
    """A network with torch's own initial laws, drawn from `generator`; the global state is not touched.

    Uniform in +-1/sqrt(hidden) for an LSTM and +-1/sqrt(inputs) for a linear layer.
    """
    with torch.device("meta"):
        network = build()
    network.to_empty(device="cpu")
    for module in network.modules():
        if isinstance(module, nn.LSTM | nn.Linear):
            bound = (module.hidden_size if isinstance(module, nn.LSTM) else module.in_features) ** -0.5
            with torch.no_grad():
                for parameter in module.parameters():
                    parameter.uniform_(-bound, bound, generator=generator)
    return network
