"""Many headings: the same table whoever made it, wherever it was interrupted."""

from __future__ import annotations

import csv
import json
import os
import random
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from math import radians
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import gyronorth as gn
from gyronorth.cli import app
from gyronorth.errors import InputError
from gyronorth.many import Request
from gyronorth.many.table import table
from gyronorth.readers import ReadOptions
from gyronorth.report.tables import Outcome

RATE_HZ = 10.0


def write_recordings(folder: Path, count: int, *, duration: float = 20.0) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(16)
    paths = [folder / f"x_{number}.csv" for number in range(count)]
    for path in paths:
        gn.write(
            gn.simulate(
                "hg9900",
                latitude=radians(32.0),
                heading=rng.uniform(0, 2 * np.pi),
                duration=duration,
                rate_hz=RATE_HZ,
                rng=rng,
            ),
            path,
        )
    return paths


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    folder = tmp_path_factory.mktemp("many") / "rec"
    write_recordings(folder, 6)
    (folder / "bad.csv").write_text("t,w_x,w_y,w_z\n0,a,b,c\n")
    return folder


@pytest.fixture
def here(recordings, tmp_path, monkeypatch):
    shutil.copytree(recordings, tmp_path / "rec")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*arguments):
    return CliRunner().invoke(app, ["heading", *map(str, arguments), "--sensor", "hg9900"])


def rows(path: str) -> list[dict[str, str]]:
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_csv_and_parquet_hold_the_same_and_tell_what_made_them(here):
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow (extra `io`) is not installed")
    for name in ("a.csv", "a.parquet"):
        result = run("rec", "--out", name)
        assert result.exit_code == 2
        assert "7 headings: 6 valid, 0 refused, 1 failed" in result.stderr
    text, typed = rows("a.csv"), parquet.read_table("a.parquet").to_pylist()
    assert [row["file"] for row in text] == ["bad.csv", *(f"x_{i}.csv" for i in range(6))]
    for ours, theirs in zip(text, typed, strict=True):
        assert ours["valid"] == str(theirs["valid"]).lower()
        assert ours["heading_deg"] == ("" if theirs["heading_deg"] is None else repr(theirs["heading_deg"]))
        assert ours["checksum"] == theirs["checksum"]
        assert ours["checksum"].startswith("sha256:")
    assert json.loads(text[0]["settings"])["method"] == "auto"
    assert "bad.csv" in text[0]["message"]


@pytest.mark.slow
def test_only_what_is_missing_or_changed_is_done_and_the_rest_is_as_it_was(here):
    run("rec", "--csv", "whole.csv")
    shutil.copy("rec/x_1.csv", "x_1.csv")
    shutil.copy("rec/x_2.csv", "rec/x_1.csv")
    Path("rec/x_3.csv").rename("x_3.csv")
    run("rec", "--csv", "t.csv")
    shutil.copy("x_1.csv", "rec/x_1.csv")
    shutil.move("x_3.csv", "rec/x_3.csv")
    result = run("rec", "--csv", "t.csv", "--resume")
    assert [line.split()[0] for line in result.stdout.splitlines()[1:]] == ["x_1.csv", "x_3.csv"]
    assert "7 headings: 6 valid" in result.stderr
    assert Path("t.csv").read_bytes() == Path("whole.csv").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rec/t.csv", "rec/t.parquet"])
def test_a_table_among_the_recordings_is_none_of_them(here, name):
    if name.endswith("parquet"):
        pytest.importorskip("pyarrow", reason="pyarrow (extra `io`) is not installed")
    run("rec", "--out", name)
    before = Path(name).read_bytes()
    result = run("rec", "--out", name, "--resume")
    assert "7 headings: 6 valid" in result.stderr
    assert Path(name).read_bytes() == before
    assert "1 failed" in run("rec/*", "--out", "t.csv").stderr
    Path(name).write_bytes(before[: len(before) // 2])
    message = "Leave --resume out" if name.endswith("csv") else "one of the recordings"
    assert message in run("rec", "--out", name, "--resume").stderr


def test_other_settings_are_refused_and_named(here):
    run("rec", "--out", "t.csv", "--latitude", 32)
    before = Path("t.csv").read_bytes()
    result = run("rec", "--out", "t.csv", "--latitude", 32.01, "--method", "mean", "--resume")
    assert result.exit_code == 2
    assert "latitude_deg was 32.0, is now 32.01; method was auto, is now mean" in result.stderr
    assert Path("t.csv").read_bytes() == before
    assert not Path("t.csv.partial").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--resume",), "none is given"),
        (("--resume", "--out", "t.csv", "--json"), "give one of them"),
        (("--out", "t.csv", "--csv", "u.csv"), "give one of them"),
        (("--out", "t.txt"), "must end in"),
        (("--out", "rec/x_1.csv"), "one of the recordings"),
        (("--out", "old.csv", "--resume"), "no table of this kind"),
        (("--out", "left.csv"), "was not finished"),
        (("--plot", "t.png"), "takes one recording"),
    ],
)
def test_refused_before_any_work(here, arguments, message):
    Path("old.csv").write_text("file,heading\nx,1\n")
    Path("left.csv.partial").write_text("rows")
    before = sorted(here.rglob("*"))
    result = run("rec", *arguments)
    assert result.exit_code == 2
    assert message in result.stderr
    assert sorted(here.rglob("*")) == before


def test_a_second_run_that_would_write_the_same_is_refused(here):
    pytest.importorskip("fcntl", reason="this system cannot lock files so")
    with (
        table(Path("t.csv"), "{}"),
        pytest.raises(InputError, match="another run"),
        table(Path("t.csv"), "{}", resume=True),
    ):
        pass


@pytest.mark.slow
def test_two_folders_with_the_same_names_stay_apart(here):
    shutil.copytree("rec", "other")
    shutil.copy("rec/x_2.csv", "other/x_1.csv")
    run("rec", "other", "--out", "t.csv")
    found = {row["file"]: row["heading_deg"] for row in rows("t.csv")}
    assert len(found) == 14
    assert found["other/x_1.csv"] == found["rec/x_2.csv"] != found["rec/x_1.csv"]


@pytest.mark.parametrize("name", ["=1+1.csv", "+x.csv", "-x.csv", "@x.csv", "'x.csv", 'a"b,c\n.csv', "x\udcff.csv"])
def test_names_are_no_formulas_and_are_known_again(here, name):
    outcome = Outcome(name, message="=cmd").stamped("sha256:1", "{}")
    key = name.encode("utf-8", "backslashreplace").decode()
    with table(Path("t.csv"), "{}") as kept:
        kept.add([outcome])
        kept.finish([key])
    written = rows("t.csv")[0]
    assert written["file"] == (f"'{key}" if key[0] in "=+-@'" else key)
    assert not written["file"].startswith(("=", "+", "-", "@"))
    assert written["message"] == "'=cmd"
    with table(Path("t.csv"), "{}", resume=True) as kept:
        assert kept.done() == {key: "sha256:1"}


@pytest.mark.parametrize("cut", [1, 2, 15, 30])
def test_a_row_that_was_not_written_whole_is_done_again(here, cut):
    with table(Path("t.csv"), "{}") as kept:
        for name in ("a\nb.csv", "c\nd.csv"):
            kept.add([Outcome(name, message="two\nlines").stamped("sha256:1", "{}")])
        content = Path("t.csv.partial").read_bytes()
    Path("t.csv.partial").write_bytes(content[:-cut])
    with table(Path("t.csv"), "{}", resume=True) as kept:
        assert kept.done() == {"a\nb.csv": "sha256:1"}
        kept.add([Outcome("c\nd.csv", message="two\nlines").stamped("sha256:1", "{}")])
        assert Path("t.csv.partial").read_bytes() == content


def test_what_may_pass_is_tried_again(here):
    with table(Path("t.csv"), "{}") as kept:
        kept.add([Outcome("a.csv", message="The worker was lost").stamped("", "{}")])
        kept.finish(["a.csv"])
    with table(Path("t.csv"), "{}", resume=True) as kept:
        assert kept.done() == {}


def test_a_fault_in_one_file_is_its_row(here, monkeypatch):
    heading = Request.heading

    def faulty(self, recording):
        if recording.source == "x_2.csv":
            raise ZeroDivisionError("by zero")
        return heading(self, recording)

    monkeypatch.setattr(Request, "heading", faulty)
    assert run("rec", "--out", "t.csv").exit_code == 2
    messages = {row["file"]: row["message"] for row in rows("t.csv")}
    assert "ZeroDivisionError: by zero" in messages["x_2.csv"]
    assert messages["x_3.csv"] == ""


@pytest.mark.slow
def test_the_api_gives_what_heading_gives_in_order(here):
    found = list(gn.heading_many(["rec"], latitude=radians(32.0), sensor="hg9900"))
    assert [outcome.file for outcome in found] == ["bad.csv", *(f"x_{i}.csv" for i in range(6))]
    assert found[0].estimate is None
    for outcome in found[1:]:
        recording = gn.read(f"rec/{outcome.file}")
        assert outcome.estimate == gn.heading(recording, sensor="hg9900")
        assert outcome.heading_true == recording.heading_true
    with ThreadPoolExecutor(2) as executor:
        parallel = gn.heading_many("rec", ReadOptions(latitude=radians(32.0)), sensor="hg9900", executor=executor)
        assert {o.file: o.estimate for o in parallel} == {o.file: o.estimate for o in found}


def killed_and_resumed(folder: Path, count: int, kills: int, *options: str) -> int:
    """Kill runs after a random number of new rows, then let one end; how many kills came in time."""
    chance = random.Random(16)
    command = [
        sys.executable,
        "-m",
        "gyronorth.cli",
        "heading",
        "rec",
        "--sensor",
        "hg9900",
        "--out",
        "t.csv",
        *options,
    ]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(os.path.abspath, sys.path))}
    partial, before, came = folder / "t.csv.partial", b"", 0
    for _ in range(kills):
        limit = before.count(b"\n") + chance.randint(1, max(2, count // kills))
        process = subprocess.Popen([*command, "--resume"], cwd=folder, env=environment, stdout=subprocess.DEVNULL)
        while process.poll() is None and (not partial.exists() or partial.read_bytes().count(b"\n") <= limit):
            time.sleep(0.001)
        if process.poll() is not None:
            break
        process.kill()
        process.wait()
        came += 1
        after = partial.read_bytes()
        whole = before[: before.rfind(b"\n") + 1]
        assert after.startswith(whole)  # what is finished stays
        names = [row[0] for row in csv.reader(after[: after.rfind(b"\n") + 1].decode().splitlines())]
        assert len(names) == len(set(names))  # and is not computed again
        before = after
    result = subprocess.run([*command, "--resume"], cwd=folder, env=environment, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    if came:
        done = {row[0] for row in csv.reader(before[: before.rfind(b"\n") + 1].decode().splitlines()[1:])}
        shown = {line.split()[0] for line in result.stdout.splitlines() if line.startswith("x_")}
        assert not done & shown
    assert not partial.exists()
    return came


@pytest.mark.slow
def test_killed_and_resumed_the_table_is_that_of_one_run(tmp_path, monkeypatch):
    write_recordings(tmp_path / "rec", 20)
    assert killed_and_resumed(tmp_path, 20, 1) == 1
    monkeypatch.chdir(tmp_path)
    assert run("rec", "--out", "once.csv").exit_code == 0
    assert Path("t.csv").read_bytes() == Path("once.csv").read_bytes()


@pytest.mark.long
def test_two_thousand_files_on_two_workers_killed_twenty_times(tmp_path, monkeypatch):
    write_recordings(tmp_path / "rec", 2000, duration=60.0)
    assert killed_and_resumed(tmp_path, 2000, 20, "--workers", "2") == 20
    monkeypatch.chdir(tmp_path)
    assert run("rec", "--out", "once.csv").exit_code == 0
    assert Path("t.csv").read_bytes() == Path("once.csv").read_bytes()


@pytest.mark.long
@pytest.mark.filterwarnings("default")  # of Dask about the worker that is killed on purpose
def test_a_dask_cluster_that_loses_a_worker_gives_the_same_table(tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed", reason="Dask (extra `scale`) is not installed")
    write_recordings(tmp_path / "rec", 60, duration=60.0)
    monkeypatch.chdir(tmp_path)
    assert run("rec", "--out", "once.csv").exit_code == 0
    cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None)
    with cluster:
        with ThreadPoolExecutor(1) as thread:
            result = thread.submit(run, "rec", "--out", "t.csv", "--scheduler", cluster.scheduler_address)
            while not Path("t.csv.partial").exists() or Path("t.csv.partial").read_bytes().count(b"\n") < 20:
                time.sleep(0.01)
            next(iter(cluster.workers.values())).process.process.kill()
            assert result.result().exit_code == 0
        with distributed.Client(cluster) as client:
            client.wait_for_workers(2, timeout=300)  # a worker that is on its way back cannot be closed
    assert Path("t.csv").read_bytes() == Path("once.csv").read_bytes()
