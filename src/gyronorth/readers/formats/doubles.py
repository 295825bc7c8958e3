"""Bare numbers in binary rows, without any header: IMU files of KF-GINS and of PSINS.

KF-GINS [1]_: rows of seven doubles, seconds of the week, increments of angle in rad and of velocity in m/s,
forward-right-down. PSINS [2]_ writes rows of doubles or floats with the time last, right-front-up. What a file holds is
told by its content: the size is a multiple of the row, one column runs on evenly as a clock does, and the velocity of
a second is gravity's.

References
----------
.. [1] KF-GINS, i2Nav group of Wuhan University, README: "IMU file: GNSS seconds of the week, angle increments,
   velocity increments", binary of seven doubles.
.. [2] G. Yan, PSINS toolbox, `binfile` and `imuplot`: columns [wm vm t].
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.errors import InputError
from gyronorth.readers.format import Format, format_info
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.source import (
    FORCES,
    NAMES,
    RATES,
    TIME,
    Block,
    Clock,
    Facts,
    Parts,
    Source,
    blocks_of,
    rows_block,
)

#: Numbers in a row, rows per block, and rows that are looked at.
WIDTH, BLOCK_ROWS, LOOKED_AT = 7, 1 << 14, 400
#: Fewest rows that show a clock, and the largest share by which gravity, and a step of the clock, may differ.
FEWEST, NEAR_GRAVITY, NEAR_STEP = 8, 0.1, 0.5
#: Largest number in a row: seconds since 1970.
LARGEST = 1e10
_LAYOUTS = {
    "KF-GINS": ("<f8", (TIME, *RATES, *FORCES), "frd"),
    "PSINS": ("<f8", (*RATES, *FORCES, TIME), "rfu"),
    "PSINS (floats)": ("<f4", (*RATES, *FORCES, TIME), "rfu"),
}


def open_doubles(path: Path, options: ReadOptions) -> Source:
    """Open a file of binary rows."""
    if options.columns:
        raise InputError(f"columns does not apply to {path.name}: its binary rows have fixed columns.")
    with path.open("rb") as file:
        found = _layout(file.read(LOOKED_AT * WIDTH * 8))
    if found is None:
        raise InputError(
            f"{path.name} holds no rows of seven binary numbers that are known: a clock and increments of angle and "
            "velocity, with gravity in them (KF-GINS, PSINS)."
        )
    dtype, order, axes = _LAYOUTS[found]
    row = WIDTH * np.dtype(dtype).itemsize
    size = path.stat().st_size
    if size % row:
        raise InputError(
            f"{path.name} ends within a row of {row} bytes: it is cut off, or another format. Copy it again; or leave "
            f"the rest out: truncate -s {size - size % row} {path.name}."
        )
    rows = size // row
    read = partial(_rows, path, dtype, [order.index(name) for name in NAMES], rows)

    def part(share: float) -> Block:
        start = round(share * max(0, rows - BLOCK_ROWS))
        return rows_block(read(start), start)

    return Source(
        format="doubles",
        name=path.name,
        columns=NAMES,
        blocks=lambda: blocks_of(map(read, range(0, rows, BLOCK_ROWS)), rows),
        stated=Facts(),
        usual=Facts(gyro_unit="rad/s", accel_unit="m/s2", axes=axes, increments="both"),
        clock=Clock(unit=1.0, name=f"number {order.index(TIME)} of each row", known=True),
        parts=Parts(rows, exact=True, block=BLOCK_ROWS, read=part),
        read_as=f"{found}: rows of {np.dtype(dtype).itemsize}-byte numbers, increments (rad, m/s)",
    )


def _rows(path: Path, dtype: str, pick: list[int], count: int, start: int) -> NDArray[np.float64]:
    """Rows of a file of `count`, from `start` on. A map of the file would end the process where it is cut short."""
    wanted = WIDTH * max(0, min(BLOCK_ROWS, count - start))
    found = np.fromfile(path, dtype, wanted, offset=start * WIDTH * np.dtype(dtype).itemsize)
    if len(found) < wanted:
        raise InputError(f"{path.name} became shorter while it was read. Read it when it is whole.")
    with np.errstate(invalid="ignore"):
        return found.reshape(-1, WIDTH)[:, pick].astype(np.float64)


def _layout(head: bytes) -> str | None:
    """The layout that the first rows show; None for another format."""
    for name, (dtype, order, _) in _LAYOUTS.items():
        row = WIDTH * np.dtype(dtype).itemsize
        with np.errstate(invalid="ignore"):  # bytes of anything: signalling NaN among them
            rows = np.frombuffer(head[: len(head) // row * row], dtype).reshape(-1, WIDTH).astype(np.float64)
        if len(rows) >= FEWEST and _fits(rows[:, [order.index(each) for each in NAMES]]):
            return name
    return None


def _fits(rows: NDArray[np.float64]) -> bool:
    """Whether rows (n, 7) begin with a clock, and gravity is in the increments of velocity."""
    if not np.isfinite(rows).all():
        return False
    with np.errstate(over="ignore", invalid="ignore"):
        step = np.diff(rows[:, 0])
    usual = float(np.median(step))
    if not 0 < usual < np.inf or abs(rows).max() > LARGEST or np.mean(abs(step / usual - 1) < NEAR_STEP) < 0.9:
        return False
    force = float(np.linalg.norm(np.median(rows[:, 4:], axis=0))) / usual
    return abs(force / STANDARD_GRAVITY - 1) < NEAR_GRAVITY


FORMAT = Format(
    format_info("doubles"), open_doubles, recognises=lambda head: _layout(head[: LOOKED_AT * 56]) is not None
)
