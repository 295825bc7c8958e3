"""Searches of several recordings a step at a time: what they ask for next is worked out for all of them at once.

A search is a generator that yields what it wants to know, `Proposing` or `Weighing`, and returns what it found. Numbers
do not depend on who runs beside it: the same operations are done on the same numbers, only fewer times over.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from typing import Any, TypeVar

from numpy.typing import NDArray

from gyronorth.alignment.tones.elimination import tones_of
from gyronorth.alignment.tones.evidence import Columns, ToneLaw, evidences
from gyronorth.arrays import Array
from gyronorth.frozen import frozen

#: Numbers of an array over models that fit the cache of a core: so many recordings are weighed at once.
AT_ONCE = 1 << 16
#: Recordings that are searched side by side.
TOGETHER = 32

Found = TypeVar("Found")


@frozen
class Proposing:
    """Where bumps and tones may be: the inputs of a network."""

    rate: NDArray[Any]  # (n, 3) in units of noise less their median
    index: NDArray[Any]  # (n,)
    cycles: NDArray[Any]  # (f,)


@frozen
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
        numbers = max(groups.values(), key=len)  # who waits may be joined by others
        requests = [waiting.pop(number) for number in numbers]
        for number, answer in zip(numbers, _answers(requests, propose), strict=True):
            go_on(number, answer)
    return [found[number] for number in range(len(searches))]


def _kind(request: Request) -> Any:
    """Requests of one kind are worked out at once."""
    if isinstance(request, Proposing):
        return len(request.rate), len(request.cycles)
    return id(request.law)


def _answers(requests: Sequence[Request], propose: ProposeMany) -> list[Any]:
    asked = [request for request in requests if isinstance(request, Proposing)]
    if asked:
        return list(propose(asked))
    weighed = [request for request in requests if isinstance(request, Weighing)]
    found: list[Any] = []
    some: list[Weighing] = []
    size = 0
    for number, one in enumerate(weighed):
        some.append(one)
        size += len(tones_of(len(one.log_prior))[0]) * (len(one.law.share) + 2)
        if size >= AT_ONCE or number == len(weighed) - 1:
            found += evidences(
                one.law,
                [each.seen for each in some],
                [each.log_prior for each in some],
                [each.scale for each in some],
            )
            some, size = [], 0
    return found
