"""The command line on recorded data: the heading that the author of the data found, and three refusals."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from gyronorth.cli import app

STIM300 = "--columns w_x=4,w_y=5,w_z=6,f_x=8,f_y=9,f_z=10 --rate 125 --gyro-unit deg/s --accel-unit g --axes flu"
DOT = "--rate 120 --gyro-unit deg/s --accel-unit m/s2 --axes flu --latitude 23.05"


def run(path, options):
    return CliRunner().invoke(app, ["heading", str(path), *options.split()])


@pytest.mark.slow
@pytest.mark.parametrize("window", ["0:1847", "0:300", "600:950", "1020:1500"])
def test_ring_laser_on_a_swaying_vehicle(real_data, window):
    options = f"--latitude 34.246048 --method inertial --json --window {window}"
    result = run(real_data / "lasergyro.imu", options)
    assert result.exit_code == 0
    assert json.loads(result.stdout)["heading_deg"] == pytest.approx(90.6, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "options", "rate_norm"),
    [
        ("stim300_cart_static_then_turn.mat", f"--latitude 41.8342 --window 0:78 {STIM300}", 254.5),
        ("xsens_mti_static.txt", "--latitude 23.05 --rate 100 --axes flu", 448.2),
        ("xsens_dot_static_dirty.csv", f"--drop-bad-rows {DOT}", None),
    ],
)
def test_large_bias_is_refused_with_its_figures(real_data, name, options, rate_norm):
    result = run(real_data / name, f"{options} --json")
    assert result.exit_code == 3
    doc = json.loads(result.stdout)
    reason = next(reason for reason in doc["reasons"] if reason["code"] == "rate_norm")
    assert reason["value"] > reason["limit"]
    assert f"{reason['value']:.2f}" in reason["message"]
    assert f"{reason['limit']:.2f}" in reason["message"]
    if rate_norm is not None:  # norm of the mean that the data's README gives
        assert doc["rate_norm_deg_h"] == pytest.approx(rate_norm, abs=0.5)


def test_dirty_file_is_an_error_that_names_the_rows(real_data):
    result = run(real_data / "xsens_dot_static_dirty.csv", DOT)
    assert result.exit_code == 2
    for words in ("Row 2 of xsens_dot_static_dirty.csv", "row 13003", "--drop-bad-rows"):
        assert words in result.output


def test_dropped_rows_are_reported(real_data):
    doc = json.loads(run(real_data / "xsens_dot_static_dirty.csv", f"--drop-bad-rows --json {DOT}").stdout)
    (warning,) = [warning for warning in doc["warnings"] if warning["code"] == "rows_dropped"]
    assert warning["value"] == 2
