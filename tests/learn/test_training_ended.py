"""`train` ended by a signal or without room in the middle: the bundle that was there is whole, one message, no part."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest
from ended import ended

pytest.importorskip("torch", reason="PyTorch comes with the extra train")
pytest.importorskip("tensorboard", reason="tensorboard comes with the extra train")

from gyronorth.learn.settings import Settings, write_settings

TINY = Settings.model_validate(
    {
        "samples": 12,
        "synthetic": {"headings": 40},
        "sampler": {"t_back": 997},
        "denoiser": {"layers": 2, "hidden": 6, "epochs": 2, "batch": 10},
    }
)


def train(place: Path, **how) -> tuple[int, str]:
    """Status and output of `train denoiser` in a child that is ended."""
    return ended(["train", "denoiser", "--config", "s.yaml", "--force", "-o", "bundle"], place, **how)


@pytest.fixture
def place(tmp_path):
    """A folder with settings and a bundle that is there."""
    write_settings(TINY, tmp_path / "s.yaml")
    (tmp_path / "bundle").mkdir()
    (tmp_path / "bundle" / "bundle.json").write_text("before")
    return tmp_path


def parts(place: Path) -> list[str]:
    return sorted(path.name for path in place.rglob("*") if path.suffix in (".part", ".old"))


@pytest.mark.slow
@pytest.mark.parametrize("at", ["bundle", pytest.param(".pt", marks=pytest.mark.long)])
@pytest.mark.parametrize("how", ["SIGTERM", "SIGKILL"])
def test_a_signal_leaves_the_old_bundle(place, how, at):
    status, _ = train(place, by=how, before=at)
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
