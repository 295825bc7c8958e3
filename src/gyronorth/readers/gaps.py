"""Gaps between rows: how long they may be, and the straight lines that bridge them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gyronorth.arrays import Array, Index
from gyronorth.errors import InputError
from gyronorth.readers.source import Source
from gyronorth.recording import Gap, Note

#: Longest gap that is bridged, s, and largest share of samples that may be missing or dropped.
LONGEST_GAP = 10.0
MOST_MISSING = 0.1
#: The same where parts are judged one by one, see `judged_in_parts`.
LONGEST_KEPT = 86400.0
#: Gaps of so many samples are short; fewest of them that tell, and the statistic of Kuiper below which they are even.
SHORT, FEWEST_GAPS, EVEN = 3, 20, 0.55
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


def _rate_without_losses(gaps: Sequence[Gap], samples: int, rate_hz: float) -> float | None:
    """The rate, Hz, if short gaps are none: they come more evenly than losses do; None where they come as losses do.

    Stamps that are rounded to ticks of nearly the sample interval show a loss wherever a tick is passed over. Losses
    come at random: the statistic of Kuiper [1]_ of their places is below `EVEN` once in 10,000 files.

    References
    ----------
    .. [1] N. H. Kuiper, "Tests concerning random points on a circle", Proc. KNAW A 63, 1960, pp. 38-47.
    """
    places = np.sort([gap.start * rate_hz / max(samples, 1) for gap in gaps if gap.samples <= SHORT])
    missing = sum(gap.samples for gap in gaps)
    if len(places) < FEWEST_GAPS or sum(gap.samples for gap in gaps if gap.samples <= SHORT) < 0.9 * missing:
        return None
    share = np.arange(1, len(places) + 1) / len(places)
    kuiper = np.max(share - places) + np.max(places - share + 1 / len(places))
    return rate_hz * (samples - missing) / samples if kuiper * np.sqrt(len(places)) < EVEN else None


def even_gaps(gaps: Sequence[Gap], samples: int, rate_hz: float, source: Source) -> tuple[Note, ...]:
    """What to say of gaps that come so evenly that the rate may be a lower one."""
    slower = _rate_without_losses(gaps, samples, rate_hz)
    if slower is None:
        return ()
    message = (
        f"{len(gaps)} short gaps of {source.name} come so evenly that they may be none: coarse stamps of a unit at "
        f"{slower:.6g} Hz look like these, and {rate_hz:.6g} Hz is taken."
    )
    if source.topic is None and not source.ours:  # in a file of ours the gaps are filled
        message += f" If its rate is the lower one: --columns t=- --rate {slower:.5g}."
    return (Note("rate_conflict", message, value=slower, limit=rate_hz),)
