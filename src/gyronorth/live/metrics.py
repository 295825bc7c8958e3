"""The state of an instrument for Prometheus: its text format, version 0.0.4."""

from __future__ import annotations

from dataclasses import asdict
from math import degrees
from typing import get_args

from gyronorth.live.status import LiveFitness, Status

#: Content type of the text.
CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"


def metrics_text(status: Status) -> str:
    """Gauges of the heading and its state, and counters of the input; what is not known is left out."""
    estimate = status.estimate
    held, turn = status.held, status.rate_of_turn
    gauges: list[tuple[str, str, float | None]] = [
        ("heading_degrees", "Heading that is given out, clockwise from true north.", _of(estimate, "heading_deg")),
        ("heading_sigma_degrees", "One standard deviation of it.", _of(estimate, "sigma_deg")),
        ("heading_valid", "Whether it may be used.", float(estimate is not None and estimate.valid)),
        ("heading_age_seconds", "Time since the latest estimate.", status.age),
        ("heading_held_seconds", "Time for which it is carried on by the gyro.", held and held.since),
        ("rate_of_turn_degrees_per_minute", "Positive to starboard.", None if turn is None else degrees(turn) * 60),
        ("sample_rate_hertz", "Rate of the samples.", status.rate_hz),
        ("connected", "Whether the source delivers.", float(status.connected)),
        ("recording_ok", "Whether the recording is whole.", float(status.recording_error is None)),
    ]
    lines: list[str] = []
    for name, words, value in gauges:
        if value is not None:
            lines += [*_head(name, words, "gauge"), f"gyronorth_{name} {float(value):.10g}"]
    lines += _head("fitness", "What the heading is good for: 1 at the present state.", "gauge")
    lines += [f'gyronorth_fitness{{state="{name}"}} {int(name == status.fitness)}' for name in get_args(LiveFitness)]
    for name, count in asdict(status.counters).items():
        lines += [*_head(f"{name}_total", f"Counter {name} of `live --json`.", "counter")]
        lines += [f"gyronorth_{name}_total {count}"]
    return "\n".join(lines) + "\n"


def _of(estimate: object, name: str) -> float | None:
    return None if estimate is None else getattr(estimate, name)


def _head(name: str, words: str, kind: str) -> list[str]:
    return [f"# HELP gyronorth_{name} {words}", f"# TYPE gyronorth_{name} {kind}"]
