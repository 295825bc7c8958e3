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
    from gyronorth.alignment.registry import METHODS as METHODS
    from gyronorth.allan import allan_deviation as allan_deviation
    from gyronorth.calibration import calibrate as calibrate
    from gyronorth.deviation import read_deviation as read_deviation
    from gyronorth.errors import InputError as InputError
    from gyronorth.estimate import Convergence as Convergence
    from gyronorth.estimate import HeadingBatch as HeadingBatch
    from gyronorth.estimate import HeadingEstimate as HeadingEstimate
    from gyronorth.findings import Finding as Finding
    from gyronorth.many import heading_many as heading_many
    from gyronorth.pipeline import convergence as convergence
    from gyronorth.pipeline import heading as heading
    from gyronorth.pipeline import heading_batch as heading_batch
    from gyronorth.planning import plan as plan
    from gyronorth.planning import plan_turns as plan_turns
    from gyronorth.readers import ReadOptions as ReadOptions
    from gyronorth.readers import read as read
    from gyronorth.readers import write as write
    from gyronorth.recording import Recording as Recording
    from gyronorth.sensor import Sensor as Sensor
    from gyronorth.sensor import read_sensor as read_sensor
    from gyronorth.sensor import sensor_names as sensor_names
    from gyronorth.sensor import write_sensor as write_sensor
    from gyronorth.simulation import Motion as Motion
    from gyronorth.simulation import simulate as simulate
    from gyronorth.streaming import StreamingHeading as StreamingHeading

    __version__: str

#: Public name -> the module that it comes from, imported when it is first asked for.
_HOMES = {
    "Convergence": "estimate",
    "Finding": "findings",
    "HeadingBatch": "estimate",
    "HeadingEstimate": "estimate",
    "InputError": "errors",
    "METHODS": "alignment.registry",
    "Motion": "simulation",
    "ReadOptions": "readers",
    "Recording": "recording",
    "Sensor": "sensor",
    "StreamingHeading": "streaming",
    "allan_deviation": "allan",
    "calibrate": "calibration",
    "convergence": "pipeline",
    "heading": "pipeline",
    "heading_batch": "pipeline",
    "heading_many": "many",
    "plan": "planning",
    "plan_turns": "planning",
    "read": "readers",
    "read_deviation": "deviation",
    "read_sensor": "sensor",
    "sensor_names": "sensor",
    "simulate": "simulation",
    "write": "readers",
    "write_sensor": "sensor",
}
__all__ = [
    "METHODS",
    "Convergence",
    "Finding",
    "HeadingBatch",
    "HeadingEstimate",
    "InputError",
    "Motion",
    "ReadOptions",
    "Recording",
    "Sensor",
    "StreamingHeading",
    "__version__",
    "allan_deviation",
    "calibrate",
    "convergence",
    "heading",
    "heading_batch",
    "heading_many",
    "plan",
    "plan_turns",
    "read",
    "read_deviation",
    "read_sensor",
    "sensor_names",
    "simulate",
    "write",
    "write_sensor",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("gyronorth")
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
