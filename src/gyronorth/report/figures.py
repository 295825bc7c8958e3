"""Figures: convergence of the heading, Allan deviation, what a sensor can reach in a time.

Colours are the colour-blind safe set of Okabe and Ito ("Color universal design", 2008), told
apart by line style as well. A figure leaves as PNG, SVG or PDF, or as SVG text for the HTML
report, where the colours become CSS variables so that they follow a light or a dark page.
"""

from __future__ import annotations

import re
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from gyronorth.angles import DEG_PER_HOUR, wrap
from gyronorth.catalogue import METHODS
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.errors import printable
from gyronorth.files import written_beside
from gyronorth.report.wording import duration_text, heading_text, number_text, part_name

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from gyronorth.allan import AllanDeviation, Characterisation, Identification
    from gyronorth.estimate import Convergence, HeadingEstimate, Pose
    from gyronorth.planning import Plan

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
#: Characters of a file name above a figure.
LONGEST_NAME = 80


def heading_figure(
    convergence: Convergence,
    estimate: HeadingEstimate,
    *,
    heading_true: float | None = None,
    deviation: AllanDeviation | None = None,
    name: str = "",
) -> Figure:
    """Convergence of one heading and, where given, the Allan deviation of its recording below it.

    Above both stands what the picture must say when it is alone: file, heading and sigma, verdict, method.
    """
    with mpl.rc_context(SETTINGS):
        figure = new_figure(8.0, 4.4 if deviation is None else 8.4)
        axes = figure.subplots(1 if deviation is None else 2, 1, squeeze=False)[:, 0]
        draw_convergence(axes[0], convergence, estimate, heading_true=heading_true)
        if deviation is not None:
            draw_allan(axes[1], deviation)
        figure.suptitle(verbatim(_headline(estimate, name)), x=0.02, ha="left", fontsize=11, color=INK)
    return figure


def _headline(estimate: HeadingEstimate, name: str) -> str:
    """File, heading and sigma, verdict, method; a refused heading is not repeated."""
    if estimate.valid and estimate.heading is not None and estimate.sigma is not None:
        heading = heading_text(np.degrees(estimate.heading))
        found = f"heading {heading} ± {number_text(np.degrees(estimate.sigma))} deg, valid"
    else:
        found = f"refused: {', '.join(dict.fromkeys(reason.code for reason in estimate.reasons))}"
    return f"{_shortened(name)}\n{found}; method {estimate.method}".lstrip()


def _shortened(name: str) -> str:
    """A file name that fits the width of a figure: of a longer one the end."""
    name = printable(name)
    return name if len(name) <= LONGEST_NAME else "…" + name[1 - LONGEST_NAME :]


def verbatim(text: str) -> str:
    """A text as matplotlib can show it: a dollar sign begins no formula; bytes that are no UTF-8 are written out."""
    return text.replace("$", r"\$").encode(errors="backslashreplace").decode()


def convergence_figure(
    convergence: Convergence, estimate: HeadingEstimate, *, heading_true: float | None = None
) -> Figure:
    """Convergence alone, in the size of the HTML report."""
    with mpl.rc_context(SETTINGS):
        figure = new_figure(4.5, 3.3)
        draw_convergence(figure.subplots(), convergence, estimate, heading_true=heading_true)
    return figure


def allan_figure(deviation: AllanDeviation) -> Figure:
    """Allan deviation of the gyro alone, in the size of the HTML report."""
    with mpl.rc_context(SETTINGS):
        figure = new_figure(4.5, 3.3)
        draw_allan(figure.subplots(), deviation)
    return figure


#: Methods whose own course the figure shows; of another the plain averaging, and its result at the end.
DRAWN_ITSELF = tuple(info.name for info in METHODS if info.along_time == info.name)


def draw_convergence(
    axes: Axes, convergence: Convergence, estimate: HeadingEstimate, *, heading_true: float | None = None
) -> None:
    """Heading against time with its 95 % band, turns taken out, about the final heading, and the reference if known."""
    axes.set(title="Heading against time", xlabel="time from the start (s)", ylabel="heading (deg)")
    final = estimate.heading
    known = np.isfinite(convergence.heading)
    if final is None or not known.any():
        axes.text(0.5, 0.5, "no heading could be computed", transform=axes.transAxes, ha="center", color=INK)
        return
    time, valid = convergence.time[known], convergence.valid[known]
    half_deg = np.degrees(convergence.half_width[known])
    if len(estimate.poses) > 1:
        axes.set(ylabel="heading of the last pose (deg)")
        heading = np.degrees(final + _less_turns(time, convergence.heading[known], estimate.poses))
    else:
        heading = np.degrees(final + wrap(convergence.heading[known] - final))
    low, high = heading - half_deg, heading + half_deg

    axes.fill_between(time, low, high, color=BLUE, alpha=0.18, linewidth=0, label="95 % interval")
    axes.plot(time, np.where(valid, heading, np.nan), color=BLUE, label="heading, valid" if valid.any() else None)
    if not valid.all():
        refused = ~valid
        refused[1:] |= ~valid[:-1]  # join the pieces
        axes.plot(time, np.where(refused, heading, np.nan), color=FAINT, linestyle=":", label="heading, refused")
    levels = [low[time >= 0.2 * time[-1]].min(), high[time >= 0.2 * time[-1]].max()]
    if estimate.method not in DRAWN_ITSELF:
        axes.set_title("Heading against time, by plain averaging")
        reach = np.degrees(
            [(final - estimate.interval95[0]) % (2 * np.pi), (estimate.interval95[1] - final) % (2 * np.pi)]
        )
        axes.errorbar(
            time[-1], np.degrees(final), yerr=reach[:, None], color=INK, marker="o", markersize=4, capsize=3,
            clip_on=False, zorder=4, label=f"{estimate.method}, {'valid' if estimate.valid else 'refused'}",
        )  # fmt: skip
        levels += [np.degrees(final) - reach[0], np.degrees(final) + reach[1]]
    elif len(time) == 1:  # a curve of one point is not seen
        axes.errorbar(
            time, heading, yerr=half_deg, color=BLUE if valid[0] else FAINT, marker="o", capsize=3, clip_on=False
        )
    if heading_true is not None:
        truth = float(np.degrees(final + wrap(heading_true - final)))
        axes.axhline(
            truth, color=RED, linestyle="--", linewidth=1.3, label=f"reference, {np.degrees(heading_true):.2f} deg"
        )
        levels.append(truth)
    margin = 0.08 * (max(levels) - min(levels)) + 1e-3
    middle = np.degrees(final)
    axes.set_ylim(max(min(levels) - margin, middle - 185), min(max(levels) + margin, middle + 185))
    axes.set_xlim(0, time[-1])
    steps = [1, 2, 3, 5, 10] if np.ptp(axes.get_ylim()) < 120 else [1, 3, 4.5, 9, 10]
    axes.yaxis.set_major_locator(MaxNLocator(nbins=7, steps=steps))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{round(value % 360, 4) % 360:g}"))
    legend_above(axes, columns=2)


def _less_turns(time: NDArray, heading: NDArray, poses: Sequence[Pose]) -> NDArray:
    """By how much each heading is off what the whole recording says of the pose that it is of, rad.

    A heading is of the pose that has begun last, or of the one before while that is too short to be found.
    """
    pose = np.array([pose.heading for pose in poses])
    last = np.maximum(np.searchsorted([pose.start for pose in poses], time, side="right") - 1, 0)
    off = wrap(heading - pose[np.stack([last, np.maximum(last - 1, 0)])])
    return np.take_along_axis(off, np.argmin(np.abs(off), axis=0)[None], axis=0)[0]


def characterisation_figure(found: Characterisation) -> Figure:
    """Allan deviation of gyro and accelerometer with the fitted model of each triad."""
    with mpl.rc_context(SETTINGS):
        figure = new_figure(8.0, 4.8 if found.accel is None else 9.2)
        axes = figure.subplots(1 if found.accel is None else 2, 1, squeeze=False)[:, 0]
        draw_allan(axes[0], found.gyro.deviation, model=found.gyro.triad)
        if found.accel is not None:
            draw_allan(axes[1], found.accel.deviation, model=found.accel.triad, sensor="accelerometer")
        figure.suptitle(verbatim(_shortened(Path(found.source).name)), x=0.02, ha="left", fontsize=11, color=INK)
    return figure


def draw_allan(
    axes: Axes,
    deviation: AllanDeviation,
    *,
    model: Identification | None = None,
    sensor: Literal["gyro", "accelerometer"] = "gyro",
) -> None:
    """Allan deviation of three axes with 95 % bounds and, where given, the model fitted to all three."""
    unit, one = ("deg/h", DEG_PER_HOUR) if sensor == "gyro" else ("mg", 1e-3 * STANDARD_GRAVITY)
    axes.set(title=f"Allan deviation of the {sensor}", xlabel="averaging time (s)", ylabel=f"deviation ({unit})")
    logarithmic(axes)
    curves = zip(
        AXIS_STYLES, *(part.T / one for part in (deviation.deviation, deviation.low, deviation.high)), strict=True
    )
    for (name, colour, line), value, low, high in curves:
        if value.all():  # an axis that does not vary has no place on a logarithmic scale
            axes.fill_between(deviation.tau, low, high, color=colour, alpha=0.13, linewidth=0)
            axes.plot(deviation.tau, value, color=colour, linestyle=line, label=f"body {name}")
    if not axes.lines:
        axes.text(0.5, 0.5, f"the {sensor} does not vary", transform=axes.transAxes, ha="center", color=INK)
    if model is not None:
        tau = deviation.tau[deviation.tau >= model.tau[0] * 0.999]
        axes.plot(tau, model.deviation(tau) / one, color=INK, linewidth=1.0, label="model of the triad")
    legend_above(axes, columns=3 if model is None else 4)


def plan_figure(plan: Plan) -> Figure:
    """Expected sigma against time with its parts, and for several latitudes."""
    with mpl.rc_context(SETTINGS):
        figure = new_figure(8.0, 8.6)
        parts, latitudes = figure.subplots(2, 1)
        for axes in (parts, latitudes):
            axes.set(xlabel="time standing still (s)", ylabel="heading sigma (deg)")
            logarithmic(axes)
        total = np.degrees(plan.sigma)
        where = f"{verbatim(plan.sensor.name)} at {np.degrees(plan.latitude):.4g} deg, {plan.method}"
        parts.set(title=f"Expected heading sigma: {where}", xlim=(plan.duration[0], plan.duration[-1]))
        parts.plot(plan.duration, total, color=INK, linewidth=2.4, label="together")
        styles = zip((BLUE, RED, GREEN, PINK), ("-", "--", "-.", ":"), strict=True)
        for (part, value), (colour, line) in zip(plan.parts.items(), styles, strict=True):
            if value.any():
                parts.plot(plan.duration, np.degrees(value), color=colour, linestyle=line, label=part_name(part))
        if plan.useful_duration is not None and plan.shortest_duration is not None:
            label = f"sigma levels off after {duration_text(plan.useful_duration)}"
            parts.axvline(plan.useful_duration, color=FAINT, linewidth=1.2, linestyle=(0, (1, 1.5)), label=label)
        bottom, top = parts.get_ylim()
        parts.set_ylim(max(total.min() / 300, bottom), min(200, top))
        latitudes.set(title="The same at other latitudes, north or south", xlim=(plan.duration[0], plan.duration[-1]))
        for latitude, sigma, colour, line in _some_latitudes(plan):
            label = f"{np.degrees(latitude):.0f} deg"
            latitudes.plot(plan.duration, np.degrees(sigma), color=colour, linestyle=line, label=label)
        latitudes.set_ylim(top=min(200, latitudes.get_ylim()[1]))
        legend_above(parts, columns=3)
        legend_above(latitudes, columns=4)
    return figure


def _some_latitudes(plan: Plan) -> list[tuple[float, NDArray[np.float64], str, str]]:
    """Latitude, sigma, colour and line style of four curves from the equator towards the pole."""
    picked = np.linspace(0, len(plan.latitudes) - 1, 4).round().astype(int)
    styles = zip((BLUE, GREEN, RED, PINK), ("-", "-.", "--", ":"), strict=True)
    return [
        (float(plan.latitudes[index]), plan.sigma_by_latitude[index], colour, line)
        for index, (colour, line) in zip(picked, styles, strict=True)
    ]


def write(figure: Figure, path: Path) -> None:
    """Write the figure in the format of the suffix, .png, .svg or .pdf."""
    suffix = path.suffix.lower()
    FigureCanvasAgg(figure)
    metadata = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(suffix)
    with mpl.rc_context(SETTINGS), written_beside(path) as part:
        figure.savefig(part, format=suffix.lstrip("."), dpi=150, metadata=metadata)


def svg_text(figure: Figure, *, salt: str) -> str:
    """The figure as an SVG element for an HTML page, coloured by CSS variables.

    `salt` keeps the identifiers of two figures on one page apart.
    """
    text = StringIO()
    with mpl.rc_context(SETTINGS | {"svg.hashsalt": salt}):
        figure.savefig(text, format="svg", transparent=True, metadata={"Date": None})
    svg = text.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r'(\bid="|href="#|url\(#)', rf"\1{salt}-", svg)
    for colour, variable in COLOURS.items():
        svg = svg.replace(colour, f"var({variable})")
    return svg


def logarithmic(axes: Axes) -> None:
    """Logarithmic scales with plain numbers at them, 0.1 rather than a power."""
    axes.set(xscale="log", yscale="log")
    axes.grid(which="minor", alpha=0.35)
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 3, 5), numticks=12))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())


def legend_above(axes: Axes, *, columns: int) -> None:
    """The legend between title and axes, where no curve can run through it."""
    if not axes.get_legend_handles_labels()[0]:
        return
    rows = -(-len(axes.get_legend_handles_labels()[0]) // columns)
    axes.legend(
        loc="lower left", bbox_to_anchor=(-0.01, 1.0), ncols=columns, borderaxespad=0.2, handlelength=2.2,
        columnspacing=1.2,
    )  # fmt: skip
    axes.set_title(axes.get_title(loc="left"), pad=8 + 14.5 * rows)


def new_figure(width: float, height: float) -> Figure:
    """An empty figure, inches."""
    figure = Figure(figsize=(width, height), layout="constrained")
    figure.get_layout_engine().set(w_pad=0.1, h_pad=0.1)  # type: ignore[union-attr]
    return figure
