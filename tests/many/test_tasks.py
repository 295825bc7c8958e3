"""`info`, `allan` and `convert` of many recordings: rows, tables, files, exit codes."""

from __future__ import annotations

import csv
import json
from math import radians
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import gyronorth as gn
from gyronorth.cli import app


@pytest.fixture
def here(tmp_path, monkeypatch):
    """Two recordings, in a folder and one below it, and a file that is none."""
    (tmp_path / "rec" / "sub").mkdir(parents=True)
    for name, seed in (("rec/a.csv", 1), ("rec/sub/b.npz", 2)):
        rng = np.random.default_rng(seed)
        recording = gn.simulate(
            "hg9900", latitude=radians(32), heading=1.0, duration=100.0, rate_hz=10.0 * seed, rng=rng
        )
        gn.write(recording, tmp_path / name)
    (tmp_path / "rec" / "bad.csv").write_text("# gyro_unit: rad/s\nt,w_x,w_y,w_z\n0,a,b,c\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def rows(path: str) -> dict[str, dict[str, str]]:
    with open(path, newline="") as file:
        return {row["file"]: row for row in csv.DictReader(file)}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "column", "expected"),
    [
        (("info",), "samples", {"a.csv": "1000", "sub/b.npz": "2000"}),
        (("allan",), "rate_hz", {"a.csv": "10.0", "sub/b.npz": "20.0"}),
        (("convert", "-o", "out/*.npz"), "output", {"a.csv": "out/a.npz", "sub/b.npz": "out/sub/b.npz"}),
    ],
    ids=["info", "allan", "convert"],
)
def test_rows_of_many_and_of_the_one_that_cannot_be_read(here, command, column, expected):
    result = run(*command, "rec", "--out", "t.csv")
    assert result.exit_code == 2
    assert "3 files: 2 " in result.stderr
    assert "1 failed" in result.stderr
    assert "bad.csv" in result.stdout
    table = rows("t.csv")
    assert {name: row[column] for name, row in table.items() if not row["message"]} == expected
    assert table["bad.csv"]["message"].startswith(("Row 3", "bad.csv"))
    assert all(row["checksum"].startswith("sha256:") for row in table.values())
    # What is done is not done again, and what has changed is.
    gn.write(gn.read("rec/a.csv").window(0.0, 90.0), "rec/bad.csv")
    Path("rec/sub/b.npz").touch()
    again = run(*command, "rec", "--out", "t.csv", "--resume")
    assert again.exit_code == 0
    assert "bad.csv" in again.stdout
    assert "b.npz" not in again.stdout
    assert not Path("t.csv.partial").exists()
    assert set(rows("t.csv")) == {"a.csv", "bad.csv", "sub/b.npz"}


@pytest.mark.slow
def test_workers_parquet_and_json_give_the_same(here):
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow (extra `io`) is not installed")
    assert run("info", "rec", "--out", "t.parquet", "--workers", "2").exit_code == 2
    table = parquet.read_table("t.parquet").to_pylist()
    documents = json.loads(run("info", "rec", "--json").stdout)
    assert [row["file"] for row in table] == [document["file"] for document in documents]
    assert [row["samples"] for row in table] == [document.get("samples") for document in documents]
    assert [document["error"] is None for document in documents] == [True, False, True]


def test_what_is_converted_holds_the_same_samples(here):
    assert run("convert", "rec/a.csv", "rec/sub/b.npz", "-o", "out/*.h5", "--decimate-to", "5").exit_code == 0
    for source, made in (("rec/a.csv", "out/rec/a.h5"), ("rec/sub/b.npz", "out/rec/sub/b.h5")):
        found = gn.read(made)
        assert found.rate_hz == 5.0
        assert np.allclose(found.gyro_b.mean(axis=0), gn.read(source).gyro_b.mean(axis=0), atol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("convert", "rec", "-o", "one.npz"), "Put a star"),
        (("convert", "rec", "-o", "rec/*.csv"), "would be written over itself"),
        (("convert", "rec/a.csv", "rec/sub/b.npz", "-o", "there/*.npz"), "exists"),
        (("convert", "rec/a.csv", "rec/a.npz", "-o", "out/*.h5"), "and so is"),
        (("allan", "rec", "--plot", "x.png"), "takes one recording"),
        (("info", "rec", "--resume"), "add --out"),
    ],
    ids=["one", "itself", "there", "twice", "single", "resume"],
)
def test_refused_before_any_work(here, arguments, words):
    Path("there/rec").mkdir(parents=True)
    Path("there/rec/a.npz").write_bytes(b"")
    Path("rec/a.npz").write_bytes(b"")
    result = run(*arguments)
    assert result.exit_code == 2
    assert words in result.stderr
    assert not Path("out").exists()
    assert Path("there/rec/a.npz").read_bytes() == b""
