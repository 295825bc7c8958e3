"""Many recordings: as an array of one length at once, and as files to a table."""

from __future__ import annotations

import csv
import tempfile
from math import degrees, radians
from pathlib import Path

import numpy as np

import gyronorth as gn
from gyronorth.readers import recordings_in, write
from gyronorth.simulation import simulate_batch

LATITUDE = radians(32.11)
rng = np.random.default_rng(7)

# An array (recordings, samples, 3) of rates, and one of specific force.
truth = rng.uniform(0, 2 * np.pi, 1000)
gyro_b, accel_b = simulate_batch(
    "isa100c", runs=1000, latitude=LATITUDE, heading=truth, duration=60, rate_hz=5, rng=rng
)
batch = gn.heading_batch(gyro_b, accel_b, rate_hz=5, latitude=LATITUDE, sensor="isa100c")
print(
    f"{len(batch.heading)} headings, {batch.valid.sum()} valid, median sigma {degrees(np.median(batch.sigma)):.2f} deg"
)

# Files of any length and format. `gyronorth heading FOLDER --csv table.csv` does the same.
with tempfile.TemporaryDirectory() as name:
    folder = Path(name)
    for number in range(3):
        recording = gn.simulate(
            "isa100c", latitude=LATITUDE, heading=2.0 * number, duration=30 * (number + 1), rate_hz=5, rng=rng
        )
        write(recording, folder / f"site_{number}.csv")
    with (folder / "table.txt").open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(("file", "heading_deg", "sigma_deg", "valid", "reasons"))
        for path in recordings_in(folder):
            estimate = gn.heading(gn.read(path), sensor="isa100c")
            codes = ";".join(reason.code for reason in estimate.reasons)
            figures = (f"{degrees(estimate.heading):.2f}", f"{degrees(estimate.sigma):.2f}", estimate.valid, codes)
            table.writerow((path.name, *figures))
    print((folder / "table.txt").read_text(), end="")
