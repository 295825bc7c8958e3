"""Decoding of frames: CPU time of ten seconds at 1 kHz, for every form of every protocol, as a ratio to real time."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from functools import partial
from pathlib import Path

from benchmarks.comparison import Comparison
from gyronorth.frames import decode

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from frames.encoders import CASES

#: Ten seconds at 1 kHz.
FRAMES, SECONDS = 10_000, 10.0
#: Decoding is to be this many times as fast as real time.
REAL_TIME = 100.0


def comparisons() -> Iterable[Comparison]:
    """The comparisons of this module."""
    candidates = {}
    for name, make in CASES.items():
        case = make(FRAMES)
        candidates[name] = partial(decode, case.preamble + b"".join(case.frames), case.protocol, case.options)
    for name, candidate in candidates.items():
        yield Comparison(
            title=f"Ten seconds of 1 kHz, {name}",
            ours=name,
            candidates={name: candidate},
            limit=SECONDS / REAL_TIME,
        )
