"""What a command writes: checked before any work, reported afterwards."""

from __future__ import annotations

import json
import os
from collections.abc import Collection
from pathlib import Path
from typing import Any

import typer

from gyronorth.cli import progress
from gyronorth.cli.progress import QUIET

#: Kinds of drawing.
PLOT_SUFFIXES = (".png", ".svg", ".pdf")


def check_outputs(
    outputs: dict[str, tuple[Path | None, tuple[str, ...]]],
    *,
    source: Path | None = None,
    kept: Collection[str] = (),
) -> None:
    """Refuse, before any work, outputs that could not be written or would overwrite the input, each other or a work.

    Parameters
    ----------
    outputs : dict
        Option name -> (path or None, the suffixes it may have; none given: any).
    source : Path, optional
        The recording that is read.
    kept : collection of str
        Options whose file is not overwritten: recordings, profiles, bundles, where `--force` is not given.
    """
    from gyronorth.errors import InputError

    taken = {} if source is None else {os.path.realpath(source): "the recording that is read"}
    for option, (path, suffixes) in outputs.items():
        if path is None:
            continue
        if option in ("--plot", "--report"):
            check_drawing(option)
        if suffixes and path.suffix.lower() not in suffixes:
            raise InputError(f"{option} {path}: the name must end in {' or '.join(suffixes)}.")
        if path.is_dir():
            raise InputError(f"{option} {path} is a folder; give the name of a file in it.")
        if not path.parent.is_dir():
            raise InputError(f"{option} {path}: the folder {path.parent} does not exist; make it first.")
        real = os.path.realpath(path)  # which takes links in a circle
        if real in taken:
            raise InputError(f"{option} {path} is {taken[real]}; choose another name.")
        if option in kept and path.is_file():
            raise InputError(f"{option} {path} exists. Give another name, or --force to overwrite it.")
        taken[real] = f"also what {option} writes"


def written(path: Path) -> None:
    """Say on standard error what was written, devices and pipes left out; nothing with -q."""
    from gyronorth.errors import one_line

    if progress.level > QUIET and (path.is_file() or path.is_dir()):
        typer.echo(f"wrote {one_line(str(path))}", err=True)


def check_drawing(what: str) -> None:
    """Refuse what draws if the libraries of the extra `report` are not installed."""
    from importlib.util import find_spec

    from gyronorth.errors import InputError

    missing = [module for module in ("matplotlib", "jinja2") if find_spec(module) is None]
    if missing:
        raise InputError(
            f"{what} needs {' and '.join(missing)}, which the small installation leaves out. "
            "Install it with: pip install 'gyronorth[report]'."
        )


def print_json(document: Any) -> None:
    """Print one JSON value; a NaN would be a fault of ours and raises."""
    typer.echo(json.dumps(document, allow_nan=False))
