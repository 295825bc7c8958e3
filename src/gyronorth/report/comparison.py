"""What the other methods make of the same recording: a second opinion for the report."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gyronorth.catalogue import METHODS
from gyronorth.errors import InputError
from gyronorth.pipeline import heading

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gyronorth.estimate import HeadingEstimate
    from gyronorth.recording import Recording
    from gyronorth.sensor import Sensor

#: Methods that take milliseconds and need nothing but the recording.
QUICK = tuple(info.name for info in METHODS if info.batched)


@dataclass(frozen=True)
class Opinion:
    """The heading of one method, degrees; None where it gives none."""

    method: str
    heading_deg: float | None
    sigma_deg: float | None
    valid: bool


def opinions(
    recording: Recording,
    estimate: HeadingEstimate,
    *,
    sensor: Sensor | None = None,
    attitude: tuple[float, float] | None = None,
) -> Sequence[Opinion]:
    """The estimate and, of one pose, those of the quick methods beside it.

    Parameters
    ----------
    recording : Recording
        The recording of the estimate.
    estimate : HeadingEstimate
        The reported heading.
    sensor, attitude
        As in `gyronorth.pipeline.heading`.
    """
    found = [estimate]
    if len(estimate.poses) == 1:
        for method in QUICK:
            if method != estimate.method:
                try:
                    found.append(
                        heading(recording, latitude=estimate.latitude, sensor=sensor, method=method, attitude=attitude)
                    )
                except InputError:  # it needs what this recording has not
                    continue
    docs = [each.to_json() for each in found]
    return [Opinion(doc["method"], doc["heading_deg"], doc["sigma_deg"], doc["valid"]) for doc in docs]
