"""NumPy archives (.npz): ours hold a recording bit for bit, in SI and body axes; others hold arrays with names."""

from __future__ import annotations

import math
import shutil
import zipfile
from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.readers.budget import check_claim
from gyronorth.readers.facts import read_facts, warnings_text
from gyronorth.readers.format import Format, format_info
from gyronorth.readers.formats.npy import npy_header, tables
from gyronorth.readers.held import held_source
from gyronorth.readers.library import errors_translated, pickled
from gyronorth.readers.mat5 import DEFLATE_RATIO
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.outgoing import RecordingStream
from gyronorth.readers.source import FORCES, RATES, Block, Facts, Source, blocks_of
from gyronorth.recording import Gap

SCHEMA = "gyronorth.recording/1"
#: Largest array read, bytes.
LARGEST_ARRAY = 1 << 30
_BLOCK_ROWS = 1 << 14
_KEYS = ("schema", "gyro_b", "accel_b", "rate_hz", "latitude", "heading_true", "session", "axes_assumed",
         "start_time_utc", "rows_dropped", "gaps", "warnings")  # fmt: skip


def open_npz(path: Path, options: ReadOptions) -> Source:
    """Open a recording that `write` stored as .npz, or the arrays of another archive."""
    with errors_translated(path.name, ".npz file"), zipfile.ZipFile(path) as archive:
        names = {name.removesuffix(".npy"): name for name in archive.namelist() if name.endswith(".npy")}
        ours = "schema" in names
        arrays = {key: _member(archive, names[key], key, path) for key in names if key in _KEYS or not ours}
    if not ours:
        return _open_foreign(arrays, options, path)
    if options.columns:
        raise InputError(f"columns does not apply to {path.name}: an .npz recording names its own arrays.")
    if options.variable is not None:
        raise InputError(f"variable does not apply to {path.name}: an .npz recording names its own arrays.")
    if _text(arrays, "schema", path) != SCHEMA:
        raise InputError(
            f"{path.name} is an .npz file whose schema is not {SCHEMA!r}: a later gyronorth wrote it, or another "
            "program."
        )
    rate_hz = _number(arrays, "rate_hz", path)
    if "gyro_b" not in arrays or rate_hz is None:
        raise InputError(f"{path.name} has no gyro_b or no rate_hz: it is damaged.")
    gyro = _samples(arrays, "gyro_b", path)
    accel = _samples(arrays, "accel_b", path) if "accel_b" in arrays else None
    if accel is not None and len(accel) != len(gyro):
        raise InputError(f"{path.name}: gyro_b has {len(gyro)} samples, accel_b {len(accel)}: it is damaged.")
    assumed = _text(arrays, "axes_assumed", path)
    return Source(
        format="npz",
        name=path.name,
        columns=RATES if accel is None else (*RATES, *FORCES),
        blocks=partial(_blocks, gyro, accel),
        stated=Facts(
            rate_hz=rate_hz,
            gyro_unit="rad/s",
            accel_unit="m/s2",
            axes=None if assumed else "frd",
            axes_assumed=assumed,
            latitude=_number(arrays, "latitude", path),
            heading_true=_number(arrays, "heading_true", path),
            session=_text(arrays, "session", path),
            start_time_utc=_text(arrays, "start_time_utc", path),
            rows_dropped=int(_number(arrays, "rows_dropped", path) or 0),
            gaps=_gaps(arrays, path),
            warnings=_warnings(arrays, path),
        ),
        ours=True,
    )


def _open_foreign(arrays: dict[str, NDArray[Any]], options: ReadOptions, path: Path) -> Source:
    held = tables(arrays)
    holds = ", ".join(f"{key} {array.shape}" for key, array in list(held.items())[:12]) or "no array of numbers"
    return held_source("npz", path.name, held, {key: array.shape for key, array in held.items()}, options, holds=holds)


def write_npz(outgoing: RecordingStream, path: Path) -> None:
    """Write a recording as .npz; an array says its length first, so the samples wait in files of their own."""
    names = ("gyro_b", "accel_b") if outgoing.has_accel else ("gyro_b",)
    with ExitStack() as stack:
        waiting = {name: stack.enter_context(TemporaryFile(dir=path.parent)) for name in names}
        for rows in outgoing.rows():
            for name, file in waiting.items():
                file.write(np.ascontiguousarray(getattr(rows, name)).tobytes())
        facts = outgoing.facts
        arrays = {
            "schema": SCHEMA,
            "rate_hz": facts.rate_hz,
            "latitude": facts.latitude,
            "heading_true": facts.heading_true,
            "session": facts.session,
            "axes_assumed": facts.axes_assumed,
            "start_time_utc": facts.start_time_utc,
            "rows_dropped": facts.rows_dropped,
            "warnings": warnings_text(facts.warnings) or None,
            "gaps": np.array([[gap.start, gap.samples] for gap in facts.gaps], dtype=float).reshape(-1, 2),
        }
        archive = stack.enter_context(zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED))
        for key, value in arrays.items():
            if value is not None:
                with archive.open(f"{key}.npy", "w") as member:
                    np.lib.format.write_array(member, np.asarray(value), allow_pickle=False)
        for name, file in waiting.items():
            header = {"descr": "<f8", "fortran_order": False, "shape": (facts.samples, 3)}
            file.seek(0)
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array_header_1_0(member, header)
                shutil.copyfileobj(file, member, 1 << 20)


def _member(archive: zipfile.ZipFile, member: str, key: str, path: Path) -> NDArray[Any]:
    """One array of the archive; sizes are checked against the file's before anything is allocated."""
    info = archive.getinfo(member)
    if info.file_size > min(LARGEST_ARRAY, DEFLATE_RATIO * path.stat().st_size):
        raise InputError(
            f"{path.name}: {key} claims {info.file_size} bytes, which the file cannot hold or which exceed "
            f"{LARGEST_ARRAY >> 20} MiB: it is damaged."
        )
    check_claim(path.name, key, info.file_size, path.stat().st_size)
    content = BytesIO(archive.read(info))
    shape, _, dtype = npy_header(content)
    if dtype.hasobject:
        raise InputError(pickled(f"{key} of {path.name}"))
    if math.prod(shape) * dtype.itemsize != info.file_size - content.tell():
        raise ValueError(f"{key} is not the array of numbers or text that its header claims")
    content.seek(0)
    return np.lib.format.read_array(content, allow_pickle=False)


def _samples(arrays: dict[str, NDArray[Any]], key: str, path: Path) -> NDArray[np.float64]:
    samples = arrays[key]
    if samples.dtype.kind not in "fiu" or samples.ndim != 2 or samples.shape[1] != 3 or len(samples) == 0:
        raise InputError(f"{path.name}: {key} has shape {samples.shape} and type {samples.dtype}; (n, 3) is expected.")
    return samples.astype(float, copy=False)


def _number(arrays: dict[str, NDArray[Any]], key: str, path: Path) -> float | None:
    if key not in arrays:
        return None
    value = arrays[key]
    if value.shape != () or value.dtype.kind not in "fiu" or not np.isfinite(value):
        raise InputError(f"{path.name}: {key} is {str(value)[:40]!r}; one finite number is expected.")
    return float(value)


def _text(arrays: dict[str, NDArray[Any]], key: str, path: Path) -> str | None:
    if key not in arrays:
        return None
    value = arrays[key]
    if value.shape != () or value.dtype.kind != "U":
        raise InputError(f"{path.name}: {key} is {str(value)[:40]!r}; one text is expected.")
    return str(value)


def _warnings(arrays: dict[str, NDArray[Any]], path: Path) -> tuple[tuple[str, float | None], ...]:
    text = _text(arrays, "warnings", path)
    return () if text is None else read_facts({"warnings": text}, lambda _: path.name)[0].warnings


def _gaps(arrays: dict[str, NDArray[Any]], path: Path) -> tuple[Gap, ...]:
    if "gaps" not in arrays:
        return ()
    gaps = arrays["gaps"]
    if gaps.dtype.kind != "f" or gaps.ndim != 2 or gaps.shape[1] != 2 or not np.isfinite(gaps).all():
        raise InputError(f"{path.name}: gaps has shape {gaps.shape} and type {gaps.dtype}; (n, 2) is expected.")
    return tuple(Gap(float(start), int(samples)) for start, samples in gaps)


def _blocks(gyro: NDArray[np.float64], accel: NDArray[np.float64] | None) -> Iterator[Block]:
    parts = (slice(start, start + _BLOCK_ROWS) for start in range(0, len(gyro), _BLOCK_ROWS))
    rows = (gyro[part] if accel is None else np.hstack([gyro[part], accel[part]]) for part in parts)
    return blocks_of(rows, len(gyro))


FORMAT = Format(format_info("npz"), open_npz, recognises=lambda head: head.startswith(b"PK\x03\x04"), write=write_npz)
