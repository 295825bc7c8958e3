"""A remark on a recording or its heading: why it is refused, or what a reader of it should know; a check it passed."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any


@dataclass(frozen=True)
class Finding:
    """A reason for refusal, a warning, or a remark of a reader of files."""

    code: str  # one of `gyronorth.catalogue.FINDINGS`
    message: str  # for people, with units
    value: float | None = None  # what was measured
    limit: float | None = None  # what it was held against
    blocking: bool = False  # a heading must not be called valid before a declaration has settled this

    def to_json(self) -> dict[str, Any]:
        """The object of the JSON lists `reasons` and `warnings`; a number that JSON cannot hold is null there."""
        return {"code": self.code, "message": self.message, "value": _held(self.value), "limit": _held(self.limit)}


@dataclass(frozen=True)
class Check:
    """One condition that a heading must meet, whether it did or not; value and limit in the reader's units."""

    code: str  # of the finding that a failure gives
    title: str  # what is compared, for people
    value: float  # what was measured
    limit: float  # value > limit fails
    unit: str
    formula: str  # how both are computed, in plain text
    passed: bool

    def to_json(self) -> dict[str, Any]:
        """The object of `explain --json`; a number that JSON cannot hold is null there."""
        return asdict(self) | {"value": _held(self.value), "limit": _held(self.limit)}


def _held(number: float | None) -> float | None:
    return number if number is None or isfinite(number) else None
