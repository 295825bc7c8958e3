"""Flicker noise made another way than the package makes it: 1/f shaped in the frequency domain.

A test oracle. The spectrum is B^2 / (2 pi sqrt(f^2 + f_0^2)) (two-sided; 1/f of IEEE Std 952-1997,
annex C, above f_0). The corner f_0 = 0.93 / (2 pi longest) gives it the power of the package's law
at zero frequency; between the two corners the laws differ by up to 8 %. Series are at least four
times as long as `longest`, and windows are cut from them that far apart.
"""

from __future__ import annotations

import numpy as np


def flicker_fft(
    bias_instability: float,
    shape: tuple[int, int],
    rate_hz: float,
    *,
    rng: np.random.Generator,
    longest: float = 1000.0,
) -> np.ndarray:
    """Flicker noise of coefficient `bias_instability`, shape (runs, samples, 3)."""
    runs, samples = shape
    apart = samples + round(longest * rate_hz)
    length = 2 ** int(np.ceil(np.log2(max(4 * longest * rate_hz, 2 * apart))))
    per_series = length // apart
    frequency = np.fft.rfftfreq(length, 1 / rate_hz)
    density = bias_instability**2 / (2 * np.pi * np.hypot(frequency, 0.93 / (2 * np.pi * longest)))
    gain = np.sqrt(density * rate_hz)
    out = np.empty((runs, samples, 3))
    starts = np.arange(per_series) * apart
    for first in range(0, runs, per_series):
        series = np.fft.irfft(np.fft.rfft(rng.standard_normal((length, 3)), axis=0) * gain[:, None], length, axis=0)
        for run, start in zip(range(first, min(first + per_series, runs)), starts, strict=False):
            out[run] = series[start : start + samples]
    return out
