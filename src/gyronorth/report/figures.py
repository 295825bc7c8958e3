"""Figures: convergence of the heading, Allan deviation, what a sensor can reach in a time.

Colours are the colour-blind safe set of Okabe and Ito ("Color universal design", 2008), told
apart by line style as well. A figure leaves as PNG, SVG or PDF, or as SVG text for the HTML
report, where the colours become CSS variables so that they follow a light or a dark page.
"""

from __future__ import annotations

from io import StringIO
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from gyronorth.angles import DEG_PER_HOUR, wrap

if TYPE_CHECKING:
    from pathlib import Path

    from gyronorth.allan import AllanDeviation
    from gyronorth.pipeline import Convergence, HeadingEstimate

#: Suffixes that a plot may be written to.
SUFFIXES = (".png", ".svg", ".pdf")

#: Colour on a light page -> CSS variable of the HTML report.
COLOURS = {
    "#1f2933": "--ink",
    "#7b8794": "--faint",
    "#d9dee4": "--grid",
    "#0072b2": "--blue",
    "#d55e00": "--red",
    "#009e73": "--green",
    "#cc79a7": "--pink",
}
INK, FAINT, GRID, BLUE, RED, GREEN, PINK = COLOURS
AXIS_STYLES = (("x", BLUE, "-"), ("y", RED, "--"), ("z", GREEN, "-."))

SETTINGS: Any = {
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.6,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "svg.fonttype": "none",
}


def heading_figure(
    convergence: Convergence,
    estimate: HeadingEstimate,
    *,
    heading_true: float | None = None,
    deviation: AllanDeviation | None = None,
) -> Figure:
    """Convergence of one heading and, where given, the Allan deviation of its recording below it."""
    with mpl.rc_context(SETTINGS):
        figure = _figure(8.0, 4.4 if deviation is None else 8.4)
        axes = figure.subplots(1 if deviation is None else 2, 1, squeeze=False)[:, 0]
        draw_convergence(axes[0], convergence, estimate, heading_true=heading_true)
        if deviation is not None:
            draw_allan(axes[1], deviation)
    return figure


def convergence_figure(
    convergence: Convergence, estimate: HeadingEstimate, *, heading_true: float | None = None
) -> Figure:
    """Convergence alone, in the size of the HTML report."""
    with mpl.rc_context(SETTINGS):
        figure = _figure(4.5, 3.3)
        draw_convergence(figure.subplots(), convergence, estimate, heading_true=heading_true)
    return figure


def allan_figure(deviation: AllanDeviation) -> Figure:
    """Allan deviation of the gyro alone, in the size of the HTML report."""
    with mpl.rc_context(SETTINGS):
        figure = _figure(4.5, 3.3)
        draw_allan(figure.subplots(), deviation)
    return figure


def draw_convergence(
    axes: Axes, convergence: Convergence, estimate: HeadingEstimate, *, heading_true: float | None = None
) -> None:
    """Heading against time with its 95 % band, unwrapped about the final heading, and the truth if known."""
    axes.set(title="Heading against time", xlabel="time from the start (s)", ylabel="heading (deg)")
    final = estimate.heading
    known = np.isfinite(convergence.heading)
    if final is None or not known.any():
        axes.text(0.5, 0.5, "no heading could be computed", transform=axes.transAxes, ha="center", color=INK)
        return
    time, valid = convergence.time[known], convergence.valid[known]
    half_deg = np.degrees(convergence.half_width[known])
    heading = np.degrees(final + wrap(convergence.heading[known] - final))
    low, high = heading - half_deg, heading + half_deg

    axes.fill_between(time, low, high, color=BLUE, alpha=0.18, linewidth=0, label="95 % interval")
    axes.plot(time, np.where(valid, heading, np.nan), color=BLUE, label="heading, valid" if valid.any() else None)
    if not valid.all():
        refused = ~valid
        refused[1:] |= ~valid[:-1]  # join the pieces
        axes.plot(time, np.where(refused, heading, np.nan), color=FAINT, linestyle=":", label="heading, refused")
    levels = [low[time >= 0.2 * time[-1]].min(), high[time >= 0.2 * time[-1]].max()]
    if heading_true is not None:
        truth = float(np.degrees(final + wrap(heading_true - final)))
        axes.axhline(
            truth, color=RED, linestyle="--", linewidth=1.3, label=f"truth, {np.degrees(heading_true):.2f} deg"
        )
        levels.append(truth)
    margin = 0.08 * (max(levels) - min(levels)) + 1e-3
    middle = np.degrees(final)
    axes.set_ylim(max(min(levels) - margin, middle - 185), min(max(levels) + margin, middle + 185))
    axes.set_xlim(0, time[-1])
    steps = [1, 2, 3, 5, 10] if np.ptp(axes.get_ylim()) < 120 else [1, 3, 4.5, 9, 10]
    axes.yaxis.set_major_locator(MaxNLocator(nbins=7, steps=steps))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{round(value % 360, 4) % 360:g}"))
    _legend_above(axes)


def draw_allan(axes: Axes, deviation: AllanDeviation) -> None:
    """Allan deviation of the gyro's axes with 95 % bounds."""
    axes.set(title="Allan deviation of the gyro", xlabel="averaging time (s)", ylabel="deviation (deg/h)")
    axes.set(xscale="log", yscale="log")
    curves = zip(AXIS_STYLES, deviation.deviation.T, deviation.low.T, deviation.high.T, strict=True)
    for (name, colour, line), value, low, high in curves:
        axes.fill_between(deviation.tau, low / DEG_PER_HOUR, high / DEG_PER_HOUR, color=colour, alpha=0.13, linewidth=0)
        axes.plot(deviation.tau, value / DEG_PER_HOUR, color=colour, linestyle=line, label=f"body {name}")
    axes.grid(which="minor", alpha=0.35)
    _legend_above(axes)


def save(figure: Figure, path: Path, *, suffix: str) -> None:
    """Write the figure to `path` in the format of `suffix`, one of `SUFFIXES`."""
    with mpl.rc_context(SETTINGS):
        FigureCanvasAgg(figure)
        metadata = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(suffix)
        figure.savefig(path, format=suffix.lstrip("."), dpi=150, metadata=metadata)


def svg_text(figure: Figure, *, salt: str) -> str:
    """The figure as an SVG element for an HTML page, coloured by CSS variables.

    `salt` keeps the identifiers of two figures on one page apart.
    """
    text = StringIO()
    with mpl.rc_context(SETTINGS | {"svg.hashsalt": salt}):
        figure.savefig(text, format="svg", transparent=True, metadata={"Date": None})
    svg = text.getvalue()
    svg = svg[svg.index("<svg") :]
    for colour, variable in COLOURS.items():
        svg = svg.replace(colour, f"var({variable})")
    return svg


def _legend_above(axes: Axes) -> None:
    """Two columns between title and axes, where no curve can run through them."""
    rows = (len(axes.get_legend_handles_labels()[0]) + 1) // 2
    axes.legend(loc="lower left", bbox_to_anchor=(-0.01, 1.0), ncols=2, borderaxespad=0.2, handlelength=2.2)
    axes.set_title(axes.get_title(loc="left"), pad=8 + 14.5 * rows)


def _figure(width: float, height: float) -> Figure:
    return Figure(figsize=(width, height), layout="constrained")
