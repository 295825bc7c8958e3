"""How a file is read, with the evidence for each decision, as text for `gyronorth import`."""

from __future__ import annotations

from math import atan2, degrees, hypot, sin
from typing import TYPE_CHECKING, TextIO

from gyronorth.angles import DEG_PER_HOUR
from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY
from gyronorth.report.terminal import print_lines
from gyronorth.report.wording import heading_text

if TYPE_CHECKING:
    from gyronorth.readers import Description
    from gyronorth.readers.mountings import Mounting

#: A norm that is Earth rate, and one that is gravity, within these shares.
NEAR_EARTH_RATE, NEAR_GRAVITY = 0.25, 0.05


def print_evidence(description: Description, latitude: float | None, stream: TextIO) -> None:
    """Print what the file was read as, and what clock, gravity and Earth rate say of that."""
    info = description.info
    increments = ", increments" if info.increments else ""
    lines = [
        ("file", f"{info.source} ({info.format})"),
        *([("read as", info.read_as)] if info.read_as else []),
        ("units", ", ".join(unit for unit in (info.gyro_unit, info.accel_unit) if unit) + increments),
        ("clock", _clock(description)),
        ("gravity", _gravity(description)),
        ("Earth rate", _earth_rate(description, latitude)),
        *[("note", f"{note.code}: {note.message}") for note in description.notes if note.code != "axes_suspect"],
    ]
    print_lines(lines, stream)


def print_mountings(found: list[Mounting], stream: TextIO) -> None:
    """Print the headings that each mounting would give, and how to find out which one holds."""
    print_lines(
        [
            (each.axes, f"{each.forward} points forward: heading {heading_text(degrees(each.heading))} deg")
            for each in found
        ],
        stream,
    )
    stream.write(
        "Not sure which? Record again and, in the last seconds, lift the end that is the nose: the axis of the file "
        "that then feels more of the table's push is forward (+), and the one that feels less is backward.\n"
    )


def _clock(description: Description) -> str:
    gaps = sum(gap.samples for gap in description.gaps)
    missing = f"{gaps} samples missing" if gaps else "none missing"
    dropped = f", {description.rows_dropped} rows dropped" if description.rows_dropped else ""
    rate_hz = description.info.rate_hz
    return f"{description.samples} samples at {rate_hz:.6g} Hz, {description.duration:.6g} s, {missing}{dropped}"


def _gravity(description: Description) -> str:
    if description.force_mean is None:
        return "no accelerometer: the unit will be taken as level unless --roll and --pitch are given"
    norm = hypot(*description.force_mean)
    verdict = "confirmed" if abs(norm / STANDARD_GRAVITY - 1) < NEAR_GRAVITY else "not confirmed"
    return f"norm {norm:.4f} m/s2, {STANDARD_GRAVITY:.2f} at rest: unit {verdict}"


def _earth_rate(description: Description, latitude: float | None) -> str:
    norm = description.rate_norm
    near = abs(norm / EARTH_RATE - 1) < NEAR_EARTH_RATE
    verdict = "unit confirmed" if near else "hidden by the bias, or the unit is wrong"
    text = f"norm {norm / DEG_PER_HOUR:.4g} deg/h, {EARTH_RATE / DEG_PER_HOUR:.2f} at rest: {verdict}"
    if not near or description.force_mean is None:
        return text
    force, rate = description.force_mean, description.rate_mean
    up = sum(w * f for w, f in zip(rate, force, strict=True)) / hypot(*force)
    across = max(norm**2 - up**2, 0.0) ** 0.5
    text += f"; latitude by the vertical part {degrees(atan2(up, across)):.1f} deg"
    if latitude is not None:
        text += f", given {degrees(latitude):.1f}"
        text += "" if abs(up / EARTH_RATE - sin(latitude)) < NEAR_EARTH_RATE else " (they do not agree)"
    return text
