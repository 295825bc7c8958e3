"""A campaign: so many mutated inputs, each from the seed and its number alone, so that one can be made again."""

from __future__ import annotations

import random
import time
import traceback
from collections import Counter
from pathlib import Path

from fuzz.mutation import mutated
from fuzz.targets import Target, judge, targets

#: Seconds of computing that one input may take.
LONGEST = 30.0


def campaign(
    cases: int, seed: int, folder: Path, *, only: str = "", keep: Path | None = None
) -> tuple[Counter[str], list[str]]:
    """What became of the inputs, and what broke the oracle; `keep` gets the inputs that did."""
    chosen = [target for target in targets(folder) if target.name.startswith(only)]
    for target in chosen:
        assert judge(target, target.honest) in ("valid", "invalid", "taken"), target.name
    counts: Counter[str] = Counter()
    failures: list[str] = []
    for number in range(cases):
        target = chosen[number % len(chosen)]
        content = mutated(target.honest, random.Random(f"{seed} {number}"), kind=target.kind)
        failure = broken(target, content, counts)
        if failure is None:
            continue
        failures.append(f"{target.name}, seed {seed}, number {number}: {failure}")
        if keep is not None:
            keep.mkdir(parents=True, exist_ok=True)
            (keep / f"{target.name}.{seed}.{number}").write_bytes(content)
    return counts, failures


def broken(target: Target, content: bytes, counts: Counter[str]) -> str | None:
    """How an input breaks the oracle; None where it does not."""
    start = time.process_time()
    try:
        counts[judge(target, content)] += 1
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        return f"{type(error).__name__}: {str(error)[:120]} ({Path(place.filename).name}:{place.lineno})"
    took = time.process_time() - start
    return f"{took:.0f} s of computing" if took > LONGEST else None
