"""One function for each of many items, on workers that may be lost."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from itertools import islice
from typing import TypeVar

from gyronorth.errors import InputError
from gyronorth.many.workers import LocalPool

T = TypeVar("T")
R = TypeVar("R")

#: Items that are given out ahead: for each process of this machine, and to any other executor.
AHEAD, AHEAD_ELSEWHERE = 3, 256
#: How often an item alone may take its worker with it.
LONE_ATTEMPTS = 2


class WorkerLost(InputError):
    """An item whose worker ended before it did."""


def each(
    function: Callable[[T], R], items: Iterable[T], executor: Executor | None = None
) -> Iterator[tuple[T, R | Exception]]:
    """`function(item)` for each item, with what came of it: its result, or the exception.

    Parameters
    ----------
    function : callable
        Importable, where there is an executor that pickles.
    items : iterable
        Taken as they are needed.
    executor : Executor, optional
        Who does the work. Without one it is done here, in the order of the items; else they come as they are finished.

    Raises
    ------
    InputError
        If all workers of an executor from outside are lost.
    """
    waiting = iter(items)
    if executor is None:
        for item in waiting:
            yield item, _here(function, item)
        return
    ahead = AHEAD * executor.workers if isinstance(executor, LocalPool) else AHEAD_ELSEWHERE
    running: dict[Future[R], T] = {}
    while True:
        lost: list[T] = []
        for item in islice(waiting, ahead - len(running)):
            try:
                running[executor.submit(function, item)] = item
            except BrokenExecutor as error:
                if not isinstance(executor, LocalPool):
                    raise _all_lost(error) from error
                lost.append(item)
                break
        if not running and not lost:
            return
        finished, _ = wait(running, return_when=FIRST_COMPLETED) if not lost else (set(running), None)
        for future in finished:
            item = running.pop(future)
            outcome = _result(future)
            if isinstance(outcome, WorkerLost):
                lost.append(item)
            else:
                yield item, outcome
        if lost and isinstance(executor, LocalPool):
            yield from _one_by_one(function, lost, running, executor)
        else:
            yield from ((item, WorkerLost(_LOST)) for item in lost)


#: What the row of an item says that took its worker with it.
_LOST = (
    "The worker was lost while it was at this recording; too little memory is the likely cause. Read a part of it with "
    "--window, or take fewer --workers."
)


def _one_by_one(
    function: Callable[[T], R], lost: list[T], running: dict[Future[R], T], executor: LocalPool
) -> Iterator[tuple[T, R | Exception]]:
    """A lost process takes the whole pool with it: of the items that were out, whichever ends its worker alone did."""
    for future, item in running.items():
        outcome = _result(future)
        if isinstance(outcome, WorkerLost):
            lost.append(item)
        else:
            yield item, outcome
    running.clear()
    executor.renew()
    for item in lost:
        outcome: R | Exception = WorkerLost(_LOST)
        for _ in range(LONE_ATTEMPTS):
            outcome = _result(executor.submit(function, item))
            if not isinstance(outcome, WorkerLost):
                break
            executor.renew()
        yield item, outcome


def _result(future: Future[R]) -> R | Exception:
    try:
        return future.result()
    except BrokenExecutor:
        return WorkerLost(_LOST)
    except Exception as error:
        return error


def _here(function: Callable[[T], R], item: T) -> R | Exception:
    try:
        return function(item)
    except Exception as error:
        return error


def _all_lost(error: Exception) -> InputError:
    return InputError(
        f"The workers were lost before their work was finished ({error}). What is finished is kept: go on with it when "
        "there are others."
    )
