"""The network of `learned`: which samples lie in a bump, and where on the frequency axis the tones are.

It proposes and does not decide: `gyronorth.alignment.tones.proposals` weighs what it proposes by
the closed-form evidence of the physical model. Two small convolutional networks, one along time and one
along frequency, with the Fourier transform of the samples outside bumps between them; so that
one network serves every length of recording.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn


class Proposal(nn.Module):
    """Log odds of a bump for every sample, and log weights of every frequency, from noise-scaled rates.

    Inputs: rate (n, samples, 3), less the median of each axis and divided by the standard
    deviation of a sample's white noise; index (samples,), sample numbers counted from the middle;
    cycles (f,), frequencies in cycles a sample, evenly spaced by 1 / (8 samples). Outputs:
    (n, samples) and (n, f).
    """

    def __init__(self, hidden: int = 32, hidden_time: int = 16) -> None:
        super().__init__()
        self.of_axis = nn.Sequential(
            _convolution(2, hidden_time, 5),
            nn.ReLU(),
            _convolution(hidden_time, hidden_time, 5, 2),
            nn.ReLU(),
            _convolution(hidden_time, hidden_time, 5, 4),
            nn.ReLU(),
        )
        self.of_axes = nn.Sequential(
            _convolution(hidden_time, hidden_time, 5, 2),
            nn.ReLU(),
            _convolution(hidden_time, 1, 3),
        )
        self.enter = _convolution(18, hidden, 5)
        self.blocks = nn.ModuleList(_convolution(hidden, hidden, 5, dilation) for dilation in (1, 2, 4, 8, 16, 1))
        self.leave = nn.Conv1d(hidden, 1, 1)

    def forward(self, rate: Tensor, index: Tensor, cycles: Tensor) -> tuple[Tensor, Tensor]:
        """See the class."""
        bump = self._bump(rate)
        spectrum = self._spectrum(rate, torch.sigmoid(-bump), index, cycles)
        x = torch.relu(self.enter(spectrum))
        for block in self.blocks:
            x = x + torch.relu(block(x))
        return bump, self.leave(x)[:, 0]

    def _bump(self, rate: Tensor) -> Tensor:
        """Each axis by the same network, then all: a bump is one whatever its axis."""
        step = torch.cat([torch.zeros_like(rate[:, :1]), rate[:, 1:] - rate[:, :-1]], dim=1)
        total: Tensor | None = None
        for axis in range(3):
            seen = self.of_axis(torch.stack([_asinh(rate[:, :, axis]), _asinh(step[:, :, axis])], dim=1))
            total = seen if total is None else total + seen
        assert total is not None
        return self.of_axes(total)[:, 0]

    def _spectrum(self, rate: Tensor, free: Tensor, index: Tensor, cycles: Tensor) -> Tensor:
        """Features (n, 18, f) of the samples weighted by the probability `free` of no bump."""
        samples = 2 * index[-1] + 1
        phase = 2 * torch.pi * index[:, None] * cycles
        cosine, sine = torch.cos(phase), torch.sin(phase)
        hann = 1 + torch.cos(2 * torch.pi * index / samples)  # mean 1
        plain = self._transform(rate, free, cosine, sine, samples)
        smooth = self._transform(rate, free * hann, cosine, sine, samples)
        power, smooth_power = (p[:, :3] ** 2 + p[:, 3:] ** 2 for p in (plain, smooth))
        scale = torch.sqrt(1 + power.sum(dim=1, keepdim=True).amax(dim=2, keepdim=True))
        like = torch.ones_like(power[:, :1])
        return torch.cat(
            [
                plain / scale,
                torch.log1p(power) / 3,
                torch.log1p(power.sum(dim=1, keepdim=True)) / 3,
                torch.log1p(smooth_power) / 3,
                torch.log1p(smooth_power.sum(dim=1, keepdim=True)) / 3,
                like * torch.log(scale) / 3,
                like * torch.log(cycles * samples),
                like * torch.log(cycles) / 3 + 1,
                like * torch.log(samples) - 5.7,
            ],
            dim=1,
        )

    @staticmethod
    def _transform(rate: Tensor, weight: Tensor, cosine: Tensor, sine: Tensor, samples: Tensor) -> Tensor:
        """Cosine and sine parts (n, 6, f), of unit variance for white noise, of the rate less its weighted mean."""
        w = weight[:, :, None]
        off = (rate - (w * rate).sum(dim=1, keepdim=True) / (1e-3 + w.sum(dim=1, keepdim=True))) * w
        off = off.transpose(1, 2) / torch.sqrt(samples / 2)
        return torch.cat([off @ cosine, off @ sine], dim=1)


def _asinh(x: Tensor) -> Tensor:
    """torch.asinh, in operators that ONNX has."""
    return torch.sign(x) * torch.log(torch.abs(x) + torch.sqrt(x * x + 1))


def _convolution(inputs: int, outputs: int, width: int, dilation: int = 1) -> nn.Conv1d:
    """A convolution that keeps the length, with the padding written out: ONNX Runtime wants it so."""
    return nn.Conv1d(inputs, outputs, width, padding=dilation * (width // 2), dilation=dilation)
