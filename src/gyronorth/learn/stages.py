"""The two stages (Fig. 2): the denoiser on clean synthetic data, then, frozen, before the heading network."""

from __future__ import annotations

import hashlib
import io
import json
from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import cast

import numpy as np
import torch
from numpy.typing import NDArray

from gyronorth.alignment.networks.diffusion import Normalisation, denoise
from gyronorth.alignment.networks.runtime import decode
from gyronorth.earth import EARTH_RATE
from gyronorth.files import written_beside
from gyronorth.learn.data import HeadingSet, TrainingData, augment, split_recordings, synthetic_set
from gyronorth.learn.denoiser import Denoiser, predictor
from gyronorth.learn.logs import training_log
from gyronorth.learn.recurrent import initialised
from gyronorth.learn.regressor import HeadingNetwork, crmse_deg, precise
from gyronorth.learn.settings import Settings
from gyronorth.learn.spectral_loss import spectral_loss
from gyronorth.learn.training import Progress, Task, decay, fit, torch_threads

Array = NDArray[np.float64]

#: Independent streams of random numbers of one seed.
SPLIT, DENOISER, DENOISER_VALIDATION, AUGMENT, HEADING = range(5)
#: Recordings that are denoised at a time: in smaller piles the products take nearly three times as long.
DENOISED_TOGETHER = 512
#: Changed with what a checkpoint holds: an older one is then refused by name.
CHECKPOINT = 2


@dataclass(frozen=True)
class Run:
    """How a stage is run, beside what decides its result."""

    folder: Path | None = None  # for checkpoints and logs; None: in memory only
    bar: bool = False  # progress bar on the terminal


@dataclass(frozen=True)
class TrainedDenoiser:
    """A denoising network with what is needed to use it."""

    network: Denoiser
    settings: Settings
    normalisation: Normalisation
    progress: Progress

    def clean(self, gyro_l: Array) -> Array:
        """Denoised angular rate (n, samples, 3), rad/s, by the sampler of the settings."""
        return denoise(
            predictor(self.network, batch=self._together()),
            gyro_l,
            schedule=self.settings.schedule,
            sampler=self.settings.sampler,
            normalisation=self.normalisation,
        )

    def _together(self) -> int:
        """Recordings at a time; across the batch that decides the result, elsewhere the speed alone."""
        batch = self.settings.heading.batch
        return batch if self.settings.layout == "across_batch" else max(batch, DENOISED_TOGETHER)


@dataclass(frozen=True)
class TrainedHeading:
    """A heading network with the denoiser before it, if it has one."""

    network: HeadingNetwork
    settings: Settings
    denoiser: TrainedDenoiser | None
    progress: Progress

    def headings(self, gyro_l: Array) -> Array:
        """Headings (n,), rad, of levelled angular rate (n, samples, 3), rad/s."""
        clean = gyro_l if self.denoiser is None else self.denoiser.clean(gyro_l)
        return self.headings_of_clean(clean)

    def headings_of_clean(self, gyro_l: Array) -> Array:
        """The same from angular rate that has been denoised already."""
        network, rate = precise(self.network), torch.from_numpy(gyro_l / EARTH_RATE)
        with torch.inference_mode():
            raw = torch.cat([network(part) for part in rate.split(self.settings.heading.batch)])
        return decode(raw.numpy(), self.settings.heading.output)


def denoiser_data(settings: Settings) -> tuple[HeadingSet, HeadingSet, HeadingSet]:
    """The synthetic set split 60/20/20 % (IV-A): training, validation, test."""
    data = synthetic_set(
        headings=settings.synthetic.headings,
        latitude=radians(settings.synthetic.latitude_deg),
        samples=settings.samples,
    )
    parts = split_recordings(data, (60, 20, 20), rng=np.random.default_rng([settings.seed, SPLIT]))
    return parts[0], parts[1], parts[2]


def train_denoiser(
    settings: Settings,
    clean: tuple[HeadingSet, HeadingSet] | None = None,
    *,
    disturbance: torch.Tensor | None = None,
    run: Run = Run(),
) -> TrainedDenoiser:
    """Stage one: teach the network to tell the noise that eq:17 adds (Alg. 1).

    Parameters
    ----------
    clean : pair of HeadingSet, optional
        Training and validation data taken as x_0; the synthetic set by default.
    disturbance : Tensor, optional
        Sequences (k, samples, 3) of unit deviation that take the place of white noise in eq:17, drawn with replacement.

    Notes
    -----
    Each batch draws t uniform on 1..T and noise afresh. The validation draws them once.
    """
    train, validation = clean if clean is not None else denoiser_data(settings)[:2]
    part = settings.denoiser
    normalisation = Normalisation(settings.normalisation).recorded(train.gyro_l)
    network, generator = new_denoiser(settings)
    gain = torch.from_numpy(np.sqrt(settings.schedule.alpha_bar)).float()
    spread = torch.from_numpy(np.sqrt(1 - settings.schedule.alpha_bar)).float()

    def noised(x_0: torch.Tensor, generator: torch.Generator) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        t = torch.randint(1, settings.schedule.steps + 1, (len(x_0),), generator=generator)
        if disturbance is None:
            noise = torch.randn(x_0.shape, generator=generator)
        else:
            noise = disturbance[torch.randint(len(disturbance), (len(x_0),), generator=generator)]
        return gain[t, None, None] * x_0 + spread[t, None, None] * noise, t, noise

    def difference(prediction: torch.Tensor, noise: torch.Tensor) -> torch.Tensor:
        if part.loss == "mse":
            return torch.mean((prediction - noise) ** 2)
        return spectral_loss(prediction, noise, part.tau)

    x_train, x_validation = _normalised(train, normalisation), _normalised(validation, normalisation)
    fixed = noised(x_validation, _generator(settings, DENOISER_VALIDATION))

    def loss(index: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
        x_t, t, noise = noised(x_train[index], generator)
        return difference(network(x_t, t), noise)

    def validate() -> float:
        with torch.inference_mode():
            prediction = torch.cat(
                [network(x, t) for x, t in zip(fixed[0].split(part.batch), fixed[1].split(part.batch), strict=True)]
            )
            return difference(prediction, fixed[2]).item()

    rate = decay(part.rate, None, part.epochs)
    task = Task("denoiser", network, len(x_train), part.batch, part.epochs, part.patience, rate, loss, validate)
    key = train.sha256() + validation.sha256()
    key += "" if disturbance is None else hashlib.sha256(disturbance.numpy().tobytes()).hexdigest()
    progress = fitted(task, settings, generator, key, run=run)
    return TrainedDenoiser(network, settings, normalisation, progress)


def new_denoiser(settings: Settings) -> tuple[Denoiser, torch.Generator]:
    """A denoiser that has learned nothing, and the generator that drew it and goes on."""
    part, generator = settings.denoiser, _generator(settings, DENOISER)
    network = initialised(
        lambda: Denoiser(
            layout=settings.layout,
            samples=settings.samples,
            layers=part.layers,
            hidden=part.hidden,
            embedding=part.embedding,
        ),
        generator,
    )
    return cast(Denoiser, network), generator


def train_heading(
    settings: Settings,
    data: TrainingData,
    denoiser: TrainedDenoiser | None,
    *,
    last: bool = False,
    run: Run = Run(),
) -> TrainedHeading:
    """Stage two: the heading network on recordings, augmented and then cleaned by the frozen denoiser.

    `denoiser` is left out where the settings say `heading.denoised: false`. The error on a test
    part is written down every epoch and decides nothing. With `last` nothing is chosen: all epochs are run and the
    last one is kept.
    """
    part = settings.heading
    denoiser = denoiser if part.denoised else None
    parts = heading_parts(settings, data, denoiser, run=run)
    x_train, x_validation, *x_test = parts.inputs
    y_train, y_validation, *y_test = parts.headings
    generator = heading_generator(settings)
    network = new_heading(settings, generator)

    def loss(index: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
        return crmse_deg(network(x_train[index], generator), y_train[index])

    def crmse(x: torch.Tensor, y: torch.Tensor) -> float:
        with torch.inference_mode():
            return crmse_deg(torch.cat([network(some) for some in x.split(part.batch)]), y).item()

    def validate() -> float:
        return crmse(x_validation, y_validation)

    def watch() -> dict[str, float]:
        return {"test": crmse(x_test[0], y_test[0])} if x_test else {}

    rate = decay(part.rate, part.rate_end, part.epochs)
    task = Task(
        "heading", network, len(x_train), part.batch, part.epochs, part.patience, rate, loss, validate, watch, last
    )
    progress = fitted(task, settings, generator, parts.key, run=run)
    return TrainedHeading(network, settings, denoiser, progress)


@dataclass(frozen=True)
class HeadingParts:
    """What a heading network is given: the augmented training part, validation and, if there is one, test."""

    inputs: list[torch.Tensor]  # (n, samples, 3) each, in units of Earth rate, through the denoiser
    headings: list[torch.Tensor]  # (n,) each, deg
    key: str  # checksum of the data and of the denoiser


def heading_parts(
    settings: Settings, data: TrainingData, denoiser: TrainedDenoiser | None, *, run: Run = Run()
) -> HeadingParts:
    """Augment the training part and clean all parts by the frozen denoiser (IV-A, Fig. 2)."""
    rng, more = np.random.default_rng([settings.seed, AUGMENT]), settings.heading.augment
    train = augment(data.train, copies=more.copies, span=radians(more.span_deg), noise=more.noise, rng=rng)
    parts = [train, data.validation] + ([] if data.test is None else [data.test])
    key = "".join(part.sha256() for part in parts) + ("" if denoiser is None else _weights_sha256(denoiser.network))
    with torch_threads(settings.threads):
        inputs = _inputs(parts, denoiser, run, _fingerprint("inputs", settings, key))
    return HeadingParts(inputs, [torch.from_numpy(np.degrees(part.heading)).float() for part in parts], key)


def heading_generator(settings: Settings) -> torch.Generator:
    """What draws a heading network's first weights, the order of its data and its dropout."""
    return _generator(settings, HEADING)


def new_heading(settings: Settings, generator: torch.Generator) -> HeadingNetwork:
    """A heading network that has learned nothing."""
    part = settings.heading
    network = initialised(
        lambda: HeadingNetwork(
            layout=settings.layout,
            samples=settings.samples,
            layers=part.layers,
            hidden=part.hidden,
            dropout=part.dropout,
            output=part.output,
        ),
        generator,
    )
    return cast(HeadingNetwork, network)


def fitted(task: Task, settings: Settings, generator: torch.Generator, data_key: str, *, run: Run = Run()) -> Progress:
    """Run a training with the settings' threads, and with checkpoint and log in the run's folder."""
    checkpoint = None if run.folder is None else run.folder / f"{task.name}.pt"
    with (
        torch_threads(settings.threads),
        training_log(run.folder, task.name, epochs=task.epochs, bar=run.bar) as report,
    ):
        fingerprint = _fingerprint(task.name, settings, data_key)
        return fit(task, generator=generator, checkpoint=checkpoint, fingerprint=fingerprint, report=report)


def _inputs(
    parts: list[HeadingSet], denoiser: TrainedDenoiser | None, run: Run, fingerprint: str
) -> list[torch.Tensor]:
    """Network inputs of each part; the denoised ones are kept in the run's folder for a resumed training."""
    if denoiser is None:
        return [_network_input(part.gyro_l) for part in parts]
    path = None if run.folder is None else run.folder / "denoised.npz"
    if path is not None and path.is_file():
        with np.load(path) as stored:
            if str(stored["arr_0"]) == fingerprint:
                return [_network_input(stored[f"arr_{k}"]) for k in range(1, len(parts) + 1)]
    clean = [denoiser.clean(part.gyro_l) for part in parts]
    if path is not None:
        buffer = io.BytesIO()
        np.savez(buffer, np.array(fingerprint), *clean)
        with written_beside(path, durable=True) as beside:
            beside.write_bytes(buffer.getbuffer())
    return [_network_input(one) for one in clean]


def _normalised(data: HeadingSet, normalisation: Normalisation) -> torch.Tensor:
    mean, std = normalisation.moments(data.gyro_l)
    return torch.from_numpy((data.gyro_l - mean) / std).float()


def _network_input(gyro_l: Array) -> torch.Tensor:
    return torch.from_numpy(gyro_l / EARTH_RATE).float()


def _generator(settings: Settings, stream: int) -> torch.Generator:
    seed = np.random.SeedSequence([settings.seed, stream]).generate_state(1, np.uint64)[0]
    return torch.Generator().manual_seed(int(seed))


def _weights_sha256(network: torch.nn.Module) -> str:
    digest = hashlib.sha256()
    for value in network.state_dict().values():
        digest.update(value.numpy().tobytes())
    return digest.hexdigest()


def _fingerprint(name: str, settings: Settings, data_key: str) -> str:
    text = json.dumps([CHECKPOINT, name, settings.model_dump(mode="json"), data_key], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()
