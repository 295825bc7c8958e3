"""The running estimate: CPU time of a second at 600 Hz by the age of the stream, a minute to a day, and its memory."""

from __future__ import annotations

import tracemalloc
from collections.abc import Iterable
from functools import partial
from math import radians

import numpy as np

from benchmarks.comparison import Comparison
from gyronorth.earth import STANDARD_GRAVITY, earth_rate_n
from gyronorth.streaming import StreamingHeading

RATE_HZ = 600
LATITUDE = radians(48)
#: One second may take this share of one core.
SHARE = 0.1
#: Time on the stream before it is measured, s. Rows are merged when the store is full, at 600 Hz after 40 minutes:
#: 39 minutes come right before, when rows are most.
AGES = {"1 min": 60, "10 min": 600, "39 min, rows most": 2340, "1 h": 3600, "24 h": 86_400}
#: A stream may hold this, bytes; all samples of a day would be 2.5e9.
MOST_BYTES = 8e6


def comparisons() -> Iterable[Comparison]:
    """The comparisons of this module."""
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    streams = {name: aged(seconds) for name, seconds in AGES.items()}
    each = (tracemalloc.get_traced_memory()[0] - before) / len(streams)
    tracemalloc.stop()
    print(f"\nMemory of a stream, mean of {', '.join(streams)}: {each / 1e6:.2f} MB, promised {MOST_BYTES / 1e6:g}")
    if each > MOST_BYTES:
        raise RuntimeError("Memory of a stream is not bounded.")
    rng = np.random.default_rng(2)
    candidates = {name: partial(ten_seconds, stream, rng) for name, stream in streams.items()}
    yield Comparison(
        title="Ten seconds of 600 Hz with an estimate after each, by the age of the stream",
        ours="24 h",
        candidates=candidates,
        targets={"10 min": 0.5},
        limit=10 * SHARE,
    )


def aged(seconds: int) -> StreamingHeading:
    """A stream that has run for that long, without estimates."""
    stream = StreamingHeading(rate_hz=RATE_HZ, latitude=LATITUDE, accelerometer=True, sensor="isa100c")
    rng = np.random.default_rng(1)
    for _ in range(0, seconds, 60):  # new noise each time: what repeats would be taken for sway
        stream.add(*still(60, rng))
    return stream


def still(seconds: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Samples of a level unit with white noise."""
    shape = (seconds * RATE_HZ, 3)
    gyro = earth_rate_n(LATITUDE) + 1e-4 * rng.standard_normal(shape)
    return gyro, [0.0, 0.0, -STANDARD_GRAVITY] + 1e-2 * rng.standard_normal(shape)


def ten_seconds(stream: StreamingHeading, rng: np.random.Generator) -> None:
    """Ten times one second of samples in 20 pieces, as they come, and an estimate."""
    for _ in range(10):
        gyro, accel = still(1, rng)
        for piece in np.array_split(np.arange(RATE_HZ), 20):
            stream.add(gyro[piece], accel[piece])
        stream.estimate()
