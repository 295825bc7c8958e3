"""Every file that people have reported gives its right value or behaviour, at the first try or by its line `Try:`."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from cases.layouts import FRD
from cases.made import ALL, DPS, HEADING, LATITUDE, SHORT, TEXTS
from cases.made_boxes import BAG_ROWS, BOXES, SHEET_ROWS, write_bags
from cases.running import RUN, followed, info
from numpy.testing import assert_allclose

from gyronorth import heading
from gyronorth.cli import app
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.readers import read

#: deg/h: the second half of a recording, and one at another rate, have a noise of their own.
NEAR = 0.1
RFU, FLU = ("--axes", "rfu"), ("--axes", "flu")


@dataclass(frozen=True)
class Case:
    """What must become of a file."""

    name: str
    options: tuple[str, ...] = FRD
    asks: bool = False
    fill: tuple[tuple[str, str], ...] = ()
    accel: bool = True
    rows: int = SHORT
    rate_hz: float = 100.0
    beside: tuple[str, ...] = ()  # files that lie beside it
    notes: tuple[str, ...] = ()
    missing: int = 0  # samples in gaps


COUNT = (("DEG_PER_S_IN_ONE_COUNT", f"{1 / 36000:.12g}"),)
RATE = (("HZ", "100"),)
CASES = [
    *(Case(name) for name in ("base.csv", "utf16.csv", "latin1_degree.csv", "crcrlf.csv", "blank_between.csv")),
    *(Case(name) for name in ("footer.csv", "header_units_dps.csv", "header_units_row.csv", "sensorconnect.csv")),
    *(Case(name) for name in ("us_px4.csv", "base.csv.gz", "navego.mat", "kfgins.bin")),
    *(Case(name, asks=True) for name in ("tabs.txt", "spaces.txt", "semicolon.csv", "semicolon_comma.csv", "iso.csv")),
    *(Case(name, asks=True) for name in ("preamble.csv", "percent.txt", "kfgins.txt", "gps_week_sow.csv")),
    *(Case(name, asks=True) for name in ("separate.mat", "transposed.mat", "ascii.mat", "array.npy", "named.npy")),
    *(Case(name, asks=True) for name in ("foreign.npz", "arcsec_increments.csv", "mg.csv", "mdps_mg.csv")),
    *(Case(name, asks=True) for name in ("stim_mixed.csv", "decimated_increments.csv")),
    Case("euroc_ns.csv", rows=ALL),
    Case("euroc_ns_gap.csv", asks=True, rows=ALL, missing=500, notes=("gaps_bridged",)),
    Case("ms_1khz.csv", asks=True, rows=30_000, rate_hz=1000.0),
    Case("ms_1khz_time.csv", asks=True, rows=30_000, rate_hz=1000.0),
    Case("week_wrap.csv", rows=ALL, notes=("time_wraps",)),
    Case("stall_20ms.csv", rows=ALL, notes=("time_jitter",)),
    Case("stall_20ms_increments.csv", rows=ALL, asks=True, notes=("time_jitter",)),
    Case("vn100_bursts.csv", rows=ALL, notes=("time_jitter",)),
    Case("zed_pairs.csv", rows=ALL, notes=("time_jitter",)),
    Case("zed_duplicates.csv", rows=ALL),
    Case("clock_restart.csv", asks=True, rows=6_000),
    Case("sensorlogger_Gyroscope.csv", FLU, accel=False),
    Case("gsdc_device_imu.csv", FLU),
    Case("gyro-0.csv", asks=True, fill=RATE, beside=("accel-0.csv",)),
    Case("phone_export.zip", asks=True, fill=RATE),
    Case("vnimu.txt", asks=True, fill=RATE),
    Case("counts.csv", asks=True, fill=COUNT),
    Case("psins_trj.mat", (), notes=("axes_assumed",)),
    Case("span.asc", (), notes=("rate_conflict",)),
    Case("zup_undeclared.csv", RFU, asks=True),
    Case("sheet.xlsx", asks=True, rows=SHEET_ROWS),
    Case("novatel_rfu.bag", RFU, rows=BAG_ROWS),
    Case("realsense_two_topics.bag", (), rows=BAG_ROWS, notes=("axes_assumed",)),
    Case("zr300_interleaved.bag", (), rows=BAG_ROWS, notes=("axes_assumed",)),
]


@pytest.fixture(scope="session")
def bags(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bags")
    write_bags(folder)
    return folder


@pytest.fixture
def place(tmp_path: Path, request: pytest.FixtureRequest):
    """Where a file lies, once it is written."""

    def put(name: str) -> Path:
        if name.endswith(".bag"):
            return request.getfixturevalue("bags") / name
        (tmp_path / name).write_bytes((TEXTS | BOXES)[name]())
        return tmp_path / name

    return put


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_file_gives_its_value(place, case):
    path = place(case.name)
    for name in case.beside:
        place(name)
    result = info([str(path), *case.options])
    if case.asks:
        result = followed(result, dict(case.fill))
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    assert found["samples"] == case.rows
    assert found["rate_hz"] == pytest.approx(case.rate_hz, rel=1e-5)
    assert found["duration_s"] == pytest.approx(case.rows / case.rate_hz, abs=0.02)
    assert sum(gap["samples"] for gap in found["gaps"]) == case.missing
    assert_allclose(found["rate_mean_deg_h"], DPS[: case.rows].mean(axis=0) * 3600, atol=NEAR)
    assert (found["force_mean_m_s2"] is not None) == case.accel
    if case.accel:
        assert_allclose(found["force_mean_m_s2"], [0, 0, -STANDARD_GRAVITY], atol=1e-3)
    assert [note["code"] for note in found["notes"]] == list(case.notes)


REFUSED = [
    ("drive_dps.csv", FRD, "it moves"),
    ("dict.pkl", FRD, "pickled Python objects"),
    ("duro_counts.bag", (), "4096"),
    ("oem7_half.bag", (), "4.903 m/s^2"),
    ("zup_undeclared.csv", ("--gyro-unit", "deg/s", "--accel-unit", "m/s2"), "--axes"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "options", "says"), REFUSED, ids=[name for name, *_ in REFUSED])
def test_a_file_is_refused_with_its_cause(place, name, options, says):
    command = "heading" if name == "zup_undeclared.csv" else "info"
    where = ("--latitude", "48") if command == "heading" else ()
    result = RUN.invoke(app, [command, str(place(name)), *options, *where], catch_exceptions=False)
    assert result.exit_code != 0
    assert says in result.output + result.stderr


def test_six_positions_are_accepted_by_the_norm_of_each(place):
    result = followed(info([str(place("six_poses.csv")), *FRD]), {})
    assert json.loads(result.stdout)["samples"] == 6000


def test_no_conversion_states_axes_that_nobody_declared(place, tmp_path):
    units = ("--gyro-unit", "deg/s", "--accel-unit", "m/s2")
    result = RUN.invoke(app, ["convert", str(place("zup_undeclared.csv")), str(tmp_path / "out.csv"), *units])
    assert result.exit_code == 2 or b"# axes:" not in (tmp_path / "out.csv").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize(("name", "axes"), [("base.csv", None), ("novatel_rfu.bag", "rfu")])
def test_the_heading(place, name, axes):
    estimate = heading(read(place(name), axes=axes, latitude=LATITUDE), method="mean")
    assert estimate.valid
    assert estimate.heading == pytest.approx(HEADING, abs=np.radians(0.5))


def test_the_table_is_whole():
    there = {case.name for case in CASES} | {name for name, *_ in REFUSED} | {"accel-0.csv", "six_poses.csv"}
    assert set(TEXTS) | set(BOXES) <= there
