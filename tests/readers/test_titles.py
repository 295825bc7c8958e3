"""What titles and units say; the table of the guide is read line by line."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from gyronorth.readers.options import ACCEL_UNITS, GYRO_UNITS, TIME_UNITS
from gyronorth.readers.spellings import ACCEL_SPELLINGS, GYRO_SPELLINGS, TIME_SPELLINGS, is_unit, spelled
from gyronorth.readers.titles import take_apart, triples

GUIDE = Path(__file__).parents[2] / "docs/guide/files.md"


@pytest.mark.parametrize(
    ("title", "kind", "axis", "unit"),
    [
        ("gyro_x", "gyro", 0, None), ("wx", "gyro", 0, None), ("GyroX", "gyro", 0, None), ("Gyr_Z", "gyro", 2, None),
        ("Gyro X (deg/s)", "gyro", 0, "deg/s"), ("angular_velocity.x", "gyro", 0, None), ("gz_dps", "gyro", 2, "deg/s"),
        ("GYR_Y[°/s]", "gyro", 1, "deg/s"), ("gyro_x_rads", "gyro", 0, "rad/s"), ("x_gyro", "gyro", 0, None),
        ("acc_x [m/s^2]", "accel", 0, "m/s2"), ("Accel_Z(g)", "accel", 2, "g"), ("ay", "accel", 1, None),
        ("specific_force_y (mg)", "accel", 1, "mg"), ("linear_acceleration.z", "accel", 2, None),
        ("mag_x", "", 0, None), ("gyro_bias_x", "", 0, None), ("field.angular_velocity_covariance0", "", 0, None),
        ("accel_std_z", "", 2, None), ("temperature", "", None, None), ("Roll (deg)", "", None, None),
        ("Time (ms)", "time", None, "ms"), ("timestamp [ns]", "time", None, "ns"), ("t_us", "time", None, "us"),
        ("week", "week", None, None), ("PacketCounter", "counter", None, None), ("yawrate", "gyro", 2, None),
    ],
)  # fmt: skip
def test_a_title_is_taken_apart(title, kind, axis, unit):
    found = take_apart(title)
    assert (found.kind, found.axis, found.unit) == (kind, axis, unit)


@pytest.mark.parametrize(
    ("title", "unit"), [("delta_theta_x (rad)", "rad/s"), ("dvel_y [m/s]", "m/s2"), ("DeltaAngle_z (deg)", "deg/s")]
)
def test_increments_have_the_unit_of_their_sum_over_a_second(title, unit):
    found = take_apart(title)
    assert (found.increments, found.unit) == (True, unit)


def test_an_angle_without_a_second_is_no_rate():
    assert take_apart("gyro_x (rad)").unit is None
    assert take_apart("gyro_rad[0]").unit is None


@pytest.mark.parametrize("table", [GYRO_SPELLINGS, ACCEL_SPELLINGS, TIME_SPELLINGS])
def test_every_unit_is_one_that_can_be_declared_and_spells_itself(table):
    known = {**GYRO_UNITS, **ACCEL_UNITS, **TIME_UNITS}
    for unit, spellings in table.items():
        assert unit in known
        assert all(spelled(spelling, table) == unit for spelling in spellings)
    flat = [spelling.replace("^", "") for spellings in table.values() for spelling in set(spellings)]
    other = {spelling: unit for unit, spellings in table.items() for spelling in spellings}
    assert all(spelled(spelling, table) == other.get(spelling, spelled(spelling, table)) for spelling in flat)


def test_a_row_of_units():
    assert all(map(is_unit, ["(s)", "[deg/s]", "m/s²", "", "°/s", "-", "degC", "counts"]))
    assert not any(map(is_unit, ["GyroX", "0.1", "time", "x"]))


def test_triples_differ_in_their_axis_alone():
    titles = ["t", "w1", "w2", "w3", "g0", "g1", "g2", "a_x", "a_y", "acc_z"]
    found = triples(titles, [take_apart(title) for title in titles])
    assert [(each.kind, each.positions) for each in found] == [("gyro", (1, 2, 3)), ("gyro", (4, 5, 6))]
    assert found[0].label == "w1..3"


def test_the_table_of_the_guide():
    """| gyro | `gyro_x`, `wx` | rad/s: `rad/s`, ... |: each title is of the kind that its line says."""
    kinds = {"angular rate": "gyro", "specific force": "accel", "time": "time"}
    rows = re.findall(r"^\| (angular rate|specific force|time) \| ([^|]*) \|", GUIDE.read_text(), re.M)
    assert {kind for kind, _ in rows} == set(kinds)
    for kind, examples in rows:
        titles = re.findall(r"`([^`]+)`", examples)
        assert len(titles) > 3
        assert all(take_apart(title).kind == kinds[kind] for title in titles), titles
