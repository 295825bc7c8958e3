"""A calibration as text: what the deviation curve brings on recordings it has not seen."""

from __future__ import annotations

from math import degrees
from typing import TYPE_CHECKING, TextIO

from gyronorth.alignment.correction import DEVIATION_SUPPORT
from gyronorth.report.terminal import print_lines, print_table

if TYPE_CHECKING:
    from gyronorth.calibration import Calibration


#: Left-out error over uncorrected error below which a curve is worth having.
WORTH_IT = 0.95


def print_calibration(found: Calibration, stream: TextIO) -> None:
    """Print the cross-validated gain, then one row per recording."""
    doc, reach = found.to_json(), degrees(DEVIATION_SUPPORT)
    ratio = doc["ratio"]
    verdict = (
        "the curve helps on recordings it has not seen" if ratio < WORTH_IT else "the curve does not help; leave it out"
    )
    lines = [
        ("recordings", f"{doc['recordings']}, session {doc['session'] or 'not stated'}"),
        ("error", f"{doc['crmse_deg']:.2f} deg uncorrected, {doc['left_out_crmse_deg']:.2f} deg cross-validated"),
        ("ratio", f"{ratio:.2f}: {verdict}"),
        ("curve", f"significant with probability {doc['curve_probability']:.2f}"),
        ("holds for", f"this unit in this power-up session; within {reach:.0f} deg of a heading of the swing"),
    ]
    print_lines(lines, stream)
    stream.write("\n")
    names = ("heading_true_deg", "error_deg", "left_out_error_deg", "left_out_sigma_deg")
    rows = [tuple(f"{row[name]:.2f}" for name in names) for row in doc["rows"]]
    print_table(("true heading", "error", "left out", "its sigma"), rows, stream)
