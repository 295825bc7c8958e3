"""Decoding of frames: CPU time of ten seconds at 1 kHz, for every form of every protocol, as a ratio to real time."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from functools import partial
from pathlib import Path

from benchmarks.comparison import Comparison
from gyronorth.frames import decode, protocol_info

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from frames.encoders import CASES

#: Ten seconds at 1 kHz.
FRAMES, SECONDS = 10_000, 10.0
#: Decoding is to be this many times as fast as real time; lines of text, which come at 400 Hz at most, 60 times.
REAL_TIME, TEXT_REAL_TIME = 100.0, 60.0


def comparisons() -> Iterable[Comparison]:
    """The comparisons of this module."""
    candidates = {}
    for name, make in CASES.items():
        case = make(FRAMES)
        candidates[name] = partial(decode, case.preamble + b"".join(case.frames), case.protocol, case.options)
    for name, candidate in candidates.items():
        text = protocol_info(CASES[name](1).protocol).form == "text" or name.endswith("text")
        yield Comparison(
            title=f"Ten seconds of 1 kHz, {name}",
            ours=name,
            candidates={name: candidate},
            limit=SECONDS / (TEXT_REAL_TIME if text else REAL_TIME),
        )
