"""Decoding of frames as `live` does: CPU time of ten seconds at 1 kHz of every form, as a ratio to real time."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from functools import partial
from pathlib import Path

from benchmarks.comparison import Comparison
from gyronorth.frames import FrameStream
from gyronorth.live.session import MOST_BYTES

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from frames.encoders import CASES, Case

#: Ten seconds at 1 kHz.
FRAMES, SECONDS = 10_000, 10.0
#: Decoding is to be this many times as fast as real time.
REAL_TIME = 100.0


def comparisons() -> Iterable[Comparison]:
    """The comparisons of this module."""
    candidates = {}
    for name, make in CASES.items():
        case = make(FRAMES)
        candidates[name] = partial(decoded, case, case.preamble + b"".join(case.frames))
    for name, candidate in candidates.items():
        yield Comparison(
            title=f"Ten seconds of 1 kHz, {name}",
            ours=name,
            candidates={name: candidate},
            limit=SECONDS / REAL_TIME,
        )


def decoded(case: Case, data: bytes) -> int:
    """Samples of a stream in the pieces in which `live` takes one that comes as fast as it can."""
    stream = FrameStream(case.protocol, case.options)
    for at in range(0, len(data), MOST_BYTES):
        stream.feed(data[at : at + MOST_BYTES])
    stream.finish()
    return stream.report.samples
