"""The choice among the methods: several poses are fitted together, one pose has one posterior."""

from __future__ import annotations

from dataclasses import replace

from gyronorth.alignment.problem import Problem
from gyronorth.alignment.registry import METHODS, Options
from gyronorth.alignment.result import Result
from gyronorth.alignment.turned.segments import Segments
from gyronorth.catalogue import method_info
from gyronorth.errors import InputError


class Auto:
    """One more method, which asks the others."""

    info = method_info("auto")

    def solve(self, problem: Problem, options: Options) -> Result:
        """`turned` where there are poses, else `posterior`; the mean where a deviation curve corrects it."""
        if problem.attitude is None and problem.segments.poses > 1:
            return replace(METHODS["turned"].solve(problem, options), why=_counted(problem.segments))
        if options.turn_angles is not None:
            raise InputError("Turn angles were given, but the recording holds one pose only. Leave them out.")
        if options.deviation is not None:
            return replace(METHODS["mean"].solve(problem, Options()), why="one pose, for the deviation curve")
        return METHODS["posterior"].solve(problem, Options())


def _counted(segments: Segments) -> str:
    """Poses and steady rotations in words."""
    spins = sum(turn.spin for turn in segments.turns)
    counts = ((segments.poses - spins, "pose"), (spins, "steady rotation"))
    return " and ".join(f"{count} {name}{'s' * (count > 1)}" for count, name in counts if count)


METHOD = Auto()
