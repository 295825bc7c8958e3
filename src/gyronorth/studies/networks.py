"""Units of work that train the networks: a denoiser, and a heading network on one split of the recordings.

A variant is what differs from the paper's settings, a nested dict in the names of the YAML
file: {"heading": {"dropout": 0.2}}. Every choice of an epoch is made on validation, unless a plan says
otherwise and every output with it; the test recordings are looked at after.
"""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gyronorth.angles import angle_error, cyclic_rmse
from gyronorth.errors import InputError
from gyronorth.evaluation import Split
from gyronorth.published import LATITUDE, Twin, model_based
from gyronorth.studies.methods import WINDOW
from gyronorth.studies.source import recordings_of
from gyronorth.studies.study import Selection, StudyPlan
from gyronorth.studies.work import Job, Result

if TYPE_CHECKING:
    from gyronorth.learn.batched import RememberingDenoiser
    from gyronorth.learn.data import HeadingSet, TrainingData
    from gyronorth.learn.settings import Settings
    from gyronorth.learn.stages import TrainedDenoiser, TrainedHeading

PARTS = ("train", "validation", "test")
Variant = Mapping[str, Any]

#: The earlier baseline: no denoiser, dropout or decay, other rate and batch (`learn.settings.baseline`).
BASELINE: Variant = {
    "heading": {
        "dropout": 0.0,
        "denoised": False,
        "rate": 0.0015,
        "rate_end": None,
        "batch": 100,
        "epochs": 500,
        "patience": 100,
    }
}
PAPER: Variant = {}
WITHOUT_DENOISER: Variant = {"heading": {"denoised": False}}
COS_SIN: Variant = {"heading": {"output": "cos_sin"}}
#: What is left of the paper's heading network when nothing is kept that does not help.
OWN_NETWORK: Variant = {"heading": {"denoised": False, "output": "cos_sin", "augment": {"noise": "redrawn"}}}
#: Epochs of either stage, at most, as the settings say.
FULL = {"denoiser": 300, "heading": 150}
#: Headings at which a trained network is asked for that of a clean Earth rate, evenly over the circle.
CIRCLE = 180


def splits_of(plan: StudyPlan, count: int) -> list[Split]:
    """The first splits of the study of random splits: networks and other methods see the same."""
    return plan.splits_of(count)


def denoiser_unit(variant: Variant, plan: StudyPlan, *, seed: int, split: Split | None = None) -> Job:
    """Train the denoiser of a variant; of two variants that differ elsewhere only, the same unit.

    Its clean data are the synthetic set, or with `split` its noisy real recordings.
    """
    about = {k: v for k, v in variant.items() if k not in ("heading", "sampler")}
    settings = merged({"seed": seed, "denoiser": _capped("denoiser", plan)}, about)
    arguments: dict[str, Any] = {"settings": settings, "seed": plan.seed, "real": None}
    if split is not None:
        arguments |= {"real": split_json(split), **plan.source()}
    return Job(f"denoiser/{digest(arguments)}", train_denoiser_unit, arguments)


def heading_unit(
    variant: Variant, plan: StudyPlan, split: Split, *, seed: int, denoiser: Job | None = None, duration: float = WINDOW
) -> Job:
    """Train the heading network of a variant on a split; its denoiser is trained before, once for all seeds."""
    settings = heading_settings(variant, plan, seed=seed, duration=duration)
    needs: tuple[Job, ...] = ()
    if settings["heading"].get("denoised", True):
        of_length = variant if duration == WINDOW else {**variant, "samples": round(3 * duration)}
        needs = (denoiser or denoiser_unit(of_length, plan, seed=plan.seed),)
    arguments = {"settings": settings, "split": split_json(split), **plan.source()}
    if plan.selection != "validation":
        arguments["selection"] = plan.selection
    named = {"arguments": arguments, "needs": [need.name for need in needs]}
    return Job(f"network/{digest(named)}", train_heading_unit, arguments, needs)


def heading_settings(variant: Variant, plan: StudyPlan, *, seed: int, duration: float = WINDOW) -> dict:
    """The settings of a variant's heading network, with no more epochs than the plan allows."""
    settings = merged({"seed": seed, "samples": round(3 * duration), "heading": _capped("heading", plan)}, variant)
    if plan.epochs is not None and "epochs" in settings["heading"]:
        settings["heading"]["epochs"] = min(plan.epochs, settings["heading"]["epochs"])
    return settings


def train_denoiser_unit(*, settings: dict, real: dict | None, seed: int, data: dict | None = None) -> Result:
    """Train a denoiser; its weights, its history, and its error on the synthetic test set."""
    from gyronorth.learn.settings import Settings
    from gyronorth.learn.stages import denoiser_data, train_denoiser

    checked = Settings.model_validate(settings)
    clean = None
    if real is not None:
        parts = split_data(real, recordings_of(seed, data), checked)
        clean = (parts.train, parts.validation)
    trained = train_denoiser(checked, clean)
    finite = bool(np.isfinite(trained.progress.best))
    result: Result = {
        "settings": checked.model_dump(mode="json"),
        "normalisation": vars(trained.normalisation),
        "epochs": trained.progress.epoch,
        "best_epoch": trained.progress.best_epoch,
        "validation_loss": _number(trained.progress.best),
        "history": _history(trained.progress.history),
        "diverged": not finite or not all(np.isfinite(h["loss"]) for h in trained.progress.history),
        "weights": pack({k: v.numpy() for k, v in trained.network.state_dict().items()}),
    }
    result["test"] = denoiser_error(trained, denoiser_data(checked)[2], seed=seed)
    return result


def train_heading_unit(
    *needs: Result,
    settings: dict,
    split: dict,
    seed: int,
    data: dict | None = None,
    selection: Selection = "validation",
) -> Result:
    """Train a heading network on a split of the recordings; headings of all parts after training.

    `selection` is what chooses the epoch: `test` puts the tested recordings in the place of validation, `leak` another
    window of them among the training data, and `last` chooses nothing.
    """
    from gyronorth.learn.settings import Settings
    from gyronorth.learn.stages import train_heading

    checked = Settings.model_validate(settings)
    parts = split_data(split, recordings_of(seed, data), checked)
    given = split_data(split, recordings_of(seed, data), checked, leak=True) if selection == "leak" else parts
    if selection == "test" and parts.test is not None:
        given = replace(parts, validation=parts.test)
    denoiser = remembering(needs[0], checked) if needs else None
    trained = train_heading(checked, given, denoiser, last=selection == "last")
    result: Result = {
        "epochs": trained.progress.epoch,
        "best_epoch": trained.progress.best_epoch,
        "history": _history(trained.progress.history),
    }
    for name in PARTS:
        part = getattr(parts, name)
        cleaned = part.gyro_l if denoiser is None else denoiser.clean(part.gyro_l)
        result[name] = {
            "recording": part.recording.tolist(),
            "error_deg": _degrees(angle_error(trained.headings_of_clean(cleaned), part.heading)),
            "model_based_deg": _degrees(angle_error(model_based(part.gyro_l), part.heading)),
            "denoised_mean_deg": _degrees(angle_error(model_based(cleaned), part.heading)),
        }
    result["circle_error_deg"] = circle_error(trained)
    return result


def circle_error(trained: TrainedHeading) -> list[float | None]:
    """Error, deg, of a heading network on clean Earth rates all around the circle: where it has learnt no heading.

    A heading in degrees modulo 360 must jump somewhere; a steep slope stands in for the jump, and there it is lost.
    """
    from gyronorth.learn.data import synthetic_set

    clean = synthetic_set(headings=CIRCLE, latitude=LATITUDE, samples=trained.settings.samples)
    return _degrees(angle_error(trained.headings_of_clean(clean.gyro_l), clean.heading))


def split_data(split: dict, recordings: Twin, settings: Settings, *, leak: bool = False) -> TrainingData:
    """The first window of each recording, in the parts of a split (IV-A: one of 100 s each).

    With `leak` the second window of the tested recordings is among the training data, a fault of many evaluations.

    Raises
    ------
    InputError
        If a recording has no second window.
    """
    from gyronorth.learn.data import HeadingSet, TrainingData

    gyro_l, heading, recording = recordings.windows(settings.samples / recordings.rate_hz)
    first, windows = np.unique(recording, return_index=True, return_counts=True)[1:]
    whole = HeadingSet(gyro_l, heading, recording)
    known = first[split["train"]]
    if leak and windows.min() < 2:
        window = settings.samples / recordings.rate_hz
        raise InputError(
            f"The recordings last {recordings.duration:g} s; two windows of {window:g} s are needed to train "
            "on another window of the tested recordings. Leave the selection leak out."
        )
    if leak:
        known = np.concatenate([known, first[split["test"]] + 1])
    parts = [whole.rows(index) for index in (known, first[split["validation"]], first[split["test"]])]
    return TrainingData(parts[0], parts[1], test=parts[2], latitude=LATITUDE)


def rebuilt(result: Result, settings: Settings) -> TrainedDenoiser:
    """The denoiser of a unit's result, with the sampler of other settings."""
    from gyronorth.alignment.networks.diffusion import Normalisation
    from gyronorth.learn.denoiser import Denoiser, set_weights
    from gyronorth.learn.settings import Settings
    from gyronorth.learn.stages import TrainedDenoiser
    from gyronorth.learn.training import Progress

    own = Settings.model_validate(result["settings"])
    part = own.denoiser
    network = Denoiser(
        layout=own.layout, samples=own.samples, layers=part.layers, hidden=part.hidden, embedding=part.embedding
    )
    set_weights(network, unpack(result["weights"]))
    progress = Progress(best_epoch=result["best_epoch"], finished=True)
    return TrainedDenoiser(network, settings, Normalisation(**result["normalisation"]), progress)


#: The denoiser of this process's units, by checksum: what it has cleaned for one split it knows in the next.
_DENOISERS: dict[str, RememberingDenoiser] = {}


def remembering(result: Result, settings: Settings) -> TrainedDenoiser:
    """The same, cleaning no recording twice in this process where it cleans each by itself."""
    from gyronorth.learn.batched import RememberingDenoiser

    denoiser = rebuilt(result, settings)
    if settings.layout != "flattened" or settings.sampler.start != "last":
        return denoiser
    key = digest([result["weights"], settings.model_dump(mode="json", exclude={"seed", "heading"})])
    if key not in _DENOISERS:
        _DENOISERS.clear()
        _DENOISERS[key] = RememberingDenoiser(**vars(denoiser))
    return _DENOISERS[key]


def denoiser_error(trained: TrainedDenoiser, test: HeadingSet, *, seed: int) -> dict:
    """Error of the predicted noise on clean test data noised by eq:17, and of the heading before and after.

    The noise prediction is scored against predicting zero, at several steps. The heading is
    that of the time mean, with noise up to the last step T, and after the paper's chain.
    """
    from gyronorth.learn.denoiser import predictor

    rng = np.random.default_rng([seed, 7])
    schedule, normalisation = trained.settings.schedule, trained.normalisation
    mean, std = normalisation.moments(test.gyro_l)
    clean = (test.gyro_l - mean) / std
    predict = predictor(trained.network, batch=trained.settings.denoiser.batch)
    steps = [1, 250, 500, 750, 950, 1000]
    share = []
    for t in steps:
        noise = rng.standard_normal(clean.shape)
        x = np.sqrt(schedule.alpha_bar[t]) * clean + np.sqrt(1 - schedule.alpha_bar[t]) * noise
        share.append(float(np.mean((predict(x.astype(np.float32), t) - noise) ** 2)))
    noised = clean + schedule.noise_ratio[-1] * rng.standard_normal(clean.shape)
    gyro = noised * std + mean
    before = angle_error(model_based(gyro), test.heading)
    after = angle_error(model_based(trained.clean(gyro)), test.heading)
    return {
        "step": steps,
        "noise_error_share": [_number(s) for s in share],
        "heading_before_deg": _number(float(np.degrees(cyclic_rmse(before)))),
        "heading_after_deg": _number(float(np.degrees(cyclic_rmse(after)))),
    }


def _capped(stage: str, plan: StudyPlan) -> dict:
    """The epochs of a stage where the plan allows fewer than its settings."""
    return {"epochs": plan.epochs} if plan.epochs is not None and plan.epochs < FULL[stage] else {}


def merged(base: Mapping, change: Mapping) -> dict:
    """Nested settings with some of them changed."""
    out = dict(base)
    for key, value in change.items():
        out[key] = merged(out.get(key, {}), value) if isinstance(value, Mapping) else value
    return out


def split_json(split: Split) -> dict:
    """A split as an argument of a unit."""
    return {name: np.sort(getattr(split, name)).tolist() for name in PARTS}


def digest(content: object) -> str:
    """Short checksum of plain data: the name of a unit."""
    import hashlib

    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def _history(history: list[dict[str, float]]) -> list[dict[str, float | None]]:
    return [{k: _number(v) for k, v in entry.items()} for entry in history]


def _number(value: float) -> float | None:
    return float(f"{value:.6g}") if np.isfinite(value) else None


def _degrees(angle: NDArray) -> list[float | None]:
    return [_number(v) for v in np.degrees(angle)]


def pack(arrays: dict[str, NDArray]) -> str:
    """Arrays as text that stands in JSON."""
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]
    return base64.b64encode(buffer.getvalue()).decode("ascii")


def unpack(text: str) -> dict[str, NDArray]:
    """The arrays of `pack`."""
    with np.load(io.BytesIO(base64.b64decode(text))) as stored:
        return {name: stored[name] for name in stored.files}
