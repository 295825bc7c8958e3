"""The league: its own counting against what is worked by hand, and every program that runs in little time."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks import league

from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY
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
    assert line.startswith("| **rest** (4) | test | 3 | 1.73 | 67 % | 25 % |")
    fewer = league.table([row, {**row, "program": "slow", "recordings": 2}]).splitlines()[-1]
    assert fewer.startswith("|  | slow (first 2) | 3 |")


def test_the_sets_are_those_of_their_seed():
    pair = [league.sets(2) for _ in range(2)]
    assert [data.name for data in pair[0]] == ["isa100c", "sdc500", "stim300", "published"]
    for one, other in zip(*pair, strict=True):
        np.testing.assert_array_equal(one.gyro_b, other.gyro_b)
        assert len(one.heading) == 2


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


def test_seed_and_versions_stand_below_the_table():
    assert "Seed 20261128, 60 recordings of a simulated set, commit " in league.origin(60)
    assert f"numpy {np.__version__}" in league.origin(60)


def test_real_recordings_are_cut_into_pieces(real_data):
    swaying, parked = league.real_sets(real_data)
    assert swaying.gyro_b.shape == swaying.accel_b.shape == (18, 1000, 3)
    assert parked.gyro_b.shape == (2, 1000, 3)
    assert np.degrees(swaying.heading) == pytest.approx(90.6)
