"""A campaign: so many mutated inputs, each from the seed and its number alone, so that one can be made again.

A fork for each input would cost more than all else. So the inputs of a target are taken in one child, where
decoders run unguarded, as they do on Windows; what ends or troubles that child is judged anew here, with a
guard of its own. Those that load PyTorch come last: it makes every fork dearer.
"""

from __future__ import annotations

import os
import random
import signal
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from fuzz.mutation import mutated
from fuzz.oracle import Target, judge
from fuzz.targets import targets

from gyronorth.apart import Apart, Limits

#: What one input may take: seconds of computing, and all of it.
LONGEST = 30.0
LIMITS = Limits(seconds=LONGEST, memory=3 << 29)


def campaign(
    cases: int, seed: int, folder: Path, *, only: str = "", keep: Path | None = None
) -> tuple[Counter[str], list[str]]:
    """What became of the inputs, and what broke the oracle; `keep` gets the inputs that did."""
    chosen = [target for target in targets(folder) if target.name.startswith(only)]
    counts: Counter[str] = Counter()
    failures: list[str] = []
    for first, target in enumerate(chosen):
        assert judge(target, target.honest) in ("valid", "invalid", "taken"), target.name
        child = None
        for number in range(first, cases, len(chosen)):
            content = mutated(target.honest, random.Random(f"{seed} {number}"), kind=target.kind)
            child = child or Apart(lambda target=target: _unguarded(target), limits=LIMITS, what=target.name)
            try:
                counts[child.ask(content, seconds=LONGEST)] += 1
                continue
            except Exception:
                child.close()
                child = None
            failure = broken(target, content, counts)
            if failure is None:
                continue
            failures.append(f"{target.name}, seed {seed}, number {number}: {failure}")
            if keep is not None:
                keep.mkdir(parents=True, exist_ok=True)
                (keep / f"{target.name}.{seed}.{number}").write_bytes(content)
    return counts, failures


def _unguarded(target: Target) -> Callable[[bytes], str]:
    """The judge in a child that forks no more."""
    del os.fork
    return lambda content: judge(target, content)


def broken(target: Target, content: bytes, counts: Counter[str]) -> str | None:
    """How an input breaks the oracle; None where it does not."""
    try:
        with limited("the input"):
            counts[judge(target, content)] += 1
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        return f"{type(error).__name__}: {str(error)[:120]} ({Path(place.filename).name}:{place.lineno})"
    return None


@contextmanager
def limited(what: str) -> Iterator[None]:
    """Code of ours that goes on for longer is interrupted here; that of others is by its own limits."""

    def stop(*_: object) -> None:
        raise TimeoutError(f"{what} took more than {LONGEST:.0f} s of computing")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, LONGEST)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)
