"""Draw the pictures of the pages: python docs/make_pictures.py [NAME ...]

Each is an SVG in `docs/images/` whose colours are CSS variables, so that `docs/pictures.py` can set it
into a light or a dark page, and a second one, `NAME_narrow.svg`, with its panels below each other for a phone.
Schematics and curves alike come from the package's own functions.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from math import cos, degrees, radians, sin
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, Polygon, Wedge

import gyronorth as gn
from gyronorth.alignment.judging import judge
from gyronorth.alignment.problem import Problem
from gyronorth.alignment.registry import METHODS, Options
from gyronorth.allan import identify
from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR, angle_error, wrap
from gyronorth.calibration import calibrate
from gyronorth.catalogue import KINDS
from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY
from gyronorth.planning import plan
from gyronorth.readers.axes import mat_bf
from gyronorth.report.figures import BLUE, COLOURS, FAINT, GREEN, GRID, INK, PINK, RED, SETTINGS, svg_text
from gyronorth.sensor import Sensor, TriadErrors
from gyronorth.simulation import Motion

ROOT = Path(__file__).parents[1]
IMAGES = ROOT / "docs/images"
LATITUDE = radians(32.11)
#: Width of a picture on a page and on a phone, in.
PAGE, PHONE = 7.2, 4.2
#: A vehicle seen from above, nose up, within (-1, 1).
VEHICLE = np.array([[-0.5, -0.8], [0.5, -0.8], [0.5, 0.4], [0.0, 0.9], [-0.5, 0.4]])


def axes_of_a_file(narrow: bool) -> Figure:
    """Three conventions, each as `mat_bf` has it."""
    figure, panels = schematic(3, (PHONE, 7.4) if narrow else (PAGE, 3.0))
    for panel, name in zip(panels, ("frd", "flu", "rfu"), strict=True):
        mat = mat_bf(name)
        vehicle(panel, 0.0)
        for axis, colour in enumerate((BLUE, RED, GREEN)):
            forward, right, down = mat[:, axis]
            if down:
                point(panel, (0, 0), into=down > 0, colour=colour)
                panel.text(0.17, -0.25, "xyz"[axis], color=colour, fontsize=12, weight="bold")
            else:
                arrow(panel, (0, 0), (1.15 * right, 1.15 * forward), colour)
                panel.text(
                    1.32 * right, 1.32 * forward, "xyz"[axis], color=colour, fontsize=12, weight="bold", **CENTRE
                )
        rows = ["".join(f"{'-' if row.min() < 0 else '+'}{'xyz'[int(np.abs(row).argmax())]}") for row in mat]
        force = (mat.T @ [0, 0, -STANDARD_GRAVITY])[2]
        panel.set_title(f"--axes {name}", loc="center", family="monospace")
        panel.text(0, -1.35, f"the same as {''.join(rows)}", **CENTRE, fontsize=8.5)
        panel.text(0, -1.68, f"at rest f_z is about {force:+.1f} m/s²", **CENTRE, fontsize=8.5)
        panel.set(xlim=(-1.6, 1.6), ylim=(-1.85, 1.5))
    return figure


def mounting(narrow: bool) -> Figure:
    """A sensor turned by a yaw in a vehicle."""
    figure, panels = schematic(2, (PHONE, 5.2) if narrow else (PAGE, 3.4))
    heading, yaw = radians(30), radians(90)
    panel = panels[0]
    vehicle(panel, heading)
    panel.add_patch(
        Polygon(turned(0.28 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]), heading + yaw), fc=GRID, ec=INK)
    )
    north_arrow(panel)
    arrow(panel, (0, 0), on_circle(heading, 1.25), BLUE)
    arrow(panel, (0, 0), on_circle(heading + yaw, 0.95), RED)
    panel.text(*on_circle(heading, 1.42), "vehicle", color=BLUE, **CENTRE)
    panel.text(*on_circle(heading + yaw, 1.3), "x of the\nsensor", color=RED, **CENTRE)
    clockwise(panel, heading, heading + yaw, 0.62, "yaw", RED)
    panel.set(xlim=(-1.7, 1.8), ylim=(-1.2, 1.6))
    panel.set_title("--boresight 0,0,90", loc="center", family="monospace")
    lines = (
        ("heading of the sensor's x axis", f"{degrees(heading + yaw):.0f}°", RED),
        ("yaw of the sensor in the vehicle", f"{degrees(yaw):.0f}°", RED),
        ("heading of the vehicle", f"{degrees(heading):.0f}°", BLUE),
    )
    for row, (text, value, colour) in enumerate(lines):
        panels[1].text(-1.5, 0.6 - 0.5 * row, text, color=colour, va="center")
        panels[1].text(1.6, 0.6 - 0.5 * row, value, color=colour, va="center", ha="right")
    panels[1].plot([-1.5, 1.6], [-0.15, -0.15], color=FAINT, linewidth=0.8)
    panels[1].text(
        -1.5, -0.95, "gyronorth takes the yaw off\nand prints the vehicle's heading.", va="center", fontsize=8.5
    )
    panels[1].set(xlim=(-1.6, 1.7), ylim=(-1.4, 1.4))
    return figure


def attitude(narrow: bool) -> Figure:
    """What heading, roll and pitch mean, each positive."""
    figure, (top, behind, side) = schematic(3, (PHONE, 6.6) if narrow else (PAGE, 2.6))
    heading, tilt = radians(50), radians(14)
    vehicle(top, heading)
    north_arrow(top)
    arrow(top, (0, 0), on_circle(heading, 1.3), BLUE)
    clockwise(top, 0, heading, 0.95, "heading", BLUE)
    top.set_title("Heading: from above,\nclockwise from true north", loc="center")
    box = np.array([[-0.9, -0.3], [0.9, -0.3], [0.9, 0.3], [-0.9, 0.3]])
    behind.add_patch(Polygon(turned(box, tilt), fc=GRID, ec=FAINT))
    behind.plot([-1.4, 1.4], [0, 0], color=FAINT, linewidth=0.8, linestyle=":")
    arrow(behind, (0, 0), on_circle(radians(90) + tilt, 1.25), RED)
    behind.text(*on_circle(radians(90) + tilt, 1.45), "y", color=RED, weight="bold", **CENTRE)
    clockwise(behind, radians(90), radians(90) + tilt, 1.0, "", RED)
    behind.set_title("Roll: from behind,\nright side down is positive", loc="center")
    nose = np.array([[-0.9, -0.3], [0.5, -0.3], [1.0, 0.0], [0.5, 0.3], [-0.9, 0.3]])
    side.add_patch(Polygon(turned(nose, -tilt), fc=GRID, ec=FAINT))
    side.plot([-1.4, 1.4], [0, 0], color=FAINT, linewidth=0.8, linestyle=":")
    arrow(side, (0, 0), on_circle(radians(90) - tilt, 1.35), BLUE)
    side.text(*on_circle(radians(90) - tilt, 1.53), "x", color=BLUE, weight="bold", **CENTRE)
    side.add_patch(Arc((0, 0), 2.2, 2.2, theta1=0, theta2=degrees(tilt), color=BLUE, linewidth=1.2))
    side.set_title("Pitch: from the right side,\nnose up is positive", loc="center")
    for panel in (top, behind, side):
        panel.set(xlim=(-1.6, 1.6), ylim=(-1.2, 1.6))
    return figure


def sigma_against_time(narrow: bool) -> Figure:
    """The error budget of three grades of sensor, by `plan`."""
    figure = Figure(figsize=(PHONE, 6.8) if narrow else (PAGE, 3.5), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True) if narrow else figure.subplots(1, 3, sharey=True)
    for panel, name in zip(panels, ("sdc500", "isa100c", "hg9900"), strict=True):
        planned = plan(name, latitude=LATITUDE)
        time = planned.duration
        panel.plot(time, np.degrees(planned.sigma), color=INK, linewidth=2.4, label="sigma")
        styles = zip(
            ("noise", "drift", "turn_on_bias", "levelling"),
            (BLUE, RED, GREEN, PINK),
            ("-", "--", "-.", ":"),
            strict=True,
        )
        for part, colour, line in styles:
            if planned.parts[part].any():
                label = {"turn_on_bias": "turn-on bias"}.get(part, part)
                panel.plot(time, np.degrees(planned.parts[part]), color=colour, linestyle=line, label=label)
        panel.set(xscale="log", yscale="log", xlim=(10, 86400), ylim=(1e-3, 20), title=name)
        panel.set_xticks([60, 600, 3600, 36000], ["1 min", "10 min", "1 h", "10 h"])
        panel.minorticks_off()
        panel.set_yticks([0.001, 0.01, 0.1, 1, 10], ["0.001", "0.01", "0.1", "1", "10"])
    panels[1 if narrow else 0].set_ylabel("heading sigma (deg)")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3 if narrow else 5)
    return figure


def error_against_latitude(narrow: bool) -> Figure:
    """What 1 deg/h of bias towards east costs, b / (Omega cos lat)."""
    figure = Figure(figsize=(PHONE if narrow else 6.4, 3.0), layout="constrained")
    panel = figure.subplots()
    latitude = np.linspace(0, 84, 300)
    panel.plot(latitude, cost(latitude), color=RED, linewidth=2)
    for at in (0, 32.11, 50, 60, 70, 80):
        panel.plot(at, cost(at), "o", color=RED, markersize=4)
        label = f"{cost(at):.1f}°"
        panel.annotate(label, (at, cost(at)), (-2, 7), textcoords="offset points", ha="right" if at > 40 else "left")
    panel.set(xlim=(-2, 86), ylim=(0, 32), xlabel="latitude, north or south (deg)")
    panel.set_ylabel("heading error (deg) per deg/h")
    return figure


def two_poses(narrow: bool) -> Figure:
    """Earth rate and bias in the body's horizontal axes, before and after half a turn."""
    figure = Figure(figsize=(PHONE, 8.6) if narrow else (PAGE, 3.3), layout="constrained")
    panels = figure.subplots(*((3, 1) if narrow else (1, 3)), sharex=True, sharey=True)
    signal, heading = EARTH_RATE * cos(LATITUDE) / DEG_PER_HOUR, radians(40)
    earth, bias = signal * np.array([-sin(heading), cos(heading)]), np.array([5.0, 2.0])  # right, forward
    rates = (earth + bias, -earth + bias)
    for panel, true, rate, title in zip(panels, (earth, -earth), rates, ("First pose", "Turned by 180°"), strict=False):
        for start, end, colour in (((0, 0), true, BLUE), (true, rate, RED), ((0, 0), rate, INK)):
            arrow(panel, tuple(start), tuple(end), colour)
        panel.set_title(title, loc="center")
    half_difference, half_sum = (rates[0] - rates[1]) / 2, (rates[0] + rates[1]) / 2
    arrow(panels[2], (0, 0), tuple(half_difference), BLUE)
    arrow(panels[2], (0, 0), tuple(half_sum), RED)
    panels[2].set_title("Both together", loc="center")
    for panel, x, y, text, colour in (
        (panels[0], -8.2, 3.5, "Earth", BLUE),
        (panels[0], -6.5, 13.4, "bias", RED),
        (panels[0], 4.5, 6.5, "measured", INK),
        (panels[1], 0.2, -6.5, "Earth", BLUE),
        (panels[1], 12.3, -11.2, "bias", RED),
        (panels[1], 9.5, -2.0, "measured", INK),
        (panels[2], -10.0, 3.0, "half the\ndifference", BLUE),
        (panels[2], 9.5, 4.0, "half the\nsum", RED),
        (panels[0], 0, -13.3, f"heading {direction(rates[0]):.0f}°, truth {degrees(heading):.0f}°", INK),
        (panels[1], 0, 13.3, "Earth's rate has turned round,\nthe bias has not", INK),
        (panels[2], 0, -13.3, f"heading {direction(half_difference):.0f}°", INK),
    ):
        panel.text(x, y, text, color=colour, fontsize=8.5, **CENTRE)
    for panel in panels:
        panel.set(
            xlim=(-16, 16),
            ylim=(-16, 16),
            aspect="equal",
            xlabel="right (deg/h)",
            ylabel="forward (deg/h)",
            xticks=(-10, 0, 10),
            yticks=(-10, 0, 10),
        )
        panel.label_outer()
    return figure


def interval_and_limits(narrow: bool) -> Figure:
    """A valid heading, a refused one, and the gates of the first beside their limits."""
    figure = Figure(figsize=(PHONE, 4.9) if narrow else (PAGE, 3.3), layout="constrained")
    if narrow:
        panels = figure.subplot_mosaic([["valid", "refused"], ["checks", "checks"]])
    else:
        panels = figure.subplot_mosaic([["valid", "refused", "checks"]], width_ratios=(1, 1, 1.35))
    left, middle, right = panels.values()
    recording = gn.read(ROOT / "examples/data/demo.npz")
    estimate = gn.heading(recording, sensor="sdc500")
    dial(left, estimate, truth=recording.heading_true)
    left.set_title("valid", loc="center", color=GREEN)
    poor = gn.simulate(
        "bmi088", latitude=LATITUDE, heading=radians(40), duration=100, rate_hz=10, rng=np.random.default_rng(3)
    )
    refused = gn.heading(poor, sensor="bmi088")
    dial(middle, refused, truth=poor.heading_true)
    middle.set_title(f"refused: {refused.reasons[0].code}", loc="center", color=RED)
    problem = Problem(recording.gyro_b, recording.accel_b, recording.rate_hz, LATITUDE, gn.read_sensor("sdc500"))
    mean = METHODS["mean"]
    gates = {gate.code: gate for gate in judge(problem, mean.solve(problem, Options()))}
    gates = [gates[code] for code in ("motion", "too_noisy", "implied_latitude", "rate_norm")]
    for row, gate in enumerate(gates):
        right.barh(row, float(gate.value / gate.limit), height=0.45, color=BLUE)
        right.text(
            0.02,
            row + 0.3,
            f"{gate.code}: {float(gate.value):.2g} of {float(gate.limit):.2g}",
            va="bottom",
            fontsize=8.5,
        )
    right.axvline(1, color=RED, linewidth=1.6)
    right.text(1.0, len(gates) - 0.2, "limit", color=RED, ha="center", va="bottom")
    right.set(xlim=(0, 1.15), ylim=(-0.5, len(gates) - 0.2), xlabel="value / limit", yticks=())
    right.grid(visible=False)
    return figure


def allan_deviation_read(narrow: bool) -> Figure:
    """An Allan deviation with the three lines that are read from it."""
    figure = Figure(figsize=(PHONE, 4.6) if narrow else (6.8, 4.0), layout="constrained")
    panel = figure.subplots()
    errors = TriadErrors(
        white=0.03 * DEG_PER_SQRT_HOUR, flicker=0.6 * DEG_PER_HOUR, random_walk=3.0 * DEG_PER_HOUR / 60
    )
    scene: Any = {"latitude": LATITUDE, "heading": 0.0, "duration": 6 * 3600, "rate_hz": 5}
    recording = gn.simulate(Sensor("demonstration", errors), **scene, rng=np.random.default_rng(8))
    taus = np.geomspace(0.2, 4000, 60)
    shown = gn.allan_deviation(recording.gyro_b[:, 0], rate_hz=5, taus=taus)
    unit = DEG_PER_HOUR
    panel.fill_between(
        shown.tau, shown.low / unit, shown.high / unit, color=FAINT, alpha=0.3, linewidth=0, label="95 % interval"
    )
    panel.plot(shown.tau, shown.deviation / unit, color=INK, linewidth=2, label="Allan deviation")
    found = identify(recording.gyro_b, rate_hz=5)
    tau = np.geomspace(0.1, 8000, 100)
    white, flicker, walk = (
        term.value for term in (found.angle_random_walk, found.bias_instability, found.rate_random_walk)
    )
    panel.plot(tau, white / np.sqrt(tau) / unit, color=BLUE, linestyle="--", label="noise, slope -1/2")
    panel.plot(
        tau, np.full_like(tau, 0.664 * flicker / unit), color=RED, linestyle="-.", label="bias instability, flat"
    )
    panel.plot(
        tau,
        walk * np.sqrt(tau / 3) / unit,
        color=GREEN,
        linestyle=":",
        linewidth=2,
        label="rate random walk, slope +1/2",
    )
    arrows: Any = {"arrowstyle": "->", "color": INK}
    at = (1, white / unit)
    panel.plot(*at, "o", color=BLUE)
    panel.annotate(f"at 1 s: N = {white / DEG_PER_SQRT_HOUR:.3f} deg/√h", at, (1.6, 7), arrowprops=arrows)
    at = (60, 0.664 * flicker / unit)
    panel.plot(*at, "o", color=RED)
    panel.annotate(f"level / 0.664: B = {flicker / unit:.2f} deg/h", at, (0.25, 0.13), arrowprops=arrows)
    at = (3, walk / unit)
    panel.plot(*at, "o", color=GREEN)
    panel.annotate(f"at 3 s: K = {walk / unit * 60:.1f} deg/h/√h", at, (12, 0.042), arrowprops=arrows)
    panel.set(xscale="log", yscale="log", xlim=(0.2, 4000), ylim=(0.03, 12))
    panel.set(xlabel="averaging time (s)", ylabel="Allan deviation (deg/h)")
    panel.set_xticks([1, 10, 100, 1000], ["1", "10", "100", "1000"])
    panel.set_yticks([0.1, 1, 10], ["0.1", "1", "10"])
    figure.legend(loc="outside lower center", ncols=1 if narrow else 3)
    return figure


def kinds_of_disturbance(narrow: bool) -> Figure:
    """The rate about the x axis under each disturbance that `learned` was trained on."""
    figure = Figure(figsize=(PHONE, 5.4) if narrow else (PAGE, 3.9), layout="constrained")
    panels = figure.subplots(*((3, 2) if narrow else (2, 3)), sharex=True).ravel()
    for panel, kind in zip(panels, KINDS, strict=True):
        recording = gn.simulate(
            "sdc500", latitude=LATITUDE, heading=radians(40), duration=100, rate_hz=3, rng=np.random.default_rng(12),
            motion=Motion(disturbance=kind),
        )  # fmt: skip
        time = (np.arange(300) + 0.5) / 3
        panel.plot(time, recording.gyro_b[:, 0] / DEG_PER_HOUR, color=BLUE, linewidth=0.9)
        panel.axhline(
            EARTH_RATE * cos(LATITUDE) * cos(radians(40)) / DEG_PER_HOUR, color=RED, linestyle="--", linewidth=1.2
        )
        mean, error = gn.heading(recording, sensor="sdc500", method="mean"), 0.0
        error = degrees(abs(angle_error(mean.heading, recording.heading_true)))
        panel.set_title(f"{kind}: mean off by {error:.1f}°", fontsize=8 if narrow else 9)
    figure.supxlabel("time (s)", fontsize=9.5)
    figure.supylabel("rate about x (deg/h)", fontsize=9.5)
    return figure


def compass_swing(narrow: bool) -> Figure:
    """Errors at known headings, and what is left of each with the curve of the others."""
    figure = Figure(figsize=(PHONE, 3.4) if narrow else (6.8, 3.2), layout="constrained")
    panel = figure.subplots()
    found = calibrate(swing(np.random.default_rng(6)))
    order = np.argsort(found.heading_true)
    truth = np.degrees(found.heading_true[order])
    panel.axhline(0, color=FAINT, linewidth=0.8)
    panel.plot(truth, np.degrees(found.error[order]), "o-", color=RED, markersize=4, label="closed form")
    panel.errorbar(
        truth, np.degrees(found.left_out[order]), np.degrees(found.sigma[order]), fmt="s", color=BLUE, markersize=3.5,
        linewidth=1, label="corrected by a curve of the other recordings, with its sigma",
    )  # fmt: skip
    panel.set(xlim=(-5, 365), xlabel="true heading (deg)", ylabel="heading error (deg)", xticks=range(0, 361, 60))
    figure.legend(loc="outside lower center", ncols=1 if narrow else 2)
    return figure


def swing(rng: np.random.Generator) -> list[gn.Recording]:
    """24 recordings of one power-up: one turn-on bias, the drift of an sdc500 in each."""
    sensor = gn.read_sensor("sdc500")
    quiet = Sensor("sdc500", TriadErrors(white=sensor.gyro.white, flicker=0.3 * DEG_PER_HOUR), sensor.accel)
    bias = np.array([0.7, -0.9, 0.4]) * DEG_PER_HOUR
    recordings = []
    for heading, child in zip(np.radians(np.arange(0, 360, 15)), rng.spawn(24), strict=True):
        recording = gn.simulate(quiet, latitude=LATITUDE, heading=heading, duration=100, rate_hz=5, rng=child)
        fields = {"latitude": LATITUDE, "heading_true": recording.heading_true, "session": "swing"}
        recordings.append(gn.Recording(recording.gyro_b + bias, recording.accel_b, 5.0, **fields))
    return recordings


#: Each drawn for a page, or narrow for a phone.
PICTURES: dict[str, Callable[[bool], Figure]] = {
    "axes": axes_of_a_file,
    "mounting": mounting,
    "attitude": attitude,
    "sigma": sigma_against_time,
    "latitude": error_against_latitude,
    "two_poses": two_poses,
    "interval": interval_and_limits,
    "allan": allan_deviation_read,
    "disturbed": kinds_of_disturbance,
    "swing": compass_swing,
}
CENTRE: Any = {"ha": "center", "va": "center"}


def cost(latitude_deg: Any) -> Any:
    """Heading error in deg for 1 deg/h towards east."""
    return np.degrees(DEG_PER_HOUR / (EARTH_RATE * np.cos(np.radians(latitude_deg))))


def schematic(count: int, size: tuple[float, float]) -> tuple[Figure, list[Axes]]:
    """Panels without scales, below each other in a picture that is higher than wide."""
    figure = Figure(figsize=size, layout="constrained")
    panels = list(figure.subplots(*((count, 1) if size[1] > size[0] else (1, count))))
    for panel in panels:
        panel.set_aspect("equal")
        panel.set_axis_off()
    return figure, panels


def on_circle(heading: float, radius: float) -> tuple[float, float]:
    """Where a heading points on a map with north up."""
    return radius * sin(heading), radius * cos(heading)


def turned(outline: Any, heading: float) -> Any:
    """Points turned clockwise."""
    return outline @ np.array([[cos(heading), -sin(heading)], [sin(heading), cos(heading)]])


def vehicle(panel: Axes, heading: float) -> None:
    """The vehicle's outline."""
    panel.add_patch(Polygon(turned(VEHICLE, heading), fc=GRID, ec=FAINT))


def arrow(panel: Axes, start: tuple[float, float], end: tuple[float, float], colour: str) -> None:
    """An arrow in data coordinates."""
    shape: Any = {
        "arrowstyle": "-|>,head_width=0.25,head_length=0.5",
        "color": colour,
        "linewidth": 2,
        "shrinkA": 0,
        "shrinkB": 0,
    }
    panel.annotate("", end, start, arrowprops=shape)


def direction(rate: Any) -> float:
    """Heading in deg of a rate (right, forward)."""
    return degrees(np.arctan2(-rate[0], rate[1]))


def north_arrow(panel: Axes) -> None:
    """True north, up."""
    panel.plot([0, 0], [0, 1.3], color=FAINT, linewidth=1.2, linestyle="--")
    panel.text(0, 1.45, "N", color=INK, weight="bold", **CENTRE)


def clockwise(panel: Axes, start: float, end: float, radius: float, label: str, colour: str) -> None:
    """An arc between two headings with its name."""
    panel.add_patch(
        Arc(
            (0, 0),
            2 * radius,
            2 * radius,
            theta1=90 - degrees(end),
            theta2=90 - degrees(start),
            color=colour,
            linewidth=1.2,
        )
    )
    if label:
        panel.text(
            *on_circle((start + end) / 2, radius + 0.17), label, color=colour, fontsize=8.5, ha="left", va="bottom"
        )


def point(panel: Axes, at: tuple[float, float], *, into: bool, colour: str) -> None:
    """An axis out of the picture (a dot) or into it (a cross)."""
    panel.add_patch(Circle(at, 0.13, fc="none", ec=colour, linewidth=2, zorder=5))
    if into:
        arm = 0.13 / np.sqrt(2)
        for sign in (1, -1):
            panel.plot([-arm, arm], [-sign * arm, sign * arm], color=colour, linewidth=1.6, zorder=6)
    else:
        panel.add_patch(Circle(at, 0.045, fc=colour, ec=colour, zorder=6))


def dial(panel: Axes, estimate: Any, *, truth: float | None) -> None:
    """A compass card with heading, 95 % interval and truth."""
    panel.set_aspect("equal")
    panel.set_axis_off()
    panel.set(xlim=(-1.45, 1.45), ylim=(-1.75, 1.45))
    panel.add_patch(Circle((0, 0), 1, fc="none", ec=FAINT))
    for name, angle in (("N", 0), ("E", 90), ("S", 180), ("W", 270)):
        panel.text(*on_circle(radians(angle), 1.2), name, color=INK, **CENTRE)
    low, high = np.degrees(estimate.interval95)
    colour = GREEN if estimate.valid else RED
    panel.add_patch(Wedge((0, 0), 1, 90 - high, 90 - low, fc=colour, alpha=0.25, ec=colour))
    arrow(panel, (0, 0), on_circle(estimate.heading, 0.97), colour)
    panel.plot(*on_circle(truth, 1.0), marker="D", color=INK, markersize=6)
    half = degrees(abs(wrap(estimate.interval95[1] - estimate.heading)))
    panel.text(0, -1.52, f"{degrees(estimate.heading):.0f}° ± {half:.0f}°, diamond: truth", **CENTRE, fontsize=8.5)


def main() -> None:
    """Write the named pictures, or all."""
    for name in sys.argv[1:] or PICTURES:
        for file, narrow in ((name, False), (f"{name}_narrow", True)):
            path = IMAGES / f"{file}.svg"
            path.write_text(picture(name, narrow=narrow))
            print(f"{path.relative_to(ROOT)}: {path.stat().st_size / 1000:.0f} kB")


def picture(name: str, *, narrow: bool) -> str:
    """The SVG of one picture, each colour a CSS variable with its light value in reserve."""
    with mpl.rc_context(SETTINGS):
        svg = svg_text(PICTURES[name](narrow), salt=f"{name}_narrow" if narrow else name)
    for colour, variable in COLOURS.items():
        svg = svg.replace(f"var({variable})", f"var({variable}, {colour})")
    # Coordinates in hundredths of a point, those of lines in tenths and on one line: a third of the size.
    svg = re.sub(r"<[^>]*>", lambda tag: shorter(tag[0], 2), svg)
    svg = re.sub(r'(?<= d=")[^"]*', lambda path: " ".join(shorter(path[0], 1).split()), svg)
    return svg.rstrip() + "\n"


def shorter(text: str, decimals: int) -> str:
    """Every number with more decimals rounded."""
    return re.sub(rf"\d+\.\d{{{decimals + 1},}}", lambda found: f"{round(float(found[0]), decimals):g}", text)


if __name__ == "__main__":
    main()
