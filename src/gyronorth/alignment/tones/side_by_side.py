"""Searches of several recordings a step at a time: what they ask for next is worked out for all of them at once.

A search is a generator that yields what it wants to know, `Proposing` or `Weighing`, and returns what it found. Numbers
do not depend on who runs beside it: the same operations are done on the same numbers, only fewer times over.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from numpy.typing import NDArray

from gyronorth.alignment.tones.evidence import Columns, ToneLaw, evidences
from gyronorth.arrays import Array

#: Numbers of an array over models that fit the cache of a core: so many recordings are weighed at once.
AT_ONCE = 1 << 13

Found = TypeVar("Found")


@dataclass(frozen=True)
class Proposing:
    """Where bumps and tones may be: the inputs of a network."""

    rate: NDArray[Any]  # (n, 3) in units of noise less their median
    index: NDArray[Any]  # (n,)
    cycles: NDArray[Any]  # (f,)


@dataclass(frozen=True)
class Weighing:
    """The evidence of every model of the columns of one recording."""

    law: ToneLaw
    seen: Columns
    log_prior: Array  # (f,)
    scale: float = 1.0


Request = Proposing | Weighing
Search = Generator[Request, Any, Found]
#: From several requests of one length to log odds (n,) and log weights (f,) of each.
ProposeMany = Callable[[Sequence[Proposing]], Sequence[tuple[Array, Array]]]


def searched(searches: Sequence[Search[Found]], propose: ProposeMany) -> list[Found]:
    """What each search found."""
    found: dict[int, Found] = {}
    waiting: dict[int, Request] = {}

    def go_on(number: int, answer: Any) -> None:
        try:
            waiting[number] = searches[number].send(answer)
        except StopIteration as end:
            found[number] = end.value

    for number in range(len(searches)):
        go_on(number, None)
    while waiting:
        groups: dict[Any, list[int]] = {}
        for number, request in waiting.items():
            groups.setdefault(_kind(request), []).append(number)
        # The smallest first: who waits for a step that is alike may be joined by others.
        numbers = min(groups.values(), key=lambda group: _size(waiting[group[0]]))
        requests = [waiting.pop(number) for number in numbers]
        for number, answer in zip(numbers, _answers(requests, propose), strict=True):
            go_on(number, answer)
    return [found[number] for number in range(len(searches))]


def _kind(request: Request) -> Any:
    """Requests of one kind are worked out at once."""
    if isinstance(request, Proposing):
        return len(request.rate), len(request.cycles)
    return id(request.law), len(request.log_prior)


def _size(request: Request) -> int:
    return 0 if isinstance(request, Proposing) else len(request.log_prior)


def _answers(requests: Sequence[Request], propose: ProposeMany) -> list[Any]:
    asked = [request for request in requests if isinstance(request, Proposing)]
    if asked:
        return list(propose(asked))
    weighed = [request for request in requests if isinstance(request, Weighing)]
    f, slow = len(weighed[0].log_prior), len(weighed[0].law.share) + 2
    group = max(1, AT_ONCE // ((1 + f + f * (f - 1) // 2) * slow))
    return [
        each
        for start in range(0, len(weighed), group)
        for each in evidences(
            weighed[0].law,
            [one.seen for one in weighed[start : start + group]],
            [one.log_prior for one in weighed[start : start + group]],
            [one.scale for one in weighed[start : start + group]],
        )
    ]
