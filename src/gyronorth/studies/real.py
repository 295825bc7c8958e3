"""`benchmark real`: every recorded data set with a reference heading, by every method, with a profile and without.

The recordings are other people's and do not ship. They are read from `--data FOLDER`, or where `GYRONORTH_REAL_DATA`
points; `CASES` says which file, whose truth, and which windows.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gyronorth.alignment.problem import Problem
from gyronorth.alignment.registry import METHODS, fits
from gyronorth.angles import angle_error
from gyronorth.errors import InputError
from gyronorth.estimate import HeadingEstimate
from gyronorth.pipeline import heading
from gyronorth.readers import ReadOptions, read
from gyronorth.recording import Recording
from gyronorth.studies.study import Study, StudyPlan
from gyronorth.studies.tables import StudyReport, Table
from gyronorth.studies.work import Job, Result

#: Where the recordings are, unless `--data` says so.
VARIABLE = "GYRONORTH_REAL_DATA"
#: Methods of one pose; `auto` is first, and the only one of a recording with several.
ONE_POSE = ("auto", "mean", "inertial", "bayes", "learned")


@dataclass(frozen=True)
class Case:
    """Windows of one recording, or of several of one unit at one place."""

    files: tuple[str, ...]
    windows: tuple[tuple[tuple[float, float] | None, ...], ...]  # of each file, s; None: the whole
    truth_deg: float | None  # heading, deg; None: whatever is found must be refused
    latitude_deg: float
    profiles: tuple[str, ...]  # beside none at all
    methods: tuple[str, ...] = ONE_POSE
    reading: Mapping[str, Any] | None = None  # what the file does not say: fields of ReadOptions


@dataclass(frozen=True)
class Origin:
    """Where a recording comes from, and who says what its heading is."""

    files: str
    what: str
    truth: str
    source: str


def _pieces(first: float, last: float, length: float) -> tuple[tuple[float, float], ...]:
    """Windows of `length` s one after another."""
    return tuple((float(t), float(t + length)) for t in np.arange(first, last - length + 1e-9, length))


_CAR, _CAR_BLIND, _DRIVE = "kingston_{}.csv", "kingston_gyro_only_{}.csv", "kingston_turned_300_697.csv"
_PARTS = ("100_200", "300_400")
_WHOLE: tuple[tuple[None], ...] = ((None,), (None,))
_SHORT = ((0.0, 60.0), (40.0, 100.0))
_VEHICLE = ("lasergyro.imu",)
_CAR_LATITUDE, _CAR_TRUTH, _CAR_PROFILES = 44.2325, 199.8, ("sdc500", "hg1700")
_STIM: Mapping[str, Any] = {
    "variable": "data",
    "columns": {"w_x": 4, "w_y": 5, "w_z": 6, "f_x": 8, "f_y": 9, "f_z": 10},
    "gyro_unit": "deg/s",
    "accel_unit": "g",
    "rate_hz": 125.0,
}


def _car(name: str, windows: tuple[tuple[tuple[float, float] | None, ...], ...]) -> Case:
    files = tuple(name.format(part) for part in _PARTS)
    return Case(files, windows, _CAR_TRUTH, _CAR_LATITUDE, _CAR_PROFILES)


def _vehicle(*windows: tuple[float, float] | None) -> Case:
    return Case(_VEHICLE, (windows,), 90.6, 34.246048, ("hg9900",))


#: Row of the table -> what is measured.
CASES: Mapping[str, Case] = {
    "car, 100 s": _car(_CAR, _WHOLE),
    "car, 60 s": _car(_CAR, (_SHORT, _SHORT)),
    "car without accelerometer, 100 s": _car(_CAR_BLIND, _WHOLE),
    "car without accelerometer, 60 s": _car(_CAR_BLIND, (_SHORT, _SHORT)),
    "car before it drives, 100 s": Case(
        (_DRIVE,), (_pieces(0.0, 200.0, 100.0),), _CAR_TRUTH, _CAR_LATITUDE, _CAR_PROFILES
    ),
    "car before it drives, 220 s": Case((_DRIVE,), (((0.0, 220.0),),), _CAR_TRUTH, _CAR_LATITUDE, _CAR_PROFILES),
    "car, standing, driving, standing": Case((_DRIVE,), ((None,),), 331.17, _CAR_LATITUDE, _CAR_PROFILES, ("auto",)),
    "tilt table, 60 s": Case(
        ("blueseis_tilt_20_80.csv",), ((None,),), 356.85, 48.1629, ("hg9900", "blueseis-3a")
    ),
    "swaying vehicle, 1847 s": _vehicle(None),
    "swaying vehicle, 300 to 480 s": _vehicle((0.0, 300.0), (600.0, 950.0), (1020.0, 1500.0)),
    "swaying vehicle, 100 s": _vehicle(*_pieces(0.0, 1800.0, 100.0)),
    "one of an up/down pair, 300 s": Case(("ln100_up.csv",), ((None,),), 5.65, 51.0447, ("hg9900",)),
    "cart with a bias of 200 deg/h": Case(
        ("stim300_cart_static_then_turn.mat",), (((0.0, 78.0),),), None, 41.8342, ("stim300",), ONE_POSE, _STIM
    ),
    "car with a consumer unit": Case(
        ("xsens_mti_static.txt",), ((None,),), None, 23.05, ("mti-600",), ONE_POSE, {"rate_hz": 100.0}
    ),
}  # fmt: skip

#: Whose recordings these are.
ORIGINS = (
    Origin(
        "kingston_*.csv",
        "parked car with people and engine, HG1700 ring lasers, 10 Hz, denoised by its authors",
        "199.8 deg: azimuth of the NovAtel SPAN; 331.17 deg at the end of the drive, the same",
        "hanymragab/Full_IMU_Mechanization, MIT",
    ),
    Origin(
        "blueseis_tilt_20_80.csv",
        "fibre-optic triad on a tilt table that tilts by hundredths of a degree, 200 Hz, no accelerometer",
        "356.85 deg: from its own still parts, taken as level",
        "solldavid/TwistPy, LGPL",
    ),
    Origin(
        "lasergyro.imu",
        "ring lasers on a parked, occupied, swaying vehicle, 100 Hz",
        "90.6 deg: the author's own fine alignment",
        "PSINS toolbox, Gongmin Yan, BSD 2-clause",
    ),
    Origin(
        "ln100_up.csv",
        "dithered ring laser, one of an up/down pair, 64 Hz; its x gyro is off by 0.25 deg/h, beyond any profile here",
        "5.65 deg: of the pair together, if the flip kept the heading",
        "naman4u13/ENGO623_LAB2, no licence stated",
    ),
    Origin(
        "stim300_cart_static_then_turn.mat",
        "STIM300 on a cart, 78 s still, turn-on bias of 200 deg/h",
        "none: must be refused",
        "public course data, no licence stated",
    ),
    Origin(
        "xsens_mti_static.txt",
        "MTi in a parked car, mean rate of 440 deg/h",
        "none: must be refused",
        "public, no licence stated",
    ),
)


def folder_of(plan: StudyPlan) -> Path:
    """The folder of the recordings.

    Raises
    ------
    InputError
        If nobody says where it is, or a recording is not in it.
    """
    given = plan.data or os.environ.get(VARIABLE)
    if not given:
        raise InputError(
            f"The real recordings do not ship with the package. Give their folder as --data FOLDER, or in {VARIABLE}."
        )
    folder = Path(given)
    missing = sorted({name for case in CASES.values() for name in case.files if not (folder / name).is_file()})
    if missing:
        raise InputError(f"{folder} lacks {', '.join(missing)}; the folder of the real recordings is expected.")
    return folder


def described(plan: StudyPlan) -> dict[str, str]:
    """The recordings and their checksums."""
    folder = folder_of(plan)
    return {name: _sha256(folder / name) for name in sorted({name for case in CASES.values() for name in case.files})}


def judge(
    *, folder: str, file: str, sha256: str, window: list[float] | None, latitude_deg: float, sensor: str | None,
    method: str, truth_deg: float | None, reading: dict[str, Any] | None,
) -> Result:  # fmt: skip
    """Heading, sigma, half-width and error of one window, deg, its verdict and its codes."""
    path = Path(folder) / file
    if sha256 != _sha256(path):
        raise InputError(f"{path} has changed since the study began. Use another -o.")
    recording = read(path, None if reading is None else ReadOptions(**reading))
    if window is not None:
        recording = recording.window(*window)
    latitude = float(np.radians(latitude_deg))
    if not _takes(method, recording, latitude):
        return {"taken": False}
    found = heading(recording, latitude=latitude, sensor=sensor, method=method)
    return {"taken": True, **_figures(found, truth_deg)}


def _takes(method: str, recording: Recording, latitude: float) -> bool:
    info = METHODS.info(method)
    problem = Problem(recording.gyro_b, recording.accel_b, recording.rate_hz, latitude)
    return (recording.accel_b is not None or not info.needs_accelerometer) and fits(info, problem)


def _figures(found: HeadingEstimate, truth_deg: float | None) -> Result:
    """Plain numbers of an estimate; the whole circle for one that has no heading."""
    codes = {"valid": found.valid, "reasons": [f.code for f in found.reasons], "used": found.method}
    if found.heading is None or found.sigma is None:
        return codes | {"heading_deg": None, "sigma_deg": 104.0, "half_deg": 180.0, "error_deg": None, "inside": True}
    low, high = found.interval95
    whole = high - low >= 2 * np.pi - 1e-9
    arc = 2 * np.pi if whole else (high - low) % (2 * np.pi)
    figures = {"heading_deg": found.heading, "sigma_deg": found.sigma, "half_deg": arc / 2}
    codes |= {name: round(float(np.degrees(value)), 4) for name, value in figures.items()}
    if truth_deg is None:
        return codes | {"error_deg": None, "inside": True}
    truth = np.radians(truth_deg)
    error = float(np.degrees(angle_error(np.asarray(found.heading), truth)))
    return codes | {"error_deg": round(error, 4), "inside": bool(whole or (truth - low) % (2 * np.pi) <= arc)}


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _units_of(name: str, case: Case, folder: Path) -> list[tuple[str, str | None, Job]]:
    """Method, profile and unit of work of every window."""
    number = list(CASES).index(name)
    found = []
    for sensor in (None, *case.profiles):
        for method in case.methods:
            for index, (file, window) in enumerate(
                (file, window) for file, windows in zip(case.files, case.windows, strict=True) for window in windows
            ):
                arguments = {
                    "folder": str(folder),
                    "file": file,
                    "sha256": _sha256(folder / file),
                    "window": None if window is None else list(window),
                    "sensor": sensor,
                    "method": method,
                    **{key: asdict(case)[key] for key in ("latitude_deg", "truth_deg", "reading")},
                }
                label = f"real/{number:02d}-{sensor or 'none'}-{method}-{index:02d}"
                found.append((method, sensor, Job(label, judge, arguments)))
    return found


def _units(plan: StudyPlan) -> list[Job]:
    folder = folder_of(plan)
    return [job for name, case in CASES.items() for _, _, job in _units_of(name, case, folder)]


def row_of(name: str, label: str, runs: list[Result]) -> tuple[Any, ...]:
    """Name, method and profile, and the figures of the valid windows."""
    good = [run for run in runs if run["valid"]]
    codes = ", ".join(sorted({code for run in runs for code in run["reasons"]}))
    head = (name, label, len(runs), len(good))
    if not good or any(run["error_deg"] is None for run in good):
        return (*head, None, None, None, None, None, codes)
    error, sigma, half = (np.array([run[key] for run in good]) for key in ("error_deg", "sigma_deg", "half_deg"))
    return (
        *head,
        sum(run["inside"] for run in good),
        float(np.sqrt(np.mean(error**2))),
        float(np.abs(error).max()),
        float(np.sqrt(np.mean(sigma**2))),
        float(np.median(half)),
        codes,
    )


def _report(plan: StudyPlan, results: Mapping[str, Result]) -> StudyReport:
    folder, rows = folder_of(plan), []
    for name, case in CASES.items():
        runs: dict[str, list[Result]] = {}
        for method, sensor, job in _units_of(name, case, folder):
            if results[job.name]["taken"]:
                runs.setdefault(f"{method}, {sensor or 'no profile'}", []).append(results[job.name])
        rows += [row_of(name, label, found) for label, found in runs.items()]
    whose = tuple((one.files, one.what, one.truth, one.source) for one in ORIGINS)
    return StudyReport(
        TEXT,
        (
            Table("Real recordings", COLUMNS, tuple(rows), NOTE),
            Table("Whose recordings, whose truth", ("files", "what", "truth", "source, licence"), whose),
        ),
    )


COLUMNS = (
    "recording", "method and profile", "windows", "valid", "of these covered", "RMSE, deg", "largest error, deg",
    "sigma, rms, deg", "half-width, deg", "reasons",
)  # fmt: skip
NOTE = (
    "Errors, sigmas and half-widths are those of the valid headings. A row is missing where a method takes no such "
    "recording: `inertial` needs an accelerometer, `bayes` takes 30 to 300 s. The Cramér-Rao floor of these units is "
    "not known: nobody has measured their noise apart from the recordings."
)
TEXT = (
    "Every recording with a reference heading that could be found, and two that must be refused. `auto` is the "
    "posterior for one pose and `turned` for several. The windows of one row follow one another in the same recordings "
    "(the 60 s windows of the car overlap by 20 s), so their errors are not independent. A profile is only that of a "
    "unit of about this class: hg9900 stands for navigation grade, sdc500 for a unit that is known to be better than "
    "its profile, hg1700 and mti-600 for the make of the unit itself."
)

REAL = Study("real", "Real recordings", "real", _units, _report, described=described)
