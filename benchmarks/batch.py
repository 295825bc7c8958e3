"""`heading_batch` on 2000 windows of the reference mix, 300 samples of three axes: the mean and the learned method."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from benchmarks.comparison import Comparison
from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR
from gyronorth.pipeline import heading_batch
from gyronorth.sensor import Sensor, TriadErrors
from gyronorth.simulation.disturbance import reference_set

#: CPU seconds that are promised, and timed rounds.
PROMISED = {"mean": (0.2, 7), "learned": (60.0, 1)}


def comparisons() -> Iterator[Comparison]:
    """One comparison for each method; it has no peer."""
    made = reference_set()
    errors = TriadErrors(white=0.02 * DEG_PER_SQRT_HOUR, turn_on_bias=0.1 * DEG_PER_HOUR)
    known: dict[str, Any] = {
        "rate_hz": made.rate_hz,
        "latitude": made.latitude,
        "sensor": Sensor("of the mix", errors, TriadErrors()),
    }
    for method, (limit, rounds) in PROMISED.items():
        yield Comparison(
            f"heading_batch, 2000 windows of 300 x 3, method {method}",
            ours="gyronorth",
            candidates={"gyronorth": lambda method=method: heading_batch(made.gyro_b, method=method, **known)},
            limit=limit,
            rounds=rounds,
        )
