"""`benchmark disturbed`, study `long`: recordings longer than those that the network was trained on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from gyronorth.alignment import registry
from gyronorth.alignment.problem import Problem
from gyronorth.angles import DEG_PER_HOUR
from gyronorth.evaluation import bootstrap_crmse
from gyronorth.sensor import Sensor, TriadErrors
from gyronorth.studies.disturbed import ratio_to, share_inside
from gyronorth.studies.disturbed_methods import WHITE, MethodHeadings, Part, by_learned, by_mean, judged, part_of
from gyronorth.studies.floors import floor_deg
from gyronorth.studies.methods import as_rad
from gyronorth.studies.study import Study, StudyPlan
from gyronorth.studies.tables import StudyReport, Table, degrees
from gyronorth.studies.work import Job, Result

KINDS, DURATIONS = ("quiet", "sway", "mixed", "warmup", "soak"), (400.0, 900.0, 3600.0)
#: Seed of the test recordings, which nothing was chosen on.
SEED = 20261126
#: Residual bias, deg/h, recordings of a case, and of a unit.
BIAS, RUNS, ROWS = 0.1, 200, 50
#: Length of the longest recordings in training, s.
TRAINED = 300.0


def by_last_part(part: Part) -> MethodHeadings:
    """`learned` on the last 300 s alone."""
    count = round(TRAINED * part.made.rate_hz)
    return by_learned(replace(part, made=replace(part.made, gyro_b=part.made.gyro_b[:, -count:])))


def by_auto(part: Part) -> MethodHeadings:
    """What `gyronorth heading` takes by itself."""
    sensor = Sensor("simulated", part.errors)
    each = [Problem(gyro_b, None, part.made.rate_hz, part.made.latitude, sensor) for gyro_b in part.gyro]
    found = [registry.solve("auto", problem, registry.Options()) for problem in each]
    heading, low, high = (
        np.array([float(value) for value in values])
        for values in zip(
            *((one.attitude.heading, one.posterior.low, one.posterior.high) for one in found), strict=True
        )
    )
    return MethodHeadings(heading, low, high)


METHODS: dict[str, Callable[[Part], MethodHeadings]] = {
    "mean": by_mean,
    "learned, last 300 s": by_last_part,
    "learned": by_learned,
    "auto": by_auto,
}


def judge_long(*, kind: str, duration: float, bias_deg_h: float, runs: int, rows: list[int], seed: int) -> Result:
    """Errors, deg, of every method on some recordings of a case, and whether their intervals hold."""
    part = part_of(kind=kind, duration=duration, bias_deg_h=bias_deg_h, runs=runs, rows=(rows[0], rows[1]), seed=seed)
    return judged(part, METHODS)


def _stem(kind: str, duration: float) -> str:
    return f"long/{kind}-{duration:g}s"


def _units(plan: StudyPlan) -> list[Job]:
    units = []
    for kind in KINDS:
        for duration in DURATIONS:
            known = {"kind": kind, "duration": duration, "bias_deg_h": BIAS, "runs": RUNS, "seed": SEED + plan.seed}
            for first in range(0, RUNS, ROWS):
                rows = [first, min(first + ROWS, RUNS)]
                units.append(Job(f"{_stem(kind, duration)}/{first:04d}", judge_long, {**known, "rows": rows}))
    return units


def _title(kind: str) -> str:
    return f"{kind}: recordings longer than {TRAINED:g} s"


def _table(kind: str, results: Mapping[str, Result], rng: np.random.Generator) -> Table:
    rows = []
    for duration in DURATIONS:
        parts = [results[name] for name in sorted(results) if name.startswith(f"{_stem(kind, duration)}/")]
        errors = {name: as_rad([e for part in parts for e in part["error_deg"][name]]) for name in METHODS}
        for name, error in errors.items():
            crmse = degrees(bootstrap_crmse(error, np.arange(len(error)), rng=rng))
            inside = share_inside([hit for part in parts for hit in part["inside"][name]])
            ratio = ratio_to(error, errors["mean"], rng)
            rows.append((f"{duration:g} s: {name}", len(error), crmse, ratio, inside))
    return Table(_title(kind), COLUMNS, tuple(rows))


def _floor(_plan: StudyPlan, _table: Table) -> str:
    errors = TriadErrors(white=WHITE, turn_on_bias=BIAS * DEG_PER_HOUR)
    values = ", ".join(f"{floor_deg(errors, duration):.3f} deg at {duration:g} s" for duration in DURATIONS)
    return f"Floor (Cramér-Rao) of undisturbed recordings, white noise and residual bias: {values}."


def _report(plan: StudyPlan, results: Mapping[str, Result]) -> StudyReport:
    rng = np.random.default_rng(plan.seed)
    return StudyReport(TEXT, tuple(_table(kind, results, rng) for kind in KINDS))


COLUMNS = ("method", "recordings", "CRMSE, deg", "ratio to the mean", "inside the 95 % interval")
TEXT = (
    "The recordings are those of the study above, of the gyro alone, but longer than the 300 s that the network of "
    "`learned` was trained on, and with `soak` beside the other kinds: a bias of 2 deg/h (one standard deviation, per "
    "axis) that settles with a time constant of 2 to 20 min, log-uniform. `learned` averages a longer recording down "
    "to no more samples than it has of 300 s, and allows for time constants of up to twice the duration; `learned, "
    "last 300 s` leaves out the rest. `auto` is what `gyronorth heading` takes by itself. The time constants were "
    "extended after the slow warm-up had been seen to fail without, on other recordings: to the design it is no "
    "surprise."
)

LONG = Study("long", "Long recordings", "disturbed", _units, _report, _floor)
