"""gyronorth train: the denoiser on synthetic data, the heading network on recordings, to a bundle."""

from __future__ import annotations

from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gyronorth.cli.app import app
from gyronorth.cli.options import Force
from gyronorth.cli.outputs import written
from gyronorth.cli.reading_options import with_reading

if TYPE_CHECKING:
    from gyronorth.readers import ReadOptions


#: Exit code of what Ctrl-C ended.
INTERRUPTED = 130


class TrainingStage(StrEnum):
    """What is trained."""

    denoiser = "denoiser"
    regressor = "regressor"
    all = "all"


@app.command()
@with_reading
def train(
    stage: Annotated[
        TrainingStage, typer.Argument(help="denoiser: on synthetic data; regressor: on recordings; all: both.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="BUNDLE", help="Folder of the bundle to write.")],
    data: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Recordings at known headings (regressor and all).")
    ] = None,
    config: Annotated[
        str | None,
        typer.Option(metavar="FILE|NAME", help="Settings: one YAML file, or paper (default), baseline, cos_sin, own."),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue an interrupted training, bit for bit.")] = False,
    force: Force = False,
    *,
    reading: ReadOptions,
) -> int:
    """Train the paper's two stages on your own recordings and export a bundle for `heading --model`."""
    from gyronorth.errors import InputError

    if find_spec("torch") is None:
        raise InputError("Training needs PyTorch, which is not installed: pip install 'gyronorth[train]'.")
    if output.is_dir() and any(output.iterdir()) and not (force or resume):
        raise InputError(f"-o {output} exists. Give another name, or --force to overwrite it.")
    from gyronorth.learn.data import own_data
    from gyronorth.learn.export import untrained
    from gyronorth.learn.run import run_training
    from gyronorth.learn.settings import settings_of

    settings = settings_of(config)
    own = None if data is None else own_data(data, settings=settings, reading=reading)
    try:
        bundle = run_training(settings, stage.value, own, output, resume, True)
    except KeyboardInterrupt:
        typer.echo(f"interrupted: give the same command with --resume to go on from {output}.training", err=True)
        return INTERRUPTED
    written(output)
    typer.echo(f"{output}: {bundle.method}, {bundle.layout}")
    if own is not None and own.swing is None:
        typer.echo(f"no correction of the closed form: {own.no_swing}")
    for name, value in bundle.metrics.items():
        typer.echo(f"{name:<36}{'' if value is None else f'{value:.4g}'}")
    if warning := untrained(bundle.metrics):
        typer.echo(f"warning: {warning}", err=True)
    return 0
