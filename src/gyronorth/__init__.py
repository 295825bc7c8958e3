"""True north from a gyroscope that stands still.

Conventions: n = NED, b = forward-right-down; heading of the body x axis, clockwise from
true north, in [0, 2 pi). SI units and radians; degrees only where a name ends in `_deg`.
The frame is the last letter of a name: `gyro_b`, `rate_l`, `earth_rate_n`, `mat_lb` (b to l).
Specific force at rest, level: (0, 0, -g).
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gyronorth.allan import allan_deviation as allan_deviation
    from gyronorth.errors import InputError as InputError
    from gyronorth.pipeline import heading as heading
    from gyronorth.pipeline import heading_batch as heading_batch
    from gyronorth.readers import read as read
    from gyronorth.recording import Recording as Recording
    from gyronorth.sensor import read_sensor as read_sensor
    from gyronorth.simulation import simulate as simulate
    from gyronorth.streaming import StreamingHeading as StreamingHeading

_HOMES = {
    "InputError": "recording",
    "Recording": "recording",
    "StreamingHeading": "streaming",
    "allan_deviation": "allan",
    "heading": "pipeline",
    "heading_batch": "pipeline",
    "read": "readers",
    "read_sensor": "sensor",
    "simulate": "simulation",
}
__all__ = [
    "InputError",
    "Recording",
    "StreamingHeading",
    "allan_deviation",
    "heading",
    "heading_batch",
    "read",
    "read_sensor",
    "simulate",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
