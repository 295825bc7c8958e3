"""Figures of the studies, drawn from the JSON files that a benchmark leaves."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullLocator

from gyronorth.report.figures import BLUE, FAINT, GREEN, INK, PINK, RED, SETTINGS, write

Study = dict[str, Any]

#: Column of a table that a bar figure shows.
_RATIO = "ratio to model-based"
_COLOURS = (BLUE, RED, GREEN, PINK, FAINT)
_STYLES = ("-", "--", "-.", ":", (0, (6, 2)))


def write_study_figures(folder: str | Path, *, suffix: str = ".png") -> list[Path]:
    """Draw every study found in a benchmark's folder beside its JSON file; give the files written."""
    written = []
    for path in sorted(Path(folder).glob("*.json")):
        study = json.loads(path.read_text(encoding="utf-8"))
        draw = FIGURES.get(study.get("study"))
        if draw is None:
            continue
        target = path.with_suffix(suffix)
        write(study_figure(study), target)
        written.append(target)
    return written


def study_figure(study: Study) -> Figure:
    """The figure of one study, from its JSON content."""
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(8.0, 4.4), layout="constrained")
        FigureCanvasAgg(figure)
        FIGURES[study["study"]](figure, study)
        selection = study.get("plan", {}).get("selection", "validation")
        if selection != "validation":
            figure.suptitle(f"networks: epoch by {selection}, not an honest choice", color=RED)
    return figure


def _noise(figure: Figure, study: Study) -> None:
    axes = figure.subplots()
    axes.set(title=study["title"], xlabel="window (s)", ylabel="model-based CRMSE (deg)", xscale="log")
    own = study["curves"].get("recordings")
    if own is not None:  # a user's: nothing printed stands beside them
        axes.plot(own["duration"], own["crmse_deg"], "-", color=BLUE, marker=".")
        return
    printed, twin = study["curves"]["printed"], study["curves"]["twin"]
    fitted = [row[2] for row in study["tables"][0]["rows"]]
    axes.plot(printed["duration"], printed["crmse_deg"], "o", color=RED, label="printed (another set)")
    axes.plot(printed["duration"], fitted, "--", color=INK, label="fit: bias and white noise")
    axes.plot(twin["duration"], twin["crmse_deg"], "-", color=BLUE, marker=".", label="reconstruction, 60 recordings")
    _plain_ticks(axes.xaxis, (10, 20, 50, 100, 200))
    axes.legend()


def _ratios(figure: Figure, study: Study) -> None:
    """Ratio to the model-based CRMSE with its 95 % interval, one panel a table."""
    tables = [table for table in study["tables"] if _RATIO in table["columns"]]
    figure.set_size_inches(10.0, 0.6 + 2.3 * len(tables))
    for axes, table in zip(figure.subplots(len(tables), 1, squeeze=False, sharex=True)[:, 0], tables, strict=True):
        column = table["columns"].index(_RATIO)
        rows = [(row[0], row[column]) for row in table["rows"] if isinstance(row[column], dict)]
        _intervals(axes, rows)
        axes.set_title(table["title"])
    axes.set_xlabel("CRMSE, ratio to model-based, 95 % interval")


def _table_2(figure: Figure, study: Study) -> None:
    """Ratios, and below where on the circle the paper's network knows no heading, with either output."""
    figure.set_size_inches(10.0, 7.5)
    parts: Any = figure.subfigures(2, 1, height_ratios=(3, 2))
    table = study["tables"][0]
    column = table["columns"].index(_RATIO)
    top = parts[0].subplots()
    _intervals(top, [(row[0], row[column]) for row in table["rows"] if isinstance(row[column], dict)])
    top.set(title=table["title"], xlabel="CRMSE, ratio to model-based, 95 % interval", xscale="log")
    _plain_ticks(top.xaxis, (0.5, 0.7, 1, 2, 5, 10))
    bottom, circle = parts[1].subplots(), dict(study["curves"]["circle"])
    heading = circle.pop("heading_deg")
    for (label, values), colour, style in zip(circle.items(), (RED, BLUE), _STYLES, strict=False):
        bottom.plot(heading, np.array(values, float), color=colour, linestyle=style, label=label)
    bottom.set(
        title="One trained network asked for the heading of a clean Earth rate",
        xlabel="heading (deg)",
        ylabel="error (deg)",
        xlim=(0, 360),
        xticks=range(0, 361, 45),
    )
    bottom.legend()


def _intervals(axes: Axes, rows: Sequence[tuple[str, dict]]) -> None:
    for place, (_, cell) in enumerate(rows):
        axes.plot([cell["low"], cell["high"]], [place, place], color=BLUE, linewidth=3, alpha=0.45)
        axes.plot(cell["value"], place, "o", color=BLUE)
    axes.axvline(1.0, color=RED, linestyle="--", linewidth=1.2)
    axes.set_yticks(range(len(rows)), [label for label, _ in rows])
    axes.set_ylim(len(rows) - 0.4, -0.6)


def _plain_ticks(axis: Axis, at: Sequence[float]) -> None:
    """Numbers as they are written, 20 and not 2 x 10^1, on an axis in logarithms."""
    axis.set_major_locator(FixedLocator(at))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())


def _scale(figure: Figure, study: Study) -> None:
    """Scale against the number of reverse steps; the first window before and after, with two normalisations."""
    by_steps = study["curves"].get("by_steps")
    parts: Any = [figure]
    if by_steps is not None:
        figure.set_size_inches(8.0, 7.5)
        parts = figure.subfigures(2, 1)
        axes = parts[0].subplots()
        for (kind, points), colour, marker in zip(by_steps.items(), _COLOURS, "osv^D", strict=False):
            steps, gain = [p["steps"] for p in points], [p["horizontal_gain"] for p in points]
            axes.plot(steps, gain, color=colour, marker=marker, markersize=4, linewidth=1.2, label=kind)
        axes.axhline(1.0, color=FAINT, linewidth=1.0)
        axes.set(title=study["title"], xlabel="reverse steps", ylabel="horizontal rate, after / before", xscale="log")
        _plain_ticks(axes.xaxis, (1, 10, 100, 1000))
        axes.legend(title="normalisation")
    curves = {kind: study["curves"][kind] for kind in ("sequence", "none") if kind in study["curves"]}
    panels = parts[-1].subplots(1, max(len(curves), 1), squeeze=False)[0]
    for axes, (kind, example) in zip(panels, curves.items(), strict=False):
        for (name, samples), colour, style in zip(example.items(), (FAINT, BLUE), ("-", "-"), strict=True):
            rate = np.array(samples)[:, 0]
            axes.plot(np.arange(len(rate)) / 3, rate, color=colour, linestyle=style, linewidth=0.9, label=name)
        axes.set(title=f"normalisation: {kind}", xlabel="time (s)", ylabel="rate about x (deg/h)")
        axes.legend()


def _t_back(figure: Figure, study: Study) -> None:
    figure.set_size_inches(8.0, 6.5)
    parts: Any = figure.subfigures(2, 1)
    top, bottom = parts
    axes = top.subplots()
    sweep = study["curves"]["sweep"]
    for part, colour, style in zip(("train", "validation", "test"), _COLOURS, _STYLES, strict=False):
        axes.plot([s["t_back"] for s in sweep], [s[part] for s in sweep], color=colour, linestyle=style, label=part)
    axes.set(title="Fig. 6: CRMSE against t_back", xlabel="t_back", ylabel="CRMSE (deg)")
    axes.legend()
    histories = study["curves"]["training"]
    panels = bottom.subplots(1, len(histories), sharey=True, squeeze=False)[0]
    for panel, (t_back, history) in zip(panels, histories.items(), strict=True):
        splits = history if isinstance(history[0], list) else [history]  # one line a split
        for key, colour, style in zip(("loss", "validation", "test"), _COLOURS, _STYLES, strict=False):
            for k, one in enumerate(split for split in splits if key in split[0]):
                values = [np.nan if entry[key] is None else entry[key] for entry in one]
                label = None if k else {"loss": "train"}.get(key, key)
                width, epochs = 1.5 / np.sqrt(len(splits)), np.arange(1, len(values) + 1)
                panel.plot(epochs, values, color=colour, linestyle=style, linewidth=width, label=label)
        panel.set(title=f"Fig. 7: t_back {t_back}", xlabel="epoch", yscale="log")
    _plain_ticks(panels[0].yaxis, (1, 10, 100))  # shared
    panels[0].set_ylabel("CRMSE (deg)")
    panels[0].legend()


def _duration(figure: Figure, study: Study) -> None:
    axes = figure.subplots()
    curves = dict(study["curves"])
    duration = curves.pop("duration")
    for (label, values), colour, style in zip(curves.items(), (INK, *_COLOURS), ("-", *_STYLES), strict=False):
        heights = [np.nan if value is None else value for value in values]
        axes.plot(duration, heights, color=colour, linestyle=style, marker=".", label=label)
    axes.set(title=study["title"], xlabel="duration (s)", ylabel="CRMSE (deg)")
    axes.legend()


def _turned(figure: Figure, study: Study) -> None:
    """RMSE over its bound with the 95 % interval, one line a plan of turns."""
    figure.set_size_inches(8.0, 5.2)
    axes, table = figure.subplots(), study["tables"][0]
    column = table["columns"].index("ratio to the bound")
    _intervals(axes, [(row[0], row[column]) for row in table["rows"]])
    axes.set(title=study["title"], xlabel="RMSE, ratio to the Cramér-Rao bound, 95 % interval")


def _disturbed(figure: Figure, study: Study) -> None:
    """Ratio to the mean on the mix, and the CRMSE of some methods against the duration."""
    figure.set_size_inches(9.0, 9.5)
    parts: Any = figure.subfigures(2, 1, height_ratios=(3, 2))
    top, bottom = (part.subplots() for part in parts)
    table = study["tables"][0]
    column = table["columns"].index("ratio to the mean")
    _intervals(top, [(row[0], row[column]) for row in table["rows"]])
    top.set(title=table["title"], xlabel="CRMSE, ratio to the mean, 95 % interval", xlim=(0, None))
    seconds, found = study["curves"]["seconds"], study["curves"]["crmse_deg"]
    names = ("mean", "Huber", "inertial (with accelerometer)", "bayes", "learned")
    for name, colour, style in zip(names, (INK, *_COLOURS), _STYLES, strict=False):
        cells = [(second, one[name]) for second, one in zip(seconds, found, strict=True) if name in one]
        heights = np.array([(cell["value"], cell["low"], cell["high"]) for _, cell in cells]).T
        at = [second for second, _ in cells]
        bottom.plot(at, heights[0], color=colour, linestyle=style, marker=".", label=name)
        bottom.fill_between(at, heights[1], heights[2], color=colour, alpha=0.15, linewidth=0)
    bottom.set(title="The mix by duration", xlabel="duration (s)", ylabel="CRMSE (deg)", xscale="log", yscale="log")
    for axis in (bottom.xaxis, bottom.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    bottom.set_xticks(seconds)
    bottom.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    bottom.minorticks_off()
    bottom.legend()


#: Situations of `stress` in words; the amount stands in place of the braces.
_SITUATIONS = {
    "honest": "like its profile",
    "wind": "wind, {} deg rms",
    "lean": "slow tilt, {} deg in 100 s",
    "nudge": "nudge of {} deg",
    "tones": "two tones, {} deg/s",
    "bias": "turn-on bias × {}",
    "drift": "drift × {}",
    "white": "noise × {}",
    "settling": "settling bias × {}",
}
#: Share missed at which the colours end, and the colour of what was not run.
_DARKEST, _NOT_RUN = 0.3, "#dfe2e6"


def _stress(figure: Figure, study: Study) -> None:
    """Share of the intervals of `auto` that miss, by situation and sensor; framed where chance does not explain it."""
    table = study["tables"][0]
    missed, refused = (table["columns"].index(name) for name in ("missed of valid", "refused"))
    cells = {tuple(row[0].split(": ", 1)): (row[missed], row[refused]) for row in table["rows"] if row[1] == "auto"}
    sensors, situations = (list(dict.fromkeys(pair[k] for pair in cells)) for k in (0, 1))
    sensors.sort()
    situations.sort(key=lambda name: ("no " in name, list(_SITUATIONS).index(name.split(",")[0].split()[0])))
    figure.set_size_inches(9.0, 1.2 + 0.31 * len(situations))
    axes = figure.subplots()
    axes.set_facecolor(_NOT_RUN)
    shown = np.full((len(situations), len(sensors)), np.nan)
    for (sensor, situation), (share, refusals) in cells.items():
        column, line = sensors.index(sensor), situations.index(situation)
        shown[line, column] = share["value"]
        text = f"{100 * share['value']:.0f}" + (f"\n{100 * refusals:.0f} refused" if refusals >= 0.005 else "")
        colour, size = ("white" if share["value"] > 0.7 * _DARKEST else INK), (6.5 if "\n" in text else 8)
        axes.text(column, line, text, ha="center", va="center", fontsize=size, linespacing=1.0, color=colour)
        if share["low"] > 0.05:
            frame = Rectangle((column - 0.47, line - 0.45), 0.94, 0.9, fill=False, edgecolor=INK, linewidth=1.5)
            axes.add_patch(frame)
    colours = LinearSegmentedColormap.from_list("missed", ["white", RED])
    drawn = axes.imshow(100 * shown, cmap=colours, vmin=0, vmax=100 * _DARKEST, aspect="auto")
    bar = figure.colorbar(drawn, ax=axes, extend="max", fraction=0.03, shrink=0.5)
    bar.ax.axhline(5, color=INK, linewidth=1.6)
    bar.set_ticks([0, 5, 10, 20, 30], labels=["0 %", "5 % claimed", "10 %", "20 %", "30 %"])
    axes.set_xticks(range(len(sensors)), [name.replace(" ", "\n", 1) for name in sensors])
    axes.set_yticks(range(len(situations)), [_situation(name) for name in situations])
    axes.tick_params(length=0, labelsize=8, labeltop=True)
    axes.grid(False)
    figure.suptitle(
        "Share of 95 % intervals that miss, % of valid headings, method auto\n"
        "framed: more than the claimed 5 %, beyond chance; grey: not run",
        x=0.02, ha="left", fontsize=10, color=INK,
    )  # fmt: skip


def _situation(name: str) -> str:
    """A situation of `stress` in words."""
    what, *lacks = name.split(", ")
    kind, _, amount = what.partition(" ")
    amount, _, time = amount.partition(" in ")
    told = [text.replace("no profile", "no profile given") for text in lacks]
    return ", ".join([_SITUATIONS[kind].format(amount) + (f" in {time}" if time else ""), *told])


def _real(figure: Figure, study: Study) -> None:
    """Largest error of `auto` on each recording beside the half-width of its interval; in red where one is outside."""
    table = study["tables"][0]
    at = {name: number for number, name in enumerate(table["columns"])}
    rows = [row for row in table["rows"] if row[at["method and profile"]].startswith("auto, ")]
    figure.set_size_inches(9.0, 1.2 + 0.21 * len(rows))
    axes = figure.subplots()
    judged = [row for row in rows if row[at["largest error, deg"]] is not None]
    lowest = min(row[at["largest error, deg"]] for row in judged)
    axes.set(xscale="log", xlabel="deg", xlim=(0.5 * lowest, 180))
    for place, row in enumerate(rows):
        error, width = row[at["largest error, deg"]], row[at["half-width, deg"]]
        if error is None:
            text = f"refused: {row[at['reasons']]}"
            axes.text(0.02, place, text, transform=axes.get_yaxis_transform(), va="center", fontsize=8, color=FAINT)
            continue
        colour = BLUE if row[at["of these covered"]] == row[at["valid"]] else RED
        axes.plot([0.5 * lowest, width], [place, place], color=colour, linewidth=6, alpha=0.25, solid_capstyle="butt")
        axes.plot(error, place, "o", color=colour, markersize=5)
    labels = [f"{row[0]}; {row[1].removeprefix('auto, ')}" for row in rows]
    axes.set_yticks(range(len(rows)), labels, fontsize=8)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.xaxis.set_major_formatter("{x:g}")
    outside = sum(row[at["valid"]] - row[at["of these covered"]] for row in judged)
    figure.suptitle(
        "Largest error (dot) and half-width of the 95 % interval (bar), method auto\n"
        f"{outside} of {sum(row[at['valid']] for row in judged)} valid headings outside (red)",
        x=0.02, ha="left", fontsize=10, color=INK,
    )  # fmt: skip


FIGURES: dict[str, Callable[[Figure, Study], None]] = {
    "noise": _noise,
    "leave_one_out": _ratios,
    "arcs": _ratios,
    "splits": _ratios,
    "table_2": _table_2,
    "scale": _scale,
    "t_back": _t_back,
    "duration": _duration,
    "turned": _turned,
    "disturbed": _disturbed,
    "real": _real,
    "stress": _stress,
}
