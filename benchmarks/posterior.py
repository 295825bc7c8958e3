"""`auto` beside `learned` of the commit that had no posterior, and beside the closed form; `learned` beside itself.

The old commit runs from a worktree of the repository, so this needs its history. Each candidate is a process that does
the work once to load everything, then again; it prints the CPU time of the second.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.comparison import Comparison
from gyronorth.simulation.disturbance import reference_set

#: The last commit whose choice was among claimed sigmas, and windows of the reference mix that are worked.
BEFORE, WINDOWS = "cdab764", 100
ROOT = Path(__file__).parents[1]
WORK = """
import sys, time
import numpy as np
from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR
from gyronorth.pipeline import heading_batch
from gyronorth.sensor import Sensor, TriadErrors
method, profile, size, data = sys.argv[1:]
made = np.load(data)
errors = TriadErrors(white=0.02 * DEG_PER_SQRT_HOUR, turn_on_bias=0.1 * DEG_PER_HOUR)
known = {"rate_hz": float(made["rate_hz"]), "latitude": float(made["latitude"]), "method": method}
known["sensor"] = Sensor("of the mix", errors, TriadErrors()) if profile == "profile" else None
size = int(size)
parts = [made["gyro_b"][start : start + size] for start in range(0, len(made["gyro_b"]), size)]
heading_batch(parts[0][:8], **known)
start = time.process_time()
for part in parts:
    heading_batch(part, **known)
print(time.process_time() - start)
"""
HOUR = """
import sys, time
from math import radians
import numpy as np
from gyronorth.pipeline import heading
from gyronorth.simulation import simulate
place = {"latitude": radians(40), "heading": radians(30)}
made = simulate("sdc500", duration=3600.0, rate_hz=100.0, rng=np.random.default_rng(1), **place)
sensor = "sdc500" if sys.argv[2] == "profile" else None
heading(made, sensor=sensor, method=sys.argv[1])
start = time.process_time()
for _ in range(3):
    heading(made, sensor=sensor, method=sys.argv[1])
print(time.process_time() - start)
"""


def comparisons() -> Iterator[Comparison]:
    """A batch and single recordings of 100 s at 3 Hz; one of 1 h at 100 Hz."""
    with tempfile.TemporaryDirectory() as folder:
        old, data = Path(folder, "before"), Path(folder, "mix.npz")
        subprocess.run(["git", "-C", ROOT, "worktree", "add", "-q", "--detach", old, BEFORE], check=True)
        try:
            made = reference_set()
            np.savez(data, gyro_b=made.gyro_b[:WINDOWS], rate_hz=made.rate_hz, latitude=made.latitude)
            for method, profile, size, most in (
                ("auto", "profile", WINDOWS, 1.5),
                ("auto", "profile", 1, 3.0),
                ("learned", "profile", WINDOWS, 0.5),
                ("learned", "no profile", WINDOWS, 0.5),
            ):
                how = "in a batch" if size > 1 else "one by one"
                peer = f"learned of {BEFORE}"
                yield Comparison(
                    f"{method} on {WINDOWS} windows of 300 x 3 {how}, {profile}",
                    ours=method,
                    candidates={
                        method: partial(_seconds, ROOT, WORK, method, profile, str(size), str(data)),
                        peer: partial(_seconds, old, WORK, "learned", profile, str(size), str(data)),
                    },
                    targets={peer: 1 / most},
                    told=True,
                )
        finally:
            subprocess.run(["git", "-C", ROOT, "worktree", "remove", "--force", old], check=True)
    for profile, targets in (("profile", {"mean": 1 / 2}), ("no profile", {})):
        yield Comparison(
            f"auto on 1 h at 100 Hz, six axes, {profile}, beyond reading",
            ours="auto",
            candidates={method: partial(_seconds, ROOT, HOUR, method, profile) for method in ("auto", "mean")},
            targets=targets,
            told=True,
        )


def _seconds(root: Path, code: str, *arguments: str) -> float:
    environment = os.environ | {"PYTHONPATH": str(root / "src")}
    run = subprocess.run(
        [sys.executable, "-c", code, *arguments], check=True, capture_output=True, text=True, env=environment
    )
    return float(run.stdout)
