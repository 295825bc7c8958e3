"""Write a recording, so that reading it gives the same bits again."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

import numpy as np

from gyronorth.readers.delimited import SIGNATURE
from gyronorth.readers.npz import SCHEMA
from gyronorth.readers.source import FORCES, RATES, TIME
from gyronorth.recording import InputError, Recording

_BLOCK_ROWS = 1 << 14


def write(recording: Recording, path: str | Path) -> None:
    """Write a recording as .csv or .npz, in SI and body axes.

    The file is written beside its place and then renamed, so that a reader never sees half
    of it. Rates, samples and times read back bit for bit; a .csv holds latitude and heading
    in degrees, which read back to the last digit but one.

    Raises
    ------
    InputError
        If the suffix is another one, or the file cannot be written.
    """
    path = Path(path)
    writers: dict[str, Callable[[Recording, BinaryIO], None]] = {".csv": _write_csv, ".npz": _write_npz}
    writer = writers.get(path.suffix.lower())
    if writer is None:
        raise InputError(f"{path.name}: a recording is written as {' or '.join(writers)}.")
    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        try:
            with beside.open("wb") as file:
                writer(recording, file)
            beside.replace(path)
        finally:
            beside.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}.") from None


def _write_csv(recording: Recording, file: BinaryIO) -> None:
    has_accel = recording.accel_b is not None
    facts: dict[str, object] = {
        SIGNATURE[0]: SIGNATURE[1],
        "rate_hz": repr(float(recording.rate_hz)),
        "gyro_unit": "rad/s",
        "accel_unit": "m/s2" if has_accel else None,
        "axes": "frd",
        "latitude_deg": None if recording.latitude is None else repr(float(np.degrees(recording.latitude))),
        "heading_true_deg": (
            None if recording.heading_true is None else repr(float(np.degrees(recording.heading_true) % 360))
        ),
        "start_time_utc": recording.start_time_utc,
        "session": recording.session,
        "samples": len(recording.gyro_b),
        "rows_dropped": recording.rows_dropped or None,
        "gaps": " ".join(f"{gap.start!r}:{gap.samples}" for gap in recording.gaps) or None,
    }
    for key, value in facts.items():
        text = str(value)
        if value is not None:
            if text != text.strip() or len(text.splitlines()) != 1:
                raise InputError(f"{key} is {text!r}; one line of text without spaces around it is expected in a CSV.")
            file.write(f"# {key}: {text}\n".encode())
    file.write((",".join((TIME, *RATES, *(FORCES if has_accel else ()))) + "\n").encode())
    for start in range(0, len(recording.gyro_b), _BLOCK_ROWS):
        part = slice(start, start + _BLOCK_ROWS)
        parts = [recording.gyro_b[part]] + ([recording.accel_b[part]] if recording.accel_b is not None else [])
        time = np.arange(start, start + len(parts[0])) / recording.rate_hz
        # repr is the shortest text that reads back to the same double.
        columns = [map(repr, column.tolist()) for column in (time, *np.hstack(parts).T)]
        file.write("".join(",".join(row) + "\n" for row in zip(*columns, strict=True)).encode())


def _write_npz(recording: Recording, file: BinaryIO) -> None:
    arrays = {
        "schema": SCHEMA,
        "gyro_b": recording.gyro_b,
        "accel_b": recording.accel_b,
        "rate_hz": float(recording.rate_hz),
        "latitude": recording.latitude,
        "heading_true": recording.heading_true,
        "session": recording.session,
        "start_time_utc": recording.start_time_utc,
        "rows_dropped": recording.rows_dropped,
        "gaps": np.array([[gap.start, gap.samples] for gap in recording.gaps], dtype=float).reshape(-1, 2),
    }
    np.savez_compressed(file, **{key: np.asarray(value) for key, value in arrays.items() if value is not None})  # type: ignore[arg-type]
