"""Write a recording, so that reading it gives the same bits again."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from gyronorth.errors import InputError
from gyronorth.files import written_beside
from gyronorth.given import checked_path, of_kind
from gyronorth.readers import registry
from gyronorth.readers.outgoing import RecordingStream
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
    of_kind("recording", recording, Recording, "a Recording")
    write_chunks([recording], path)


def write_chunks(chunks: Iterable[Recording], path: str | Path) -> None:
    """Write the chunks of one recording as `write` does, without holding all of them at once."""
    path = checked_path("path", path)
    writer = registry.writer_of(path.suffix.lower())
    if writer is None:
        *others, last = registry.FORMATS.written
        raise InputError(f"{path.name}: a recording is written as {', '.join(others)} or {last}.")
    outgoing = RecordingStream(chunks)
    outgoing.texts()  # a fact that cannot be written is told before the work
    with written_beside(path, durable=True) as beside:
        writer(outgoing, beside)
