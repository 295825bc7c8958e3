"""A command line in a child of the tests that is ended, or finds no room, while it writes."""

from __future__ import annotations

import os
import resource
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Sequence
from pathlib import Path

from gyronorth.cli import main


def ended(
    words: Sequence[str], place: Path, *, by: str | None = None, before: str = "", room: int | None = None
) -> tuple[int, str]:
    """Status of the child as `os.waitpid` gives it, and what it said.

    `by` is the signal that comes before the last step of the first file whose name ends in `before`; `room` the longest
    file, bytes.
    """
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # it may have threads, of which none is needed
        pid = os.fork()
    if pid == 0:
        try:
            os.chdir(place)
            os.dup2(writing, 1)
            os.dup2(writing, 2)
            sys.stdout, sys.stderr = os.fdopen(1, "w", closefd=False), os.fdopen(2, "w", closefd=False)
            for number in (signal.SIGTERM, signal.SIGHUP):  # the tests themselves may run where it is ignored
                signal.signal(number, signal.SIG_DFL)
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            if room is not None:
                resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))
            if by is not None:
                _end_before_the_last_step(signal.Signals[by], before)
            sys.argv = ["gyronorth", *words]
            main()
        except SystemExit as end:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(end.code if isinstance(end.code, int) else 1)
        except BaseException:
            traceback.print_exc()
            sys.stderr.flush()
        finally:
            os._exit(99)
    os.close(writing)
    with os.fdopen(reading, errors="replace") as pipe:
        said = pipe.read()
    return os.waitpid(pid, 0)[1], said


def _end_before_the_last_step(number: signal.Signals, before: str) -> None:
    """Let the next rename to such a name raise the signal instead, once."""
    waiting = [number]
    for name, step in (("rename", Path.rename), ("replace", Path.replace)):

        def last_step(self: Path, target: Path, do=step) -> object:
            if waiting and Path(target).name.endswith(before):
                os.kill(os.getpid(), waiting.pop())
                time.sleep(60)
            return do(self, target)

        setattr(Path, name, last_step)
