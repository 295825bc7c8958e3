"""The bundles that ship with the package: `python -m gyronorth.learn.shipped [FOLDER]` trains them again.

The paper's system and the earlier baseline, trained with the paper's settings on the published
twin, of which the biases are real and the noise is simulated.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from gyronorth.alignment.networks.bundle import Bundle
from gyronorth.learn.data import HeadingSet, TrainingData, split_recordings
from gyronorth.learn.run import run_training
from gyronorth.learn.settings import Settings, baseline, paper
from gyronorth.published import LATITUDE, SESSION, published_twin

SEED = 20240501
SOURCE = (
    "published reconstruction: mean rates of 60 real SDC500 recordings (arXiv 2312.12121), so that the biases are "
    "real, with simulated white noise; split 42/7/11 by recording"
)


def twin_data(settings: Settings) -> TrainingData:
    """Both 100 s windows of each recording of the reconstruction, split by recording in the paper's ratio 24/4/6."""
    rng = np.random.default_rng([SEED, settings.seed])
    twin = published_twin(rate_hz=settings.rate_hz, rng=rng)
    gyro_l, heading, recording = twin.windows(settings.samples / settings.rate_hz)
    train, validation, test = split_recordings(HeadingSet(gyro_l, heading, recording), (24, 4, 6), rng=rng)
    return TrainingData(
        train,
        validation,
        test=test,
        source=SOURCE,
        latitude=LATITUDE,
        sensor="sdc500",
        unit="SDC500 of arXiv 2312.12121",
        session=SESSION,
    )


def train_shipped(folder: Path, *, progress: bool = False) -> dict[str, Bundle]:
    """Train and export both bundles to `folder`; an interrupted run is continued."""
    bundles = {}
    for method, settings in (("paper", paper()), ("baseline", baseline())):
        stage = "all" if settings.heading.denoised else "regressor"
        bundles[method] = run_training(settings, stage, twin_data(settings), folder / method, True, progress)
    return bundles


if __name__ == "__main__":
    train_shipped(Path(sys.argv[1] if len(sys.argv) > 1 else "bundles"), progress=True)
