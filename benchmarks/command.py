"""The command line: start-up, and one heading beside a ten-line numpy script on the same file.

The script averages and takes an arc tangent; it checks nothing, has no uncertainty and no verdict.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from math import radians
from pathlib import Path

import numpy as np

from benchmarks.comparison import Comparison
from gyronorth.readers import write
from gyronorth.simulation import simulate

#: What a help text needs of its libraries.
LIBRARIES = "import typer.core, typer.rich_utils"
DURATION, RATE_HZ, SEED = 100.0, 600.0, 20260501
MEMORY_MB = 400
SCRIPT = """
import sys
import numpy as np
data = np.loadtxt(sys.argv[1], delimiter=",", comments="#", skiprows=int(sys.argv[2]))
w, f = data[:, 1:4].mean(axis=0), data[:, 4:7].mean(axis=0)
roll = np.arctan2(-f[1], -f[2])
pitch = np.arctan2(f[0], np.hypot(f[1], f[2]))
x = w[0] * np.cos(pitch) + np.sin(pitch) * (w[1] * np.sin(roll) + w[2] * np.cos(roll))
y = w[1] * np.cos(roll) - w[2] * np.sin(roll)
print(np.degrees(np.arctan2(-y, x)) % 360)
"""


def comparisons() -> Iterator[Comparison]:
    """Start-up of the command; the whole command on 100 s at 600 Hz."""
    command = [sys.executable, "-m", "gyronorth.cli"]
    yield Comparison(
        "gyronorth --help beside importing what it is made with",
        ours="gyronorth --help",
        candidates={
            "gyronorth --help": lambda: _run([*command, "--help"]),
            "import of typer and rich": lambda: _run([sys.executable, "-c", LIBRARIES]),
        },
        targets={"import of typer and rich": 0.6},
    )
    with tempfile.TemporaryDirectory() as folder:
        path, script = Path(folder) / "rec.csv", Path(folder) / "script.py"
        rng = np.random.default_rng(SEED)
        write(
            simulate(
                "sdc500", latitude=radians(32.11), heading=radians(40), duration=DURATION, rate_hz=RATE_HZ, rng=rng
            ),
            path,
        )
        script.write_text(SCRIPT)
        header = next(number for number, line in enumerate(path.open(), start=1) if not line.startswith("#"))
        ours = [*command, "heading", str(path), "--sensor", "sdc500", "--json"]
        theirs = [sys.executable, str(script), str(path), str(header)]
        yield Comparison(
            f"heading of a CSV of {DURATION * RATE_HZ:g} rows, six axes, the whole process",
            ours="gyronorth heading",
            candidates={"gyronorth heading": lambda: _run(ours), "numpy script": lambda: _run(theirs)},
            limit=2.0,
        )
        paper = [*ours, "--method", "paper"]
        print(f"\ngyronorth heading --method paper: peak memory {_peak_mb(paper):.0f} MB, promised {MEMORY_MB}")
        yield Comparison(
            "the same by the shipped bundle of the paper's system, PyTorch not loaded",
            ours="--method paper",
            candidates={"--method paper": lambda: _run(paper), "--method mean": lambda: _run(ours)},
            limit=3.0,
        )


def _peak_mb(command: list[str]) -> float:
    """Largest resident memory of the command, MB; ends the run if it is more than promised."""
    code = "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL); "
    code += "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024)"
    found = subprocess.run([sys.executable, "-c", code, *command], check=True, capture_output=True, text=True)
    peak = float(found.stdout)
    if peak > MEMORY_MB:
        raise SystemExit(f"{' '.join(command)} took {peak:.0f} MB, promised {MEMORY_MB}.")
    return peak


def _run(command: list[str]) -> None:
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
