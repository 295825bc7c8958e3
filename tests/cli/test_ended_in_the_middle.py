"""Every command that writes, ended in the middle: the old file is whole, and nothing is left beside it."""

import gzip
import os
import signal
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli.test_cli import run
from ended import ended
from still import still

from gyronorth import write
from gyronorth.cli.app import commands
from gyronorth.recording import Recording

#: (command, option that names what it writes) -> lines that end in the name of that file.
WRITES = {
    ("convert", "-o"): [f"convert rec.csv --force -o out.{suffix}" for suffix in ("npz", "h5")],
    ("convert", "--out"): ["convert rec.csv --force -o other_*.npz --out out.csv"],
    ("simulate", "-o"): [
        "simulate --sensor stim300 --latitude 48 --heading 1 --duration 60 --rate 20 --seed 1 --force -o out.npz"
    ],
    ("allan", "-o"): ["allan rec.csv --force -o out.json"],
    ("allan", "--out"): ["allan rec.csv --out out.csv"],
    ("info", "--out"): ["info rec.csv --out out.csv"],
    ("heading", "--csv"): ["heading rec.csv --csv out.csv"],
    ("heading", "--out"): ["heading rec.csv --out out.csv"],
    ("import", "-o"): ["import rec.csv --yes --axes frd --force -o out.npz"],
    ("import", "--save-preset"): ["import rec.csv --yes --axes frd --force -o other.npz --save-preset out.json"],
    ("calibrate", "-o"): ["calibrate swing --latitude 45 --force -o out.json"],
}
#: Their libraries take seconds to load.
DEAR = {
    ("convert", "-o"): [f"convert rec.csv --force -o out.{suffix}" for suffix in ("csv", "parquet", "bag", "mcap")],
    ("heading", "--report"): ["heading rec.csv --report out.html"],
    ("heading", "--plot"): ["heading rec.csv --plot out.png"],
    ("allan", "--plot"): ["allan rec.csv --plot out.svg"],
    ("plan", "--plot"): ["plan --sensor stim300 --latitude 48 --plot out.svg"],
}
#: Folders and streams: below, in tests/learn/test_training_ended.py, and in tests/live/test_session.py.
ELSEWHERE = {("published", "-o"), ("benchmark", "-o"), ("train", "-o"), ("live", "--save")}
#: Options with a path that is read.
READ = {"source", "--accel", "--config", "--data", "--deviation", "--model"}


def test_no_output_of_a_command_is_forgotten():
    """A new option that takes a path is either read, or ended in the middle here or there."""
    known = {*WRITES, *DEAR, *ELSEWHERE}
    for name, command in commands().items():
        for option in command.params:
            described = getattr(option, "type_descriptor", None)
            if described is None:
                pytest.skip("this version of typer does not say what an option holds")
            if described.annotation is Path or "save" in option.name:
                assert option.opts[0] in READ or (name, option.opts[0]) in known, f"{name} {option.opts[0]}"


def lines(of: dict) -> list[str]:
    return [line for each in of.values() for line in each]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ended")
    gyro, accel = still(700)
    write(Recording(gyro, accel, 10.0, latitude=np.radians(45)), folder / "rec.csv")
    (folder / "swing").mkdir()
    for k in range(7):
        gyro, accel = still(50, seed=k)
        truth = Recording(gyro, accel, 10.0, latitude=np.radians(45), heading_true=0.1 * k, session="s")
        write(truth, folder / "swing" / f"{k}.csv")
    return folder


def cases() -> Iterator[Any]:
    """Each line with each end; SIGKILL, of which no code of ours hears, at one of them in the quick run."""
    for number, line in enumerate([*lines(WRITES), *lines(DEAR)]):
        for how in ("SIGTERM", "SIGKILL", "full"):
            dear = line in lines(DEAR) or (how == "SIGKILL" and number > 0)
            words = line.split()
            name = "-".join([words[0], *words[-2:], how])
            yield pytest.param(line, how, id=name, marks=pytest.mark.long if dear else ())


@pytest.mark.slow
@pytest.mark.parametrize(("command", "how"), list(cases()))
def test_the_old_file_is_whole(folder, command, how):
    output = folder / command.split()[-1]
    output.write_text("before")
    before = sorted(path.name for path in folder.iterdir())
    status, _ = ended(
        command.split(), folder, **({"room": 100} if how == "full" else {"by": how, "before": output.name})
    )
    for other in ("other.npz", "other_rec.npz", "out.csv.partial"):  # whole, and what --resume goes on with
        (folder / other).unlink(missing_ok=True)
    if how == "full":
        assert (os.WIFEXITED(status), os.WEXITSTATUS(status)) == (True, 2)
    else:
        assert os.WIFSIGNALED(status)
        assert os.WTERMSIG(status) == signal.Signals[how]
    assert output.read_text() == "before"
    left = [path for path in folder.iterdir() if path.name not in before]
    if how == "SIGKILL":
        assert all(path.name.startswith(".") and path.suffix == ".part" for path in left)
    else:
        assert not left
    for path in (*left, output):
        path.unlink()


@pytest.mark.parametrize(
    "how", ["SIGTERM", *(pytest.param(how, marks=pytest.mark.long) for how in ("SIGKILL", "full"))]
)
def test_a_folder_is_there_when_it_is_whole(tmp_path, how):
    command = "published --rate 0.2 -o out"
    status, _ = ended(command.split(), tmp_path, **({"room": 100} if how == "full" else {"by": how, "before": "out"}))
    assert (os.WIFEXITED(status) and os.WEXITSTATUS(status) == 2) if how == "full" else os.WIFSIGNALED(status)
    assert all(path.name.startswith(".") and how == "SIGKILL" for path in tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("how", ["SIGTERM", "SIGHUP", pytest.param("SIGKILL", marks=pytest.mark.long), "full"])
def test_a_benchmark_keeps_what_is_finished(tmp_path, monkeypatch, how):
    @contextmanager
    def threads(*_, **__):
        with ThreadPoolExecutor(1) as pool:
            yield pool

    monkeypatch.setattr("gyronorth.many.workers.executor_on", threads)
    monkeypatch.setattr("gyronorth.studies.work._work", lambda unit, needs: ({"name": unit.name}, 0.0))
    second = {"before": "001.json"}
    command = "benchmark published --study leave_one_out -o out"
    status, said = ended(command.split(), tmp_path, **({"room": 100} if how == "full" else {"by": how, **second}))
    left = [path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()]
    assert "Traceback" not in said
    if how == "full":
        assert (os.WIFEXITED(status), os.WEXITSTATUS(status)) == (True, 2), said
        assert "cannot be written" in said
        assert left == []
        return
    assert os.WIFSIGNALED(status)
    assert os.WTERMSIG(status) == signal.Signals[how]
    assert "out/units/loo/000.json" in left
    parts = [name for name in left if name.endswith(".part")]
    assert len(parts) == (1 if how == "SIGKILL" else 0)


def test_ctrl_c_in_a_benchmark_says_what_is_kept(tmp_path, monkeypatch):
    (tmp_path / "out" / "units").mkdir(parents=True)

    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("gyronorth.studies.benchmark.run_benchmark", interrupted)
    result = run("benchmark", "published", "--study", "noise", "-o", tmp_path / "out")
    assert result.exit_code == 130
    assert "keeps what is finished; the same command goes on with it" in result.stderr
    assert "error: interrupted" in result.stderr


@pytest.mark.slow
def test_a_signal_while_reading_leaves_no_temporary_file(folder, tmp_path, monkeypatch):
    """A packed file is unpacked into the folder of temporary files: it goes with the process."""
    packed = tmp_path / "rec.csv.gz"
    packed.write_bytes(gzip.compress((folder / "rec.csv").read_bytes()))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))

    def ends(*_, **__):
        assert [path for path in tmp_path.iterdir() if path.is_dir()]
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(60)

    monkeypatch.setattr("gyronorth.readers.grid_stream.GridStream.__init__", ends)
    status, _ = ended(["heading", packed.name], tmp_path)
    assert os.WIFSIGNALED(status)
    assert list(tmp_path.iterdir()) == [packed]
