"""Files that change while they are read: one message or a recording, whatever the format and however they change."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gyronorth import write
from gyronorth.errors import InputError
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.reading import Reading
from gyronorth.recording import Recording


def cut(path: Path) -> None:
    os.truncate(path, path.stat().st_size // 2)


def emptied(path: Path) -> None:
    os.truncate(path, 0)


def grown(path: Path) -> None:
    with path.open("ab") as file:
        file.write(path.read_bytes()[-400:])


def written_over(path: Path) -> None:
    size = path.stat().st_size
    with path.open("r+b") as file:
        file.write(np.random.default_rng(1).bytes(size))


def removed(path: Path) -> None:
    path.unlink()


CHANGES = (cut, emptied, grown, written_over, removed)


@pytest.fixture(scope="module")
def honest(tmp_path_factory) -> list[tuple[str, bytes, ReadOptions]]:
    """Every layout and format, and frames; long enough for several blocks where that costs nothing."""
    for needed in ("pyarrow", "openpyxl", "zstandard", "pymseed", "rdata", "rosbags", "mcap", "h5py"):
        pytest.importorskip(needed)
    from frames.encoders import CASES
    from fuzz.recordings import base_files, samples

    folder = tmp_path_factory.mktemp("honest")
    found = [(name, content, ReadOptions(**declared)) for name, content, declared in base_files(folder)]
    gyro, accel = (np.tile(each, (40_000 // len(each), 1)) for each in samples())
    many = Recording(gyro, accel, 100.0, latitude=0.56)
    for suffix in (".csv", ".npz", ".h5", ".parquet"):
        write(many, folder / f"long{suffix}")
        found.append((f"long{suffix}", (folder / f"long{suffix}").read_bytes(), ReadOptions()))
    for suffix in (".bag", ".mcap"):
        write(Recording(*samples(), 100.0, latitude=0.56), folder / f"short{suffix}")
        found.append((f"short{suffix}", (folder / f"short{suffix}").read_bytes(), ReadOptions()))
    rows = np.column_stack([np.arange(len(gyro)) / 100, gyro / 100, accel / 100])
    found.append(("long.bin", rows.astype("<f8").tobytes(), ReadOptions(latitude=0.56, axes="frd")))
    np.save(folder / "long.npy", np.column_stack([gyro, accel]))
    named = dict(zip(("w_x", "w_y", "w_z", "f_x", "f_y", "f_z"), range(6), strict=True))
    declared = ReadOptions(rate_hz=100.0, gyro_unit="rad/s", accel_unit="m/s2", axes="frd", columns=named)
    found.append(("long.npy", (folder / "long.npy").read_bytes(), declared))
    for name in list(CASES)[:3]:
        case = CASES[name](150)
        content = case.preamble + b"".join(case.frames)
        options = ReadOptions(protocol=case.protocol, axes="frd", rate_hz=case.options.rate_hz, format="frames")
        found.append((f"{name}.bin", content, options))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "when"),
    [(cut, 1), *(pytest.param(change, when, marks=pytest.mark.long) for change in CHANGES for when in (0, 1))],
)
def test_a_file_that_changes_ends_in_a_message_or_a_recording(honest, tmp_path, change: Callable, when: int):
    taken = 0
    for name, content, options in honest:
        path = tmp_path / name
        path.write_bytes(content)
        try:
            reading = Reading(path, options, None)
            blocks = reading.samples()
            for _ in range(when):
                next(blocks)
            change(path)
            for block in blocks:
                assert block.ndim == 2
            reading.grid.finish()
            taken += 1
        except InputError:
            continue
        finally:
            path.unlink(missing_ok=True)
    assert taken  # packed files, and those that are read as a whole, are held by then
