"""gyronorth published: the reconstruction of the published recordings, as files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gyronorth.cli.app import app


@app.command()
def published(
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FOLDER", help="New folder for the CSV files.")],
    seed: Annotated[int, typer.Option(min=0, metavar="N", help="Seed of the simulated noise.")] = 0,
    rate: Annotated[float, typer.Option("--rate", min=0.1, max=600.0, metavar="HZ", help="Samples per second.")] = 3.0,
) -> None:
    """Write the 60 published recordings, reconstructed from printed figures: real biases, simulated noise, as CSV."""
    import numpy as np

    from gyronorth.errors import InputError
    from gyronorth.files import folder_beside
    from gyronorth.published import published_twin
    from gyronorth.readers import write

    if output.exists() and (not output.is_dir() or any(output.iterdir())):
        raise InputError(f"{output} is there already and not empty. Give a new folder for -o.")
    twin = published_twin(rate_hz=rate, rng=np.random.default_rng(seed))
    with folder_beside(output) as beside:
        for index in range(len(twin.heading_true)):
            recording = twin.recording(index)
            write(recording, beside / f"published_{index:02d}.csv")
    typer.echo(
        f"{output}: {len(twin.heading_true)} recordings of {twin.duration:g} s at {rate:g} Hz. Their mean rates, and "
        "so their biases, are the printed ones of a real SDC500; their noise is simulated."
    )
