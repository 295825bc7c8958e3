"""Where the CPU time of `gyronorth heading` goes: `python -m benchmarks stages [--rounds N] [--json FILE]`.

Stage by stage on the long files of `cost`, beside the script that only loads them, where pandas is not installed. Each
round is a process of its own; the least time of a stage counts, as what else the machine does only adds to it.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.cost import LONG, RATE_HZ, WITHOUT_PANDAS, comments_of, written
from benchmarks.samples import LOADS

#: Notes how much CPU time this process, and the children it has waited for, have taken up to now.
_MARK = """
import json, resource, time
marks = []
def mark(name):
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    marks.append((name, time.process_time(), children.ru_utime + children.ru_stime))
mark("start of Python")
import numpy
mark("NumPy")
"""
_ARROW = """
if sys.argv[1].endswith(".parquet"):
    import pyarrow.parquet
else:
    import pyarrow.csv
mark("pyarrow")
"""
OURS = f"""
import sys
{_MARK}
import typer.core
mark("typer")
{_ARROW}
import gyronorth.cli.heading_command, gyronorth.pipeline, gyronorth.readers, gyronorth.report.terminal
mark("gyronorth")
recording = gyronorth.readers.read(sys.argv[1])
mark("reading the rows and checking them")
gyronorth.pipeline.heading(recording, sensor="sdc500")
mark("the heading by auto")
print(json.dumps(marks))
"""
THEIRS = f"""
import sys
{_MARK}
{_ARROW}
{LOADS}
mark("loading the rows, means")
print(json.dumps(marks))
"""


def main(arguments: list[str]) -> int:
    """Measure, print a line for each stage, and write the figures where they are asked for."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks stages")
    parser.add_argument("--rounds", type=int, default=5, help="rounds, of which the least time counts")
    parser.add_argument("--json", type=Path, help="write the figures here")
    given = parser.parse_args(arguments)
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for suffix in ("csv", "parquet"):
            path = written(Path(folder, f"long.{suffix}"), LONG)
            above = str(comments_of(path)) if suffix == "csv" else "0"
            for program, code in (("gyronorth heading", OURS), ("loading alone", WITHOUT_PANDAS + THEIRS)):
                stages = _least([sys.executable, "-c", code, str(path), above], given.rounds)
                found.append({"rows": round(LONG * RATE_HZ), "format": suffix, "program": program, "cpu_s": stages})
                print(json.dumps(found[-1]), flush=True)
    if given.json:
        given.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    return 0


def _least(command: list[str], rounds: int) -> dict[str, float]:
    """CPU seconds of each stage, in the order of the stages; what children did is part of it."""
    least: dict[str, float] = {}
    for _ in range(rounds):
        run = subprocess.run(command, check=True, capture_output=True, text=True)
        before = 0.0
        for name, own, children in json.loads(run.stdout.splitlines()[-1]):
            least[name] = min(least.get(name, float("inf")), own + children - before)
            before = own + children
    return {name: round(seconds, 4) for name, seconds in least.items()}
