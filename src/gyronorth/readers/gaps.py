"""Gaps between rows: how long they may be, and the straight lines that bridge them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gyronorth.arrays import Array, Index
from gyronorth.errors import InputError
from gyronorth.recording import Gap

#: Longest gap that is bridged, s, and largest share of samples that may be missing or dropped.
LONGEST_GAP = 10.0
MOST_MISSING = 0.1
#: The same where parts are judged one by one, see `judged_in_parts`.
LONGEST_KEPT = 86400.0
#: Samples across a gap that are made at once.
PIECE = 1 << 18


def too_long(row: str, step: float, before: float, *, longest: float) -> str:
    """The complaint of a gap of `step` s before a row, behind `before` s of data."""
    return (
        f"{row}: {step:.6g} s lie between this row and the one before, which ends {before:.6g} s of data; gaps of up "
        f"to {longest:g} s are bridged. Take a part without the gap: --window START:END, or split the file."
    )


def too_many(missing: int, samples: int, name: str) -> str:
    """The complaint of a recording too many of whose samples are missing."""
    return (
        f"{missing} of {samples} samples of {name} are missing; up to {MOST_MISSING:.0%} are bridged. Take a better "
        "part: --window START:END, or split the file."
    )


def straight_lines(position: int, before: Array | None, positions: Index, data: Array, ends: tuple[float, float]
                   ) -> Iterator[Array]:  # fmt: skip
    """Samples of every place of the grid behind one of them, piece by piece.

    Parameters
    ----------
    position : int
        The place behind which they begin.
    before : ndarray, shape (k,), optional
        The sample at that place.
    positions, data : ndarray, shape (m,) and (m, k)
        Places and samples of the rows, in order.
    ends : tuple of float
        Places between which samples are wanted.
    """
    knots, values = positions, data
    if before is not None:
        knots, values = np.concatenate([[position], positions]), np.vstack([before, data])
    first, last = int(max(ends[0], position + 1)), int(min(ends[1], positions[-1] + 1))
    for start in range(first, last, PIECE):
        grid = np.arange(start, min(start + PIECE, last))
        yield np.stack([np.interp(grid, knots, column) for column in values.T], axis=1)


def judged_in_parts(gaps: tuple[Gap, ...], *, samples: int, rate_hz: float) -> None:
    """Refuse a part of a recording, of `samples` samples, whose gaps are more than may be bridged.

    Raises
    ------
    InputError
        If one is too long, or too much is missing in all.
    """
    missing = sum(gap.samples for gap in gaps)
    longest = max((gap.samples for gap in gaps), default=0) / rate_hz
    if longest > LONGEST_GAP or missing > MOST_MISSING * samples:
        raise InputError(
            f"{missing} of {samples} samples of this window are missing, up to {longest:.6g} s at a stretch; up to "
            f"{MOST_MISSING:.0%}, and {LONGEST_GAP:g} s at a stretch, are bridged."
        )
