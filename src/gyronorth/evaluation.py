"""Judging headings: splits by recording or arc; circular errors; intervals over recordings.

Nothing here knows how a heading was made. Splits are of recordings: windows of one recording
are always on the same side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyronorth.angles import cyclic_rmse, wrap
from gyronorth.arrays import Index


@dataclass(frozen=True)
class Split:
    """Recordings to learn from, to choose by and to test on, as integer indices.

    Raises
    ------
    ValueError
        If a recording is in two parts.
    """

    train: Index
    test: Index
    validation: Index

    def __post_init__(self) -> None:
        together = np.concatenate([self.train, self.validation, self.test])
        if len(np.unique(together)) != len(together):
            raise ValueError("A recording is in two parts of a split; each may be in one only.")

    @property
    def known(self) -> Index:
        """Training and validation together: what a method without validation may learn from."""
        return np.concatenate([self.train, self.validation])


def leave_one_out(count: int) -> list[Split]:
    """Each of `count` recordings tested once, all others known."""
    everything = np.arange(count)
    return [Split(np.delete(everything, i), everything[i : i + 1], _NONE) for i in everything]


def leave_arcs_out(heading: ArrayLike, arc: int) -> list[Split]:
    """`arc` recordings next to each other on the circle tested, all others known.

    Every recording starts one arc, so each is tested `arc` times: near both ends and in the middle.
    """
    order = np.argsort(np.asarray(heading, float), kind="stable")
    count = len(order)
    if not 0 < arc < count:
        raise ValueError(f"arc is {arc}; 1 to {count - 1} recordings can be left out of {count}.")
    turns = (np.roll(order, -start) for start in range(count))
    return [Split(np.sort(turn[arc:]), turn[:arc], _NONE) for turn in turns]


def random_splits(
    count: int, repeats: int, *, sizes: tuple[int, int, int] = (24, 4, 6), rng: np.random.Generator
) -> list[Split]:
    """`repeats` draws of training, validation and test recordings (the paper's 24/4/6) from `count`."""
    train, validation, test = sizes
    if train + validation + test > count:
        raise ValueError(f"{count} recordings came in; {train}+{validation}+{test} are needed. Give smaller sizes.")
    draws = (rng.permutation(count) for _ in range(repeats))
    ends = (train, train + validation, train + validation + test)
    return [Split(d[: ends[0]], d[ends[1] : ends[2]], d[ends[0] : ends[1]]) for d in draws]


@dataclass(frozen=True)
class Interval:
    """A figure with its 95 % interval."""

    value: float
    low: float
    high: float


def bootstrap_crmse(error: ArrayLike, recording: ArrayLike, *, rng: np.random.Generator, draws: int = 4000) -> Interval:
    """CRMSE, in the unit of `error` (rad), with the percentile interval over recordings drawn anew."""
    return _bootstrap([_squares(error, recording)], rng, draws)


def bootstrap_ratio(
    error: ArrayLike, reference: ArrayLike, recording: ArrayLike, *, rng: np.random.Generator, draws: int = 4000
) -> Interval:
    """CRMSE of a method over that of a reference, with the paired interval over recordings.

    Parameters
    ----------
    error, reference : array_like, shape (n,)
        Errors of both on the same tests, rad.
    recording : array_like, shape (n,)
        Which recording a test is of. All tests of a recording are drawn together, since
        neither windows nor repeated splits add recordings (Efron and Tibshirani, "An
        Introduction to the Bootstrap", 1993, ch. 8 and 13).
    """
    return _bootstrap([_squares(error, recording), _squares(reference, recording)], rng, draws)


def coverage(
    error: ArrayLike, sigma: ArrayLike, recording: ArrayLike, *, rng: np.random.Generator, draws: int = 4000
) -> Interval:
    """Share of errors within 1.96 sigma, with its interval over recordings (Wilson's where all tests agree)."""
    inside = np.abs(wrap(error)) <= 1.96 * np.asarray(sigma, float)
    sums, counts = _sums(inside.astype(float), recording)
    value = sums.sum() / counts.sum()
    pick = rng.integers(len(sums), size=(draws, len(sums)))
    shares = sums[pick].sum(axis=1) / counts[pick].sum(axis=1)
    low, high = np.quantile(shares, [0.025, 0.975])
    return wilson(float(value), len(sums)) if low == high else Interval(float(value), float(low), float(high))


def wilson(value: float, n: int) -> Interval:
    """A share of n independent tests with Wilson's 95 % interval ("Probable inference", JASA 22, 1927, 209-212)."""
    z = 1.96
    centre, half = (value + z**2 / (2 * n)), z * np.sqrt(value * (1 - value) / n + z**2 / (4 * n**2))
    low, high = (centre - half) / (1 + z**2 / n), (centre + half) / (1 + z**2 / n)
    return Interval(value, max(float(low), 0.0), min(float(high), 1.0))  # rounding may reach beyond both


def share_of_wins(errors: Sequence[ArrayLike], references: Sequence[ArrayLike]) -> float:
    """Share of splits in which a method has the smaller CRMSE."""
    return float(np.mean([cyclic_rmse(e) < cyclic_rmse(r) for e, r in zip(errors, references, strict=True)]))


_NONE = np.zeros(0, dtype=np.int64)


def _sums(values: NDArray[np.float64], recording: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    _, which, counts = np.unique(np.asarray(recording), return_inverse=True, return_counts=True)
    return np.bincount(which, values).astype(float), counts


def _squares(error: ArrayLike, recording: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    return _sums(wrap(error) ** 2, recording)


def _bootstrap(parts: list, rng: np.random.Generator, draws: int) -> Interval:
    recordings = len(parts[0][0])
    pick = rng.integers(recordings, size=(draws, recordings))

    def figure(index: NDArray) -> NDArray[np.float64]:
        roots = [np.sqrt(sums[index].sum(axis=-1) / counts[index].sum(axis=-1)) for sums, counts in parts]
        return roots[0] if len(roots) == 1 else roots[0] / roots[1]

    low, high = np.quantile(figure(pick), [0.025, 0.975])
    return Interval(float(figure(np.arange(recordings))), float(low), float(high))
