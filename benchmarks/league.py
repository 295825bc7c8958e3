"""The same recordings through gyronorth and its peers: `python -m benchmarks league [--runs N] [--data FOLDER]`.

Error, claimed sigma, how often the truth lies in the 95 % interval, refused, CPU. Simulated sets are drawn by
gyronorth's simulator; the set `published` has the mean rates of 60 real SDC500 recordings (arXiv 2312.12121) with
simulated white noise; `--data` adds real recordings whose headings are known, cut into 100 s. Every peer is given
the same profile, as its interface takes it.

`--page` writes table, origin and picture into docs/results/league.md and the files beside it.
"""

from __future__ import annotations

import argparse
import csv
import re
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from math import degrees, hypot
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gyronorth.angles import angle_error, cyclic_rmse
from gyronorth.conditioning import decimated
from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY
from gyronorth.pipeline import heading_batch
from gyronorth.published import published_twin
from gyronorth.readers import read
from gyronorth.sensor import Sensor, read_sensor
from gyronorth.simulation import simulate_batch

Array = NDArray[np.float64]
SEED, RATE_HZ, DURATION = 20261128, 10.0, 100.0
LATITUDE = np.radians(48.0)
PUBLISHED_LATITUDE = np.radians(32.11)
#: Two-sided 95 % point of the normal law, for peers that claim a sigma only.
NORMAL_975 = 1.96
#: Programs that take seconds per recording get only the first of a set.
AT_MOST = {"python-ins filter": 6}
#: The filter updates once a second; means over that time cost a sixth and change its heading by 0.03 of its sigma.
KALMAN_RATE_HZ = 1.0
#: Real recordings with known headings: name of the set, profile whose bias is nearest, files.
REAL = (
    ("laser gyro, parked, swaying", "hg9900", ("lasergyro.imu",)),
    ("HG1700, parked", "sdc500", ("kingston_100_200.csv", "kingston_300_400.csv")),
)
PAGE = Path(__file__).parents[1] / "docs/results/league.md"
COLUMNS = ("set", "program", "recordings", "error_deg", "sigma_deg", "truth_in_95", "refused", "cpu_s")


@dataclass(frozen=True)
class Recordings:
    """A set of recordings of one sensor at one latitude, level or nearly so."""

    name: str
    sensor: Sensor
    latitude: float  # rad
    rate_hz: float
    gyro_b: Array  # (m, n, 3) rad/s
    accel_b: Array  # (m, n, 3) m/s^2
    heading: Array  # (m,) rad


@dataclass(frozen=True)
class Answer:
    """What a program said: arrays of shape (m,); NaN where it says nothing."""

    heading: Array  # rad
    sigma: Array  # rad
    inside: Array  # 1 if the truth lies in the 95 % interval, 0 if not
    refused: Array


def sets(runs: int) -> list[Recordings]:
    """Three profiles, each run a power-up of its own, and the published recordings."""
    rng = np.random.default_rng(SEED)
    found = []
    for name in ("isa100c", "sdc500", "stim300"):
        heading = rng.uniform(0, 2 * np.pi, runs)
        roll, pitch = rng.uniform(-0.05, 0.05, (2, runs))
        gyro_b, accel_b = simulate_batch(
            name,
            runs=runs,
            latitude=LATITUDE,
            heading=heading,
            duration=DURATION,
            rate_hz=RATE_HZ,
            rng=rng,
            roll=roll,
            pitch=pitch,
        )
        assert accel_b is not None
        found.append(Recordings(name, read_sensor(name), LATITUDE, RATE_HZ, gyro_b, accel_b, heading))
    found.append(published(runs, rng=rng))
    return found


def published(runs: int, *, rng: np.random.Generator) -> Recordings:
    """Mean rates of real recordings, level, with the white noise of both sensors of the profile."""
    drawn = published_twin(rng=rng)
    sensor, rate_hz, some = read_sensor("sdc500"), 3.0, slice(None, runs)
    gyro_b = drawn.gyro_l[some]
    accel_b = np.array([0.0, 0.0, -STANDARD_GRAVITY]) + rng.normal(
        scale=sensor.accel.white * np.sqrt(rate_hz), size=gyro_b.shape
    )  # without it StaticAlignment of navtk, which weighs by the scatter, gives no alignment
    return Recordings("published", sensor, PUBLISHED_LATITUDE, rate_hz, gyro_b, accel_b, drawn.heading_true[some])


def real_sets(folder: Path) -> list[Recordings]:
    """Pieces of `DURATION` of the real recordings in a folder, at `RATE_HZ`."""
    found = []
    for name, sensor, files in REAL:
        recordings = [decimated(read(folder / file), RATE_HZ) for file in files]
        count = round(DURATION * RATE_HZ)
        pieces = [
            (recording, slice(start, start + count))
            for recording in recordings
            for start in range(0, len(recording.gyro_b) - count + 1, count)
        ]
        latitude = recordings[0].latitude
        assert latitude is not None
        found.append(
            Recordings(
                name,
                read_sensor(sensor),
                latitude,
                RATE_HZ,
                np.array([recording.gyro_b[part] for recording, part in pieces]),
                np.array([recording.accel_b[part] for recording, part in pieces if recording.accel_b is not None]),
                np.array([recording.heading_true for recording, _ in pieces]),
            )
        )
    return found


def gyronorth(data: Recordings) -> Answer:
    """Method auto with the profile."""
    found = heading_batch(
        data.gyro_b, data.accel_b, rate_hz=data.rate_hz, latitude=data.latitude, sensor=data.sensor, method="auto"
    )
    width = (found.high - found.low) % (2 * np.pi)
    inside = ((data.heading - found.low) % (2 * np.pi) <= width) | (found.high - found.low >= 2 * np.pi)
    return Answer(found.heading, found.sigma, inside.astype(float), ~found.valid)


def numpy_script(data: Recordings) -> Answer:
    """Twenty lines of NumPy: mean rate, levelled; sigma from white noise alone."""
    headings = np.array([_plain(*pair) for pair in zip(data.gyro_b, data.accel_b, strict=True)])
    duration = data.gyro_b.shape[1] / data.rate_hz
    sigma = data.sensor.gyro.white / np.sqrt(duration) / (EARTH_RATE * np.cos(data.latitude))
    return claimed(data, headings, np.full(len(headings), sigma))


def ahrs_triad(data: Recordings) -> Answer:
    """TRIAD of ahrs, with the mean rate in place of the magnetic field; it claims no sigma."""
    from ahrs.filters import TRIAD

    triad = TRIAD()
    triad.v1 = np.array([0.0, 0.0, 1.0])
    triad.v2 = np.array([np.cos(data.latitude), 0.0, -np.sin(data.latitude)])
    headings = []
    for gyro_b, accel_b in zip(data.gyro_b, data.accel_b, strict=True):
        mat_bn = np.asarray(triad.estimate(w1=-accel_b.mean(axis=0), w2=gyro_b.mean(axis=0)))
        headings.append(np.arctan2(mat_bn[0, 1], mat_bn[0, 0]))
    return claimed(data, np.array(headings), np.full(len(headings), np.nan))


def navtk(kind: str) -> Callable[[Recordings], Answer]:
    """StaticAlignment or StaticWahbaAlignment of NavToolkit."""

    def solve(data: Recordings) -> Answer:
        rows = [_navtk_one(kind, data, index) for index in range(len(data.gyro_b))]
        heading, sigma = np.array(rows).T
        return claimed(data, heading, sigma)

    return solve


def kalman(data: Recordings) -> Answer:
    """Error-state filter of python-ins: zero velocity each second, biases as states, from the plain heading."""
    factor = max(round(data.rate_hz / KALMAN_RATE_HZ), 1)
    slow = replace(
        data,
        rate_hz=data.rate_hz / factor,
        gyro_b=_block_means(data.gyro_b, factor),
        accel_b=_block_means(data.accel_b, factor),
    )
    rows = [_kalman_one(slow, index) for index in range(len(slow.gyro_b))]
    heading, sigma = np.array(rows).T
    return claimed(data, heading, sigma)


PROGRAMS: dict[str, Callable[[Recordings], Answer]] = {
    "gyronorth": gyronorth,
    "navtk StaticAlignment": navtk("StaticAlignment"),
    "navtk StaticWahbaAlignment": navtk("StaticWahbaAlignment"),
    "python-ins filter": kalman,
    "ahrs TRIAD": ahrs_triad,
    "numpy script": numpy_script,
}


def claimed(data: Recordings, heading: Array, sigma: Array) -> Answer:
    """The answer of a program that refuses nothing and claims a normal law."""
    inside = np.where(np.isnan(sigma), np.nan, np.abs(angle_error(heading, data.heading)) <= NORMAL_975 * sigma)
    return Answer(heading, sigma, inside, np.isnan(heading))


def _plain(gyro_b: Array, accel_b: Array) -> float:
    """Heading of the mean rate, rad: the projection of the rate on the level plane against the body axis."""
    down = -accel_b.mean(axis=0) / np.linalg.norm(accel_b.mean(axis=0))
    east = np.cross(down, gyro_b.mean(axis=0))
    north = np.cross(east, down)
    return float(np.arctan2(east[0] / np.linalg.norm(east), north[0] / np.linalg.norm(north)))


def _navtk_one(kind: str, data: Recordings, index: int) -> tuple[float, float]:
    """Heading and sigma, rad."""
    import aspn23_xtensor as aspn
    from navtk import filtering, inertial

    gyro, accel = data.sensor.gyro, data.sensor.accel
    three = np.ones(3)
    # Increments: with samples of rate its covariance comes out smaller by the sample interval.
    model = filtering.ImuModel(
        accel.white * three,
        gyro.white * three,
        hypot(accel.flicker, accel.turn_on_bias) * three,
        3600.0 * three,
        hypot(gyro.flicker, gyro.turn_on_bias) * three,
        3600.0 * three,
        accel_bias_initial_sigma=accel.turn_on_bias * three,
        gyro_bias_initial_sigma=gyro.turn_on_bias * three,
    )
    step = 1e9 / data.rate_hz
    count = data.gyro_b.shape[1]
    velocity, angle = data.accel_b[index] / data.rate_hz, data.gyro_b[index] / data.rate_hz
    alignment = getattr(inertial, kind)(model, (count - 2) / data.rate_hz)
    kinds = aspn.AspnMessageType
    site = aspn.MeasurementPosition(
        aspn.TypeHeader(kinds.ASPN_MEASUREMENT_POSITION, 0, 0, 0, 0),
        aspn.TypeTimestamp(0),
        aspn.AspnMeasurementPositionReferenceFrame.ASPN_MEASUREMENT_POSITION_REFERENCE_FRAME_GEODETIC,
        data.latitude,
        0.0,
        0.0,
        np.eye(3),
        aspn.AspnMeasurementPositionErrorModel.ASPN_MEASUREMENT_POSITION_ERROR_MODEL_NONE,
        np.zeros(0),
        [],
    )
    alignment.process(site)
    kind_of_data = aspn.AspnMeasurementImuImuType.ASPN_MEASUREMENT_IMU_IMU_TYPE_INTEGRATED
    for number in range(count):
        header = aspn.TypeHeader(kinds.ASPN_MEASUREMENT_IMU, 0, 0, 0, number)
        stamp = aspn.TypeTimestamp(round((number + 1) * step))
        alignment.process(aspn.MeasurementImu(header, stamp, kind_of_data, velocity[number], angle[number], []))
    solved, solution = alignment.get_computed_alignment()
    known, covariance = alignment.get_computed_covariance()
    if not solved:
        return np.nan, np.nan
    mat = np.asarray(solution.rot_mat)
    heading = float(np.arctan2(mat[0, 1], mat[0, 0]))
    return heading, float(np.sqrt(covariance[8, 8])) if known else np.nan


def _block_means(samples: Array, factor: int) -> Array:
    """Means of `factor` samples each, (m, n, 3) to (m, n // factor, 3)."""
    runs, count, axes = samples.shape
    whole = count // factor
    return samples[:, : whole * factor].reshape(runs, whole, factor, axes).mean(axis=2)


def _kalman_one(data: Recordings, index: int) -> tuple[float, float]:
    """Heading and sigma, rad."""
    import pandas as pd
    from pyins import filters, inertial_sensor, measurements, strapdown

    gyro, accel = data.sensor.gyro, data.sensor.accel
    gyro_b, accel_b = data.gyro_b[index], data.accel_b[index]
    times = np.arange(len(gyro_b)) / data.rate_hz
    columns = ["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
    imu = pd.DataFrame(np.hstack([gyro_b, accel_b]), index=pd.Index(times, name="time"), columns=columns)
    mean = accel_b.mean(axis=0)
    start = {
        "lat": degrees(data.latitude),
        "lon": 0.0,
        "alt": 0.0,
        "VN": 0.0,
        "VE": 0.0,
        "VD": 0.0,
        "roll": degrees(np.arctan2(-mean[1], -mean[2])),
        "pitch": degrees(np.arctan2(mean[0], np.hypot(mean[1], mean[2]))),
        "heading": degrees(_plain(gyro_b, accel_b)),
    }
    still = pd.DataFrame(0.0, index=np.arange(1.0, times[-1]), columns=["VN", "VE", "VD"])
    bias = hypot(gyro.flicker, gyro.turn_on_bias)
    accel_bias = hypot(accel.flicker, accel.turn_on_bias)
    north = EARTH_RATE * np.cos(data.latitude)
    result = filters.run_feedback_filter(
        pd.Series(start, name=times[0]),
        1.0,
        0.01,
        max(degrees(accel_bias / STANDARD_GRAVITY), 0.01),
        min(max(degrees(bias / north), 0.1), 60.0),
        strapdown.compute_increments_from_imu(imu, "rate"),
        inertial_sensor.EstimationModel(bias_sd=bias, noise=gyro.white),
        inertial_sensor.EstimationModel(bias_sd=accel_bias, noise=accel.white),
        measurements=[measurements.NedVelocity(still, 0.01)],
    )
    heading = np.radians(result.trajectory["heading"].iloc[-1])
    return float(heading), float(np.radians(result.trajectory_sd["heading"].iloc[-1]))


def row(data: Recordings, program: str) -> dict[str, object]:
    """One line of the table, degrees and CPU seconds of the whole set."""
    data = first(data, AT_MOST.get(program, len(data.heading)))
    PROGRAMS[program](first(data, 1))  # compiles and loads what it needs
    start = time.process_time()
    answer = PROGRAMS[program](data)
    seconds = time.process_time() - start
    said = ~np.isnan(answer.heading)
    return {
        "set": data.name,
        "program": program,
        "recordings": len(data.heading),
        "error_deg": degrees(cyclic_rmse(angle_error(answer.heading[said], data.heading[said])))
        if said.any()
        else None,
        "sigma_deg": degrees(np.sqrt(np.mean(answer.sigma[said] ** 2))) if said.any() else None,
        "truth_in_95": float(np.mean(answer.inside[said])) if said.any() else None,
        "refused": float(np.mean(answer.refused)),
        "cpu_s": seconds,
    }


def first(data: Recordings, count: int) -> Recordings:
    """The first recordings of a set."""
    return replace(data, gyro_b=data.gyro_b[:count], accel_b=data.accel_b[:count], heading=data.heading[:count])


def table(rows: list[dict[str, object]]) -> str:
    """The rows as Markdown: a set is named in its first row, and a program that got less than the set says how many."""
    lines = [
        "| recordings | program | error | claimed sigma | truth in its 95 % | refused | CPU |",
        "|---|---|---|---|---|---|---|",
    ]
    whole: dict[object, object] = {}
    for line in rows:
        name, count = line["set"], line["recordings"]
        heading = "" if name in whole else f"**{name}** ({count})"
        share = "no sigma" if _missing(line["truth_in_95"]) else f"{100 * float(str(line['truth_in_95'])):.0f} %"
        error, sigma = (_angle(line[name]) for name in ("error_deg", "sigma_deg"))
        some = "" if count == whole.setdefault(name, count) else f" (first {count})"
        lines.append(
            f"| {heading} | {line['program']}{some} | {error} | {sigma} | {share} | "
            f"{100 * float(str(line['refused'])):.0f} % | {line['cpu_s']:.2f} s |"
        )
    return "\n".join(lines) + "\n"


def _angle(value: object) -> str:
    """An angle in deg with three figures."""
    return "none" if _missing(value) else f"{float(str(value)):#.3g}".rstrip(".")


def origin(runs: int) -> str:
    """What made the figures: seed, commit, versions."""
    command = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty", "--abbrev=10"]
    described = subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()
    packages = ("gyronorth", "navtk", "python-ins", "ahrs", "numpy")
    versions = ", ".join(f"{name} {version(name)}" for name in packages if _installed(name))
    return f"Seed {SEED}, {runs} recordings of a simulated set, commit `{described or 'unknown'}`; {versions}.\n"


def read_rows(path: Path) -> list[dict[str, object]]:
    """The rows of a league.csv, as `row` makes them."""
    with path.open(encoding="utf-8", newline="") as file:
        return [
            {name: value if name in ("set", "program") else float(value or "nan") for name, value in one.items()}
            | {"recordings": int(one["recordings"])}
            for one in csv.DictReader(file)
        ]


def draw(rows: list[dict[str, object]], path: Path) -> None:
    """Error over claimed sigma of each program, a line a set: 1 is an honest claim, to the right it is too small."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    from gyronorth.report.figures import BLUE, FAINT, GREEN, INK, PINK, RED, SETTINGS, write

    names = list(dict.fromkeys(row["set"] for row in rows))
    programs = [name for name in PROGRAMS if any(row["program"] == name and _ratio(row) for row in rows)]
    with mpl.rc_context(SETTINGS):
        figure = Figure(figsize=(8.0, 0.9 + 0.55 * len(names)), layout="constrained")
        axes = figure.subplots()
        for number, (program, colour, marker) in enumerate(
            zip(programs, (BLUE, RED, GREEN, PINK, FAINT), "osv^D", strict=False)
        ):
            below = 0.11 * (number - (len(programs) - 1) / 2)  # beside each other where they agree
            found = [(_ratio(row), names.index(row["set"]) + below) for row in rows if row["program"] == program]
            axes.plot(*zip(*found, strict=True), marker, color=colour, markersize=6, label=program)
        axes.axvline(1.0, color=INK, linewidth=1.0, linestyle="--")
        axes.set(xscale="log", xlabel="RMS error / RMS claimed sigma; right of 1 the claim is too small")
        axes.xaxis.set_major_formatter("{x:g}")
        axes.set_yticks(range(len(names)), names)
        axes.set_ylim(len(names) - 0.5, -0.5)
        figure.legend(loc="outside upper center", ncols=3)
    write(figure, path)


def _ratio(row: dict[str, object]) -> float | None:
    """Error over claimed sigma, None where there is no claim."""
    if _missing(row["sigma_deg"]) or _missing(row["error_deg"]):
        return None
    return float(str(row["error_deg"])) / float(str(row["sigma_deg"]))


def on_page(page: str, rows: list[dict[str, object]], about: str) -> str:
    """The page with this table and origin between its marks."""
    for mark, text in (("table", table(rows)), ("origin", about)):
        pattern = re.compile(rf"(<!-- {mark}: [^\n]*-->\n).*?(<!-- end -->)", re.DOTALL)
        page, count = pattern.subn(lambda found, text=text: f"{found[1]}{text}{found[2]}", page)
        assert count == 1, f"the page has {count} places for {mark}"
    return page


def _installed(name: str) -> bool:
    """Whether a package is installed."""
    try:
        return bool(version(name))
    except PackageNotFoundError:
        return False


def _missing(value: object) -> bool:
    return value is None or bool(np.isnan(float(str(value))))


def main(words: list[str]) -> int:
    """Run every program on every set, and write league.csv and league.md."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks league", description="gyronorth beside its peers.")
    parser.add_argument("--runs", type=int, default=60, help="recordings of a set")
    parser.add_argument("--data", type=Path, help="folder of the real recordings, whose files REAL names")
    parser.add_argument("--output", type=Path, default=Path("out/league"), help="folder of league.csv and league.md")
    parser.add_argument("--page", action="store_true", help="write them into docs/results, and the picture")
    parser.add_argument(
        "--without",
        action="append",
        default=[],
        choices=list(PROGRAMS),
        help="leave a program out; with --page its rows stay as they are",
    )
    chosen = parser.parse_args(words)
    rows, about = [], origin(chosen.runs)  # of the files as they are when it starts
    before = {(one["set"], one["program"]): one for one in read_rows(PAGE.with_suffix("") / "league.csv")}
    real = real_sets(chosen.data) if chosen.data else []
    for data in [*sets(chosen.runs), *real]:
        for program in PROGRAMS:
            if program not in chosen.without:
                rows.append(row(data, program))
                print(rows[-1], flush=True)
            elif chosen.page and (data.name, program) in before:
                rows.append(before[data.name, program])
    if chosen.page and chosen.without:
        about = f"{about.rstrip()} Rows of {' and '.join(chosen.without)} as before.\n"
    output = PAGE.with_suffix("") if chosen.page else chosen.output
    output.mkdir(parents=True, exist_ok=True)
    with (output / "league.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    draw(rows, output / "league.png")
    if chosen.page:
        PAGE.write_text(on_page(PAGE.read_text(encoding="utf-8"), rows, about), encoding="utf-8")
    else:
        (output / "league.md").write_text(f"{table(rows)}\n{about}", encoding="utf-8")
    return 0
