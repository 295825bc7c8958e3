"""Geometry of a compass card in SVG coordinates, north up and clockwise, and of the quadrants of a turned recording."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, degrees, radians, sin
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gyronorth.arrays import Array
    from gyronorth.estimate import Pose

#: Half a quadrant, rad: a pose turned by exactly 90 deg is in the middle of the second.
QUADRANT_CENTRE = radians(45)


def on_circle(heading_deg: float, radius: float) -> str:
    """A point of the card."""
    return f"{radius * sin(radians(heading_deg)):.2f} {-radius * cos(radians(heading_deg)):.2f}"


def sector_path(low_deg: float, high_deg: float, radius: float) -> str | None:
    """Path of the sector clockwise from `low_deg` to `high_deg`; None where it is the whole circle."""
    arc = arc_path(low_deg, high_deg, radius)
    return None if arc is None else f"M0 0 L{arc[1:]} Z"


def arc_path(low_deg: float, high_deg: float, radius: float) -> str | None:
    """Path of the arc clockwise from `low_deg` to `high_deg`; None where it is the whole circle."""
    if high_deg - low_deg >= 360:
        return None
    width = (high_deg - low_deg) % 360
    start, end = on_circle(low_deg, radius), on_circle(low_deg + width, radius)
    return f"M{start} A{radius:g} {radius:g} 0 {int(width > 180)} 1 {end}"


def density_path(heading: Array, density: Array, radius: float, height: float) -> str:
    """Path of a density that stands on the circle: its highest value is `height`; angles in rad, clockwise in order."""
    size = radius + height * density / density.max()
    outer = [on_circle(degrees(angle), length) for angle, length in zip(heading, size, strict=True)]
    inner = [on_circle(degrees(angle), radius) for angle in heading[::-1]]
    return f"M{' L'.join([*outer, *inner])} Z"


def quadrant_seconds(poses: Sequence[Pose]) -> list[float]:
    """Seconds of standing still in each quadrant from the first pose on: about 0, 90, 180 and 270 deg."""
    seconds = [0.0] * 4
    for pose in poses:
        turned = degrees(pose.heading - poses[0].heading + QUADRANT_CENTRE) % 360
        seconds[int(turned // 90) % 4] += pose.end - pose.start
    return seconds
