"""Where work is done: processes of this machine, or the workers of a Dask cluster."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from gyronorth.errors import InputError

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    import distributed

#: How often a cluster gives a piece of work out again whose worker was lost or that failed.
ATTEMPTS = 3


@contextmanager
def executor_on(scheduler: str | None, *, workers: int | None = None) -> Iterator[Executor]:
    """A pool of local processes, or with the address of a Dask scheduler its cluster.

    Raises
    ------
    InputError
        If Dask is not installed or does not answer.
    """
    if scheduler is None:
        pool = LocalPool(workers)
        try:
            yield pool
        except Exception:
            pool.shutdown(cancel_futures=True)  # what runs is let end
            raise
        except BaseException:  # Ctrl-C, or a signal: what runs may take an hour
            pool.stop()
            raise
        pool.shutdown(cancel_futures=True)
        return
    try:
        from distributed import Client
    except ImportError:
        raise InputError("--scheduler needs Dask, which is not installed. Install gyronorth[scale].") from None
    try:
        client = Client(scheduler, timeout=5)
    except (OSError, ValueError) as error:
        raise InputError(
            f"No Dask scheduler answers at {scheduler} ({error}). Start one or give its address."
        ) from None
    with client:
        yield DaskPool(client)


class LocalPool(Executor):
    """A pool of processes that can be made anew when one of them was lost, which ends all of them."""

    def __init__(self, workers: int | None = None) -> None:
        self.workers = workers or os.cpu_count() or 1
        self._pool: ProcessPoolExecutor | None = None
        self._open: Connection | None = None  # the processes end when it is closed

    def submit(self, function: Callable[..., Any], /, *args: Any, **arguments: Any) -> Future[Any]:
        """Give work to a process; the first call starts them."""
        if self._pool is None:
            # Fork after PyTorch has started threads can hang.
            context = _spawn()
            theirs, self._open = context.Pipe(duplex=False)
            self._pool = ProcessPoolExecutor(self.workers, mp_context=context, initializer=_begin, initargs=(theirs,))
        return self._pool.submit(function, *args, **arguments)

    def renew(self) -> None:
        """Forget the processes; the next work starts others."""
        self.shutdown(cancel_futures=True)
        self._pool = None

    def stop(self) -> None:
        """End the processes at once, whatever they do."""
        if self._open is not None:
            self._open.close()
        self.renew()  # and what the pool shared with them goes: its semaphores

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes."""
        if self._pool is not None:
            self._pool.shutdown(wait=wait, cancel_futures=cancel_futures)


class DaskPool(Executor):
    """Work on the workers of a Dask cluster.

    Dask's own `ClientExecutor` asks for the state of a unit after it has fetched the result, and takes
    the result for an exception if the worker has been lost in between.
    """

    def __init__(self, client: distributed.Client) -> None:
        self._client = client

    def submit(self, function: Callable[..., Any], /, *args: Any, **arguments: Any) -> Future[Any]:
        """Give work to the cluster."""
        given: Future[Any] = Future()
        remote = self._client.submit(function, *args, retries=ATTEMPTS, pure=False, **arguments)
        remote.add_done_callback(lambda unit: _hand_over(unit, given))
        return given


def _hand_over(unit: distributed.Future[Any], given: Future[Any]) -> None:
    from distributed import KilledWorker

    try:
        given.set_result(unit.result())
    except (CancelledError, KilledWorker) as error:
        given.set_exception(BrokenExecutor(str(error)))
    except Exception as error:
        given.set_exception(error)


def _spawn() -> Any:
    import multiprocessing

    return multiprocessing.get_context("spawn")


def _begin(held: Connection) -> None:
    """How a worker begins: it leaves an interruption to its parent, ends when told or with it, and uses one thread."""
    import multiprocessing

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent, held), daemon=True).start()


def _end_with(parent: Any, held: Connection) -> None:
    """A parent that was killed tells its workers nothing: they would wait for work forever."""
    from multiprocessing.connection import wait

    wait([parent.sentinel, held])
    os._exit(1)
