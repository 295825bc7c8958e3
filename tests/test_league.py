"""The league: its own counting against what is worked by hand, and every program that runs in little time."""

import re
from dataclasses import replace

import numpy as np
import pytest
from benchmarks import league

from gyronorth.angles import angle_error
from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY
from gyronorth.pipeline import heading_batch
from gyronorth.sensor import read_sensor


def at_rest(heading_deg, seconds=4):
    """Recordings without error at 45 N, level, at 2 Hz."""
    heading = np.radians(np.asarray(heading_deg, dtype=float))
    north = EARTH_RATE * np.cos(np.pi / 4)
    down = np.full(len(heading), -EARTH_RATE * np.sin(np.pi / 4))
    rate = np.stack([north * np.cos(heading), -north * np.sin(heading), down], axis=-1)
    gyro_b = np.repeat(rate[:, None], 2 * seconds, axis=1)
    accel_b = np.broadcast_to([0.0, 0.0, -STANDARD_GRAVITY], gyro_b.shape)
    return league.Recordings("rest", read_sensor("sdc500"), np.pi / 4, 2.0, gyro_b, accel_b, heading)


@pytest.mark.parametrize("program", ["numpy script", "ahrs TRIAD"])
def test_a_recording_without_error_gives_its_heading(program):
    if "ahrs" in program:
        pytest.importorskip("ahrs", reason="ahrs comes with the extra dev")
    data = at_rest([0, 75, 200, 359])
    answer = league.PROGRAMS[program](data)
    np.testing.assert_allclose(np.cos(answer.heading - data.heading), 1, atol=1e-12)


def test_a_row_counts_errors_claims_and_refusals():
    data = at_rest([10, 20, 350, 90])

    def program(data):
        heading = data.heading + np.radians([3, -3, 3, np.nan][: len(data.heading)])
        return league.claimed(data, heading, np.radians([2.0, 2.0, 1.0, 1.0][: len(data.heading)]))

    league.PROGRAMS["test"] = program
    try:
        row = league.row(data, "test")
    finally:
        del league.PROGRAMS["test"]
    assert row["error_deg"] == pytest.approx(3)
    assert row["sigma_deg"] == pytest.approx(np.sqrt(3))
    assert row["truth_in_95"] == pytest.approx(2 / 3)
    assert row["refused"] == pytest.approx(1 / 4)
    line = league.table([row]).splitlines()[-1]
    assert line.startswith("| **rest** (4) | test | 3.00 | 1.73 | 67 % | 25 % |")
    fewer = league.table([row, {**row, "program": "slow", "recordings": 2}]).splitlines()[-1]
    assert fewer.startswith("|  | slow (first 2) | 3.00 |")


def test_the_sets_are_those_of_their_seed():
    pair = [league.sets(2) for _ in range(2)]
    assert [data.name for data in pair[0]] == ["isa100c", "sdc500", "stim300", "published"]
    for one, other in zip(*pair, strict=True):
        np.testing.assert_array_equal(one.gyro_b, other.gyro_b)
        assert len(one.heading) == 2


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The copy keyword is deprecated")  # python-ins with pandas 3
@pytest.mark.parametrize(
    "program", [pytest.param(name, marks=[pytest.mark.long] * ("filter" in name)) for name in league.PROGRAMS]
)
def test_every_program_answers(program):
    for package, names in {"navtk": "navtk", "pyins": "python-ins", "ahrs": "ahrs"}.items():
        if names in program:
            pytest.importorskip(package, reason=f"{names} comes with the extra dev")
    data = league.first(league.sets(1)[0], 1)
    short = slice(None, 200 if "python" in program else None)
    data = replace(data, gyro_b=data.gyro_b[:, short], accel_b=data.accel_b[:, short])
    row = league.row(data, program)
    assert row["recordings"] == 1
    assert row["error_deg"] < 20


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["StaticAlignment", "StaticWahbaAlignment"])
def test_the_closed_form_agrees_with_navtoolkit(kind):
    """Another program's heading of the same samples, of which it leaves out the last: it is then aligned."""
    pytest.importorskip("navtk", reason="navtk comes with the extra dev")
    data = league.first(league.sets(4)[0], 4)
    theirs = league.navtk(kind)(data).heading
    gyro_b, accel_b = data.gyro_b[:, :-1], data.accel_b[:, :-1]
    ours = heading_batch(
        gyro_b, accel_b, rate_hz=data.rate_hz, latitude=data.latitude, sensor=data.sensor, method="mean"
    )
    assert np.abs(angle_error(theirs, ours.heading)).max() < 1e-5


def test_seed_and_versions_stand_below_the_table():
    assert "Seed 20261128, 60 recordings of a simulated set, commit " in league.origin(60)
    assert f"numpy {np.__version__}" in league.origin(60)


def test_real_recordings_are_cut_into_pieces(real_data):
    swaying, parked = league.real_sets(real_data)
    assert swaying.gyro_b.shape == swaying.accel_b.shape == (18, 1000, 3)
    assert parked.gyro_b.shape == (2, 1000, 3)
    assert np.degrees(swaying.heading) == pytest.approx(90.6)


def rows_of_the_page():
    """The rows of docs/results/league/league.csv, as the command made them."""
    return league.read_rows(league.PAGE.with_suffix("") / "league.csv")


def test_the_page_shows_the_table_of_its_data():
    page = league.PAGE.read_text(encoding="utf-8")
    shown = re.search(r"<!-- table: [^\n]*-->\n(.*?)<!-- end -->", page, re.DOTALL)[1]
    assert shown == league.table(rows_of_the_page())
    assert "-dirty" not in page


def test_what_the_page_says_in_words_is_what_its_data_say():
    page = " ".join(league.PAGE.read_text(encoding="utf-8").split())
    rows = {(row["set"], row["program"]): row for row in rows_of_the_page()}
    swaying = {name: row for (data, name), row in rows.items() if "swaying" in data}
    ours = swaying.pop("gyronorth")
    said = re.search(r"the others are ([\d.]+) to ([\d.]+) deg off and claim at most ([\d.]+) deg", page)
    errors = [row["error_deg"] for row in swaying.values()]
    claimed = [row["sigma_deg"] for row in swaying.values() if not np.isnan(row["sigma_deg"])]
    assert [float(number) for number in said.groups()] == [
        round(min(errors), 1),
        round(max(errors), 1),
        round(max(claimed), 2),
    ]
    said = re.search(r"gyronorth is ([\d.]+) deg off and claims ([\d.]+) deg", page)
    assert [float(number) for number in said.groups()] == [round(ours["error_deg"], 1), round(ours["sigma_deg"], 1)]
    plain = ["navtk StaticAlignment", "navtk StaticWahbaAlignment", "ahrs TRIAD", "numpy script"]
    apart = [
        abs(rows[data, name]["error_deg"] / rows[data, "gyronorth"]["error_deg"] - 1)
        for data in ("isa100c", "sdc500", "stim300", "published")
        for name in plain
    ]
    assert max(apart) <= float(re.search(r"within (\d+) % of its error", page)[1]) / 100
    held = [row["truth_in_95"] for (_, name), row in rows.items() if name == "gyronorth"]
    assert min(held) >= 0.89


def test_a_page_without_its_marks_is_left_alone():
    with pytest.raises(AssertionError, match="0 places for table"):
        league.on_page("no table here", [], "")


@pytest.mark.slow
def test_the_picture_has_a_mark_for_each_claim(tmp_path):
    league.draw(rows_of_the_page(), tmp_path / "league.png")
    assert (tmp_path / "league.png").stat().st_size > 10_000
