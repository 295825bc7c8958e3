"""Whatever happens while a file or a folder is written, there is the old one or the new one, and nothing beside it."""

from __future__ import annotations

import errno
import os
import signal
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from gyronorth.errors import InputError
from gyronorth.files import folder_beside, no_empty_folder, write_text, written_beside

FULL = OSError(errno.ENOSPC, "No space left on device")


def names(folder: Path) -> list[str]:
    return sorted(os.listdir(folder))


def permissions(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


@pytest.fixture
def umask():
    before = os.umask(0o027)
    yield 0o027
    os.umask(before)


class Known:
    """Stands in for chance: the name of the part can be told beforehand."""

    @staticmethod
    def hex() -> str:
        return "0" * 16


class TestFile:
    def test_a_new_file_gets_the_permissions_of_the_umask(self, tmp_path, umask):
        write_text(tmp_path / "new", "text ä\n")
        assert (tmp_path / "new").read_bytes() == "text ä\n".encode()
        assert permissions(tmp_path / "new") == 0o666 & ~umask
        assert names(tmp_path) == ["new"]

    @pytest.mark.parametrize("mode", [0o600, 0o664, 0o755, 0o444])
    def test_the_permissions_of_the_old_file_stay(self, tmp_path, umask, mode):
        path = tmp_path / "file"
        path.write_text("old")
        path.chmod(mode)
        with written_beside(path, durable=True) as part:
            assert permissions(part) & ~mode & 0o077 == 0  # nobody else may look into it meanwhile
            part.unlink()  # some libraries make the file themselves
            part.write_text("new")
        assert path.read_text() == "new"
        assert permissions(path) == mode

    def test_the_old_file_stays_until_the_new_one_is_whole(self, tmp_path):
        path = tmp_path / "file"
        path.write_text("old")
        with written_beside(path) as part:
            part.write_text("new")
            assert path.read_text() == "old"
            assert part.parent == path.parent
        assert path.read_text() == "new"

    def test_names_differ_from_one_writing_to_the_next(self, tmp_path):
        with written_beside(tmp_path / "file") as one, written_beside(tmp_path / "file") as other:
            assert one != other

    @pytest.mark.parametrize("raised", [FULL, KeyboardInterrupt(), ZeroDivisionError(), InputError("bad")])
    def test_a_failure_leaves_the_old_file_and_nothing_else(self, tmp_path, raised):
        path = tmp_path / "file"
        path.write_text("old")

        def fail():
            with written_beside(path) as part:
                part.write_text("half")
                raise raised

        with pytest.raises(InputError if raised is FULL else type(raised)):
            fail()
        assert path.read_text() == "old"
        assert names(tmp_path) == ["file"]

    def test_a_full_disk_is_told_with_its_cure(self, tmp_path):
        if not Path("/dev/full").exists():
            pytest.skip("no /dev/full on this system")
        with (
            pytest.raises(InputError, match=r"file cannot be written: No space left on device\. Free some space"),
            written_beside(tmp_path / "file"),
            Path("/dev/full").open("w") as file,
        ):
            file.write("x" * 100_000)
        assert names(tmp_path) == []

    def test_a_link_at_the_name_of_the_part_is_not_followed(self, tmp_path, monkeypatch):
        victim = tmp_path / "victim"
        victim.write_text("precious")
        monkeypatch.setattr("gyronorth.files.os.urandom", lambda _: Known())
        (tmp_path / f".file.{Known.hex()}.part").symlink_to(victim)
        with pytest.raises(InputError, match="file cannot be written: File exists"):
            write_text(tmp_path / "file", "new")
        assert victim.read_text() == "precious"

    def test_a_link_at_the_place_keeps_pointing(self, tmp_path):
        (tmp_path / "elsewhere").mkdir()
        target, link = tmp_path / "elsewhere" / "target", tmp_path / "link"
        target.write_text("old")
        link.symlink_to(target)
        write_text(link, "new")
        assert link.is_symlink()
        assert target.read_text() == "new"
        assert names(tmp_path / "elsewhere") == ["target"]

    def test_a_device_is_written_directly(self):
        with written_beside("/dev/null") as part:
            assert part == Path("/dev/null")

    def test_a_name_as_long_as_the_disk_takes(self, tmp_path):
        write_text(tmp_path / ("ä" * 127), "text")
        assert names(tmp_path) == ["ä" * 127]

    def test_places_that_cannot_be_written(self, tmp_path):
        (tmp_path / "file").write_text("old")
        for place, cause in {
            "none/file": f"No such file or directory. Make the folder {tmp_path / 'none'} first",
            "file/file": f"Not a directory. {tmp_path / 'file'} is a file",
            "": "Is a directory. Choose another name",
        }.items():
            with pytest.raises(InputError) as caught:
                write_text(tmp_path / place, "text")
            assert f"{tmp_path / place} cannot be written: {cause}" in str(caught.value)

    def test_an_error_of_another_file_is_not_told_as_ours(self, tmp_path):
        with pytest.raises(FileNotFoundError, match="source"), written_beside(tmp_path / "file"):
            (tmp_path / "source").read_bytes()
        assert names(tmp_path) == []


class TestFolder:
    def old(self, tmp_path: Path) -> Path:
        folder = tmp_path / "bundle"
        folder.mkdir()
        (folder / "old.txt").write_text("old")
        return folder

    def test_a_new_folder_appears_whole(self, tmp_path):
        folder = tmp_path / "deep" / "bundle"
        with folder_beside(folder) as part:
            (part / "a").mkdir()
            (part / "a" / "b.txt").write_text("b")
            assert not folder.exists()
        assert (folder / "a" / "b.txt").read_text() == "b"
        assert names(folder.parent) == ["bundle"]

    def test_an_old_folder_goes_with_all_that_is_in_it(self, tmp_path):
        folder = self.old(tmp_path)
        folder.chmod(0o700)
        with folder_beside(folder) as part:
            (part / "new.txt").write_text("new")
            assert names(folder) == ["old.txt"]
        assert names(folder) == ["new.txt"]
        assert permissions(folder) == 0o700
        assert names(tmp_path) == ["bundle"]

    @pytest.mark.parametrize("raised", [FULL, KeyboardInterrupt(), InputError("bad")])
    def test_a_failure_leaves_the_old_folder_and_nothing_else(self, tmp_path, raised):
        folder = self.old(tmp_path)

        def fail():
            with folder_beside(folder) as part:
                (part / "new.txt").write_text("new")
                raise raised

        with pytest.raises(InputError if raised is FULL else type(raised)):
            fail()
        assert names(folder) == ["old.txt"]
        assert names(tmp_path) == ["bundle"]

    def test_a_failure_at_the_last_step_brings_the_old_folder_back(self, tmp_path, monkeypatch):
        folder, rename = self.old(tmp_path), Path.rename

        def second_fails(self, target):
            if self.suffix == ".part":
                raise FULL
            return rename(self, target)

        monkeypatch.setattr(Path, "rename", second_fails)
        with pytest.raises(InputError, match="No space left"), folder_beside(folder) as part:
            (part / "new.txt").write_text("new")
        assert names(folder) == ["old.txt"]
        assert names(tmp_path) == ["bundle"]

    def test_no_parents_are_left_by_a_failure(self, tmp_path):
        with pytest.raises(ZeroDivisionError), folder_beside(tmp_path / "deep" / "bundle"):
            raise ZeroDivisionError
        assert names(tmp_path) == []

    def test_a_link_to_a_folder_keeps_pointing(self, tmp_path):
        folder, link = self.old(tmp_path), tmp_path / "link"
        link.symlink_to(folder)
        with folder_beside(link) as part:
            (part / "new.txt").write_text("new")
        assert link.is_symlink()
        assert names(folder) == ["new.txt"]

    def test_a_file_is_not_replaced_by_a_folder(self, tmp_path):
        (tmp_path / "bundle").write_text("old")
        with (
            pytest.raises(InputError, match="bundle cannot be written: a file of that name"),
            folder_beside(tmp_path / "bundle"),
        ):
            pytest.fail("the block must not be entered")
        assert (tmp_path / "bundle").read_text() == "old"
        assert names(tmp_path) == ["bundle"]


# A shell that starts the tests in its background has SIGINT ignored in all that they start.
WAITING = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)
from gyronorth.files import folder_beside, write_text, written_beside
with {writer}(sys.argv[1]) as part:
    write_text(part / "half" if part.is_dir() else part, "half")
    print("ready", flush=True)
    time.sleep(600)
"""


@pytest.mark.parametrize("writer", ["written_beside", "folder_beside"])
@pytest.mark.parametrize("sign", [signal.SIGTERM, signal.SIGINT])
def test_a_process_that_is_ended_leaves_nothing(tmp_path, writer, sign):
    code = WAITING.format(writer=writer)
    process = subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path / "out")], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    assert process.stdout is not None
    assert process.stdout.readline() == b"ready\n"
    assert len(names(tmp_path)) == 1
    process.send_signal(sign)
    assert process.wait() == -sign  # ended by the signal, as whoever sent it expects
    process.stdout.close()
    assert names(tmp_path) == []


def test_the_signal_is_left_to_whoever_waits_for_it(tmp_path):
    came = []
    before = signal.signal(signal.SIGTERM, lambda *_: came.append(True))
    try:
        with written_beside(tmp_path / "file"):
            os.kill(os.getpid(), signal.SIGTERM)
    finally:
        signal.signal(signal.SIGTERM, before)
    assert came == [True]
    assert names(tmp_path) == ["file"]


def test_after_writing_the_signal_does_what_it_did(tmp_path):
    write_text(tmp_path / "file", "text")
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_any_thread_may_write(tmp_path):
    thread = threading.Thread(target=write_text, args=(tmp_path / "file", "text"))
    thread.start()
    thread.join()
    assert (tmp_path / "file").read_text() == "text"


def test_a_folder_that_was_there_stays(tmp_path):
    with pytest.raises(ZeroDivisionError), no_empty_folder(tmp_path):
        raise ZeroDivisionError
    assert tmp_path.is_dir()
