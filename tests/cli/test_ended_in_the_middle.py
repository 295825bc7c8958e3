"""Every command that writes, ended in the middle: the old file is whole, and nothing is left beside it."""

import os
import signal

import numpy as np
import pytest
from ended import ended
from still import still

from gyronorth import write
from gyronorth.recording import Recording

SIMULATE = "simulate --sensor stim300 --latitude 48 --heading 1 --duration 60 --rate 20 --seed 1 --force -o out.npz"
COMMANDS = [
    *(f"convert rec.csv --force -o out.{suffix}" for suffix in ("npz", "h5")),
    SIMULATE,
    "allan rec.csv --force -o out.json",
    "heading rec.csv --csv out.csv",
    "import rec.csv --yes --axes frd --force -o other.npz --save-preset out.json",
    "calibrate swing --latitude 45 --force -o out.json",
]
#: Their libraries take seconds to load.
DEAR = [
    *(f"convert rec.csv --force -o out.{suffix}" for suffix in ("csv", "parquet", "bag", "mcap")),
    "heading rec.csv --report out.html",
    "heading rec.csv --plot out.png",
]


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


@pytest.mark.parametrize("how", ["SIGTERM", "SIGKILL", "full"])
@pytest.mark.parametrize(
    "command",
    [*COMMANDS, *(pytest.param(command, marks=pytest.mark.long) for command in DEAR)],
    ids=lambda command: f"{command.split()[0]}-{command.split('.')[-1]}",
)
def test_the_old_file_is_whole(folder, command, how):
    output = folder / command.split()[-1]
    output.write_text("before")
    before = sorted(path.name for path in folder.iterdir())
    status, _ = ended(
        command.split(), folder, **({"room": 100} if how == "full" else {"by": how, "before": output.name})
    )
    (folder / "other.npz").unlink(missing_ok=True)
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
