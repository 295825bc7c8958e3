"""The denoiser's reverse process on one recording: an exported bundle beside a diffusers loop over the same network."""

from __future__ import annotations

import copy
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import cast

import diffusers
import numpy as np
import torch

from benchmarks.comparison import Comparison
from gyronorth.alignment.networks.diffusion import Sampler, Schedule
from gyronorth.alignment.networks.runtime import LoadedBundle, clean, load_bundle
from gyronorth.angles import DEG_PER_SQRT_HOUR, angle_error
from gyronorth.learn.data import synthetic_set
from gyronorth.learn.denoiser import Denoiser
from gyronorth.learn.export import export_bundle
from gyronorth.learn.recurrent import BiLSTM
from gyronorth.learn.settings import paper
from gyronorth.learn.stages import TrainedDenoiser, train_denoiser

T_BACK = 950
#: The paper's own sampler, and the same 50 steps taken in one jump.
CHAIN = Sampler(t_back=T_BACK)
ONE = Sampler(t_back=T_BACK, jumps=1, noise=False)
LATITUDE = np.radians(32.11)
#: Angle random walk of an SDC500, as one sample at 3 Hz, rad/s.
NOISE = 0.02 * DEG_PER_SQRT_HOUR * np.sqrt(3.0)


def comparisons() -> Iterable[Comparison]:
    """The comparisons of this module; prints how far the headings of the samplers lie apart."""
    torch.set_num_threads(1)
    settings = paper()
    trained = train_denoiser(
        settings.model_copy(update={"denoiser": settings.denoiser.model_copy(update={"epochs": 40})})
    )
    print("\n" + _heading_differences(trained))
    gyro, chain = _recordings(1), _bundle(trained)
    one = _with_sampler(chain, ONE)
    x = torch.from_numpy((gyro - gyro.mean()) / gyro.std()).float()
    lstm, gated = _as_lstm(trained.network), trained.network
    scheduler = _scheduler()
    loop = {
        "diffusers": lambda: _diffusers_loop(scheduler, lstm, x),
        "diffusers, layers as ours": lambda: _diffusers_loop(scheduler, gated, x),
    }
    yield Comparison(
        title="Denoising one recording of 300 samples, flattened: 50 steps",
        ours="gyronorth",
        candidates={"gyronorth": _repeated(lambda: clean(chain, gyro)), **{k: _repeated(f) for k, f in loop.items()}},
        targets={"diffusers": 5.0},
    )
    yield Comparison(
        title="The same in one step instead of 50",
        ours="gyronorth",
        candidates={"gyronorth": _repeated(lambda: clean(one, gyro)), **{k: _repeated(f) for k, f in loop.items()}},
        targets={"diffusers": 40.0},
    )


def _repeated(work: Callable[[], object], times: int = 5) -> Callable[[], None]:
    def many() -> None:
        for _ in range(times):
            work()

    return many


def _recordings(n: int) -> np.ndarray:
    clean_set = synthetic_set(headings=n, latitude=float(LATITUDE))
    return clean_set.gyro_l + NOISE * np.random.default_rng(1).standard_normal(clean_set.gyro_l.shape)


def _bundle(trained: TrainedDenoiser) -> LoadedBundle:
    with tempfile.TemporaryDirectory() as folder:
        export_bundle(Path(folder) / "bundle", denoiser=trained)
        return _with_sampler(load_bundle(Path(folder) / "bundle"), CHAIN)


def _with_sampler(bundle: LoadedBundle, sampler: Sampler) -> LoadedBundle:
    assert bundle.info.denoiser is not None
    part = bundle.info.denoiser.model_copy(update={"sampler": sampler})
    return replace(bundle, info=bundle.info.model_copy(update={"denoiser": part}))


def _as_lstm(network: Denoiser) -> Denoiser:
    """The same network and weights with torch.nn.LSTM layers, as one would write it."""
    network = copy.deepcopy(network)
    for layer in network.recurrent:
        cast(BiLSTM, layer).single_step = False
    return network


def _scheduler() -> diffusers.DDPMScheduler:
    schedule = Schedule()
    scheduler = diffusers.DDPMScheduler(
        num_train_timesteps=schedule.steps,
        trained_betas=schedule.beta[1:],
        clip_sample=False,
        variance_type="fixed_large",
    )
    scheduler.set_timesteps(schedule.steps)
    return scheduler


def _diffusers_loop(scheduler: diffusers.DDPMScheduler, network: Denoiser, x: torch.Tensor) -> torch.Tensor:
    """diffusers counts steps from 0, we from 1."""
    generator = torch.Generator().manual_seed(0)
    with torch.inference_mode():
        for t in scheduler.timesteps[: len(scheduler.timesteps) - T_BACK]:
            noise = network(x, (t + 1).expand(len(x)))
            x = scheduler.step(noise, t, x, generator=generator).prev_sample
    return x


def _heading_differences(trained: TrainedDenoiser, n: int = 90) -> str:
    """RMS difference of the mean rate's heading between samplers, over simulated recordings."""
    gyro = _recordings(n)

    def heading(sampler: Sampler) -> np.ndarray:
        settings = trained.settings.model_copy(update={"sampler": sampler})
        mean = replace(trained, settings=settings).clean(gyro).mean(axis=1)
        return np.arctan2(-mean[:, 1], mean[:, 0])

    reference = heading(replace(CHAIN, noise=False))
    others = {
        "with sampling noise": heading(CHAIN),
        "one step": heading(ONE),
        "DDIM, 50 steps": heading(Sampler(kind="ddim", t_back=T_BACK)),
        "DDIM, one step": heading(Sampler(kind="ddim", t_back=T_BACK, jumps=1)),
    }
    rms = {name: np.degrees(np.sqrt(np.mean(angle_error(one, reference) ** 2))) for name, one in others.items()}
    return f"Heading against the 50 steps without sampling noise, RMS of {n} recordings: " + ", ".join(
        f"{name} {value:.2g} deg" for name, value in rms.items()
    )
