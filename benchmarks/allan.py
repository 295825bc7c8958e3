"""Overlapped Allan deviation beside allantools: the same averaging times, the same figures to 1e-9."""

from __future__ import annotations

from collections.abc import Iterable

import allantools
import numpy as np

from benchmarks.comparison import Comparison
from gyronorth.allan import allan_deviation

SAMPLES = 1_000_000
RATE_HZ = 100.0
TAUS = 90


def comparisons() -> Iterable[Comparison]:
    """The comparisons of this module."""
    x = np.random.default_rng(1).standard_normal(SAMPLES)
    for longest, words in ((SAMPLES // 4, "a quarter"), (SAMPLES // 20, "a twentieth")):
        yield _beside_allantools(x, averaging_times(longest), words)


def averaging_times(longest: int) -> np.ndarray:
    """90 different multiples of the sample interval, evenly in the logarithm, s."""
    count = TAUS
    while len(multiples := np.unique(np.geomspace(1, longest, count).round())) < TAUS:
        count += 1
    return multiples[-TAUS:] / RATE_HZ


def _beside_allantools(x: np.ndarray, taus: np.ndarray, words: str) -> Comparison:
    def ours() -> np.ndarray:
        return allan_deviation(x, rate_hz=RATE_HZ, taus=taus).deviation

    def theirs() -> np.ndarray:
        return allantools.oadev(x, rate=RATE_HZ, data_type="freq", taus=taus)[1]

    np.testing.assert_allclose(ours(), theirs(), rtol=1e-9)
    return Comparison(
        title=f"Overlapped Allan deviation, 1e6 samples, {len(taus)} averaging times up to {words} of the record",
        ours="gyronorth",
        candidates={"gyronorth": ours, "allantools": theirs},
        targets={"allantools": 3.0},
    )
