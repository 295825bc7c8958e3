"""A remark on a recording or its heading: why it is refused, or what a reader of it should know."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """A reason for refusal, or a warning."""

    code: str  # one of DESIGN's codes, e.g. "rate_norm"
    message: str  # for people, with units
    value: float | None = None  # what was measured
    limit: float | None = None  # what it was held against
