"""The pictures of the page as SVG text: compass rose, heading and rate against time, quadrants.

Colours are variables of the page's style sheet, so that light and dark follow it; what is not valid
differs in line and fill, not in colour alone.
"""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from itertools import pairwise
from math import ceil, degrees, floor, log10

import numpy as np
from numpy.typing import NDArray

from gyronorth.angles import DEG_PER_HOUR
from gyronorth.arrays import Array
from gyronorth.earth import EARTH_RATE
from gyronorth.live.estimation import LiveEstimate
from gyronorth.live.status import Status
from gyronorth.report.dial import on_circle, sector_path
from gyronorth.report.wording import heading_text, interval_text

#: Size of a chart in its own units, and the place of its axes.
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 480.0, 220.0, 62.0, 8.0, 12.0, 30.0
#: Of a heading trace, what lies within so many degrees of the present heading is drawn.
FACING = 45.0
#: Room that the text of a mark needs, in the chart's units.
LINE = 18.0
#: Points that are drawn of a trace.
DRAWN = 240


def compass(status: Status) -> str:
    """The rose, north up, with the 95 % sector and the heading."""
    estimate = status.estimate
    parts = ['<circle r="92" class="card"/>']
    for angle in range(0, 360, 10):
        inner = 82 if angle % 30 == 0 else 87
        parts.append(f'<path d="M{on_circle(angle, 92)} L{on_circle(angle, inner)}" class="tick"/>')
    for angle in range(0, 360, 30):
        name = {0: "N", 90: "E", 180: "S", 270: "W"}.get(angle, str(angle))
        x, y = on_circle(angle, 104).split()
        cardinal = "cardinal" if angle % 90 == 0 else "degree"
        parts.append(f'<text x="{x}" y="{y}" class="{cardinal}">{name}</text>')
    label = "Compass rose: no heading yet"
    if estimate is not None and estimate.heading is not None:
        doc = estimate.to_json()
        low, high = doc["interval95_deg"]
        state = "valid" if estimate.valid else "invalid"
        sector = sector_path(low, high, 80)
        parts.append(f'<circle r="80" class="sector {state}"/>' if sector is None else "")
        parts.append("" if sector is None else f'<path d="{sector}" class="sector {state}"/>')
        if status.heading_true is not None:
            tip = degrees(status.heading_true)
            corners = " ".join(on_circle(tip + turn, 92 - depth).replace(" ", ",") for turn, depth in _TRUTH)
            parts.append(f'<polygon points="{corners}" class="truth"><title>reference heading</title></polygon>')
        parts.append(f'<g transform="rotate({doc["heading_deg"]:.3f})" class="needle {state}">{_NEEDLE}</g>')
        interval = interval_text(doc["interval95_deg"])
        label = f"Compass rose: heading {heading_text(doc['heading_deg'])} degrees, {state}, 95 % interval {interval}"
    parts.append('<circle r="4" class="hub"/>')
    return f'<svg viewBox="-116 -116 232 232" role="img" aria-label="{label}">{"".join(parts)}</svg>'


_NEEDLE = '<path d="M0 -80 L7 -60 L2 -62 L2 30 L-2 30 L-2 -62 L-7 -60 Z"/>'
_TRUTH = ((0, 0), (-3.5, 10), (3.5, 10))


def heading_chart(status: Status) -> str:
    """Heading against time with its 95 % band."""
    found = status.found
    if found is None or not np.isfinite(found.trace[:, 1]).any():
        return _empty("Heading against time: no heading yet")
    trace = _thinned(found.trace[np.isfinite(found.trace[:, 1])])
    time, heading, half, valid = trace.T
    heading = (heading + status.alignment) % (2 * np.pi)
    last = degrees(heading[-1])
    off = (np.degrees(heading) - last + 180) % 360 - 180
    half = np.degrees(half)
    recent = time >= 0.2 * time[-1]
    near = np.abs(off) <= (FACING if half[-1] < FACING else 180.0)  # else the unit faced another way
    recent &= near
    reach = float(np.max(np.abs(off[recent]) + np.minimum(half[recent], 3 * half[-1]), initial=0.05))
    reach = min(1.1 * reach, 180.0)
    x, y = _axis_x(time[-1]), _axis_y(-reach, reach)
    parts = []
    for a, b in _runs(near):
        upper, lower = (y(np.clip(off[a:b] + sign * half[a:b], -reach, reach)) for sign in (1, -1))
        band = _points(np.concatenate([x(time[a:b]), x(time[a:b])[::-1]]), np.concatenate([upper, lower[::-1]]))
        parts.append(f'<polygon points="{band}" class="band"/>')
    inside = near & (np.abs(off) <= reach)
    for a, b in _runs(inside):
        if b - a == 1:  # a line of one point is not seen
            parts.append(_one_estimate(float(x(time[a])), y(off[a] + np.array([-1, 0, 1]) * half[a]), bool(valid[a])))
            continue
        for c, d in pairwise([a, *(a + 1 + np.flatnonzero(np.diff(valid[a:b]))).tolist(), b]):
            style = "line valid" if valid[c] else "line invalid"
            end = min(d + 1, b)  # joined to the next verdict
            parts.append(f'<polyline points="{_points(x(time[c:end]), y(off[c:end]))}" class="{style}"/>')
    marks = [(value, heading_text(last + value, decimals=_decimals(reach)) + "°") for value in _round_steps(reach)]
    low = interval_text([(last - half[-1]) % 360, (last + half[-1]) % 360] if half[-1] < 180 else [0, 360])
    label = f"Heading against time: now {heading_text(last)} degrees, 95 % interval {low}"
    return _chart(label, time[-1], [(float(y(np.array(value))), text) for value, text in marks], parts)


def rate_chart(found: LiveEstimate | None) -> str:
    """Norm of the mean rate against time, beside Earth rate."""
    if found is None or len(found.rate_norm[0]) == 0:
        return _empty("Rate against time: no samples yet")
    time, norm = (np.asarray(column, dtype=float) for column in found.rate_norm)
    step = max(1, ceil(len(time) / DRAWN))
    whole = max(step * (len(time) // step), 0)
    if whole:
        time, norm = time[:whole].reshape(-1, step).mean(axis=1), norm[:whole].reshape(-1, step).mean(axis=1)
    norm, earth = norm / DEG_PER_HOUR, EARTH_RATE / DEG_PER_HOUR
    top = float(max(2 * earth, 1.3 * np.quantile(norm, 0.8)))
    end = float(max(time[-1], 1e-9))
    x, y = _axis_x(end), _axis_y(0.0, top)
    parts = [
        f'<polyline points="{_points(x(time), y(np.minimum(norm, top)))}" class="line rate"/>',
        f'<path d="M{LEFT} {y(np.array(earth)):.1f} H{WIDTH - RIGHT}" class="earth"/>',
        f'<text x="{LEFT - 5}" y="{y(np.array(earth)):.1f}" class="axis end">{earth:.2f}</text>',
    ]
    marks = [(float(y(np.array(value))), f"{value:g}") for value in _round_steps(top) if value >= 0]
    marks = [mark for mark in marks if abs(mark[0] - float(y(np.array(earth)))) > LINE]
    mean = found.estimate.rate_norm / DEG_PER_HOUR
    return _chart(
        f"Rate norm against time, degrees per hour: the mean is {mean:.2f}, Earth rate {earth:.2f}", end, marks, parts
    )


def quadrants(seconds: list[float]) -> str:
    """Time of standing still in each quadrant, from the first pose on."""
    longest = max(max(seconds), 1e-9)
    parts = []
    for number, value in enumerate(seconds):
        low, high = 90 * number - 43, 90 * number + 43
        parts.append(f'<path d="{sector_path(low, high, 46)}" class="quadrant"/>')
        if value > 0:
            radius = 46 * max(0.25, (value / longest) ** 0.5)
            parts.append(f'<path d="{sector_path(low, high, radius)}" class="quadrant done"/>')
        x, y = on_circle(90 * number, 30).split()
        parts.append(f'<text x="{x}" y="{y}" class="degree">{value:.0f} s</text>')
    described = ", ".join(f"{90 * number} degrees {value:.0f} s" for number, value in enumerate(seconds))
    label = f"Time in each quadrant: {described}"
    return f'<svg viewBox="-50 -50 100 100" role="img" aria-label="{label}">{"".join(parts)}</svg>'


def _empty(label: str) -> str:
    text = f'<text x="{WIDTH / 2}" y="{HEIGHT / 2}" class="note middle">{escape(label.partition(": ")[2])}</text>'
    return _frame(label, text)


def _chart(label: str, end: float, marks: list[tuple[float, str]], parts: list[str]) -> str:
    grid = [
        f'<path d="M{LEFT} {place:.1f} H{WIDTH - RIGHT}" class="grid"/>'
        f'<text x="{LEFT - 5}" y="{place:.1f}" class="axis end">{escape(text)}</text>'
        for place, text in marks
    ]
    unit, name = (1.0, "s") if end < 180 else (60.0, "min") if end < 7200 else (3600.0, "h")
    x = _axis_x(end)
    for value in _round_steps(end / unit):
        if value >= 0:
            place = float(x(np.array(value * unit)))
            style = "middle" if place < WIDTH - 2 * LINE else "end"
            text = f"{value:g} {name}" if value else "0"
            grid.append(f'<text x="{place:.1f}" y="{HEIGHT - 11}" class="axis {style}">{text}</text>')
    return _frame(label, "".join(grid + parts))


def _frame(label: str, inside: str) -> str:
    return f'<svg viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" aria-label="{escape(label)}">{inside}</svg>'


def _axis_x(end: float) -> Callable[[Array], Array]:
    return lambda time: LEFT + (WIDTH - LEFT - RIGHT) * time / end


def _axis_y(low: float, high: float) -> Callable[[Array], Array]:
    return lambda value: TOP + (HEIGHT - TOP - BOTTOM) * (high - value) / (high - low)


def _points(x: Array, y: Array) -> str:
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x.tolist(), y.tolist(), strict=True))


def _one_estimate(x: float, y: Array, valid: bool) -> str:
    """An estimate that stands alone: a dot, and its interval as a bar with ends."""
    low, middle, high = np.clip(y, TOP, HEIGHT - BOTTOM).tolist()
    style = "valid" if valid else "invalid"
    bar = f"M{x:.1f} {low:.1f} V{high:.1f} M{x - 4:.1f} {low:.1f} h8 M{x - 4:.1f} {high:.1f} h8"
    return f'<path d="{bar}" class="line {style}"/><circle cx="{x:.1f}" cy="{middle:.1f}" r="3" class="dot {style}"/>'


def _thinned(trace: Array) -> Array:
    """At most about `DRAWN` rows, always with the last."""
    step = max(1, ceil(len(trace) / DRAWN))
    return trace[::-1][::step][::-1]


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Start and end of each run of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _round_steps(reach: float) -> list[float]:
    """Round values from -reach to reach, about three on either side of zero."""
    raw = reach / 3
    power = 10.0 ** floor(log10(raw))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= raw)
    most = floor(reach / step)
    return [round(number * step, 10) for number in range(-most, most + 1)]


def _decimals(reach: float) -> int:
    return 0 if reach >= 5 else 1 if reach >= 0.5 else 2
