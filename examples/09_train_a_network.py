"""Train the paper's two stages on recordings of one's own, and run the bundle. A toy: seconds, not hours."""

from __future__ import annotations

import sys
import tempfile
from importlib.util import find_spec
from math import degrees, radians
from pathlib import Path

import numpy as np

import gyronorth as gn
from gyronorth.readers import ReadOptions, write

if find_spec("torch") is None:
    sys.exit("This example needs the extra train: pip install 'gyronorth[train]'")

from gyronorth.learn.data import own_data
from gyronorth.learn.run import run_training
from gyronorth.learn.settings import Settings

LATITUDE = radians(32.11)
small = Settings(  # what is not named keeps the paper's value
    samples=60,  # 20 s at 3 Hz
    synthetic={"headings": 24},
    denoiser={"layers": 1, "hidden": 8, "epochs": 2},
    heading={"layers": 1, "hidden": 8, "epochs": 5, "augment": {"copies": 10}},
)

with tempfile.TemporaryDirectory() as name:
    folder = Path(name)
    (folder / "mine").mkdir()
    rng = np.random.default_rng(9)
    for number in range(12):
        recording = gn.simulate("sdc500", latitude=LATITUDE, heading=0.52 * number, duration=20, rate_hz=3, rng=rng)
        write(recording, folder / f"mine/{number}.csv")
    data = own_data(folder / "mine", settings=small, reading=ReadOptions(latitude=LATITUDE))
    bundle = run_training(small, "all", data, folder / "bundle")
    for metric, value in bundle.metrics.items():
        print(f"{metric:36s} {'none' if value is None else f'{value:.3g}'}")

    new = gn.simulate("sdc500", latitude=LATITUDE, heading=1.0, duration=20, rate_hz=3, rng=rng)
    estimate = gn.heading(new, sensor="sdc500", method="paper", model=folder / "bundle")
    print(f"heading {degrees(estimate.heading):.0f} deg, truth {degrees(1.0):.0f}; it has learnt next to nothing, and")
    print(f"its sigma of {degrees(estimate.sigma):.0f} deg, from the recordings it had not seen, says so")
