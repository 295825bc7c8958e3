"""`benchmark stress`: what unit and platform do beyond the profile, and whether the intervals hold.

A cell is a sensor, a duration and one thing that differs from the profile: `data/stress_cells.csv` lists them. Beside
each stands what generalised least squares could do that knew the covariance of the disturbance and of the sensor.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files

import numpy as np

from gyronorth.alignment.posterior.blocks import COUNT
from gyronorth.alignment.posterior.law import FINE, block_operators
from gyronorth.angles import angle_error
from gyronorth.arrays import Array
from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY
from gyronorth.evaluation import wilson
from gyronorth.pipeline import heading
from gyronorth.recording import Recording
from gyronorth.sensor import Sensor, read_sensor
from gyronorth.sensor.law import NoiseLaw
from gyronorth.simulation import Motion, simulate_batch
from gyronorth.simulation.disturbance import Draw
from gyronorth.studies.study import Study, StudyPlan
from gyronorth.studies.tables import StudyReport, Table
from gyronorth.studies.work import Job, Result

#: Recordings of a cell and of a unit, their rate, Hz, and latitude, rad.
RUNS, ROWS, RATE_HZ, LATITUDE = 100, 50, 10.0, np.radians(48.0)
METHODS = ("auto", "mean", "inertial")
#: Attitude of the units, one standard deviation, rad; lag of the wind, s.
TILTED, LAG = np.radians(1.0), 3.0


@dataclass(frozen=True)
class Cell:
    """One situation of one sensor."""

    sensor: str
    duration_s: float
    situation: str  # honest, wind, lean, nudge, tones, bias, drift, white, settling
    amount: float  # deg rms (wind), deg a 100 s (lean), deg (nudge), deg/s (tones); else times the profile's
    time_s: float  # time constant of settling
    accel: bool
    profile: bool

    @property
    def name(self) -> str:
        """For people."""
        what = self.situation if self.situation == "honest" else f"{self.situation} {self.amount:g}"
        what += f" in {self.time_s:g} s" if self.time_s else ""
        lacks = [word for word, has in (("accelerometer", self.accel), ("profile", self.profile)) if not has]
        return f"{self.sensor} {self.duration_s:g} s: {what}" + (f", no {' and no '.join(lacks)}" if lacks else "")

    def unit(self) -> Sensor:
        """The sensor as it is, beyond its profile."""
        sensor, gyro = read_sensor(self.sensor), read_sensor(self.sensor).gyro
        factor = {self.situation: self.amount}
        gyro = replace(
            gyro,
            turn_on_bias=gyro.turn_on_bias * factor.get("bias", 1.0),
            flicker=gyro.flicker * factor.get("drift", 1.0),
            white=gyro.white * factor.get("white", 1.0),
        )
        return replace(sensor, gyro=gyro)

    def settling(self) -> float:
        """Size of the settling bias, one standard deviation, rad/s."""
        gyro = read_sensor(self.sensor).gyro
        return self.amount * float(np.hypot(gyro.turn_on_bias, gyro.flicker)) if self.situation == "settling" else 0.0

    def motion(self) -> Motion:
        """How the platform moves."""
        size = np.radians(self.amount)
        moves = {
            "wind": lambda draw: draw.wind(size, LAG),
            "lean": lambda draw: draw.lean(size / 100),
            "nudge": lambda draw: draw.nudge(size),
            "tones": lambda draw: sum(draw.sine(draw.half_normal(size), draw.log_uniform(0.02, 0.3)) for _ in (0, 1)),
        }
        if self.situation not in moves:
            return Motion()
        return Motion(disturbance=lambda times, *, runs, rng: moves[self.situation](Draw(runs, times, rng)))


@cache
def cells() -> tuple[Cell, ...]:
    """The cells of the shipped list."""
    text = (files("gyronorth") / "data" / "stress_cells.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(text.splitlines())
    return tuple(
        Cell(
            row["sensor"],
            float(row["duration_s"]),
            row["situation"],
            float(row["amount"]),
            float(row["time_s"]),
            row["accel"] == "1",
            row["profile"] == "1",
        )
        for row in rows
    )


def recordings(cell: Cell, runs: int, rng: np.random.Generator) -> tuple[Array, Array | None, Array]:
    """Rates and forces (runs, n, 3) of a cell and the true headings at the end, rad."""
    start = rng.uniform(0, 2 * np.pi, runs)
    roll, pitch = TILTED * rng.standard_normal((2, runs)) * (1.0 if cell.accel else 0.0)
    nudged = []

    def moves(times: Array, *, runs: int, rng: np.random.Generator) -> Array:
        angle = np.asarray(motion.disturbance(times, runs=runs, rng=rng))  # type: ignore[operator]
        nudged.append(angle[:, -1, 2])
        return angle

    motion = cell.motion()
    gyro_b, accel_b = simulate_batch(
        cell.unit(),
        runs=runs,
        latitude=LATITUDE,
        heading=start,
        duration=cell.duration_s,
        rate_hz=RATE_HZ,
        rng=rng,
        roll=roll,
        pitch=pitch,
        motion=motion if isinstance(motion.disturbance, str) else Motion(disturbance=moves),
        accel=cell.accel,
    )
    if cell.situation == "settling":
        time = (np.arange(gyro_b.shape[1]) + 0.5) / RATE_HZ
        size = cell.settling() * rng.standard_normal((runs, 1, 3))
        gyro_b = gyro_b + size * np.exp(-time / cell.time_s)[:, None]
    turned = np.concatenate(nudged) if cell.situation == "nudge" else 0.0
    return gyro_b, accel_b, (start + turned) % (2 * np.pi)


def judge_cell(*, cell: list, runs: int, method: str, seed: list[int]) -> Result:
    """Errors, sigmas, ends of intervals, deg, and verdicts of `runs` recordings of a cell."""
    one = Cell(*cell)
    gyro_b, accel_b, truth = recordings(one, runs, np.random.default_rng(seed))
    sensor = one.sensor if one.profile else None
    rows = []
    for index in range(runs):
        recording = Recording(gyro_b[index], None if accel_b is None else accel_b[index], RATE_HZ)
        found = heading(recording, latitude=LATITUDE, sensor=sensor, method=method)
        if found.heading is None:
            rows.append((180.0, 104.0, 180.0, True, False))
            continue
        low, high = found.interval95
        whole = high - low >= 2 * np.pi - 1e-9
        half = np.pi if whole else ((high - low) % (2 * np.pi)) / 2
        inside = whole or (truth[index] - low) % (2 * np.pi) <= (high - low) % (2 * np.pi)
        error = np.degrees(angle_error(np.asarray(found.heading), truth[index]))
        rows.append((float(error), np.degrees(found.sigma or np.pi), np.degrees(half), bool(inside), found.valid))
    columns = list(zip(*rows, strict=True))
    names = ("error_deg", "sigma_deg", "half_deg", "inside", "valid")
    return {name: [round(float(v), 6) for v in values] for name, values in zip(names, columns, strict=True)}


def oracle_sigma(cell: Cell) -> float:
    """Sigma of generalised least squares with the true covariance of disturbance and sensor, rad.

    Block means of the rate and, with an accelerometer, of its integral less the tilt. Tones and nudges are left out:
    who knows their frequency or time loses next to nothing by them. Without an accelerometer a lean is a bias.
    """
    unit, seconds = cell.unit(), cell.duration_s / COUNT
    both, edges = block_operators(seconds, accel=cell.accel), np.arange(COUNT + 1)
    times = np.asarray(edges * seconds, dtype=float)
    fine = np.arange(FINE * COUNT + 1)
    time = (fine[:-1] + 0.5) * seconds / FINE
    covariance = both @ NoiseLaw(unit.gyro).mean_covariance(fine[:-1], fine[1:], rate_hz=FINE / seconds) @ both.T
    if cell.situation == "settling":
        column = both @ np.exp(-time / cell.time_s) * cell.settling()
        covariance += np.outer(column, column)
    moved = _moved(cell, times)
    covariance[:COUNT, :COUNT] += np.diff(np.diff(moved, axis=0), axis=1) / seconds**2
    if cell.accel:
        force = NoiseLaw(replace(unit.accel, turn_on_bias=0.0))
        own = force.mean_covariance(edges[:-1], edges[1:], rate_hz=1 / seconds) / STANDARD_GRAVITY**2
        covariance[COUNT:, COUNT:] += own + 1.0
    constant = both @ np.ones(FINE * COUNT)
    information = constant @ np.linalg.solve(covariance, constant)
    level = (unit.accel.turn_on_bias / STANDARD_GRAVITY * EARTH_RATE * np.sin(LATITUDE)) ** 2 if cell.accel else 0.0
    variance = 1 / information + unit.gyro.turn_on_bias**2 + level
    return float(np.sqrt(variance) / (EARTH_RATE * np.cos(LATITUDE)))


def _moved(cell: Cell, times: Array) -> Array:
    """Covariance of the tilt at `times`, one axis, rad^2."""
    size = np.radians(cell.amount)
    if cell.situation == "lean":
        return np.outer(times, times) * (size / 100) ** 2 / 2
    if cell.situation != "wind":
        return np.zeros((len(times), len(times)))
    lag = np.abs(times[:, None] - times)
    return size**2 * (np.exp(-lag / LAG) - np.exp(-4 * lag / LAG) / 4) / 0.75


def _units(plan: StudyPlan) -> list[Job]:
    return [
        Job(
            f"stress/{number:03d}-{method}-{first:04d}",
            judge_cell,
            {"cell": list(vars(cell).values()), "runs": ROWS, "method": method, "seed": [plan.seed, number, first]},
        )
        for number, cell in enumerate(cells())
        for method in METHODS
        if method != "inertial" or cell.accel
        for first in range(0, RUNS, ROWS)
    ]


def _row(cell: Cell, method: str, parts: list[Result]) -> tuple:
    names = ("error_deg", "sigma_deg", "half_deg", "inside", "valid")
    error, sigma, half, inside, valid = (np.concatenate([part[name] for part in parts]) for name in names)
    good = valid.astype(bool)
    count = int(good.sum())
    if count == 0:
        return cell.name, method, len(valid), None, 1.0, None, None, None, 1.96 * np.degrees(oracle_sigma(cell))
    return (
        cell.name,
        method,
        len(valid),
        wilson(float(np.mean(inside[good] == 0)), count),
        float(np.mean(~good)),
        float(np.sqrt(np.mean(error[good] ** 2))),
        float(np.sqrt(np.mean((error[good] / sigma[good]) ** 2))),
        float(np.median(half[good])),
        float(min(1.96 * np.degrees(oracle_sigma(cell)), 180.0)),
    )


def _report(_plan: StudyPlan, results: Mapping[str, Result]) -> StudyReport:
    rows = []
    for number, cell in enumerate(cells()):
        for method in METHODS:
            stem = f"stress/{number:03d}-{method}-"
            parts = [results[name] for name in sorted(results) if name.startswith(stem)]
            if parts:
                rows.append(_row(cell, method, parts))
    told = {row[0] for row in rows if row[1] == "auto"}
    left = [cell.name for cell in cells() if cell.name not in told]
    missing = f" Not run here: {'; '.join(left)}." if left else ""
    return StudyReport(TEXT + missing, (Table("Beyond the profile", COLUMNS, tuple(rows)),))


COLUMNS = (
    "cell",
    "method",
    "recordings",
    "missed of valid",
    "refused",
    "RMSE, deg",
    "error over sigma, rms",
    "half-width, deg",
    "oracle's half-width, deg",
)
TEXT = (
    f"Simulated recordings at {RATE_HZ:g} Hz and {np.degrees(LATITUDE):g} N, headings uniform on the circle, roll and "
    "pitch normal with 1 deg (level without an accelerometer). One thing differs from the profile that is given: wind "
    "(deg rms), a lean that goes on (deg a 100 s), a nudge in azimuth (deg), two tones (deg/s), turn-on bias, drift or "
    "white noise (times the profile's), or a bias that settles (ten times the root sum square of turn-on bias and "
    "bias instability). The oracle is generalised least squares that knows the covariance of all of it."
)

STRESS = Study("stress", "Beyond the profile", "stress", _units, _report)
