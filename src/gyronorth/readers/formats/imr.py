"""Raw IMU files of Inertial Explorer (.imr).

A header of 512 bytes [1]_: the text `$IMURAW`, the order of bytes, whether rates or increments follow, their scales.
Then rows of 32 bytes: the time, s of the GPS week, and six counts, of angle or rate in deg and of velocity or
acceleration in m. Inertial Explorer wants y forward and z up; what a file holds, it does not say.

References
----------
.. [1] NovAtel, Waypoint software documentation, Data formats, IMR file.
"""

from __future__ import annotations

import struct
from functools import partial
from math import isfinite
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.readers.format import Format, format_info
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.source import NAMES, Block, Clock, Facts, Parts, Source, blocks_of, rows_block
from gyronorth.readers.times import WEEK

#: How a file begins, bytes of its header and of a row, and rows of a block.
SIGNATURE, HEADER, ROW, BLOCK_ROWS = b"$IMURAW\0", 512, 32, 1 << 14


def open_imr(path: Path, options: ReadOptions) -> Source:
    """Open an .imr file."""
    if options.columns:
        raise InputError(f"columns does not apply to {path.name}: its binary rows have fixed columns.")
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(HEADER)
    if len(head) < HEADER or not head.startswith(SIGNATURE):
        raise InputError(
            f"{path.name} is no .imr file: a header of {HEADER} bytes that begins with $IMURAW is expected."
        )
    rows, rest = divmod(size - HEADER, ROW)
    if rest:
        raise InputError(
            f"{path.name} ends within a row of {ROW} bytes: it is cut off. Copy it again; or leave the rest out: "
            f"truncate -s {size - rest} {path.name}."
        )
    order = "<" if head[8] == 0 else ">"
    of_angle, of_velocity, _, gyro_scale, accel_scale = struct.unpack_from(f"{order}iiddd", head, 17)
    if of_angle not in (0, 1) or of_velocity not in (0, 1) or not all(
        isfinite(scale) and 0 < scale < 1e6 for scale in (gyro_scale, accel_scale)
    ):  # fmt: skip
        raise InputError(
            f"{path.name} states scales of {gyro_scale:.4g} deg and {accel_scale:.4g} m in one count, increments as "
            f"{of_angle} and {of_velocity}: positive scales, and 0 or 1 are expected. Its header is damaged."
        )
    increments = {(1, 1): "both", (1, 0): "gyro", (0, 1): "accel"}.get((of_angle, of_velocity), False)
    read = partial(_rows, path, order, np.array([1.0, *[gyro_scale] * 3, *[accel_scale] * 3]), rows)

    def part(share: float) -> Block:
        start = round(share * max(0, rows - BLOCK_ROWS))
        return rows_block(read(start), start)

    kinds = f"{'angles' if of_angle else 'rates'}, {'velocities' if of_velocity else 'accelerations'}"
    return Source(
        format="imr",
        name=path.name,
        columns=NAMES,
        blocks=lambda: blocks_of(map(read, range(0, rows, BLOCK_ROWS)), rows),
        stated=Facts(gyro_unit="deg/s", accel_unit="m/s2", increments=increments),
        usual=Facts(axes="rfu"),
        clock=Clock(unit=1.0, wrap=WEEK, name="the time of each row", known=True),
        parts=Parts(rows, exact=True, block=BLOCK_ROWS, read=part),
        read_as=f"Inertial Explorer: {kinds}, {gyro_scale:.6g} deg and {accel_scale:.6g} m in one count",
    )


def _rows(path: Path, order: str, scale: NDArray[np.float64], count: int, start: int) -> NDArray[np.float64]:
    """Rows of a file of `count`, from `start` on: the time, and the counts with their scale."""
    wanted = max(0, min(BLOCK_ROWS, count - start))
    kind = np.dtype([("time", f"{order}f8"), ("counts", f"{order}i4", (6,))])
    found = np.fromfile(path, kind, wanted, offset=HEADER + start * ROW)
    if len(found) < wanted:
        raise InputError(f"{path.name} became shorter while it was read. Read it when it is whole.")
    with np.errstate(invalid="ignore"):  # a damaged time is refused as what it is
        return np.column_stack([found["time"], found["counts"]]) * scale


FORMAT = Format(format_info("imr"), open_imr, recognises=lambda head: head.startswith(SIGNATURE))
