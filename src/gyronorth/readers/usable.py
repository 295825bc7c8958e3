"""Rows that can be used: finite, within the range of any sensor, and not without gravity."""

from __future__ import annotations

import numpy as np

from gyronorth.arrays import Array, Mask
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.errors import InputError
from gyronorth.readers.asking import ask
from gyronorth.readers.declared import Declared
from gyronorth.readers.evidence import COUNTS_PER_G, NEAR_GRAVITY, is_whole, norm_of_parts
from gyronorth.readers.options import ACCEL_UNITS, GYRO_UNITS, ReadOptions
from gyronorth.readers.source import Question, Source

#: Largest plausible angular rate, rad/s (2005 deg/s, the range of the fastest gyros), and specific force, m/s^2.
LARGEST_RATE = 35.0
LARGEST_FORCE = 400.0


def usable_rows(data: Array) -> Mask:
    """Which rows of rate and specific force, shape (n, 3) or (n, 6), SI, are finite, plausible and not all zero."""
    limit = np.array([LARGEST_RATE] * 3 + [LARGEST_FORCE] * (data.shape[1] - 3))
    fits = np.abs(data) <= limit  # False for nan
    usable = np.ones(len(data), dtype=bool) if fits.all() else np.asarray(fits.all(axis=1))
    if data.shape[1] == 6:
        usable &= (data[:, 3] != 0) | (data[:, 4] != 0) | (data[:, 5] != 0)
    return usable


def why_unusable(values: Array, data: Array, source: Source, declared: Declared) -> list[str]:
    """What is wrong with each row, in the units of the file.

    Parameters
    ----------
    values : ndarray, shape (n, k)
        Rows of the file, columns as `source.columns`.
    data : ndarray, shape (n, 3) or (n, 6)
        The same in SI, without the time.
    """
    return [_why(values[i], data[i], source, declared) for i in range(len(data))]


def mostly_unusable(values: Array, lead: str, source: Source, declared: Declared, options: ReadOptions) -> InputError:
    """The complaint of a block of which most rows are unusable.

    Parameters
    ----------
    values : ndarray, shape (n, 3) or (n, 6)
        Its rows as they stand in the file, without the time.
    lead : str
        How it begins: the first such row, and how many are like it.
    """
    if is_whole(values) and np.abs(values).max() > 1:
        gyro_scale = f"{declared.gyro_unit.upper().replace('/', '_PER_')}_IN_ONE_COUNT"
        says = (
            f"{lead}, and all are whole numbers, as counts are: the data sheet says how much one is. Declare "
            "it: --gyro-scale and --accel-scale, each in the unit of the file."
        )
        cure = ("--gyro-scale", gyro_scale, *_scale_by_gravity(values[:, 3:], declared.accel_unit))
        return ask(source.name, options, [Question(says, cure, certain=False)])
    return InputError(
        f"{lead}: are columns and units declared right? (A sensor that is absent can be left out: --columns "
        "f_x=-,f_y=-,f_z=-.)"
    )


def _scale_by_gravity(counts: Array, unit: str) -> tuple[str, ...]:
    """The scale of an accelerometer's counts, (n, 3), that makes gravity of them; none without an accelerometer."""
    size = norm_of_parts(counts) if counts.shape[1] else 0.0
    if size == 0:
        return ()
    size = next((each for each in COUNTS_PER_G if abs(size / each - 1) < NEAR_GRAVITY / 2), size)
    return "--accel-scale", f"{STANDARD_GRAVITY / ACCEL_UNITS[unit] / size:.6g}"


def _why(values: Array, data: Array, source: Source, declared: Declared) -> str:
    for position, column in enumerate(source.columns):
        if not np.isfinite(values[position]):
            return f"{column} is {values[position]}; a finite number is expected"
    names = source.columns[len(values) - len(data) :]
    for position, column in enumerate(names):
        gyro = position < 3
        unit = declared.gyro_unit if gyro else declared.accel_unit
        limit = LARGEST_RATE if gyro else LARGEST_FORCE
        if abs(data[position]) > limit:
            scale = (GYRO_UNITS if gyro else ACCEL_UNITS)[unit]
            return (
                f"{column} is {data[position] / scale:.4g} {unit}; the largest plausible "
                f"{'rate' if gyro else 'specific force'} is {limit / scale:.4g} {unit}"
            )
    return "f_x, f_y and f_z are all exactly 0, which no body at rest can feel"
