"""Write a recording, so that reading it gives the same bits again."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable
from pathlib import Path
from tempfile import TemporaryFile

import numpy as np

from gyronorth.errors import InputError
from gyronorth.files import written_beside
from gyronorth.readers.hdf5 import write_hdf5
from gyronorth.readers.mcap import write_mcap
from gyronorth.readers.npz import write_npz
from gyronorth.readers.outgoing import Outgoing
from gyronorth.readers.parquet import write_parquet
from gyronorth.readers.rosbag import write_rosbag1
from gyronorth.readers.source import FORCES, RATES, TIME
from gyronorth.recording import Recording


def write(recording: Recording, path: str | Path) -> None:
    """Write a recording in the format of the suffix: .csv, .npz, .h5, .hdf5, .parquet, .mcap or .bag.

    The file is written beside its place and then renamed, so that a reader never sees half
    of it. Everything reads back bit for bit. Units are SI and axes forward-right-down; the
    messages of .mcap and .bag are forward-left-up, as is usual there.

    Raises
    ------
    InputError
        If the suffix is another one, or the file cannot be written.
    """
    write_chunks([recording], path)


def write_chunks(chunks: Iterable[Recording], path: str | Path) -> None:
    """Write the chunks of one recording as `write` does, without holding all of them at once."""
    path = Path(path)
    writer = WRITERS.get(path.suffix.lower())
    if writer is None:
        *others, last = WRITERS
        raise InputError(f"{path.name}: a recording is written as {', '.join(others)} or {last}.")
    outgoing = Outgoing(chunks)
    outgoing.texts()  # a fact that cannot be written is told before the work
    try:
        with written_beside(path, durable=True) as beside:
            writer(outgoing, beside)
    except RuntimeError as error:  # HDF5, on a full disk
        raise InputError(f"{path} cannot be written: {str(error)[:200]}") from None


def _write_csv(outgoing: Outgoing, path: Path) -> None:
    """Comment lines come first and are known last: the rows wait in a file of their own."""
    with TemporaryFile(dir=path.parent) as body, path.open("wb") as file:
        for rows in outgoing.rows():
            parts = [rows.gyro_b] + ([rows.accel_b] if rows.accel_b is not None else [])
            time = rows.numbers() / outgoing.rate_hz
            # repr is the shortest text that reads back to the same double.
            columns = [map(repr, column.tolist()) for column in (time, *np.hstack(parts).T)]
            body.write("".join(",".join(row) + "\n" for row in zip(*columns, strict=True)).encode())
        file.writelines(f"# {key}: {text}\n".encode() for key, text in outgoing.texts().items())
        file.write((",".join((TIME, *RATES, *(FORCES if outgoing.has_accel else ()))) + "\n").encode())
        body.seek(0)
        shutil.copyfileobj(body, file, 1 << 20)


#: What writes a file, by suffix.
WRITERS: dict[str, Callable[[Outgoing, Path], None]] = {
    ".csv": _write_csv,
    ".npz": write_npz,
    ".h5": write_hdf5,
    ".hdf5": write_hdf5,
    ".parquet": write_parquet,
    ".mcap": write_mcap,
    ".bag": write_rosbag1,
}
