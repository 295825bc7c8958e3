"""Interleaved timing of several ways to do the same work, and the ratios between them."""

from __future__ import annotations

import resource
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Comparison:
    """One piece of work and the ways to do it.

    A module of this package defines `comparisons() -> Iterable[Comparison]`; the runner finds it.
    """

    title: str  # the work, with its size
    ours: str  # which of the candidates is ours
    candidates: dict[str, Callable[[], object]]  # name: does the whole work once
    targets: dict[str, float] = field(default_factory=dict)  # name of a peer: how many times as fast we promise to be
    limit: float | None = None  # promised CPU seconds of ours, where there is no peer to divide by
    rounds: int | None = None  # overrides the runner's number of rounds
    told: bool = False  # whether each candidate returns the CPU seconds of its work, without its start; none is untimed
    megabytes: float | None = None  # promised peak memory of ours, whose work then returns it; no untimed round before


@dataclass(frozen=True)
class Result:
    """CPU seconds of each candidate, round by round."""

    comparison: Comparison
    seconds: dict[str, list[float]]
    peak: float | None = None  # largest of ours, MB, where one is promised

    def median(self, name: str) -> float:
        """Median CPU seconds of a candidate."""
        return statistics.median(self.seconds[name])

    def ratios(self, name: str) -> list[float]:
        """How many times as fast as `name` ours was, round by round."""
        return [peer / ours for peer, ours in zip(self.seconds[name], self.seconds[self.comparison.ours], strict=True)]

    def missed(self) -> list[str]:
        """Promises that this run did not keep."""
        peers = [
            f"{name}: {statistics.median(self.ratios(name)):.2f}x, promised {target:g}x"
            for name, target in self.comparison.targets.items()
            if statistics.median(self.ratios(name)) < target
        ]
        own, limit = self.median(self.comparison.ours), self.comparison.limit
        most = self.comparison.megabytes
        if most is not None and self.peak is not None and self.peak > most:
            peers.append(f"{self.peak:.0f} MB, promised {most:g}")
        return peers + ([f"{own:.2f} CPU-s, promised {limit:g}"] if limit is not None and own > limit else [])


def run(comparison: Comparison, *, rounds: int) -> Result:
    """Time the candidates in turn, round after round, after one untimed round."""
    seconds: dict[str, list[float]] = {name: [] for name in comparison.candidates}
    names = list(comparison.candidates)
    for name in names if comparison.megabytes is None and not comparison.told else ():
        comparison.candidates[name]()
    peak = None
    for number in range(comparison.rounds or rounds):
        shift = number % len(names)
        for name in names[shift:] + names[:shift]:  # nobody always comes first
            start = _cpu_seconds()
            done = comparison.candidates[name]()
            if comparison.megabytes is not None and name == comparison.ours:
                peak = max(peak or 0.0, float(done))  # type: ignore[arg-type]
            seconds[name].append(float(done) if comparison.told else _cpu_seconds() - start)  # type: ignore[arg-type]
    return Result(comparison, seconds, peak)


def _cpu_seconds() -> float:
    """CPU time of this process and of the children it has waited for: waiting for a busy machine does not count."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime
