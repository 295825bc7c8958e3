"""Presets: what is shipped, what is saved, what overrules what. Their files are read in tests/cases."""

from __future__ import annotations

import json

import pytest
from numpy.testing import assert_allclose
from still import csv_file, rows_of, still

from gyronorth.errors import InputError
from gyronorth.readers import ReadOptions, describe, read
from gyronorth.readers.presets import document, load, matching, shipped

TITLES = ("angular_velocity.x", "angular_velocity.y", "angular_velocity.z")


def test_the_shipped_presets():
    named = {preset.name for preset in shipped()}
    assert named >= {
        "euroc", "rostopic", "kf-gins", "psins", "navego", "xsens-mt", "xsens-dot", "vectornav", "sensorconnect",
        "phyphox-gyroscope", "sensor-logger", "gnss-logger", "gnss-ins-sim", "px4", "ros-csv",
    }  # fmt: skip
    for preset in shipped():
        assert {"w_x", "w_y", "w_z"} <= set(preset.declared["columns"])
        assert preset.declared["gyro_unit"]
        assert load(preset.name) == preset


def test_the_preset_with_most_of_the_titles_applies():
    assert matching(TITLES, "", "a.csv").name == "ros-csv"
    assert matching(TITLES[:2], "", "a.csv") is None
    wanted = ("time", "seconds_elapsed", "z", "y", "x")
    assert matching(wanted, "", "Gyroscope.csv").name == "sensor-logger"
    assert matching(wanted, "", "Accelerometer.csv") is None


def ros_file(tmp_path, **kwargs):
    rows = rows_of([*still(300)])
    header = ",".join((*TITLES, *(f"linear_acceleration.{a}" for a in "xyz")))
    return csv_file(tmp_path, rows, comments=[], header=header, **kwargs)


def test_what_a_preset_says_unasked_is_usual_and_a_declaration_overrules_it(tmp_path):
    path = ros_file(tmp_path)
    assert_allclose(read(path, rate_hz=100).gyro_b, still(300)[0])
    read_as = describe(path, rate_hz=100).info.read_as
    assert read_as.startswith("sensor_msgs/Imu as CSV")
    with pytest.raises(InputError, match="--gyro-unit"):  # found out: Earth rate tells
        read(path, rate_hz=100, gyro_unit="deg/s")


def test_a_preset_that_was_saved_is_read_again(tmp_path):
    options = ReadOptions(rate_hz=100, axes="flu", gyro_unit="rad/s", accel_unit="m/s2", columns={"t": "-"})
    path = tmp_path / "mine.json"
    path.write_text(document(options, "mine"))
    assert load(str(path)).onto(ReadOptions()) == options
    # What is declared beside it counts, column by column.
    with_it = load(str(path)).onto(ReadOptions(axes="rfu", columns={"w_x": "gx"}))
    assert (with_it.axes, with_it.gyro_unit, dict(with_it.columns or {})) == ("rfu", "rad/s", {"t": "-", "w_x": "gx"})
    assert describe(ros_file(tmp_path), preset=str(path)).info.axes == "flu"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("nothing", "is no preset"),
        ("[1]", "a JSON object is expected"),
        (json.dumps({"gyro": "deg/s"}), "holds gyro; the keys of a preset are title"),
        (json.dumps({"gyro_unit": "deg"}), "gyro_unit is 'deg'"),
        (json.dumps({"columns": 5}), "is no preset"),
        (json.dumps({"columns": 0}), "is no preset: columns is an object"),
        (json.dumps({"gyro_scale": 10**400}), "gyro_scale is beyond 1.8e308; a number is expected"),
        (json.dumps({"gyro_scale": 1e300}), r"gyro_scale is above 1e\+30"),
        (json.dumps({"rate_hz": 10**400}), "rate_hz is beyond 1.8e308; a number is expected"),
        (json.dumps({"only": [1]}), "is no preset"),
    ],
)
def test_files_that_are_no_presets(tmp_path, content, message):
    path = tmp_path / "mine.json"
    path.write_text(content)
    with pytest.raises(InputError, match=message):
        load(str(path))


def test_a_name_that_is_none():
    with pytest.raises(InputError, match=r"There is no preset 'eurok'; shipped are euroc, .* Did you mean 'euroc'\?"):
        load("eurok")
