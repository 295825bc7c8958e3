"""Cost and memory of `gyronorth heading` against the number of samples: `python -m benchmarks samples [--most N]`.

Parquet files of six axes at 600 Hz, each beside a script that only loads the same file with pyarrow and takes means;
a process each, CPU time and peak memory of the process and its children.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY

RATE_HZ, SEED, GROUP = 600.0, 7, 1 << 17
SIZES = (10_000, 30_000, 100_000, 300_000, 1_000_000, 3_000_000, 10_000_000, 30_000_000, 100_000_000)
LOADS = """
import sys
import numpy as np
import pyarrow.parquet as parquet
from pyarrow import csv
names = ["w_x", "w_y", "w_z", "f_x", "f_y", "f_z"]
if sys.argv[1].endswith(".parquet"):
    table = parquet.read_table(sys.argv[1], columns=names, use_threads=False)
else:
    table = csv.read_csv(sys.argv[1], csv.ReadOptions(skip_rows=int(sys.argv[2]), use_threads=False))
samples = np.column_stack([table[name].to_numpy() for name in names])
print(samples[:, :3].mean(axis=0), samples[:, 3:].mean(axis=0))
"""


def main(arguments: list[str]) -> int:
    """Measure, print a line for each size, and write the figures where they are asked for."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks samples")
    parser.add_argument("--most", type=float, default=1e7, help="largest number of samples")
    parser.add_argument("--json", type=Path, help="write the figures here")
    parser.add_argument("--plot", type=Path, help="draw them")
    given = parser.parse_args(arguments)
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for size in (size for size in SIZES if size <= given.most):
            path = Path(folder, "long.parquet")
            write_parquet(path, size)
            ours = measured([sys.executable, "-m", "gyronorth.cli", "heading", str(path), "--sensor", "sdc500"])
            loads = measured([sys.executable, "-c", LOADS, str(path)])
            found.append({"samples": size, "heading": ours, "loads": loads, "arrays_mb": size * 48 / 1e6})
            print(json.dumps(found[-1]), flush=True)
    if given.json:
        given.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    if given.plot:
        draw(found, given.plot)
    return 0


def write_parquet(path: Path, samples: int) -> None:
    """A unit at rest, group of rows by group."""
    import pyarrow
    import pyarrow.parquet as parquet

    rng = np.random.default_rng(SEED)
    means = [*(EARTH_RATE * np.array([0.65, -0.54, -0.53])), 0.1, -0.2, -STANDARD_GRAVITY]
    noise = [1e-4] * 3 + [1e-2] * 3
    names = ("t", "w_x", "w_y", "w_z", "f_x", "f_y", "f_z")
    facts = {"rate_hz": str(RATE_HZ), "gyro_unit": "rad/s", "accel_unit": "m/s2", "axes": "frd", "latitude_deg": "32.1"}
    schema = pyarrow.schema([(name, pyarrow.float64()) for name in names], metadata=facts)
    with parquet.ParquetWriter(str(path), schema, compression="none", use_dictionary=False) as writer:
        for start in range(0, samples, GROUP):
            count = min(GROUP, samples - start)
            columns = [(start + np.arange(count)) / RATE_HZ]
            columns += [rng.normal(mean, sigma, count) for mean, sigma in zip(means, noise, strict=True)]
            writer.write_table(pyarrow.table(columns, schema=schema))


def measured(command: list[str], *, stdin: Path | None = None) -> dict[str, float]:
    """CPU seconds and peak memory, MB, of a process and the children it waited for."""
    code = "import resource, subprocess, sys; subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL); "
    code += "u = resource.getrusage(resource.RUSAGE_CHILDREN); print(u.ru_utime + u.ru_stime, u.ru_maxrss / 1024)"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(os.path.abspath, sys.path))}
    with open(stdin or os.devnull, "rb") as source:
        run = subprocess.run(
            [sys.executable, "-c", code, *command], stdin=source, capture_output=True, text=True, env=environment
        )
    seconds, megabytes = map(float, run.stdout.split())
    return {"cpu_s": seconds, "peak_mb": megabytes}


def draw(found: list[dict[str, Any]], path: Path) -> None:
    """The figure of the page."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    from gyronorth.report.figures import BLUE, INK, RED, SETTINGS, write

    samples = [each["samples"] for each in found]
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(9.0, 3.8), layout="constrained")
        panels = figure.subplots(1, 2)
        for axes, key, title in zip(panels, ("cpu_s", "peak_mb"), ("CPU time (s)", "Peak memory (MB)"), strict=True):
            for name, label, colour in (("heading", "gyronorth heading", BLUE), ("loads", "loading alone", RED)):
                axes.plot(samples, [each[name][key] for each in found], "o-", color=colour, label=label)
            axes.set(title=title, xlabel="samples, six axes, Parquet", xscale="log", yscale="log")
            axes.yaxis.set_major_formatter("{x:g}")
        panels[1].plot(samples, [each["arrays_mb"] for each in found], ":", color=INK, label="the two arrays")
        for axes in panels:
            axes.legend()
    write(figure, path)
