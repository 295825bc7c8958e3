"""`train denoiser|regressor|all`: both stages with checkpoints, then the bundle."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from gyronorth.alignment.networks.bundle import Bundle
from gyronorth.errors import InputError
from gyronorth.learn.data import TrainingData
from gyronorth.learn.export import check_export, export_bundle
from gyronorth.learn.settings import Settings, read_settings, write_settings
from gyronorth.learn.stages import Run, denoiser_data, train_denoiser, train_heading


def run_training(
    settings: Settings,
    stage: Literal["denoiser", "regressor", "all"],
    data: TrainingData | None,
    out: str | Path,
    resume: bool = False,
    progress: bool = False,
) -> Bundle:
    """Train one stage or both and export the bundle `out`.

    Checkpoints, logs and settings go to the folder `<out>.training` beside it. `regressor`
    needs the denoiser that an earlier `denoiser` with the same settings left there, unless the
    settings do without one. `data` is not used by `denoiser`. With `resume`, what is there is
    continued and ends as if it had never been interrupted.

    Raises
    ------
    InputError
        If there is an earlier training that `resume` does not name, or one with other settings or data, or if the
        bundle could not be written in the end. Then nothing is left behind.
    """
    out = Path(out)
    if stage != "denoiser" and data is None:
        raise InputError(f"Training the stage {stage} needs recordings with reference headings: give --data FOLDER.")
    check_export(out, settings)
    denoised = settings.heading.denoised or stage == "denoiser"
    folder = out.with_name(out.name + ".training")
    _check_folder(folder, settings, stage, resume)
    if stage == "regressor" and denoised and not (folder / "denoiser.pt").is_file():
        raise InputError(
            f"{folder} holds no trained denoiser. Train it first with `train denoiser` and the same -o, "
            "or both with `train all`."
        )
    if denoised:
        denoiser_data(settings)  # refuses too few headings
    folder.mkdir(parents=True, exist_ok=True)
    write_settings(settings, folder / "settings.yaml")
    run = Run(folder=folder, bar=progress)
    # A finished stage only reads its checkpoint.
    denoiser = train_denoiser(settings, run=run) if denoised else None
    if stage == "denoiser" or data is None:
        return export_bundle(out, denoiser=denoiser)
    heading = train_heading(settings, data, denoiser, run=run)
    return export_bundle(out, denoiser=denoiser, heading=heading, data=data)


def _check_folder(folder: Path, settings: Settings, stage: str, resume: bool) -> None:
    """Refuse a folder of checkpoints that is not to be continued, or not with these settings."""
    kept = folder / "settings.yaml"
    blocking = {"denoiser": ["denoiser.pt"], "regressor": ["heading.pt"], "all": ["denoiser.pt", "heading.pt"]}[stage]
    if not resume and any((folder / name).exists() for name in blocking):
        raise InputError(
            f"{folder} holds an earlier training. Continue it with --resume, or remove the folder, or give another -o."
        )
    if kept.is_file() and read_settings(kept) != settings:
        raise InputError(f"{kept} differs from the settings given. Continue with the same ones, or give another -o.")
