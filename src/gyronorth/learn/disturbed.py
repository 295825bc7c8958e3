"""Training of `learned`: recordings of the reference mix drawn afresh for every batch.

`python -m gyronorth.learn.disturbed [FOLDER]` makes the bundle that ships with the package again
(the default folder is `bundles/learned`); an interrupted run is continued.
"""

from __future__ import annotations

import json
import math
import sys
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from gyronorth.alignment.networks.bundle import Bundle, Domain, ProposalPart, checksum
from gyronorth.alignment.networks.runtime import load_bundle, solve
from gyronorth.alignment.tones.evidence import network_axes
from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR, angle_error, cyclic_rmse
from gyronorth.attitude import heading_of_rate
from gyronorth.files import folder_beside
from gyronorth.learn.proposal import Proposal
from gyronorth.learn.training import Progress, Task, fit, torch_threads
from gyronorth.sensor import TriadErrors
from gyronorth.simulation.disturbance import DEG, DISTRIBUTIONS, Draw, reference_set

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DisturbedSettings:
    """Everything that decides the training."""

    seed: int = 20240612
    rate_hz: float = 3.0
    #: Lengths of the recordings in samples, one drawn for each batch: 30 to 300 s.
    samples: tuple[int, ...] = (90, 120, 150, 200, 240, 300, 300, 300, 300, 300, 450, 600, 900)
    white: tuple[float, float] = (0.01, 0.05)  # angle random walk, log-uniform, deg/sqrt(h)
    knocks: float = 0.2  # share of the batches with knocks beside bumps
    batch: int = 48  # recordings of 300 samples; longer ones are fewer
    batches: int = 100  # an epoch
    epochs: int = 48
    rate: float = 2e-3  # Adam, falling as a cosine to zero
    hidden: int = 32
    validation: int = 200  # recordings of each length that judge an epoch
    calibration: int = 2000  # recordings of each kind that calibrate sigma


DEFAULT = DisturbedSettings()


@dataclass(frozen=True)
class DisturbedBatch:
    """Simulated recordings of one length with what disturbed them."""

    rate: Tensor  # (n, samples, 3) in units of noise, less the median
    index: Tensor  # (samples,)
    cycles: Tensor  # (f,)
    bump: Tensor  # (n, samples) 1 within a bump or knock
    tone: Tensor  # (n, 2) number of the nearest frequency
    present: Tensor  # (n, 2) 1 where there is that tone


def draw_batch(settings: DisturbedSettings, size: int, *, samples: int, rng: np.random.Generator) -> DisturbedBatch:
    """Recordings of the reference mix with white noise and no heading: constants are taken away."""
    edges = np.arange(samples + 1) / settings.rate_hz
    draw = Draw(size, edges, rng)
    frequency = np.stack([draw.log_uniform(0.008, 0.3) for _ in range(2)], axis=1)
    present = rng.random((size, 2)) < 0.7
    angle = sum(draw.sine(draw.half_normal(0.002 * DEG) * present[:, [i]], frequency[:, i]) for i in range(2))
    struck = draw.bumps(0)
    if rng.random() < settings.knocks:
        struck = struck + draw.knocks(0)
    low, high = np.log(settings.white)
    noise = np.exp(rng.uniform(low, high, (size, 1, 1))) * DEG_PER_SQRT_HOUR * np.sqrt(settings.rate_hz)
    settled = (rng.random((size, 1, 1)) < 0.8) * draw.warm_up()
    rate = np.diff(angle + struck + settled, axis=1) * settings.rate_hz
    rate = rate / noise + rng.standard_normal(rate.shape)
    moved = np.abs(np.diff(struck, axis=1)).max(axis=2) * settings.rate_hz
    index, cycles = network_axes(samples, settings.rate_hz)
    spacing = cycles[1] - cycles[0]
    cell = np.clip(np.round((frequency / settings.rate_hz - cycles[0]) / spacing), 0, len(cycles) - 1)
    return DisturbedBatch(
        torch.as_tensor(rate - np.median(rate, axis=1, keepdims=True), dtype=torch.float32),
        torch.as_tensor(index),
        torch.as_tensor(cycles),
        torch.as_tensor(moved > 0.3 * noise[:, :, 0], dtype=torch.float32),
        torch.as_tensor(cell, dtype=torch.int64),
        torch.as_tensor(present, dtype=torch.float32),
    )


def loss_of(network: Proposal, batch: DisturbedBatch) -> Tensor:
    """Cross entropy of the bumps plus that of each tone's cell, nats a recording and sample or tone."""
    bump, tone = network(batch.rate, batch.index, batch.cycles)
    struck = functional.binary_cross_entropy_with_logits(bump, batch.bump)
    log_weight = torch.log_softmax(tone, dim=1)
    each = -log_weight.gather(1, batch.tone) * batch.present
    return 10 * struck + each.sum() / batch.present.sum().clamp(min=1)


def train(
    settings: DisturbedSettings,
    *,
    checkpoint: Path | None = None,
    report: Callable[[Progress], None] | None = None,
) -> tuple[Proposal, Progress]:
    """Train the network; the weights with the lowest loss on fixed validation recordings are kept."""
    torch.manual_seed(settings.seed)
    network = Proposal(settings.hidden)
    held = [
        draw_batch(settings, settings.validation, samples=n, rng=np.random.default_rng([settings.seed, n]))
        for n in (90, 300, 900)
    ]

    def loss(index: Tensor, generator: torch.Generator) -> Tensor:
        rng = np.random.default_rng(int(torch.randint(2**62, (1,), generator=generator)))
        samples = int(rng.choice(settings.samples))
        size = max(1, round(len(index) * 300 / max(samples, 200)))
        return loss_of(network, draw_batch(settings, size, samples=samples, rng=rng))

    def validate() -> float:
        with torch.no_grad():
            return float(np.mean([loss_of(network, batch).item() for batch in held]))

    task = Task(
        name="proposal",
        network=network,
        items=settings.batch * settings.batches,
        batch=settings.batch,
        epochs=settings.epochs,
        patience=settings.epochs,
        rate=lambda epoch: settings.rate * (0.01 + 0.495 * (1 + math.cos(math.pi * epoch / settings.epochs))),
        loss=loss,
        validate=validate,
    )
    generator = torch.Generator().manual_seed(settings.seed)
    progress = fit(task, generator=generator, checkpoint=checkpoint, fingerprint=repr(settings), report=report)
    return network, progress


def export_proposal(network: Proposal, path: Path, *, rate_hz: float) -> None:
    """Write the network as ONNX, open in the number of recordings, samples and frequencies."""
    index, cycles = network_axes(300, rate_hz)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", category=DeprecationWarning)  # torch calls this exporter legacy
        torch.onnx.export(
            network.eval(),
            (torch.zeros(1, 300, 3), torch.as_tensor(index), torch.as_tensor(cycles)),
            str(path),
            dynamo=False,
            input_names=["rate", "index", "cycles"],
            output_names=["bump", "tone"],
            dynamic_axes={
                "rate": {0: "n", 1: "samples"},
                "index": {0: "samples"},
                "cycles": {0: "f"},
                "bump": {0: "n", 1: "samples"},
                "tone": {0: "n", 1: "f"},
            },
            opset_version=17,
        )


def calibrated_scale(folder: Path, settings: DisturbedSettings) -> tuple[float, dict[str, float | None]]:
    """By how much the intervals of the bundle must be widened to hold 95 %, and what it is worth in validation.

    Validation recordings of 100 s, half of the reference mix and half quiet, of other seeds than the test set.
    """
    bundle, ratio, metrics = load_bundle(folder), [], {}
    bias, white = 0.1 * DEG_PER_HOUR, 0.02 * DEG_PER_SQRT_HOUR
    for number, kind in enumerate(("mixed", "quiet")):
        made = reference_set(kind, runs=settings.calibration, bias=bias, white=white, seed=settings.seed + 1 + number)
        errors = TriadErrors(white=white, turn_on_bias=bias)
        found = solve(bundle, made.gyro_b, rate_hz=made.rate_hz, latitude=made.latitude, errors=errors)
        off = angle_error(made.heading, found.heading)
        ratio.append(np.where(off > 0, off / found.high, off / found.low))
        mean = made.gyro_b.mean(axis=1)
        closed_form = angle_error(heading_of_rate(mean), made.heading)
        metrics[f"validation_{kind}_recordings"] = float(settings.calibration)
        metrics[f"validation_{kind}_mean_crmse_deg"] = float(np.degrees(cyclic_rmse(closed_form)))
        metrics[f"validation_{kind}_learned_crmse_deg"] = float(np.degrees(cyclic_rmse(off)))
    scale = float(np.quantile(np.concatenate(ratio), 0.95))
    for kind, part in zip(("mixed", "quiet"), ratio, strict=True):
        metrics[f"validation_{kind}_coverage"] = float(np.mean(part <= scale))
    return scale, metrics


def make_bundle(
    folder: Path, settings: DisturbedSettings = DEFAULT, *, report: Callable[[Progress], None] | None = None
) -> Bundle:
    """Train, export and calibrate the bundle `folder`; checkpoints go to `<folder>.training` beside it."""
    training = folder.with_name(folder.name + ".training")
    training.mkdir(parents=True, exist_ok=True)
    with torch_threads(1):
        network, progress = train(settings, checkpoint=training / "proposal.pt", report=report)
    with folder_beside(folder) as part:
        export_proposal(network, part / "proposal.onnx", rate_hz=settings.rate_hz)
        bundle = Bundle(
            method="learned",
            layout="temporal",
            domain=Domain(
                rate_hz=settings.rate_hz, samples=min(settings.samples), longest_samples=max(settings.samples)
            ),
            proposal=ProposalPart(sha256=checksum(part / "proposal.onnx")),
            training=json.loads(json.dumps(asdict(settings))),
            metrics={"epochs": float(progress.epoch), "validation_loss": progress.best},
            provenance={
                "torch": torch.__version__,
                "data": "synthetic: gyronorth.simulation.disturbance, drawn afresh for each batch",
            },
        )
        (part / "bundle.json").write_text(bundle.to_json(), encoding="utf-8")
        scale, metrics = calibrated_scale(part, settings)
        bundle = bundle.model_copy(
            update={
                "proposal": bundle.proposal.model_copy(update={"sigma_scale": scale}) if bundle.proposal else None,
                "metrics": {**bundle.metrics, **metrics},
            }
        )
        (part / "bundle.json").write_text(bundle.to_json(), encoding="utf-8")
        (part / "README.md").write_text(model_card(bundle, settings), encoding="utf-8")
    return bundle


def model_card(bundle: Bundle, settings: DisturbedSettings) -> str:
    """README.md of the bundle: what it does, what it was trained on, where it does not apply."""
    rows = [
        f"| {kind} | {bundle.metrics[f'validation_{kind}_mean_crmse_deg']:.2f} "
        f"| {bundle.metrics[f'validation_{kind}_learned_crmse_deg']:.2f} "
        f"| {100 * (bundle.metrics[f'validation_{kind}_coverage'] or 0):.1f} % |"
        for kind in ("mixed", "quiet")
    ]
    return CARD.format(
        shortest=min(settings.samples) / settings.rate_hz,
        longest=max(settings.samples) / settings.rate_hz,
        rate=settings.rate_hz,
        low=settings.white[0],
        high=settings.white[1],
        mix="; ".join(f"{name}: {DISTRIBUTIONS[name]}" for name in ("sway tone", "bump", "knock", "warm-up")),
        recordings=settings.calibration,
        rows="\n".join(rows),
        scale=bundle.proposal.sigma_scale if bundle.proposal else 1.0,
        seed=settings.seed,
        examples=settings.epochs * settings.batches * settings.batch,
    )


CARD = """# Heading under disturbance (`learned`)

A network looks at a level gyro recording and proposes which samples lie in a bump and on which
frequencies it sways. On the 16 likeliest frequencies every model (no, one or two tones; nothing slow, a
settling bias, a slow tilt or a walking bias) is weighed by its closed-form evidence, and the headings are averaged.
The network proposes, physics decides: a wrong proposal costs accuracy only where it misses a tone.

- Input: {shortest:g} to {longest:g} s of levelled angular rate at {rate:g} Hz; gyro alone. Any latitude where Earth's
  rate has a horizontal part. Rates are scaled by the sensor's own noise; trained for {low:g} to {high:g} deg/sqrt(h).
- Trained on simulation only, about {examples} recordings, each used once. {mix}.
- It carries no unit's deviation curve and no prior on heading.
- Remake: `python -m gyronorth.learn.disturbed FOLDER` (seed {seed}).

| validation, {recordings} recordings of 100 s each | mean, deg | learned, deg | inside the 95 % interval |
|---|---|---|---|
{rows}

Sigma and interval are widened by {scale:.3f}, chosen on these recordings. Where the residual exceeds the
sensor's noise the noise is scaled up and `fits` is false: the disturbance is of no kind that was learned.

A tilt of a hundredth of a degree that takes minutes turns the unit by less than its gyro's noise: the gyro alone cannot
see most of it, and the interval covers it less often than it says. An accelerometer sees it; use `inertial` there.
Not for a unit that drives or is carried; not where tones lie outside 0.008-0.3 Hz. In up to {longest:g} s a bias that
settles more slowly than 120 s is taken for a walk from switch-on, and the interval is too narrow; a longer recording is
averaged down to no more samples, and its bias may take up to twice its duration. White noise alone is estimated best
by the mean.
"""


def main() -> None:
    """`python -m gyronorth.learn.disturbed [FOLDER]`."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "bundles/learned")

    def show(progress: Progress) -> None:
        if progress.history:
            print(progress.epoch, {name: round(value, 5) for name, value in progress.history[-1].items()}, flush=True)

    print(make_bundle(folder, report=show).metrics)


if __name__ == "__main__":
    main()
