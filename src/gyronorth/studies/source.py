"""Which recordings the studies are run on: the published twin, or the public recordings that a user brings."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path

import numpy as np

from gyronorth.errors import InputError
from gyronorth.published import Twin, published_twin

#: Rate of the studies, Hz: the paper's, from 600 Hz by averages of 200 samples, which keep the mean.
RATE = 3.0


def recordings_of(seed: int, data: dict | None = None) -> Twin:
    """The twin of a seed; with `data`, of `described`, the public recordings in that folder."""
    if data is None:
        return published_twin(rate_hz=RATE, rng=np.random.default_rng(seed))
    found = public_recordings(data["folder"])
    if _sha256(found) != data["sha256"]:
        raise InputError(f"The recordings in {data['folder']} have changed since the study began. Use another -o.")
    return found


def described(folder: str) -> dict:
    """Folder and checksum of public recordings, as the argument of a unit of work."""
    return {"folder": folder, "sha256": _sha256(public_recordings(folder))}


@lru_cache(maxsize=1)
def public_recordings(folder: str) -> Twin:
    """Levelled 3 Hz rates of the published layout (`x_<heading>.csv`), below `folder` at any depth.

    All are cut to the shortest. Their noise is real; its size is taken from first differences.

    Raises
    ------
    InputError
        If there are no such files, or one has no reference heading.
    """
    from gyronorth.attitude import level, mat_lb
    from gyronorth.conditioning import decimated
    from gyronorth.readers import read

    paths = sorted(Path(folder).rglob("x_*.csv"))
    if not paths:
        raise InputError(
            f"{folder} holds no files x_<heading>.csv. Give your clone of "
            "ansfl/Learning-Based-MEMS-Gyrocompassing or its folder data."
        )
    rates, headings = [], []
    for path in paths:
        recording = read(path)
        if recording.heading_true is None:
            raise InputError(f"{path} has no reference heading; its name should be x_<degrees>.csv.")
        if recording.accel_b is not None:
            recording = recording.rotated(mat_lb(*level(recording.accel_b.mean(axis=0))))
        rates.append(decimated(recording, RATE).gyro_b)
        headings.append(recording.heading_true)
    samples = min(len(rate) for rate in rates)
    gyro_l = np.stack([rate[:samples] for rate in rates])
    noise = np.sqrt(np.median(np.mean(np.diff(gyro_l, axis=1) ** 2, axis=1)) / 2)
    return Twin(gyro_l, np.array(headings), RATE, float(noise / np.sqrt(RATE)))


def _sha256(recordings: Twin) -> str:
    digest = hashlib.sha256(np.ascontiguousarray(recordings.gyro_l).tobytes())
    digest.update(np.ascontiguousarray(recordings.heading_true).tobytes())
    return digest.hexdigest()
