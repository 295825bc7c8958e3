"""What stands there stays, unless it is told to go; names and texts from outside cannot steer a terminal or a sheet."""

import csv
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from cli.test_cli import run
from still import still

from gyronorth import write, write_sensor
from gyronorth.readers import recordings_in
from gyronorth.recording import Recording
from gyronorth.sensor import read_sensor

ESCAPE = "\x1b]0;owned\x07\x1b[31m"


@pytest.fixture(scope="module")
def rec(tmp_path_factory):
    path = tmp_path_factory.mktemp("overwriting") / "rec.csv"
    gyro, accel = still(2000)
    write(Recording(gyro, accel, 10.0, latitude=0.5), path)
    return path


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        ["convert", "{rec}", "-o", "{out}.csv"],
        ["simulate", "--sensor", "stim300", "--latitude", "48", "--heading", "1", "--duration", "5", "--rate", "10",
         "--seed", "1", "-o", "{out}.npz"],
        ["allan", "{rec}", "-o", "{out}.json"],
    ],
    ids=lambda command: command[0],
)  # fmt: skip
def test_a_work_that_exists_is_overwritten_on_request_alone(rec, tmp_path, command):
    command = [word.format(rec=rec, out=tmp_path / "out") for word in command]
    output = Path(command[command.index("-o") + 1])
    first = run(*command)
    assert (first.exit_code, first.stderr) == (0, f"wrote {output}\n")
    output.write_text("mine")
    output.chmod(0o640)
    refused = run(*command)
    assert refused.exit_code == 2
    assert "exists. Give another name, or --force to overwrite it" in refused.stderr
    assert output.read_text() == "mine"
    assert run(*command, "--force").exit_code == 0
    assert output.read_bytes()[:4] != b"mine"
    assert output.stat().st_mode & 0o777 == 0o640


@pytest.mark.slow
def test_tables_plots_and_reports_are_written_anew(rec, tmp_path, monkeypatch):
    monkeypatch.setattr("gyronorth.report.html.svg_text", lambda figure, salt: "")  # drawn in tests/report
    outputs = [str(tmp_path / name) for name in ("a.csv", "a.html")]
    for _ in range(2):
        result = run("heading", rec, "--sensor", "sdc500", "--csv", outputs[0], "--report", outputs[1])
        assert result.exit_code in (0, 3)
        assert result.stderr == f"wrote {outputs[1]}\nwrote {outputs[0]}\n"


def test_a_bundle_that_exists_is_not_trained_over(tmp_path):
    pytest.importorskip("torch")
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "bundle.json").write_text("{}")
    result = run("train", "denoiser", "-o", tmp_path / "b")
    assert result.exit_code == 2
    assert "exists. Give another name, or --force" in result.stderr


def test_ctrl_c_in_a_training_names_resume(tmp_path, monkeypatch):
    pytest.importorskip("torch")
    import gyronorth.learn.run

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(gyronorth.learn.run, "run_training", interrupted)
    result = run("train", "denoiser", "-o", tmp_path / "b")
    assert result.exit_code == 130
    assert "with --resume" in result.stderr


def test_names_and_headers_do_not_steer_the_terminal(rec, tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    shutil.copy(rec, folder / f"a{ESCAPE}\n.csv")
    (folder / f"b{ESCAPE}.csv").write_text(f"t,w_x\n0,{ESCAPE}\n")
    text = rec.read_text()
    shown = rec.with_name("session.csv")
    shown.write_text(text.replace("# rate_hz", f"# session: {ESCAPE}\u202e\n# rate_hz", 1))
    profile = tmp_path / "own.json"
    write_sensor(read_sensor("stim300"), profile)
    profile.write_text(profile.read_text().replace('"name": "', '"name": "\\u001b[2J'))
    for command in (
        ["heading", folder],
        ["info", folder / f"b{ESCAPE}.csv"],
        ["info", shown],
        ["heading", shown, "--sensor", profile],
        ["heading", folder / f"c{ESCAPE}.csv"],
    ):
        result = run(*command)
        printed = result.stdout + result.stderr
        assert printed
        assert "\x1b" not in printed
        assert "\x07" not in printed
        assert "\u202e" not in printed
        if "info" in command or "heading" in command:
            assert "\\x1b" in printed


def test_a_cell_that_begins_like_a_formula_is_a_text(rec, tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    shutil.copy(rec, folder / "=cmd|x.csv")
    table = tmp_path / "table.csv"
    run("heading", folder, "--csv", table)
    with table.open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert row["file"] == "'=cmd|x.csv"
    assert np.isfinite(float(row["sigma_deg"]))


def test_a_fault_in_one_file_is_its_row(rec, tmp_path, monkeypatch):
    folder = tmp_path / "folder"
    folder.mkdir()
    for name in ("a.csv", "b.csv"):
        shutil.copy(rec, folder / name)
    from gyronorth import readers

    whole = readers.read

    def read(path, *rest, **declared):
        if path.name == "a.csv":
            raise IndexError("deep inside")
        return whole(path, *rest, **declared)

    monkeypatch.setattr(readers, "read", read)
    result = run("heading", folder)
    assert result.exit_code == 2
    assert "a fault of gyronorth, please report it: IndexError: deep inside" in result.stdout
    assert len([line for line in result.stdout.splitlines() if line.startswith(("a.csv", "b.csv"))]) == 2


@pytest.mark.parametrize(
    "command",
    [
        ["heading", "loop.csv", "--latitude", "32"],
        ["heading", "{rec}", "--csv", "nowhere/out.csv"],
        ["heading", "{rec}", "--csv", "/dev/full"],
        ["heading", "{rec}", "--preset", "deep.json"],
        ["heading", "{rec}", "--preset", "/dev/zero"],
        ["heading", "{rec}", "--deviation", "/dev/zero"],
        ["heading", "{rec}", "--boresight", "1e300,0,0"],
        ["heading", "/dev/zero", "--latitude", "32"],
        ["allan", "tiny.csv"],
        ["heading", "slow.csv", "--latitude", "32"],
        ["live", "-", "--config", "/dev/zero"],
        ["live", "-", "--config", "loop.csv"],
    ],
    ids=lambda command: " ".join(command),
)
def test_places_and_numbers_of_ill_will_end_in_one_message(rec, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    Path("loop.csv").symlink_to("loop.csv")
    Path("deep.json").write_text("[" * 100_000)
    gyro, accel = still(200)
    write(Recording(gyro * 1e-310, accel, 10.0), "tiny.csv")
    rows = np.column_stack([np.arange(200) * 1e-321, gyro, accel])
    np.savetxt("slow.csv", rows, delimiter=",", header="t,w_x,w_y,w_z,f_x,f_y,f_z", comments="", fmt="%.17g")
    result = run(*[word.format(rec=rec) for word in command])
    assert (result.exit_code, "Traceback" in result.output) == (2, False)


def test_a_folder_of_links_to_what_never_ends_comes_to_an_end(rec, tmp_path):
    (tmp_path / "a.csv").symlink_to(rec)
    for name, target in (("loop.csv", "loop.csv"), ("gone.csv", "nowhere"), ("zero.csv", "/dev/zero")):
        (tmp_path / name).symlink_to(target)
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "piped.csv").symlink_to("pipe.csv")
    assert [path.name for path in recordings_in(tmp_path)] == ["a.csv", "gone.csv", "loop.csv"]
    assert run("heading", tmp_path, "--csv", tmp_path / "out.csv").exit_code == 2
    rows = csv.DictReader((tmp_path / "out.csv").read_text().splitlines())
    assert [row["file"] for row in rows] == ["a.csv", "gone.csv", "loop.csv"]
