"""Units of work of the studies: small, resumable, one result file each, on any executor.

A unit is a plain function with plain arguments. Its result file holds what is needed to repeat
and to judge it: arguments, seed, commit, hash of the shipped data, command. A unit whose file
is there with the same arguments is not run again; a file appears whole or not at all. Nothing
in it depends on where or how often it was run, so that local processes and a cluster leave
the same files.
"""

from __future__ import annotations

import hashlib
import json
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import Any

from gyronorth.errors import InputError
from gyronorth.files import write_text

SCHEMA = "gyronorth.unit/1"

Result = dict[str, Any]


@dataclass(frozen=True)
class Job:
    """One piece of work: `function(*results of needs, **arguments)` gives a JSON-able dict.

    `name` is the path of its result file below `units/`, without suffix.
    """

    name: str
    function: Callable[..., Result]
    arguments: Mapping[str, Any]
    needs: tuple[Job, ...] = field(default=())

    def key(self) -> str:
        """Checksum of what decides the result."""
        what = [self.function.__module__, self.function.__qualname__, self.arguments, [n.key() for n in self.needs]]
        return hashlib.sha256(json.dumps([*what, data_sha256()], sort_keys=True).encode()).hexdigest()


def run_units(
    units: Sequence[Job],
    folder: Path,
    executor: Executor,
    *,
    command: str,
    done: Callable[[int, int], None] = lambda _finished, _total: None,
    spent: Callable[[Job, float], None] = lambda _unit, _seconds: None,
) -> dict[str, Result]:
    """Run what is not there yet and give all results by name.

    Finished units are written as they come; `done(finished, total)` is called after each, and `spent(unit, seconds)`
    with the CPU time of its process.
    An exception in a unit is raised once the others that run have been written.

    Raises
    ------
    InputError
        If the workers end before their units do.
    """
    order = with_needs(units)
    results = {unit.name: result for unit in order if (result := _stored(unit, folder)) is not None}
    waiting = [unit for unit in order if unit.name not in results]
    running: dict[Future[tuple[Result, float]], Job] = {}
    failure: Exception | None = None
    done(len(results), len(order))
    while (waiting and failure is None) or running:
        if failure is None:
            for unit in [u for u in waiting if all(n.name in results for n in u.needs)]:
                waiting.remove(unit)
                running[executor.submit(_work, unit, [results[n.name] for n in unit.needs])] = unit
        finished, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in finished:
            unit = running.pop(future)
            try:
                result, seconds = future.result()
            except Exception as error:
                failure = failure or error
                continue
            _write(unit, result, folder, command)
            results[unit.name] = result
            spent(unit, seconds)
            done(len(results), len(order))
    if isinstance(failure, BrokenExecutor):
        raise InputError(
            f"The workers were lost before their units were finished ({failure}). The likely cause is too little "
            "memory, or with --scheduler a broken connection. What is finished is kept: give the command again to "
            "go on, with fewer --workers if it happens again."
        ) from failure
    if failure is not None:
        raise failure
    return results


@cache
def data_sha256() -> str:
    """Checksum of the published figures that ship with the package."""
    digest = hashlib.sha256()
    for name in ("published_recordings.csv", "published_durations.csv"):
        digest.update((files("gyronorth") / "data" / name).read_bytes())
    return digest.hexdigest()


@cache
def commit() -> str:
    """Commit of the code, with + if files differ from it; the package version outside a repository."""
    here = Path(__file__).parent
    git = ["git", "-C", str(here)]
    try:
        head = subprocess.run([*git, "rev-parse", "HEAD"], capture_output=True, text=True, check=True).stdout.strip()
        changed = subprocess.run([*git, "status", "--porcelain", "--", ":/src"], capture_output=True, text=True)
    except (OSError, subprocess.CalledProcessError):
        return f"version {version('gyronorth')}"
    return head + ("+" if changed.stdout.strip() else "")


def write_json(path: Path, content: object) -> None:
    """JSON, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def _work(unit: Job, needs: list[Result]) -> tuple[Result, float]:
    start = time.process_time()
    return unit.function(*needs, **unit.arguments), time.process_time() - start


def finished_units(units: Sequence[Job], folder: Path) -> set[str]:
    """Names of the units whose results are in the folder already."""
    return {unit.name for unit in units if _stored(unit, folder) is not None}


def with_needs(units: Sequence[Job]) -> list[Job]:
    """The units and all that they need, each once, needs first."""
    found: dict[str, Job] = {}

    def visit(unit: Job) -> None:
        for need in unit.needs:
            visit(need)
        if unit.name in found and found[unit.name].key() != unit.key():
            raise ValueError(f"Two different units are called {unit.name}.")
        found.setdefault(unit.name, unit)

    for unit in units:
        visit(unit)
    return list(found.values())


def _path(unit: Job, folder: Path) -> Path:
    return folder / "units" / f"{unit.name}.json"


def _stored(unit: Job, folder: Path) -> Result | None:
    path = _path(unit, folder)
    if not path.is_file():
        return None
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return content["result"] if content.get("key") == unit.key() else None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}.") from None
    except (ValueError, AttributeError, LookupError, RecursionError):
        raise InputError(f"{path} is no result of a unit: it is damaged. Remove it; it is then made again.") from None


def _write(unit: Job, result: Result, folder: Path, command: str) -> None:
    content = {
        "schema": SCHEMA,
        "unit": unit.name,
        "key": unit.key(),
        "seed": unit.arguments.get("seed"),
        "commit": commit(),
        "data_sha256": data_sha256(),
        "command": command,
        "arguments": dict(unit.arguments),
        "needs": [need.name for need in unit.needs],
        "result": result,
    }
    write_json(_path(unit, folder), content)
