"""Bidirectional LSTM layers, the three layouts, and randomness from a generator only.

Layouts of a batch x (n, samples, 3), as (batch, steps, width) of the recurrence:

- `temporal`: (n, samples, 3), one step per time sample;
- `flattened`: (n, 1, 3 samples), one step per recording, channel-major (all x, then y, then z);
- `across_batch`: (1, n, 3 samples), the public baseline's: the recurrence runs over the
  recordings of a batch, so that a prediction depends on its neighbours. For reproduction only.
"""

from __future__ import annotations

from collections.abc import Callable

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
        return self._gates("weight_ih_l0"), self._gates("bias_ih_l0"), self._gates("bias_hh_l0")

    def _gates(self, name: str) -> Tensor:
        """Parameter `name`, rows in the order input, output, cell gate, each forward then backward."""
        # torch orders them input, forget, cell, output.
        forward, backward = getattr(self.lstm, name).chunk(4), getattr(self.lstm, name + "_reverse").chunk(4)
        return torch.cat([part[gate] for gate in (0, 3, 2) for part in (forward, backward)])


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
