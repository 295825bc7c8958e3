"""The choice among the methods: several poses are fitted together, one pose has one posterior."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gyronorth.alignment.problem import Problem
from gyronorth.alignment.registry import METHODS, Options, solve_each
from gyronorth.alignment.result import Result
from gyronorth.alignment.turned.segments import Segments
from gyronorth.catalogue import method_info
from gyronorth.errors import InputError


class Auto:
    """One more method, which asks the others."""

    info = method_info("auto")

    def solve(self, problem: Problem, options: Options) -> Result:
        """`turned` where there are poses, else `posterior`; the mean where a deviation curve corrects it."""
        return self.solve_many([problem], options)[0]

    def solve_many(self, problems: Sequence[Problem], options: Options) -> list[Result]:
        """The same of several recordings of one length, rate and place: those of one pose side by side."""
        found: dict[int, Result] = {}
        for number, problem in enumerate(problems):
            if problem.attitude is None and problem.segments.poses > 1:
                turned = METHODS["turned"].solve(problem, options)
                found[number] = replace(turned, why=_counted(problem.segments))
            elif options.turn_angles is not None:
                raise InputError("Turn angles were given, but the recording holds one pose only. Leave them out.")
            elif options.deviation is not None:
                mean = METHODS["mean"].solve(problem, Options())
                found[number] = replace(mean, why="one pose, for the deviation curve")
        left = [number for number in range(len(problems)) if number not in found]
        solved = solve_each("posterior", [problems[number] for number in left], Options())
        found |= dict(zip(left, solved, strict=True))
        return [found[number] for number in range(len(problems))]


def _counted(segments: Segments) -> str:
    """Poses and steady rotations in words."""
    spins = sum(turn.spin for turn in segments.turns)
    counts = ((segments.poses - spins, "pose"), (spins, "steady rotation"))
    return " and ".join(f"{count} {name}{'s' * (count > 1)}" for count, name in counts if count)


METHOD = Auto()
