"""`benchmark real`: its list, its units, and a few of its figures where the recordings are."""

import json
from dataclasses import replace

import pytest
from typer.testing import CliRunner

from gyronorth.cli import app
from gyronorth.errors import InputError
from gyronorth.sensor import sensor_names
from gyronorth.studies import real
from gyronorth.studies.study import StudyPlan, write_study


def test_every_recording_has_an_origin_and_every_profile_is_shipped():
    stems = [origin.files.split("*")[0] for origin in real.ORIGINS]
    for case in real.CASES.values():
        assert all(any(file.startswith(stem) for stem in stems) for file in case.files)
        assert set(case.profiles) <= set(sensor_names())
        assert len(case.windows) == len(case.files)


def test_without_the_recordings_it_says_where_they_should_be(monkeypatch, tmp_path):
    monkeypatch.delenv(real.VARIABLE, raising=False)
    with pytest.raises(InputError, match="--data FOLDER, or in GYRONORTH_REAL_DATA"):
        real.REAL.units(StudyPlan())
    found = CliRunner().invoke(app, ["benchmark", "real", "-o", str(tmp_path / "out"), "--data", str(tmp_path)])
    assert found.exit_code == 2
    assert "lacks blueseis_tilt_20_80.csv" in str(found.exception) + found.output
    assert not (tmp_path / "out").exists()


def test_a_recording_that_changed_is_told(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("w_x,w_y,w_z\n")
    with pytest.raises(InputError, match="has changed"):
        real.judge(
            folder=str(tmp_path), file="a.csv", sha256="0", window=None, latitude_deg=0.0, sensor=None, method="mean",
            truth_deg=None, reading=None,
        )  # fmt: skip


def test_rows_of_valid_and_refused_windows():
    """RMS and coverage of what is valid; a refused one counts, and its reason is told."""
    good = {"valid": True, "reasons": [], "error_deg": 3.0, "sigma_deg": 4.0, "half_deg": 8.0, "inside": True}
    far = {**good, "error_deg": -4.0, "sigma_deg": 3.0, "half_deg": 2.0, "inside": False}
    refused = {**good, "valid": False, "reasons": ["too_noisy"], "error_deg": 90.0}
    row = real.row_of("car", "auto", [good, far, refused])
    assert row[2:5] == (3, 2, 1)
    assert row[5:] == (pytest.approx(12.5**0.5), 4.0, pytest.approx(12.5**0.5), 5.0, "too_noisy")


@pytest.mark.slow
def test_study_on_two_recordings(real_data, monkeypatch, tmp_path):
    """A car that must have its heading, and a cart that must be refused; the folder's name is in no output."""
    monkeypatch.setenv(real.VARIABLE, str(real_data))
    names = ("car, 100 s", "cart with a bias of 200 deg/h")
    monkeypatch.setattr(
        real, "CASES", {name: replace(real.CASES[name], methods=("mean", "inertial")) for name in names}
    )
    plan = StudyPlan()
    results = {job.name: job.function(**job.arguments) for job in real.REAL.units(plan)}
    table = write_study(real.REAL, plan, results, tmp_path, command="c").tables[0]
    rows = {(row[0], row[1]): row for row in table.rows}
    assert rows[names[0], "inertial, sdc500"][2:5] == (2, 2, 2)
    assert rows[names[0], "inertial, sdc500"][5] < 4 < 15 < rows[names[0], "mean, sdc500"][5]
    assert rows[names[1], "mean, stim300"][2:4] == (1, 0)
    assert "rate_norm" in rows[names[1], "mean, stim300"][-1]
    content = json.loads((tmp_path / "real.json").read_text())
    assert set(content["recordings"]) == {"kingston_100_200.csv", "kingston_300_400.csv", *real.CASES[names[1]].files}
    assert str(real_data) not in (tmp_path / "real.json").read_text() + (tmp_path / "real.md").read_text()
