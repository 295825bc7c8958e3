"""`benchmark disturbed`: every method on disturbed, quiet and held-out recordings, by kind and by duration."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyronorth.angles import angle_error
from gyronorth.disturbance import HELD_OUT, KINDS, reference_set
from gyronorth.evaluation import Interval, bootstrap_crmse, bootstrap_ratio
from gyronorth.studies.disturbed_methods import METHODS, Part, part_of
from gyronorth.studies.methods import as_rad, rounded
from gyronorth.studies.study import Plan, Study
from gyronorth.studies.tables import Report, Table, degrees
from gyronorth.studies.work import Result, Unit

Array = NDArray[np.float64]

#: Seed of the test set: `reference_set()` itself, of which the hash is reported.
SEED = 20240611
#: Recordings of a unit.
ROWS = 100
#: (kind, duration, s, residual bias, deg/h, recordings).
CASES = (
    ("mixed", 100.0, 0.1, 2000),
    ("quiet", 100.0, 0.1, 1000),
    ("mixed", 100.0, 1.0, 500),
    *((kind, 100.0, 0.1, 300) for kind in (*(k for k in KINDS if k not in ("mixed", "quiet")), *HELD_OUT)),
    *(("mixed", duration, 0.1, 200) for duration in (10.0, 30.0, 60.0, 200.0, 300.0)),
)
#: Windows that the bundles take, s; `bayes` needs the time of hundreds of recordings beyond 100 s.
WINDOWS = {
    "learned": (30.0, 300.0),
    "learned, periodogram for network": (30.0, 300.0),
    "paper's pipeline, as shipped": (100.0, 100.0),
    "bayes": (30.0, 200.0),
}
#: Recordings by which the cost of a method is measured.
TIMED = 40


def judge(*, kind: str, duration: float, bias_deg_h: float, runs: int, rows: list[int], seed: int) -> Result:
    """Errors, deg, of every method on some recordings of a case, and whether their intervals hold."""
    part = part_of(kind=kind, duration=duration, bias_deg_h=bias_deg_h, runs=runs, rows=(rows[0], rows[1]), seed=seed)
    errors, inside = {}, {}
    for name, method in METHODS.items():
        shortest, longest = WINDOWS.get(name, (0.0, np.inf))
        if not shortest <= duration <= longest:
            continue
        found = method(part)
        off = angle_error(part.made.heading[part.rows], found.heading)
        errors[name] = rounded(off)
        if found.low is not None and found.high is not None:
            inside[name] = ((off >= found.low) & (off <= found.high)).tolist()
    return {"error_deg": errors, "inside": inside}


def cost(*, seed: int) -> Result:
    """CPU milliseconds a recording of 100 s of the mix, best of three rounds: of this machine, unlike all else here."""
    part = part_of(kind="mixed", duration=100.0, bias_deg_h=0.1, runs=2000, rows=(0, TIMED), seed=seed)
    return {"cpu_ms": {name: min(_timed(method, part) for _ in range(3)) for name, method in METHODS.items()}}


def _timed(method: Any, part: Part) -> float:
    start = time.process_time()
    method(part)
    return round((time.process_time() - start) / TIMED * 1e3, 3)


def _name(kind: str, duration: float, bias_deg_h: float) -> str:
    return f"{kind}-{duration:g}s-{bias_deg_h:g}"


def _units(plan: Plan) -> list[Unit]:
    seed = SEED + plan.seed
    units = [Unit("disturbed/cost", cost, {"seed": seed})]
    for kind, duration, bias_deg_h, runs in CASES:
        for first in range(0, runs, ROWS):
            arguments = {"kind": kind, "duration": duration, "bias_deg_h": bias_deg_h, "runs": runs, "seed": seed}
            name = f"disturbed/{_name(kind, duration, bias_deg_h)}-{first:04d}"
            units.append(Unit(name, judge, {**arguments, "rows": [first, min(first + ROWS, runs)]}))
    return units


def _gathered(results: Mapping[str, Result], kind: str, duration: float, bias_deg_h: float) -> dict[str, dict]:
    """Errors, rad, and hits of each method over all units of a case."""
    stem = f"disturbed/{_name(kind, duration, bias_deg_h)}-"
    parts = [results[name] for name in sorted(results) if name.startswith(stem)]
    gathered: dict[str, dict] = {"error_deg": {}, "inside": {}}
    for what, found in gathered.items():
        for part in parts:
            for method, values in part[what].items():
                found.setdefault(method, []).extend(values)
    return gathered


def _figures(gathered: dict[str, dict], rng: np.random.Generator) -> dict[str, tuple[Interval, Interval, float | None]]:
    """CRMSE, deg, its ratio to the mean's, and coverage, of each method."""
    mean, figures = as_rad(gathered["error_deg"]["mean"]), {}
    each = np.arange(len(mean))
    for name, values in gathered["error_deg"].items():
        error, inside = as_rad(values), gathered["inside"].get(name)
        coverage = None if inside is None else float(np.mean(inside))
        figures[name] = (
            degrees(bootstrap_crmse(error, each, rng=rng)),
            bootstrap_ratio(error, mean, each, rng=rng),
            coverage,
        )
    return figures


def _report(plan: Plan, results: Mapping[str, Result]) -> Report:
    rng = np.random.default_rng(plan.seed)
    tables, ratios, curve = [], [], {}
    milliseconds = results["disturbed/cost"]["cpu_ms"]
    for kind, duration, bias_deg_h, runs in CASES:
        figures = _figures(_gathered(results, kind, duration, bias_deg_h), rng)
        rows = tuple((name, crmse, ratio, coverage) for name, (crmse, ratio, coverage) in figures.items())
        held = ", held out of training and priors" if kind in HELD_OUT else ""
        title = f"{kind}{held}: {duration:g} s, residual bias {bias_deg_h:g} deg/h, {runs} recordings"
        columns = ("method", "CRMSE, deg", "ratio to the mean", "inside the 95 % interval")
        tables.append(Table(title, columns, rows))
        if kind == "mixed" and bias_deg_h == 0.1:
            curve[duration] = {name: vars(crmse) for name, (crmse, _, _) in figures.items()}
        if (kind, duration, bias_deg_h) == ("mixed", 100.0, 0.1):
            ratios = [(name, ratio.value, milliseconds[name]) for name, (_, ratio, _) in figures.items()]
    tables.insert(
        0, Table("Cost, 100 s", ("method", "CRMSE over the mean's", "CPU ms a recording"), tuple(ratios), COST)
    )
    digest = reference_set(seed=SEED + plan.seed).sha256
    curves = {"seconds": sorted(curve), "crmse_deg": [curve[d] for d in sorted(curve)]}
    return Report(TEXT.format(digest=digest), tuple(tables), curves)


COST = "Measured in one process on the machine that ran this; compare within the column only."
TEXT = (
    "Simulated recordings at 3 Hz and 32.11 N, angle random walk 0.02 deg/sqrt(h), a level unit, gyro alone but for "
    "inertial-frame alignment, which has an SDC500's accelerometer too. The set `mixed` of 100 s has the SHA-256 "
    "{digest}. Intervals are bootstraps over recordings. `bayes` and `learned` know the sensor's noise and residual "
    "bias, and the distributions of the mix. `learned, periodogram for network` is `learned` with a classical short "
    "list of frequencies: it shows how much of the gain is the closed-form evidence and how much the network. "
    "`learned` also allows for a bias that walks from switch-on, which carries it through the ramp; this hypothesis "
    "was added after the ramp had failed without it on validation recordings, so that of the three held-out kinds the "
    "ramp is no surprise to the design, though to every parameter."
)

DISTURBED = Study("disturbed", "Disturbed recordings", "disturbed", _units, _report)
