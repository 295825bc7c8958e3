"""Numbers and verdicts in the reader's words: degrees that wrap at north, signs, two figures of a sigma."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gyronorth.angles import DEG_PER_HOUR
from gyronorth.earth import EARTH_RATE
from gyronorth.errors import one_line

if TYPE_CHECKING:
    from gyronorth.report.tables import Outcome


def heading_text(heading_deg: float, *, decimals: int = 2, width: int = 0, full_turn: bool = False) -> str:
    """A heading in [0, 360) as text: 359.999 is 0.00, never 360.00.

    With `full_turn`, exactly 360 stays 360: the upper end of the interval that holds every heading.
    """
    if not (full_turn and heading_deg == 360):
        heading_deg = round(heading_deg % 360, decimals) % 360
    return f"{heading_deg:0{width}.{decimals}f}"


def interval_text(interval_deg: list[float], *, unit: str = " deg") -> str:
    """The 95 % interval in words; clockwise, so the first limit may be the larger."""
    low, high = interval_deg
    if high - low >= 360:
        return "any heading"
    crossing = ", through north" if low > high else ""
    return f"{heading_text(low)} to {heading_text(high)}{unit}{crossing}"


def number_text(value: float | None, *, decimals: int = 2, unit: str = "") -> str:
    """A number with its unit, or "unknown"; small numbers keep two figures, and there is no -0.00."""
    if value is None:
        return "unknown"
    value += 0.0  # -0.0 becomes 0.0
    small = value != 0 and abs(value) < 10.0**-decimals
    text = f"{value:.2g}" if small else f"{value:.{decimals}f}"
    return f"{text}{unit}" if unit == "°" else f"{text} {unit}".rstrip()


def fixed_text(value: float | None, *, decimals: int = 2) -> str:
    """A number that always has so many decimals, such as roll and pitch, or "unknown"; there is no -0.00."""
    return "unknown" if value is None else f"{round(value, decimals) + 0.0:.{decimals}f}"


def duration_text(seconds: float) -> str:
    """A duration in the unit that people would use: 45 s, 12 min, 2.8 h."""
    if seconds < 60:
        return f"{seconds:.3g} s"
    return f"{seconds / 60:.3g} min" if seconds < 3600 else f"{seconds / 3600:.3g} h"


def angle_text(angle_deg: float | None, *, unit: str = "") -> str:
    """A part of sigma: beyond half a turn its size means nothing."""
    if angle_deg is not None and angle_deg > 180:
        return f"> 180{unit}"
    return number_text(angle_deg, unit=unit)


def plain_text(value: float | None) -> str:
    """A number of unknown size with four figures, empty where there is none."""
    return "" if value is None else f"{value:.4g}"


def with_sigma(values: list[float], sigmas: list[float], *, unit: str) -> str:
    """Values of the three axes, each with its standard deviation."""
    shown = (f"{number_text(value)} ± {number_text(sigma)}" for value, sigma in zip(values, sigmas, strict=True))
    return f"{', '.join(shown)} {unit}"


def finding_text(finding: dict[str, Any]) -> str:
    """A reason or warning on one line; its message holds the measured value beside the limit."""
    return f"{finding['code']}: {finding['message']}"


def verdict_text(doc: dict[str, Any]) -> str:
    """Whether the heading may be used, in one sentence."""
    if doc["valid"]:
        return "valid"
    if doc["heading_deg"] is None:
        return "refused: no heading could be computed"
    return "refused: do not use this heading"


def part_name(part: str) -> str:
    """A part of sigma in words: turn_on_bias is "turn-on bias"."""
    return part.replace("turn_on", "turn-on").replace("_", " ")


def heading_lines(outcome: Outcome) -> list[tuple[str, str]]:
    """The estimate of `outcome` as (label, text), what matters most first."""
    doc = outcome.document()
    refused = "" if doc["valid"] or doc["heading_deg"] is None else " (refused)"
    heading = "none" if doc["heading_deg"] is None else f"{heading_text(doc['heading_deg'])} deg{refused}"
    lines = [
        ("verdict", verdict_text(doc)),
        ("heading", heading),
        ("sigma", number_text(doc["sigma_deg"], unit="deg")),
        ("95 % interval", interval_text(doc["interval95_deg"])),
    ]
    lines += [("reason", finding_text(finding)) for finding in doc["reasons"]]
    lines += [("warning", finding_text(finding)) for finding in doc["warnings"]]
    true_deg, error_deg = outcome.truth_deg()
    if true_deg is not None:
        lines.append(("reference heading", f"{heading_text(true_deg)} deg, error {number_text(error_deg, unit='deg')}"))
    lines.append(("method", f"{doc['method']} ({doc['method_reason']})"))
    if doc["bundle"] is not None:
        lines.append(("bundle", doc["bundle"]))
    known = {part: value for part, value in doc["sigma_parts_deg"].items() if value is not None}
    parts = [f"{part_name(part)} {angle_text(value)}" for part, value in known.items()]
    lines.append(("error budget", f"{', '.join(parts)} deg" if parts else "unknown"))
    lines.append(("roll, pitch", f"{number_text(doc['roll_deg'])}, {number_text(doc['pitch_deg'])} deg"))
    mean = ", ".join(number_text(value) for value in doc["rate_mean_deg_h"])
    norm = number_text(doc["rate_norm_deg_h"], unit="deg/h")
    lines.append(("mean rate", f"{mean} deg/h; norm {norm}, Earth {EARTH_RATE / DEG_PER_HOUR:.2f}"))
    implied = number_text(doc["implied_latitude_deg"], decimals=1, unit="deg")
    lines.append(("latitude", f"{number_text(doc['latitude_deg'], decimals=4)} deg; implied by the rate {implied}"))
    if doc["gyro_bias_deg_h"] is not None:
        lines.append(("gyro bias", with_sigma(doc["gyro_bias_deg_h"], doc["gyro_bias_sigma_deg_h"], unit="deg/h")))
        if any(doc["scale_factor_sigma_ppm"]):  # of a profile without one it is no unknown
            lines.append(
                ("scale factor", with_sigma(doc["scale_factor_ppm"], doc["scale_factor_sigma_ppm"], unit="ppm"))
            )
    for pose in doc["poses"] if len(doc["poses"]) > 1 else ():
        span = f"{pose['start_s']:g} to {pose['end_s']:g} s"
        lines.append(("pose", f"{span}: {heading_text(pose['heading_deg'])} deg"))
    end = "" if doc["end_time_utc"] is None else f", ends {doc['end_time_utc']}"
    lines.append(("recording", f"{one_line(outcome.file)}, {doc['duration_s']:g} s at {doc['rate_hz']:g} Hz{end}"))
    lines += [("read as", outcome.read_as)] if outcome.read_as else []
    lines.append(("sensor", doc["sensor"] or "no profile given"))
    return lines
