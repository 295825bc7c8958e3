"""gyronorth import: what is shown, asked, written and refused."""

from __future__ import annotations

import json

import numpy as np
import pytest
from cases.layouts import ACCEL, DPS, GYRO, HEADING, LAYOUTS, OURS, TIME, text
from numpy.testing import assert_allclose
from typer.testing import CliRunner

from gyronorth import read
from gyronorth.cli import app, import_command

RUN = CliRunner()
RFU = [1, 0, 2], np.array([1, 1, -1])


def run(*arguments, answers=None):
    return RUN.invoke(app, ["import", *map(str, arguments)], input=answers, catch_exceptions=False)


@pytest.fixture
def unstated(tmp_path):
    """Right-forward-up, and nothing in the file says so."""
    order, signs = RFU
    columns = (TIME, *(DPS[:, order] * signs).T, *(ACCEL[:, order] * signs).T)
    path = tmp_path / "raw.csv"
    path.write_bytes(text([OURS], columns))
    return path


def test_with_axes_and_yes_it_writes_what_states_everything(tmp_path, unstated):
    result = run(unstated, "--yes", "--axes", "rfu", "--latitude", 48, "-o", tmp_path / "out.csv")
    assert result.exit_code == 0
    assert "read as" in result.stdout
    assert "gravity     norm 9.80" in result.stdout
    assert "unit confirmed; latitude by the vertical part 4" in result.stdout
    assert "taken: --gyro-unit deg/s --accel-unit m/s2" in result.stdout
    recording = read(tmp_path / "out.csv")
    assert_allclose(recording.gyro_b, GYRO, atol=1e-11)  # ten digits of deg/s
    assert np.degrees(recording.latitude or 0) == pytest.approx(48)


def test_without_axes_it_shows_the_headings_that_gravity_allows_and_writes_nothing(tmp_path, unstated):
    result = run(unstated, "--yes", "-o", tmp_path / "out.csv")
    assert result.exit_code == 2
    assert f"rfu  +y points forward: heading {np.degrees(HEADING):.0f}" in result.stdout.replace("59.", "60.")
    assert "--axes flu or rfu or bru or lbu" in result.stderr
    assert not (tmp_path / "out.csv").exists()


def test_without_yes_nothing_is_taken_where_nobody_can_be_asked(unstated):
    result = run(unstated, "--axes", "rfu")
    assert result.exit_code == 2
    assert result.stderr.endswith(f"Try: gyronorth import {unstated} --axes rfu --gyro-unit deg/s --accel-unit m/s2\n")


def test_in_a_terminal_it_asks(tmp_path, unstated, monkeypatch):
    monkeypatch.setattr(import_command, "_can_ask", lambda: True)
    result = run(unstated, "-o", tmp_path / "out.csv", "--save-preset", tmp_path / "mine", answers="\n\nrfu\n")
    assert result.exit_code == 0
    assert_allclose(read(tmp_path / "out.csv").accel_b, ACCEL, atol=1e-6)
    preset = json.loads((tmp_path / "mine.json").read_text())
    assert preset == {
        "title": "files like raw.csv", "gyro_unit": "deg/s", "accel_unit": "m/s2", "axes": "rfu",
    }  # fmt: skip
    assert_allclose(read(unstated, preset=str(tmp_path / "mine.json")).gyro_b, GYRO, atol=1e-11)


def test_what_physics_does_not_tell_is_not_taken_by_yes(tmp_path):
    layout = next(each for each in LAYOUTS if each.name == "no_time.csv")
    path = tmp_path / layout.name
    path.write_bytes(layout.content)
    result = run(path, "--yes", "--axes", "frd")
    assert (result.exit_code, result.stderr.count("--rate HZ")) == (2, 2)
    # A gyro whose bias hides Earth rate: the likeliest unit is proposed, and not taken.
    path.write_bytes(text([OURS], (TIME, *(DPS + 0.4).T, *ACCEL.T)))
    result = run(path, "--yes", "--axes", "frd")
    assert result.exit_code == 2
    assert "Try: gyronorth import" in result.stderr


def test_nothing_is_overwritten_without_force(tmp_path, unstated):
    taken = tmp_path / "raw-imported.csv"
    taken.write_text("mine")
    result = run(unstated, "--yes", "--axes", "rfu")
    assert (result.exit_code, taken.read_text()) == (2, "mine")
    assert "exists. Give another name" in result.stderr
    assert run(unstated, "--yes", "--axes", "rfu", "--force").exit_code == 0
    assert len(read(taken).gyro_b) == len(GYRO)
