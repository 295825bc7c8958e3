"""The methods by name, and how one of them solves a problem.

A method is one file with an object `METHOD` (or a function `method(name)` where several names share a class) and one
row of `gyronorth.catalogue.METHODS`, which says what is true of it. A method from outside is added by `register`.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast

import numpy as np

from gyronorth import catalogue
from gyronorth.alignment.gates import length_finding
from gyronorth.alignment.problem import Problem
from gyronorth.alignment.result import Result, together, unknown
from gyronorth.arrays import Mask
from gyronorth.catalogue import MethodInfo
from gyronorth.errors import InputError
from gyronorth.frozen import frozen
from gyronorth.given import number

if TYPE_CHECKING:
    from gyronorth.deviation import DeviationModel

#: A recording may be this much longer, s, than the longest that a method takes: samples are never counted to the end.
LENGTH_SLACK = 1.0


#: Entry points of installed packages that name a method of their own.
ENTRY_POINTS = "gyronorth.methods"


@frozen
class Options:
    """What a user asks of a method, beside the problem."""

    bundle: Path | None = None  # trained networks; None: those that ship
    turn_angles: tuple[float, ...] | None = None  # of the turns between poses, rad, clockwise from above
    turn_angle_sigma: float | None = None  # of one of them, rad; None: from what the gyro measures of the turns
    deviation: DeviationModel | None = None  # curve that corrects the closed form


class Method(Protocol):
    """A way to find a heading."""

    @property
    def info(self) -> MethodInfo:
        """Its row of the catalogue."""
        ...

    def solve(self, problem: Problem, options: Options) -> Result:
        """What it finds of one recording; of a batch where `info.batched`."""
        ...


class _Methods(Mapping[str, Method]):
    """Every known method, imported when it is first asked for."""

    def __init__(self) -> None:
        self._rows = {info.name: info for info in catalogue.METHODS}
        self._loaded: dict[str, Method] = {}

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, name: str) -> Method:
        name = str(name)
        if name not in self._rows:
            from importlib.metadata import entry_points  # slow to load

            for entry in entry_points(group=ENTRY_POINTS, name=name):
                self.add(entry.load())
        if name not in self._rows:
            near = difflib.get_close_matches(str(name), self._rows, n=1)
            hint = f" (did you mean {near[0]}?)" if near else ""
            raise InputError(f"Method {name!r} is not known{hint}; one of {', '.join(self._rows)} is expected.")
        if name not in self._loaded:
            module = import_module(self._rows[name].module)
            self._loaded[name] = module.method(name) if hasattr(module, "method") else module.METHOD
        return self._loaded[name]

    def __contains__(self, name: object) -> bool:
        try:
            self[str(name)]
        except InputError:
            return False
        return True

    def info(self, name: str) -> MethodInfo:
        """The row of a method, without importing it."""
        return self._rows[name] if (name := str(name)) in self._rows else self[name].info

    def add(self, method: Method) -> None:
        """Register a method; see `register`."""
        self._rows[method.info.name] = method.info
        self._loaded[method.info.name] = method


METHODS = _Methods()
"""The known methods by name, also those that other packages add; each is loaded when it is first asked for."""


def register(method: Method) -> None:
    """Add a method from outside the package, or replace one.

    Parameters
    ----------
    method : Method
        An object with `info` (a `catalogue.MethodInfo`) and `solve`. From then on `heading(..., method=NAME)`,
        batches, streams and the command line take it. An installed package can name it as an entry point of the
        group `ENTRY_POINTS` instead.
    """
    METHODS.add(method)


def check(name: str, problem: Problem, options: Options) -> Method:
    """The method, if it can work on this problem with these options.

    Raises
    ------
    InputError
        If the method is not known, or its traits do not allow what is asked.
    """
    method, info = METHODS[name], METHODS.info(name)
    if options.bundle is not None and not info.takes_bundle:
        takers = [other.name for other in catalogue.METHODS if other.takes_bundle]
        raise InputError(
            f"A bundle was given, but method {name} runs none; {', '.join(takers[:-1])} and {takers[-1]} do."
        )
    if options.turn_angles is not None and not info.takes_turn_angles:
        raise InputError(f"Turn angles belong to method turned, or auto; method {name} was given. Leave them out.")
    sigma = options.turn_angle_sigma
    if sigma is not None and options.turn_angles is None:
        raise InputError("A sigma of the turn angles was given, but no turn angles. Give both, or leave it out.")
    if sigma is not None and not 0 < sigma < np.inf:
        raise InputError(f"The sigma of the turn angles is {sigma:g} rad; a positive angle is expected.")
    if problem.attitude is not None and not info.takes_attitude:
        raise InputError(
            f"Roll and pitch were given, but method {name} takes the attitude from the recording itself. "
            "Leave them out, or use --method mean."
        )
    _check_attitude(problem.attitude)
    for what, given in (("Roll and pitch", problem.attitude), ("Turn angles", options.turn_angles)):
        if given is not None and not np.isfinite(given).all():
            raise InputError(f"{what} of {given} rad were given; finite angles are expected.")
    if problem.attitude is not None and options.turn_angles is not None:
        raise InputError(
            "Roll and pitch were given together with turn angles: they hold for one pose, the angles for several. "
            "Leave one of them out."
        )
    if info.needs_accelerometer and problem.accel_b is None:
        raise InputError(
            f"Method {name!r} traces gravity and needs specific force; the recording has angular rate only. "
            "Use --method mean."
        )
    if not fits(info, problem):
        raise InputError(
            f"Method {name!r} works on {info.shortest_s:g} to {info.longest_s:g} s at {info.lowest_rate_hz:g} Hz "
            f"or more; the recording has {problem.duration:g} s at {problem.rate_hz:g} Hz. Cut it with --window, or "
            "use --method mean."
        )
    return method


def _check_attitude(attitude: Any) -> None:
    if attitude is None:
        return
    angles = list(attitude) if hasattr(attitude, "__iter__") and getattr(attitude, "ndim", 1) else []
    if len(angles) != 2:
        raise InputError(f"The attitude is {attitude!r:.80}; roll and pitch, two angles in rad, are expected.")
    for name, angle in zip(("roll", "pitch"), angles, strict=True):
        number(f"The {name} given", angle)


def fits(info: MethodInfo, problem: Problem) -> bool:
    """Whether a method is made for recordings of this rate and duration."""
    return (
        problem.rate_hz >= info.lowest_rate_hz and info.shortest_s <= problem.duration <= info.longest_s + LENGTH_SLACK
    )


def solve(name: str, problem: Problem, options: Options) -> Result:
    """What a method finds of one recording, corrected by a deviation curve where one is given.

    Raises
    ------
    InputError
        As `check`, and where the method itself cannot work on the recording.
    """
    method = check(name, problem, options)
    too_short = length_finding(problem.gyro_b.shape[-2], problem.duration)
    if too_short is not None:
        return unknown(problem.mean, why="too short for any other", refusals=(too_short,))
    result = method.solve(problem, options)
    if options.deviation is None:
        return result
    if not METHODS.info(result.method).corrected_by_deviation:
        raise InputError(
            f"A deviation curve corrects the closed form, but the method is {result.method}. Use --method mean with it."
        )
    from gyronorth.alignment import correction

    return correction.corrected(result, problem, options.deviation)


def solve_batch(name: str, problem: Problem, options: Options) -> list[tuple[Mask, Problem, Result]]:
    """Results of a batch, shape (n,), in groups: which recordings, their problem, and what was found.

    Recordings that the method works at once are one group, and so are those whose results, by one method and with a
    claim to judge, can be judged as one; each of the others is one of its own. So a batch and its recordings one by one
    give the same.
    """
    method, everything = check(name, problem, options), np.ones(problem.shape, dtype=bool)
    too_short = length_finding(problem.gyro_b.shape[-2], problem.duration)
    if too_short is not None:
        return [(everything, problem, unknown(problem.mean, refusals=(too_short,)))]
    if METHODS.info(name).batched:
        return [(everything, problem, method.solve(problem, options))]
    _ = problem.motion  # worked out for all at once, and handed on
    ones = [problem[index] for index in range(len(everything))]
    if options.deviation is not None:
        results = [solve(name, one, options) for one in ones]
    else:
        results = solve_each(name, ones, options)
    groups: dict[tuple[object, ...], list[int]] = {}
    for place, result in enumerate(results):
        alone = result.judged is None or bool(result.refusals)
        groups.setdefault((place,) if alone else (result.method, *result.variance), []).append(place)
    found: list[tuple[Mask, Problem, Result]] = []
    for places in groups.values():
        where = np.isin(np.arange(len(results)), places)
        if len(places) == 1:
            found.append((where, ones[places[0]], results[places[0]]))
        else:
            some = problem if where.all() else problem[where]
            found.append((where, some, together([results[place] for place in places])))
    return found


def solve_each(name: str, problems: Sequence[Problem], options: Options) -> list[Result]:
    """What a method finds of each of several recordings of one length, rate and place, side by side where it can."""
    method = METHODS[name]
    many = getattr(method, "solve_many", None)
    if many is None:
        return [method.solve(problem, options) for problem in problems]
    return list(cast("Iterable[Result]", many(problems, options)))
