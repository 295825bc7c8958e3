"""Export to a bundle: two ONNX networks, `bundle.json`, and a model card."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from torch import nn

from gyronorth.alignment.networks.bundle import Bundle, DenoiserPart, DeviationPart, Domain, HeadingPart, checksum
from gyronorth.angles import angle_error, cyclic_rmse
from gyronorth.attitude import heading_of_rate
from gyronorth.deviation import DeviationModel, fit_deviation, rate_surplus
from gyronorth.errors import InputError
from gyronorth.files import folder_beside
from gyronorth.learn.data import TrainingData, noise_deg_s
from gyronorth.learn.regressor import precise
from gyronorth.learn.settings import Settings
from gyronorth.learn.stages import TrainedDenoiser, TrainedHeading

#: A network is called untrained that errs on its own training recordings by more than so many times the closed form's
#: error, and by more than so many degrees.
UNTRAINED = 2.0
UNTRAINED_DEG = 10.0


def export_bundle(
    folder: str | Path,
    *,
    denoiser: TrainedDenoiser | None,
    heading: TrainedHeading | None = None,
    data: TrainingData | None = None,
) -> Bundle:
    """Write a bundle folder; an old one of the same name is replaced only when the new one is whole.

    Parameters
    ----------
    denoiser, heading : the trained stages; a bundle of a denoiser alone gives no heading.
    data : TrainingData, optional
        What the heading network was trained on: its sensor, latitude, noise and checksums are recorded.

    Raises
    ------
    InputError
        For the across_batch layout, whose headings depend on the other recordings in a batch,
        or if `folder` is there and is not a bundle.
    """
    trained = heading or denoiser
    if trained is None:
        raise ValueError("export_bundle needs a trained denoiser, a heading network, or both.")
    settings = trained.settings
    folder = Path(folder)
    layout = check_export(folder, settings)
    with folder_beside(folder) as part:
        denoiser_part = heading_part = None
        if denoiser is not None:
            x, t = torch.zeros(1, settings.samples, 3), torch.ones(1, dtype=torch.int64)
            _export(denoiser.network, {"x": x, "t": t}, "noise", part / "denoiser.onnx")
            denoiser_part = DenoiserPart(
                sha256=checksum(part / "denoiser.onnx"),
                schedule=settings.schedule,
                sampler=settings.sampler,
                normalisation=denoiser.normalisation,
            )
        if heading is not None:
            rate = torch.zeros(1, settings.samples, 3, dtype=torch.float64)
            _export(precise(heading.network), {"rate": rate}, "heading", part / "heading.onnx")
            heading_part = HeadingPart(sha256=checksum(part / "heading.onnx"), output=settings.heading.output)
        curve, deviation_part = _deviation(data), None
        if curve is not None:
            curve.write(part / "deviation.json")
            deviation_part = DeviationPart(sha256=checksum(part / "deviation.json"))
        bundle = Bundle(
            method="denoiser" if heading is None else "paper" if denoiser is not None else "baseline",
            layout=layout,
            domain=_domain(settings, data),
            denoiser=denoiser_part,
            heading=heading_part,
            deviation=deviation_part,
            training=settings.model_dump(mode="json"),
            data_sha256={} if data is None else {"train": data.train.sha256(), "validation": data.validation.sha256()},
            metrics=_metrics(denoiser, heading, data, curve),
            provenance={
                "gyronorth": _version("gyronorth"),
                "torch": torch.__version__,
                "data": data.source if data else "synthetic",
                **({"no_deviation": data.no_swing} if data and data.no_swing else {}),
            },
        )
        (part / "bundle.json").write_text(bundle.to_json(), encoding="utf-8")
        (part / "README.md").write_text(model_card(bundle), encoding="utf-8")
    return bundle


def check_export(folder: Path, settings: Settings) -> Literal["temporal", "flattened"]:
    """The layout of the bundle; refuses, before any training, one that could not be written in the end.

    Raises
    ------
    InputError
        For the across_batch layout, or if `folder` is there and is not a bundle.
    """
    if settings.layout == "across_batch":
        raise InputError(
            "The layout across_batch cannot be exported: its heading of one recording depends on the others beside it. "
            "Train with layout: flattened or temporal."
        )
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file; give a new folder for -o.")
    if folder.exists() and not (folder / "bundle.json").is_file() and any(folder.iterdir()):
        raise InputError(f"{folder} is not empty and not a bundle; give a new folder for -o.")
    return settings.layout


def _export(network: nn.Module, inputs: dict[str, torch.Tensor], output: str, path: Path) -> None:
    axes = {name: {0: "n"} for name in (*inputs, output)}
    with warnings.catch_warnings():
        # dynamo=True takes minutes on 300 recurrent steps; torch calls this exporter legacy. The others
        # warn of sizes fixed while tracing: of the width, which is fixed, and of the batch in the initial
        # state of an LSTM, which is exported open (a test runs several batch sizes).
        warnings.filterwarnings("ignore", category=DeprecationWarning)
        warnings.filterwarnings("ignore", category=torch.jit.TracerWarning)  # pyright: ignore[reportPrivateImportUsage]
        warnings.filterwarnings("ignore", message="Exporting a model to ONNX with a batch_size other than 1")
        torch.onnx.export(
            network.eval(),
            tuple(inputs.values()),
            str(path),
            dynamo=False,
            input_names=list(inputs),
            output_names=[output],
            dynamic_axes=axes,
            opset_version=17,
        )


def _domain(settings: Settings, data: TrainingData | None) -> Domain:
    if data is None:
        return Domain(rate_hz=settings.rate_hz, samples=settings.samples)
    return Domain(
        rate_hz=settings.rate_hz,
        samples=settings.samples,
        latitude_deg=None if data.latitude is None else float(np.degrees(data.latitude)),
        sensor=data.sensor,
        noise_deg_s=noise_deg_s(data.train) or None,
        unit=data.unit,
        session=data.session,
    )


def _deviation(data: TrainingData | None) -> DeviationModel | None:
    """The correction of the closed form that the unit's own recordings teach."""
    if data is None or data.swing is None:
        return None
    swing = data.swing
    return fit_deviation(
        swing.heading,
        swing.surplus,
        swing.heading_true,
        unit=data.unit,
        session=data.session,
        duration=swing.duration,
        latitude=data.latitude,
    )


def _metrics(
    denoiser: TrainedDenoiser | None,
    heading: TrainedHeading | None,
    data: TrainingData | None,
    curve: DeviationModel | None,
) -> dict[str, float | None]:
    metrics: dict[str, float | None] = {}
    for name, trained in (("denoiser", denoiser), ("heading", heading)):
        if trained is not None:
            metrics[f"{name}_epochs"] = float(trained.progress.epoch)
            metrics[f"{name}_best_epoch"] = float(trained.progress.best_epoch)
            metrics[f"{name}_validation_loss"] = trained.progress.best if np.isfinite(trained.progress.best) else None
    if heading is not None and data is not None:
        for name, part in (("train", data.train), ("validation", data.validation), ("test", data.test)):
            if part is None:
                continue
            metrics[f"{name}_recordings"] = float(len(np.unique(part.recording)))
            mean = part.gyro_l.mean(axis=1)
            closed_form = heading_of_rate(mean)
            estimates = {"model_based": closed_form, "network": heading.headings(part.gyro_l)}
            if curve is not None and data.latitude is not None and part is data.test:
                estimates["deviation"] = curve.correct(closed_form, rate_surplus(mean, data.latitude))[0]
            for method, estimate in estimates.items():
                metrics[f"{name}_{method}_crmse_deg"] = float(
                    np.degrees(cyclic_rmse(angle_error(estimate, part.heading)))
                )
    return metrics


def untrained(metrics: Mapping[str, float | None]) -> str:
    """The warning about a network that has not even learned its own training recordings; empty for others."""
    network, closed_form = (metrics.get(f"train_{name}_crmse_deg") for name in ("network", "model_based"))
    if network is None or closed_form is None or network <= max(UNTRAINED * closed_form, UNTRAINED_DEG):
        return ""
    return (
        f"The network is not trained: it errs by {network:.3g} deg on the recordings it was trained on, the closed "
        f"form by {closed_form:.3g} deg. The likely causes are too few epochs (heading.epochs) or too few headings."
    )


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def model_card(bundle: Bundle) -> str:
    """The README.md of a bundle: what it is, what it was trained on, what it is worth, where it does not apply."""
    domain, metrics = bundle.domain, bundle.metrics
    title = {
        "paper": "Diffusion-denoiser-aided heading",
        "baseline": "Baseline heading network",
        "denoiser": "Denoiser",
    }
    lines = [f"# {title.get(bundle.method, 'Learned heading')} (`{bundle.method}`, layout `{bundle.layout}`)", ""]
    lines += [
        f"- Input: {domain.window:g} s of levelled angular rate at {domain.rate_hz:g} Hz ({domain.samples} samples).",
        f"- Latitude: {_or_any(domain.latitude_deg, 'deg')}. Sensor class: {domain.sensor or 'any'}.",
        f"- White noise of a training sample: {_or_any(domain.noise_deg_s, 'deg/s')}.",
        f"- Data: {bundle.provenance.get('data') or 'not stated'}.",
    ]
    if bundle.denoiser is not None:
        sampler, schedule = bundle.denoiser.sampler, bundle.denoiser.schedule
        lines.append(
            f"- Denoiser: normalised per {bundle.denoiser.normalisation.kind}; sampler {sampler.kind} "
            f"back to step {sampler.t_back} of {schedule.steps}."
        )
    if bundle.deviation is not None:
        lines.append(
            "- `heading --method learned --model` with this bundle corrects the closed form by the deviation of the "
            "training and validation recordings (`deviation.json`), in their session only."
        )
    elif "no_deviation" in bundle.provenance:
        lines.append(
            f"- No deviation curve (`deviation.json`), so no `heading --method learned`: "
            f"{bundle.provenance['no_deviation']}."
        )
    if domain.unit or domain.session:
        lines.append(
            f"- **Carries the deviation of unit {domain.unit or 'not stated'}, session "
            f"{domain.session or 'not stated'}**: part of what it learned is that unit's own error and does not "
            "hold for another."
        )
    if warning := untrained(metrics):
        lines += ["", f"**{warning}**"]
    if "validation_network_crmse_deg" in metrics:
        methods = {"model_based": "closed form", "network": "this network"}
        if bundle.deviation is not None:
            methods["deviation"] = "learned + deviation"
        lines += ["", f"| cyclic RMSE, deg | {' | '.join(methods.values())} |", "|---" * (len(methods) + 1) + "|"]
        for name in ("train", "validation", "test"):
            if f"{name}_recordings" not in metrics:
                continue
            row = [metrics.get(f"{name}_{method}_crmse_deg") for method in methods]
            cells = " | ".join("" if value is None else f"{value:.2f}" for value in row)
            lines.append(f"| {name} ({metrics[f'{name}_recordings']:.0f} recordings) | {cells} |")
        lines += [
            "",
            "All recordings are of one set: no row is the error to expect on recordings of another unit or day. "
            "The validation recordings chose the epoch. White noise alone is estimated best by the closed form.",
        ]
    return "\n".join(lines) + "\n"


def _or_any(value: float | None, unit: str) -> str:
    return "any" if value is None else f"{value:.4g} {unit}"
