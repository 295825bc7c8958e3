"""The frequency grid shared by the network of `learned`, its training and its use."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gyronorth.alignment.bayes import FREQUENCIES, SPACING


def frequency_grid(samples: int, rate_hz: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Sample numbers from the middle (samples,) and frequencies in cycles a sample (f,): those of `bayes`."""
    highest = min(FREQUENCIES[1], 0.4 * rate_hz)
    frequency = np.arange(FREQUENCIES[0], highest, SPACING * rate_hz / samples)
    index = np.arange(samples) - (samples - 1) / 2
    return index.astype(np.float32), (frequency / rate_hz).astype(np.float32)
