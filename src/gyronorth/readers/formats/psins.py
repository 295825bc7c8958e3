"""PSINS text files (.imu) of Gongmin Yan's toolbox: integer increments behind three numeric lines.

    pitch roll yaw (deg; yaw counter-clockwise)  vE vN vU (m/s)
    latitude longitude (deg)  height (m)  t0 (s)  sampling interval (ms)  g (m/s^2)
    gyro scale x y z (arcsec per count)  accelerometer scale x y z (ug s per count)

Lines that begin with % are comments. Axes are right-front-up by the format's convention; yaw
belongs to the front axis, and g is the unit of the accelerometer's scale.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from gyronorth.errors import InputError
from gyronorth.readers.format import Format, format_info
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.source import FORCES, RATES, Block, Facts, Source
from gyronorth.readers.text import Layout, text_blocks, text_parts
from gyronorth.readers.text_head import TextHead
from gyronorth.recording import FASTEST_RATE_HZ, SLOWEST_RATE_HZ

_ARCSEC = math.pi / 180 / 3600
_TITLES = ("gx", "gy", "gz", "ax", "ay", "az")
#: Scales of like axes differ by less than this factor; counts in their place do not.
_SCALE_SPREAD = 10.0


def open_psins(path: Path, options: ReadOptions) -> Source:
    """Open a PSINS .imu file."""
    if options.columns:
        raise InputError(f"columns does not apply to {path.name}: a PSINS .imu file has fixed columns.")
    with TextHead(path) as head:
        attitude = _header_line(head, "pitch roll yaw vE vN vU")
        place = _header_line(head, "latitude longitude height t0 interval-in-ms g")
        row = head.row
        scale_row = head.row + 1
        scale = _header_line(head, "three gyro scales in arcsec, three accelerometer scales in ug s")
        offset, data_row = head.offset, head.row
    latitude_deg, interval_ms, gravity = place[0], place[4], place[5]
    if not (abs(latitude_deg) <= 90 and 9.7 <= gravity <= 9.9):
        raise InputError(
            f"Row {row} of {path.name}: latitude is {latitude_deg:g} deg and g {gravity:g} m/s^2; -90 to 90 and "
            "9.7 to 9.9 are expected in the second header line (latitude longitude height t0 interval g)."
        )
    if not 1000 / FASTEST_RATE_HZ <= interval_ms <= 1000 / SLOWEST_RATE_HZ:
        raise InputError(f"Row {row} of {path.name}: the sampling interval is {interval_ms:g} ms; 10 means 100 Hz.")
    if min(scale) <= 0 or any(max(part) > _SCALE_SPREAD * min(part) for part in (scale[:3], scale[3:])):
        raise InputError(
            f"Row {scale_row} of {path.name}: {' '.join(f'{value:g}' for value in scale)} are no scale factors. The "
            "third header line (three gyro scales in arcsec, three accelerometer scales in ug s, all positive) seems "
            "to be missing; put it in from the data sheet."
        )
    layout = Layout(_TITLES, tuple(range(6)), None)
    parts = text_parts(path, offset, data_row, layout)
    units = np.concatenate([np.array(scale[:3]) * _ARCSEC, np.array(scale[3:]) * 1e-6 * gravity])
    return Source(
        format="psins",
        name=path.name,
        columns=(*RATES, *FORCES),
        blocks=lambda: (_scaled(block, units) for block in text_blocks(path, offset, data_row, layout)),
        stated=Facts(
            rate_hz=1000 / interval_ms,
            gyro_unit="rad/s",
            accel_unit="m/s2",
            increments=True,
            latitude=math.radians(latitude_deg),
            # All three angles zero: the writer did not know them.
            heading_true=math.radians(-attitude[2]) % (2 * math.pi) if any(attitude[:3]) else None,
        ),
        usual=Facts(axes="rfu"),
        axes_defined=True,
        truth_follows_axes=True,
        parts=replace(parts, read=lambda share: _scaled(parts.read(share), units)),
    )


def _scaled(block: Block, units: np.ndarray) -> Block:
    """Counts turned into rad and m/s per sample."""
    return replace(block, values=block.values * units)


def _header_line(head: TextHead, meaning: str) -> list[float]:
    while (line := head.take()) is not None:
        if not line.strip() or line.lstrip().startswith("%"):
            continue
        try:
            values = [float(field) for field in line.split()]
        except ValueError:
            values = []
        if len(values) == 6 and np.isfinite(values).all():
            return values
        raise InputError(
            f"Row {head.row} of {head.name} is {line[:60]!r}; a header line of six numbers is expected: {meaning}."
        )
    raise InputError(f"{head.name} ends within its header; a line of six numbers is expected: {meaning}.")


FORMAT = Format(format_info("psins"), open_psins, recognises=lambda head: b"PSINS" in head)
