"""Headings as rows of a CSV table, one per recording, in degrees."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from gyronorth.frozen import frozen

if TYPE_CHECKING:
    from gyronorth.estimate import HeadingEstimate

#: Columns of the table; a field without a value is empty.
COLUMNS = (
    "file",
    "heading_deg",
    "sigma_deg",
    "low_deg",
    "high_deg",
    "valid",
    "reasons",
    "warnings",
    "method",
    "roll_deg",
    "pitch_deg",
    "latitude_deg",
    "sensor",
    "duration_s",
    "rate_hz",
    "rate_norm_deg_h",
    "implied_latitude_deg",
    "heading_true_deg",
    "error_deg",
    "message",
    "fitness",
)


@frozen
class Outcome:
    """Result of one file: an estimate, or the message that says why there is none."""

    file: str
    estimate: HeadingEstimate | None = None
    message: str = ""
    heading_true: float | None = None  # rad, when the file knows it
    checksum: str = ""  # of what the file held, where a table of many is kept
    settings: str = ""  # JSON of all that decided the heading, likewise
    window: tuple[float, float] | None = None  # start and end in the file, s, where it is one of its windows

    def label(self) -> str:
        """File, and window where there is one, for people."""
        return self.file if self.window is None else "{} {:g}:{:g} s".format(self.file, *self.window)

    def stamped(self, checksum: str, settings: str) -> Outcome:
        """The same with what tells later whether it still holds."""
        return replace(self, checksum=checksum, settings=settings)

    read_as: str = ""  # what each column of the file was taken for

    def document(self) -> dict[str, Any]:
        """One object of the JSON array of a folder: `file`, `error` and the heading's fields, where there is one."""
        if self.estimate is None:
            return {"file": self.file, "error": self.message, "heading_deg": None, "valid": False}
        return {"file": self.file, "error": None, **self.estimate.to_json()}

    def row(self) -> dict[str, Any]:
        """One row of the CSV table."""
        if self.estimate is None:
            return {"file": self.file, "valid": "false", "message": self.message}
        doc = self.estimate.to_json()
        low, high = doc["interval95_deg"]
        true_deg, error_deg = self.truth_deg()
        return {column: doc.get(column) for column in COLUMNS} | {
            "file": self.file,
            "low_deg": low,
            "high_deg": high,
            "valid": str(doc["valid"]).lower(),
            "reasons": ";".join(finding["code"] for finding in doc["reasons"]),
            "warnings": ";".join(finding["code"] for finding in doc["warnings"]),
            "heading_true_deg": true_deg,
            "error_deg": error_deg,
        }

    def truth_deg(self) -> tuple[float | None, float | None]:
        """The heading the file knows and the signed error of the estimate, degrees."""
        from math import degrees

        from gyronorth.angles import angle_error

        if self.heading_true is None:
            return None, None
        true_deg = degrees(self.heading_true)
        if self.estimate is None or self.estimate.heading is None:
            return true_deg, None
        return true_deg, degrees(float(angle_error(self.estimate.heading, self.heading_true)))
