"""`train` ended by a signal or without room in the middle: the bundle that was there is whole, one message, no part."""

from __future__ import annotations

import os
import resource
import signal
import sys
import time
import traceback
import warnings
from pathlib import Path

import pytest

pytest.importorskip("torch", reason="PyTorch comes with the extra train")
pytest.importorskip("tensorboard", reason="tensorboard comes with the extra train")

from gyronorth.cli import main
from gyronorth.learn.settings import Settings, write_settings

TINY = Settings.model_validate(
    {
        "samples": 12,
        "synthetic": {"headings": 40},
        "sampler": {"t_back": 997},
        "denoiser": {"layers": 2, "hidden": 6, "epochs": 2, "batch": 10},
    }
)


def train(place: Path, *, ended: tuple[str, str] | None = None, room: int | None = None) -> tuple[int, str]:
    """Status and output of `train denoiser` in a child.

    `ended` is a signal, and the end of the name before whose last step it comes; `room` the longest file, bytes.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # it may have threads, of which none is needed
        pid = os.fork()
    if pid == 0:
        try:
            os.chdir(place)
            said = os.open("said", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(said, 1)
            os.dup2(said, 2)
            sys.stdout, sys.stderr = os.fdopen(1, "w", closefd=False), os.fdopen(2, "w", closefd=False)
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            if room is not None:
                resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))
            waiting = [ended] if ended is not None else []
            for name, step in (("rename", Path.rename), ("replace", Path.replace)):

                def last_step(self: Path, target: Path, do=step) -> object:
                    if waiting and Path(target).name.endswith(waiting[0][1]):
                        waiting.clear()
                        assert ended is not None
                        os.kill(os.getpid(), signal.Signals[ended[0]])
                        time.sleep(60)
                    return do(self, target)

                setattr(Path, name, last_step)
            sys.argv = ["gyronorth", "train", "denoiser", "--config", "s.yaml", "--force", "-o", "bundle"]
            main()
        except SystemExit as end:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(end.code if isinstance(end.code, int) else 1)
        except BaseException:
            traceback.print_exc()
            sys.stderr.flush()
        finally:
            os._exit(99)
    status = os.waitpid(pid, 0)[1]
    return status, (place / "said").read_text()


@pytest.fixture
def place(tmp_path):
    """A folder with settings and a bundle that is there."""
    write_settings(TINY, tmp_path / "s.yaml")
    (tmp_path / "bundle").mkdir()
    (tmp_path / "bundle" / "bundle.json").write_text("before")
    return tmp_path


def parts(place: Path) -> list[str]:
    return sorted(path.name for path in place.rglob("*") if path.suffix in (".part", ".old"))


@pytest.mark.parametrize("at", ["bundle", pytest.param(".pt", marks=pytest.mark.long)])
@pytest.mark.parametrize("how", ["SIGTERM", "SIGKILL"])
def test_a_signal_leaves_the_old_bundle(place, how, at):
    status, _ = train(place, ended=(how, at))
    assert os.WIFSIGNALED(status)
    assert os.WTERMSIG(status) == signal.Signals[how]
    left = parts(place)
    assert all(name.startswith(".") for name in left)
    assert how == "SIGKILL" or not left
    # Killed between the two renames, the old bundle waits beside its place.
    kept = [path for path in place.rglob("bundle.json") if path.read_text() == "before"]
    assert len(kept) == 1
    assert how == "SIGKILL" or kept == [place / "bundle" / "bundle.json"]


@pytest.mark.parametrize("room", [2000, *(pytest.param(room, marks=pytest.mark.long) for room in (100, 12_000))])
def test_no_room_is_one_message(place, room):
    status, said = train(place, room=room)
    assert (os.WIFEXITED(status), os.WEXITSTATUS(status)) == (True, 2), said
    assert "Traceback" not in said
    assert "cannot be written" in said
    assert (place / "bundle" / "bundle.json").read_text() == "before"
    assert not parts(place)
