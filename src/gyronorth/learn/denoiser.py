"""The noise-predicting network of the denoiser (III-B, Fig. 3)."""

from __future__ import annotations

import math

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from gyronorth.alignment.networks.diffusion import Predict
from gyronorth.learn.recurrent import BiLSTM, from_layout, to_layout, width


def step_embedding(t: Tensor, size: int) -> Tensor:
    """Sinusoidal embedding of the steps t (n,), shape (n, size) (Vaswani et al. 2017, section 3.5)."""
    rate = torch.exp(torch.arange(size // 2, dtype=torch.float32) * (-math.log(10000.0) / (size // 2)))
    angle = t.to(torch.float32)[:, None] * rate
    return torch.cat([torch.sin(angle), torch.cos(angle)], dim=1)


class Denoiser(nn.Module):
    """Bidirectional LSTM layers with the step embedding, projected to each layer's input, added to it."""

    def __init__(self, *, layout: str, samples: int, layers: int = 5, hidden: int = 64, embedding: int = 20) -> None:
        super().__init__()
        self.layout, self.embedding = layout, embedding
        wide = width(layout, samples)
        inputs = [wide] + [2 * hidden] * (layers - 1)
        single = layout == "flattened"
        self.recurrent = nn.ModuleList(BiLSTM(size, hidden, single_step=single) for size in inputs)
        self.project = nn.ModuleList(nn.Linear(embedding, size) for size in inputs)
        self.head = nn.Linear(2 * hidden, wide)

    def forward(self, x: Tensor, t: Tensor) -> Tensor:
        """Predicted noise (n, samples, 3) of x (n, samples, 3) at the steps t (n,)."""
        embedded = step_embedding(t, self.embedding).to(x.dtype)
        h = to_layout(x, self.layout)
        for recurrent, project in zip(self.recurrent, self.project, strict=True):
            step = project(embedded)
            h = recurrent(h + (step[None] if self.layout == "across_batch" else step[:, None]))
        return from_layout(self.head(h), self.layout)


def predictor(network: nn.Module, *, batch: int) -> Predict:
    """The network as the function that the samplers call, at most `batch` recordings at a time."""

    def predict(x: NDArray[np.float32], t: int) -> NDArray[np.float32]:
        with torch.inference_mode():
            parts = [network(part, torch.full((len(part),), t)) for part in torch.from_numpy(x).split(batch)]
        return torch.cat(parts).numpy()

    return predict


def set_weights(network: nn.Module, weights: dict[str, NDArray[np.float32]]) -> None:
    """Load weights kept as arrays by name, as `state_dict` names them."""
    network.load_state_dict({name: torch.from_numpy(value) for name, value in weights.items()})
