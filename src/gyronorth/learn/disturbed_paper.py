"""The paper's networks trained on disturbed recordings: what they are worth where the mean suffers.

Three denoisers. `white` is the paper's, on clean data of the site with white noise added (eq:17).
`disturbance` puts simulated disturbance, sensor noise included, in the place of the white noise, so that the
chain of eq:18 takes that away. `pairs` forgets the schedule: the network sees a normalised recording and
predicts what is to be taken from it to leave the constant Earth rate, in one step. Before the
heading network stands one of them, or none.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray

from gyronorth.alignment.networks.diffusion import Normalisation
from gyronorth.attitude import mat_bn
from gyronorth.earth import earth_rate_n
from gyronorth.learn.data import HeadingSet, synthetic_set
from gyronorth.learn.denoiser import Denoiser, predictor
from gyronorth.learn.settings import Settings
from gyronorth.learn.stages import TrainedDenoiser, fitted, new_denoiser, train_denoiser
from gyronorth.learn.training import Task, decay
from gyronorth.simulation.disturbance import reference_set

Array = NDArray[np.float64]
Kind = Literal["white", "disturbance", "pairs"]

#: Site of the reference set, deg.
LATITUDE_DEG = 32.11
#: Seeds of the recordings beside that of the settings: none is that of the test set.
TRAIN, VALIDATION = 101, 102
#: Of the recordings this share is of the reference mix; the others are quiet.
MIXED = 0.8


@dataclass(frozen=True)
class Recordings:
    """Disturbed and quiet recordings, and the constant rate that each would read without anything on top."""

    noisy: HeadingSet
    clean: Array  # (n, 1, 3) rad/s


def draw_recordings(settings: Settings, count: int, *, stream: int) -> Recordings:
    """`count` recordings at headings uniform on the circle, 4 of 5 of the reference mix."""
    parts = []
    for number, (kind, share) in enumerate((("mixed", MIXED), ("quiet", 1 - MIXED))):
        seed = int(np.random.SeedSequence([settings.seed, stream, number]).generate_state(1)[0])
        duration = settings.samples / settings.rate_hz
        parts.append(reference_set(kind, runs=round(count * share), duration=duration, seed=seed))
    heading = np.concatenate([part.heading for part in parts])
    gyro = np.concatenate([part.gyro_b for part in parts])
    clean = mat_bn(0.0, 0.0, heading) @ earth_rate_n(radians(LATITUDE_DEG))
    return Recordings(HeadingSet(gyro, heading, np.arange(len(heading))), clean[:, None])


def train_kind(settings: Settings, kind: Kind, train: Recordings, validation: Recordings) -> TrainedDenoiser:
    """A denoiser of the kind."""
    if kind == "pairs":
        return _train_pairs(settings, train, validation)
    clean = synthetic_set(headings=720, latitude=radians(LATITUDE_DEG), samples=settings.samples)
    every = np.arange(720)
    parts = clean.rows(every % 5 != 0), clean.rows(every % 5 == 0)
    if kind == "white":
        return train_denoiser(settings, parts)
    off = train.noisy.gyro_l - train.clean
    off = off / np.sqrt(np.mean(off**2, axis=(1, 2), keepdims=True))
    return train_denoiser(settings, parts, disturbance=torch.from_numpy(off).float())


def without_disturbance(denoiser: TrainedDenoiser, kind: Kind, gyro_l: Array) -> Array:
    """Denoised angular rate (n, samples, 3), rad/s: by the chain, or for `pairs` in one step."""
    if kind != "pairs":
        return denoiser.clean(gyro_l)
    mean, std = denoiser.normalisation.moments(gyro_l)
    predict = predictor(denoiser.network, batch=denoiser.settings.heading.batch)
    step = denoiser.settings.schedule.steps
    return gyro_l - std * predict(((gyro_l - mean) / std).astype(np.float32), step)


def _train_pairs(settings: Settings, train: Recordings, validation: Recordings) -> TrainedDenoiser:
    """The denoiser's network on pairs of a recording and its constant rate, always at the last step."""
    part, normalisation = settings.denoiser, Normalisation(settings.normalisation)
    network, generator = new_denoiser(settings)

    def pair(data: Recordings) -> tuple[torch.Tensor, torch.Tensor]:
        gyro = data.noisy.gyro_l
        mean, std = normalisation.moments(gyro)
        return torch.from_numpy((gyro - mean) / std).float(), torch.from_numpy((gyro - data.clean) / std).float()

    (x_train, y_train), (x_validation, y_validation) = pair(train), pair(validation)

    def difference(network: Denoiser, x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
        off = network(x, torch.full((len(x),), settings.schedule.steps)) - y
        # What counts for the heading is the error of the time mean; the shape comes second.
        return off.mean(dim=1).pow(2).mean() + 0.1 * off.pow(2).mean()

    def validate() -> float:
        with torch.inference_mode():
            return difference(network, x_validation, y_validation).item()

    task = Task(
        name="denoiser",
        network=network,
        items=len(x_train),
        batch=part.batch,
        epochs=part.epochs,
        patience=part.patience,
        rate=decay(part.rate, part.rate / 20, part.epochs),
        loss=lambda index, _: difference(network, x_train[index], y_train[index]),
        validate=validate,
    )
    key = train.noisy.sha256() + validation.noisy.sha256()
    return TrainedDenoiser(network, settings, normalisation, fitted(task, settings, generator, key))
