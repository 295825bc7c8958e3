"""One stream of rows, of a file or of a sensor that runs: what is declared of it, its grid and its axes."""

from __future__ import annotations

from pathlib import Path

from gyronorth.arrays import Array, Mask
from gyronorth.readers.axes import in_axes
from gyronorth.readers.declared import Declared, resolve
from gyronorth.readers.grid import GridBuilder
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.source import Source
from gyronorth.readers.usable import usable_rows


class GridStream:
    """Takes the rows of a source; gives samples on a uniform grid, SI, in the axes of the source and of the body.

    Parameters
    ----------
    source : Source
        An opened recording, or what is known of a stream.
    options : ReadOptions
        What is declared of it.
    path : str or Path, optional
        The file, to be named where something is left open.

    Raises
    ------
    InputError
        If a unit, the axes or the rate is not known, or declarations contradict each other.
    """

    def __init__(self, source: Source, options: ReadOptions, path: str | Path | None = None) -> None:
        self.source, self.options = source, options
        self.declared: Declared = resolve(source, options, path)
        self.grid = GridBuilder(source, self.declared, options)

    @property
    def width(self) -> int:
        """Numbers in a sample: 3, or 6 with an accelerometer."""
        return len(self.declared.scale(1.0))

    def usable(self, values: Array) -> Mask:
        """Which rows (n, k), columns as those of the source, a sensor can have given."""
        data = values if self.source.clock is None else values[:, 1:]
        return usable_rows(data * self.declared.scale(self.grid.rate_hz or 1.0))

    def in_body_axes(self, samples: Array) -> tuple[Array, Array | None]:
        """Rate and specific force (n, 3) of samples in the axes of the source; None without an accelerometer."""
        parts = [samples[:, :3], *([samples[:, 3:]] if samples.shape[1] == 6 else [])]
        mat = self.declared.mat_vf
        gyro, *accel = (part if mat is None else in_axes(part, mat) for part in parts)
        return gyro, accel[0] if accel else None
