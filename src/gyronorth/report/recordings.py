"""What a file holds, as text."""

from __future__ import annotations

from math import ceil
from typing import TYPE_CHECKING, Any, TextIO

from gyronorth.angles import DEG_PER_HOUR
from gyronorth.earth import EARTH_RATE
from gyronorth.report.terminal import print_lines
from gyronorth.report.wording import heading_text, number_text

if TYPE_CHECKING:
    from gyronorth.readers import Description


#: How the axes of a file are known, in words.
AXES_ORIGINS = {
    "stated": "stated by the file",
    "declared": "declared",
    "format": "defined by the format",
    "assumed": "assumed: nobody says so",
}


def print_description(description: Description, stream: TextIO) -> None:
    """Print a `Description` as `label  text` lines."""
    doc = description.to_json()
    axes = f"{doc['axes']} ({AXES_ORIGINS[doc['axes_origin']]})"
    units = doc["gyro_unit"] if doc["accel_unit"] is None else f"{doc['gyro_unit']}, {doc['accel_unit']}"
    mean = ", ".join(number_text(value) for value in doc["rate_mean_deg_h"])
    norm = number_text(doc["rate_norm_deg_h"], unit="deg/h")
    lines = [
        ("file", doc["source"]),
        ("format", doc["format"]),
        *([("topic", doc["topic"])] if doc["topic"] else []),
        ("columns", ", ".join(doc["columns"])),
        *([("read as", doc["read_as"])] if doc["read_as"] else []),
        ("length", _length(doc)),
        ("units in the file", f"{units}{', increments' if doc['increments'] else ''}"),
        ("axes in the file", axes),
        ("latitude", number_text(doc["latitude_deg"], decimals=4, unit="deg")),
    ]
    if doc["heading_true_deg"] is not None:
        lines.append(("true heading", f"{heading_text(doc['heading_true_deg'])} deg"))
    lines += [(name, doc[key]) for name, key in (("starts", "start_time_utc"), ("session", "session")) if doc[key]]
    if doc["estimated_from"] is not None:
        share = doc["estimated_from"]["samples"] / doc["samples"]
        where = f"{doc['estimated_from']['places']} places, {share:.2%} of all samples"
        lines.append(("estimated from", f"{where}: the means, and the gaps that the file does not state"))
    sigma = _scatter(doc)
    lines.append(("mean rate", f"{mean}{sigma} deg/h in body axes; norm {norm}, Earth {EARTH_RATE / DEG_PER_HOUR:.2f}"))
    if doc["force_mean_m_s2"] is None:
        lines.append(("mean specific force", "no accelerometer"))
    else:
        force = ", ".join(number_text(value, decimals=4) for value in doc["force_mean_m_s2"])
        lines.append(("mean specific force", f"{force} m/s2 in body axes (0, 0, -9.8 when level)"))
    if doc["clock"] is not None:
        lines.append(("clock", _clock(doc["clock"])))
    lines += [("gaps", _gaps(doc)), ("rows dropped", str(doc["rows_dropped"]))]
    lines += [("note", f"{note['code']}: {note['message']}") for note in doc["notes"]]
    print_lines(lines, stream)


def _length(doc: dict[str, Any]) -> str:
    about = "" if doc["estimated_from"] is None or doc["estimated_from"]["samples_known"] else "about "
    return f"{about}{doc['samples']} samples, {about}{doc['duration_s']:.10g} s at {doc['rate_hz']:.10g} Hz"


def _clock(clock: dict[str, Any]) -> str:
    counts = [f"{clock['lost']} lost"]
    late = f"{clock['late']} late" + (f" (by up to {number_text(1e3 * clock['latest_s'])} ms)" if clock["late"] else "")
    counts += [late, f"{clock['repeated']} repeated", f"{clock['duplicated']} duplicated"]
    counts.append(f"{clock['backwards']} backwards")
    wraps = "".join(f"; starts again from 0 as {words}" for words in clock["wraps"])
    back = f"; {clock['given_back']} bridged samples were late, not lost" if clock["given_back"] else ""
    return f"{number_text(clock['data_s'])} s of data; stamps {', '.join(counts)}{wraps}{back}"


def _scatter(doc: dict[str, Any]) -> str:
    """1 sigma of the mean rates, where these are those of some places."""
    if doc["estimated_from"] is None:
        return ""
    return f" (± {', '.join(f'{sigma:.2g}' for sigma in doc['estimated_from']['rate_mean_sigma_deg_h'])})"


def _gaps(doc: dict[str, Any]) -> str:
    count = f"{len(doc['gaps'])}, {sum(gap['samples'] for gap in doc['gaps'])} samples" if doc["gaps"] else "none"
    estimate = doc["estimated_from"]
    if estimate is None or estimate["missing"] is None:
        return count
    missing, sigma = round(estimate["missing"]), ceil(estimate["missing_sigma"])
    return f"{count}; by the first and the last time {missing} ± {sigma} samples are missing in all"
