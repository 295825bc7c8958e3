"""The heading networks: the baseline (II-B) and the enhanced one (III-D), and their loss (eq:25)."""

from __future__ import annotations

import copy

import torch
from torch import Tensor, nn

from gyronorth.learn.recurrent import BiLSTM, dropout, to_layout, width


class HeadingNetwork(nn.Module):
    """Bidirectional LSTM layers and a fully connected head.

    The input is the angular rate (n, samples, 3) in units of Earth rate, about one: in deg/s it
    would be 0.003 and hardly move an LSTM; the paper does not say. In the temporal layout the
    head sees the last state of either direction.

    `output="degrees"` gives (n, 1), a heading in degrees to be taken modulo 360, as the public
    baseline does; `"cos_sin"` gives (n, 2), a vector along the heading.
    """

    def __init__(
        self,
        *,
        layout: str,
        samples: int,
        layers: int = 2,
        hidden: int = 24,
        dropout: float = 0.0,
        output: str = "degrees",
    ) -> None:
        super().__init__()
        self.layout, self.hidden, self.dropout, self.output = layout, hidden, dropout, output
        inputs = [width(layout, samples)] + [2 * hidden] * (layers - 1)
        single = layout == "flattened"
        self.recurrent = nn.ModuleList(BiLSTM(size, hidden, single_step=single) for size in inputs)
        self.head = nn.Linear(2 * hidden, 1 if output == "degrees" else 2)

    def forward(self, x: Tensor, generator: torch.Generator | None = None) -> Tensor:
        """Raw output for x (n, samples, 3); with a generator, in training: with dropout."""
        h = to_layout(x.to(next(self.recurrent.parameters()).dtype), self.layout)
        for recurrent in self.recurrent:
            h = dropout(recurrent(h), self.dropout, generator)
        if self.layout == "temporal":
            h = torch.cat([h[:, -1, : self.hidden], h[:, 0, self.hidden :]], dim=1)
        else:
            h = h[:, 0] if self.layout == "flattened" else h[0]
        return self.head(h.to(self.head.weight.dtype))


def precise(network: HeadingNetwork) -> HeadingNetwork:
    """A copy for inference in float64; of a temporal one the head only: ONNX Runtime has no float64 LSTM.

    Degrees modulo 360 must jump by 360 somewhere on the circle. The network makes the jump a
    steep slope, on which float32 is worth 2e-4 deg and more.
    """
    network = copy.deepcopy(network)
    (network.head if network.layout == "temporal" else network).double()
    return network


def heading_deg(raw: Tensor) -> Tensor:
    """Heading, deg, of a raw output (n, 1) or (n, 2); not wrapped."""
    if raw.shape[1] == 1:
        return raw[:, 0]
    return torch.rad2deg(torch.atan2(raw[:, 1], raw[:, 0]))


def crmse_deg(raw: Tensor, truth_deg: Tensor) -> Tensor:
    """Cyclic root mean square error, deg (eq:25)."""
    error = heading_deg(raw) - truth_deg
    wrapped = torch.remainder(error + 180.0, 360.0) - 180.0
    # The square root has no slope at zero error: the floor, 1e-6 deg, keeps the gradient finite.
    return torch.sqrt(torch.mean(wrapped**2) + 1e-12)
