"""Rows in order of time that wait for the stamps behind them before they get a place on the grid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gyronorth.frozen import frozen


@frozen
class WaitingRows:
    """Rows in order of time whose places on the grid are not settled, and the bad ones among them."""

    data: NDArray[np.float64]  # (m, 3) or (m, 6) SI
    numbers: NDArray[np.int64]  # (m,) as the user counts rows
    stamps: NDArray[np.float64]  # (m,) in units of the clock, without wraps
    bad: NDArray[np.int64]  # numbers of bad rows
    reasons: tuple[tuple[int, str], ...]

    @classmethod
    def none(cls, width: int) -> WaitingRows:
        """No row."""
        nothing = np.zeros(0, dtype=np.int64)
        return cls(np.zeros((0, width)), nothing, np.zeros(0), nothing, ())

    def followed_by(self, other: WaitingRows) -> WaitingRows:
        """Both, `other` last."""
        if len(self.numbers) == len(self.bad) == 0:
            return other
        return WaitingRows(
            np.concatenate([self.data, other.data]),
            np.concatenate([self.numbers, other.numbers]),
            np.concatenate([self.stamps, other.stamps]),
            np.concatenate([self.bad, other.bad]),
            self.reasons + other.reasons,
        )

    def split(self, count: int, *, last: bool) -> tuple[WaitingRows, WaitingRows]:
        """The first `count` rows, with the bad ones before the next row (with `last` all bad ones), and the rest."""
        if last:
            return self, WaitingRows.none(self.data.shape[1])
        limit = int(self.numbers[count])
        early = self.bad < limit
        return (
            WaitingRows(
                self.data[:count],
                self.numbers[:count],
                self.stamps[:count],
                self.bad[early],
                tuple(reason for reason in self.reasons if reason[0] < limit),
            ),
            WaitingRows(
                self.data[count:],
                self.numbers[count:],
                self.stamps[count:],
                self.bad[~early],
                tuple(reason for reason in self.reasons if reason[0] >= limit),
            ),
        )


def repeats(step: NDArray[np.float64], data: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which steps, shape (n,), between rows of data, shape (n + 1, k), lead to the same time and the same values."""
    return (step == 0) & (data[1:] == data[:-1]).all(axis=1)


def first_run(flags: NDArray[np.bool_], length: int) -> int | None:
    """Where the first run of at least `length` true flags begins; None where there is none."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]])))
    begins, ends = edges[::2], edges[1::2]
    long = np.flatnonzero(ends - begins >= length)
    return int(begins[long[0]]) if len(long) else None
