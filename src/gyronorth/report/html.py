"""One heading as one self-contained HTML page: verdict, figures, error budget, inputs."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from math import degrees, floor, log10
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from gyronorth.angles import DEG_PER_HOUR
from gyronorth.earth import EARTH_RATE
from gyronorth.report.checks import limit_text, share, value_text
from gyronorth.report.comparison import Opinion
from gyronorth.report.dial import arc_path, density_path, on_circle, quadrant_seconds, sector_path
from gyronorth.report.figures import allan_figure, convergence_figure, svg_text
from gyronorth.report.residual import Residual, residual_figure
from gyronorth.report.sensors import figure_texts
from gyronorth.report.spectrum import Spectrum, spectrum_figure
from gyronorth.report.tables import Outcome
from gyronorth.report.wording import (
    angle_text,
    fixed_text,
    heading_text,
    interval_text,
    number_text,
    part_name,
    plain_text,
    verdict_text,
)

if TYPE_CHECKING:
    from gyronorth.allan import AllanDeviation
    from gyronorth.estimate import Convergence, HeadingDensity, HeadingEstimate
    from gyronorth.sensor import Sensor


def heading_page(
    outcome: Outcome,
    convergence: Convergence,
    *,
    deviation: AllanDeviation | None = None,
    inputs: Sequence[tuple[str, str]] = (),
    sensor: Sensor | None = None,
    spectrum: Spectrum | None = None,
    residual: Residual | None = None,
    opinions: Sequence[Opinion] = (),
) -> str:
    """The page as text: no script, no external resource, light and dark, readable on a phone.

    Parameters
    ----------
    outcome : Outcome
        The estimate, the file it comes from and the truth if the file knows it.
    convergence : Convergence
        Heading against time, for the figure.
    deviation : AllanDeviation, optional
        Of the gyro; left out for records that are too short.
    inputs : sequence of (str, str)
        What the user gave, as (name, value).
    sensor : Sensor, optional
        The profile, whose figures are shown.
    spectrum : Spectrum, optional
        Of the gyro; left out for records that are too short.
    residual : Residual, optional
        Of the gyro; left out for records that are too short.
    opinions : sequence of Opinion
        The headings of other methods beside the estimate.
    """
    estimate = outcome.estimate
    if estimate is None:
        raise ValueError(f"{outcome.file} has no estimate to report: {outcome.message}")
    doc = estimate.to_json()
    true_deg, error_deg = outcome.truth_deg()
    white = None if sensor is None else sensor.gyro.white
    figure = convergence_figure(convergence, estimate, heading_true=outcome.heading_true)
    return (
        _environment()
        .get_template("heading.html.jinja")
        .render(
            doc=doc,
            name=PurePath(outcome.file).name,
            verdict=verdict_text(doc),
            interval=interval_text(doc["interval95_deg"], unit="°"),
            true_deg=true_deg,
            error_deg=error_deg,
            bars=_bars(doc),
            dial=_dial(doc, estimate.posterior),
            convergence_svg=svg_text(figure, salt="convergence"),
            allan_svg=None if deviation is None else svg_text(allan_figure(deviation), salt="allan"),
            spectrum_svg=None
            if spectrum is None
            else svg_text(spectrum_figure(spectrum, white=white), salt="spectrum"),
            residual_svg=None
            if residual is None
            else svg_text(residual_figure(residual, white=white), salt="residual"),
            sensor_white=white,
            residual_span=None if residual is None else number_text(residual.span, unit="s"),
            opinions=opinions if len(opinions) > 1 else (),
            checks=_checks(estimate),
            figures="" if sensor is None else "; ".join(f"{name} {value}" for name, value in figure_texts(sensor)),
            inputs=inputs,
            poses=_poses(estimate),
            disturbance=_disturbance(estimate),
            turns=[degrees(turn.angle) for turn in estimate.turns],
            quadrants=quadrant_seconds(estimate.poses),
            earth_rate_deg_h=EARTH_RATE / DEG_PER_HOUR,
            written=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
            version=version("gyronorth"),
        )
    )


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("gyronorth.report", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "number": number_text,
        "fixed": fixed_text,
        "angle": angle_text,
        "heading": heading_text,
        "part": part_name,
        "plain": plain_text,
    }
    return environment


def _checks(estimate: HeadingEstimate) -> list[dict[str, Any]]:
    """The checks of the page's table: value and limit as text, and the share of the limit that is used, per cent."""
    return [
        {
            "title": check.title,
            "passed": check.passed,
            "value": value_text(check),
            "limit": limit_text(check),
            "percent": 100 * min(share(check), 1),
        }
        for check in estimate.checks
    ]


def _bars(doc: dict[str, Any]) -> list[dict[str, Any]]:
    """The error budget and its total, each with its length in per cent of the longest."""
    parts = doc["sigma_parts_deg"].items()
    rows = [{"name": part_name(part), "value": value} for part, value in parts if value is not None]
    rows.sort(key=lambda row: -row["value"])
    rows.append({"name": "together", "value": doc["sigma_deg"]})
    lengths = [min(row["value"] or 0, 180) for row in rows]
    longest = max(lengths) or 1
    decimals = max(2, 1 - floor(log10(doc["sigma_deg"] or 1)))
    return [
        row | {"percent": 100 * length / longest, "text": _bar_text(row["value"], decimals)}
        for row, length in zip(rows, lengths, strict=True)
    ]


def _bar_text(value_deg: float | None, decimals: int) -> str:
    """A part of the error budget with the decimals of the total; beyond half a turn its size means nothing."""
    return angle_text(value_deg, unit="°") if (value_deg or 0) > 180 else f"{fixed_text(value_deg, decimals=decimals)}°"


def _poses(estimate: HeadingEstimate) -> list[dict[str, Any]]:
    """The poses of the page's table: times, heading, residual of the fit and its sigma in deg/h."""
    return [
        {
            "start_s": pose.start,
            "end_s": pose.end,
            "heading_deg": degrees(pose.heading),
            "residual_deg_h": None if pose.residual is None else pose.residual / DEG_PER_HOUR,
            "sigma_deg_h": None if pose.residual_sigma is None else pose.residual_sigma / DEG_PER_HOUR,
        }
        for pose in estimate.poses
    ]


def _disturbance(estimate: HeadingEstimate) -> list[tuple[str, str]]:
    """What was found by a method that models disturbance, as (name, value)."""
    found = estimate.disturbance
    if found is None:
        return []
    rows = [("sway tones, expected number", number_text(found.sway_tones, decimals=1))]
    chances = (("bias settling", found.settling), ("bias random walk", found.walk), ("slow tilt", found.tilt))
    rows += [(f"{name}, probability", f"{chance:.2f}") for name, chance in chances if chance is not None]
    rows.append(("left out as bumps", number_text(found.masked_s, decimals=1, unit="s")))
    rows.append(("residual over sensor noise", number_text(found.residual_ratio)))
    return rows


def _dial(doc: dict[str, Any], posterior: HeadingDensity | None) -> dict[str, Any]:
    """A compass card: path of the 95 % sector, of the density, and the tip of the needle on a circle of radius 80."""
    low, high = doc["interval95_deg"]
    sector = sector_path(low, high, 80)
    needle = None if doc["heading_deg"] is None else on_circle(doc["heading_deg"], 74)
    ticks = [(on_circle(angle, 80), on_circle(angle, 72 if angle % 90 else 68)) for angle in range(0, 360, 30)]
    density = None if posterior is None else density_path(posterior.heading, posterior.density, 80, 18)
    return {
        "whole": sector is None,
        "sector": sector,
        "density": density,
        "arc": arc_path(low, high, 80),
        "needle": needle,
        "ticks": ticks,
    }
