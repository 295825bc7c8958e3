"""`benchmark turned`: heading from poses and turns against its bound, and whether its interval holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from gyronorth.alignment.turned.bound import turned_sigma
from gyronorth.alignment.turned.fit import turned
from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR, angle_error, wrap
from gyronorth.evaluation import Interval, bootstrap_crmse, wilson
from gyronorth.sensor import Sensor, TriadErrors
from gyronorth.simulation import Motion, simulate_batch
from gyronorth.studies.methods import as_rad, rounded
from gyronorth.studies.study import Study, StudyPlan
from gyronorth.studies.tables import StudyReport, Table, degrees
from gyronorth.studies.work import Job, Result

#: Time of standing still, shared by the poses, and of each turn, s; sample rate, Hz.
STILL, TURN, RATE_HZ = 100.0, 10.0, 10.0
#: Recordings of a case, and of a unit.
RUNS, ROWS = 2000, 500


@dataclass(frozen=True)
class TurnedCase:
    """A plan of turns, a place and a sensor; everything else is white noise and turn-on bias."""

    turns_deg: tuple[float, ...]
    latitude_deg: float = 32.11
    roll_deg: float = 0.0
    flicker_deg_h: float = 0.0
    scale_ppm: float = 0.0
    profile: bool = True  # whether the fit knows the sensor
    runs: int = RUNS

    def sensor(self) -> Sensor:
        """The unit: angle random walk 0.02 deg/sqrt(h), turn-on bias 1 deg/h, an accelerometer of 0.5 mg."""
        gyro = TriadErrors(
            white=0.02 * DEG_PER_SQRT_HOUR,
            turn_on_bias=DEG_PER_HOUR,
            flicker=self.flicker_deg_h * DEG_PER_HOUR,
            scale_factor=self.scale_ppm * 1e-6,
        )
        return Sensor("simulated", gyro, TriadErrors(white=1e-3, turn_on_bias=5e-3))

    def bound(self) -> float:
        """Cramer-Rao bound of the heading, rad."""
        return turned_sigma(
            self.sensor(),
            latitude=np.radians(self.latitude_deg),
            turns=tuple(np.radians(self.turns_deg)),
            still_duration=STILL,
            turn_duration=TURN,
        )


_HALF, _QUARTERS = (180.0,), (90.0,) * 3
#: Row of the table -> what is simulated.
CASES = {
    "one pose": TurnedCase(()),
    "2 x 180": TurnedCase(_HALF),
    "4 x 90": TurnedCase(_QUARTERS),
    "one turn of 60 deg": TurnedCase((60.0,)),
    "2 x 180, latitude 0": TurnedCase(_HALF, latitude_deg=0.0),
    "2 x 180, latitude 60": TurnedCase(_HALF, latitude_deg=60.0),
    "2 x 180, latitude -45": TurnedCase(_HALF, latitude_deg=-45.0),
    "2 x 180, tilted by 10 deg": TurnedCase(_HALF, roll_deg=10.0),
    "4 x 90, tilted by 10 deg": TurnedCase(_QUARTERS, roll_deg=10.0),
    "2 x 180, latitude -45, tilted by 10 deg": TurnedCase(_HALF, latitude_deg=-45.0, roll_deg=10.0),
    "2 x 180, flicker 1 deg/h": TurnedCase(_HALF, flicker_deg_h=1.0),
    "4 x 90, flicker 1 deg/h": TurnedCase(_QUARTERS, flicker_deg_h=1.0),
    "10 x 180, flicker 1 deg/h": TurnedCase((180.0,) * 9, flicker_deg_h=1.0),
    "2 x 180, scale factor 3000 ppm": TurnedCase(_HALF, scale_ppm=3000.0),
    "4 x 90, scale factor 3000 ppm": TurnedCase(_QUARTERS, scale_ppm=3000.0),
    "2 x 180, no profile": TurnedCase(_HALF, profile=False, runs=500),
    "2 x 180, flicker 1 deg/h, no profile": TurnedCase(_HALF, flicker_deg_h=1.0, profile=False, runs=500),
}


def judge(*, case: dict, runs: int, seed: list[int]) -> Result:
    """Errors and sigmas, deg, of `runs` recordings of a case at headings uniform on the circle."""
    one, rng = TurnedCase(**{**case, "turns_deg": tuple(case["turns_deg"])}), np.random.default_rng(seed)
    sensor, turns = one.sensor(), np.radians(one.turns_deg)
    pose = STILL / (len(turns) + 1)
    starts = pose * (np.arange(len(turns)) + 1) + TURN * np.arange(len(turns))
    motion = Motion(turns=tuple((float(s), TURN, float(angle)) for s, angle in zip(starts, turns, strict=True)))
    known: dict[str, Any] = {"rate_hz": RATE_HZ, "latitude": float(np.radians(one.latitude_deg))}
    start = rng.uniform(0, 2 * np.pi, runs)
    gyro, accel = simulate_batch(
        sensor,
        runs=runs,
        heading=start,
        duration=STILL + TURN * len(turns),
        rng=rng,
        roll=float(np.radians(one.roll_deg)),
        motion=motion,
        **known,
    )
    assert accel is not None
    errors = sensor if one.profile else None
    fits = [turned(g, a, errors=errors, **known) for g, a in zip(gyro, accel, strict=True)]
    off = angle_error(np.array([fit.heading for fit in fits]), wrap(start + turns.sum()))
    sigma = np.array([fit.sigma for fit in fits])
    return {"error_deg": rounded(off), "sigma_deg": rounded(sigma)}


def _units_of(number: int, case: TurnedCase, plan: StudyPlan) -> list[Job]:
    arguments = {**asdict(case), "turns_deg": list(case.turns_deg)}
    return [
        Job(
            f"turned/{number:02d}-{first:04d}",
            judge,
            {"case": arguments, "runs": min(ROWS, case.runs - first), "seed": [plan.seed, number, first]},
        )
        for first in range(0, case.runs, ROWS)
    ]


def _units(plan: StudyPlan) -> list[Job]:
    return [unit for number, case in enumerate(CASES.values()) for unit in _units_of(number, case, plan)]


def _report(plan: StudyPlan, results: Mapping[str, Result]) -> StudyReport:
    rng, rows = np.random.default_rng(plan.seed), []
    for number, (name, case) in enumerate(CASES.items()):
        parts = [results[unit.name] for unit in _units_of(number, case, plan)]
        error, sigma = (np.concatenate([as_rad(p[key]) for p in parts]) for key in ("error_deg", "sigma_deg"))
        found, bound = bootstrap_crmse(error, np.arange(len(error)), rng=rng), case.bound()
        ratio = Interval(*(value / bound for value in (found.value, found.low, found.high)))
        inside = wilson(float(np.mean(np.abs(error) <= 1.96 * sigma)), len(error))
        rows.append((name, len(error), degrees(found), float(np.degrees(bound)), ratio, inside))
    columns = ("turns", "recordings", "RMSE, deg", "bound, deg", "ratio to the bound", "inside the 95 % interval")
    return StudyReport(TEXT, (Table("Heading from poses and turns", columns, tuple(rows)),))


TEXT = (
    f"Simulated recordings at {RATE_HZ:g} Hz: {STILL:g} s of standing still in all, shared by poses that turns of "
    f"{TURN:g} s part, at headings uniform on the circle; 32.11 N, level, unless the row says otherwise. The gyroscope "
    "has an angle random walk of 0.02 deg/sqrt(h) and a turn-on bias of 1 deg/h, normal per axis; flicker and scale "
    "factor errors are on top where the row says so. 2 x 180 is one turn of 180 deg between two poses, 4 x 90 three "
    "turns of 90 deg, 10 x 180 nine of 180 deg. The bound is the Cramer-Rao bound of that noise law, the figure that "
    "`gyronorth plan --turns` gives. The fit finds poses and turns itself and takes the angles of the turns from the "
    "gyroscope. Without a profile it infers noise and in-run drift from the recording, and allows any turn-on bias."
)

TURNED = Study("turned", "Turning the unit", "turned", _units, _report)
