"""Sources to recordings: folders, patterns, lists and URLs, each recording once and under its own name."""

from __future__ import annotations

import io
import os
import zipfile
from pathlib import Path

import pytest

from gyronorth.errors import InputError
from gyronorth.sources.listing import names_one, recordings
from gyronorth.sources.remote import at_hand, checksum_of


@pytest.fixture
def tree(tmp_path, monkeypatch):
    for name in ("a/x_10.csv", "a/x_9.csv", "a/sub/y.csv", "b/x_9.csv", "b/notes.md"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def names(*sources: str) -> list[str]:
    return [item.name for item in recordings(sources)]


def test_one_folder_names_from_itself_on_two_do_not(tree):
    assert names("a") == ["sub/y.csv", "x_9.csv", "x_10.csv"]
    assert names("a", "b") == ["a/sub/y.csv", "a/x_9.csv", "a/x_10.csv", "b/x_9.csv"]


def test_patterns_lists_and_repetitions(tree):
    assert names("*/x_9.csv") == ["a/x_9.csv", "b/x_9.csv"]
    assert names("**/*.csv") == ["a/sub/y.csv", "a/x_9.csv", "a/x_10.csv", "b/x_9.csv"]
    Path("list.txt").write_text("# ours\n\nb\na/x_9.csv\ngone.csv\n")
    assert names("@list.txt", "./b/x_9.csv", "a/sub") == ["b/x_9.csv", "a/x_9.csv", "gone.csv", "a/sub/y.csv"]


def zipped(path: str, *members: str) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        for member in members:
            archive.writestr(member, member)


def test_each_recording_of_an_archive_is_one(tree):
    phone = ("Gyroscope.csv", "Accelerometer.csv", "Linear Accelerometer.csv", "meta/time.csv")
    zipped("a/two.zip", "x_9.csv", "sub/y.npz", "readme.txt", "doc.pdf")
    zipped("a/one.zip", "x.csv")
    zipped("a/papers.zip", "doc.pdf", "table.xlsx2")
    zipped("phones.zip", *(f"{folder}/{name}" for folder in ("s 1", "s 2") for name in phone))
    zipped("phone.zip", *phone)
    zipped("bags.zip", *(f"{bag}/{name}" for bag in ("run1", "run2") for name in ("metadata.yaml", "x.db3", "x.csv")))
    Path("a/cut.zip").write_bytes(Path("a/two.zip").read_bytes()[:60])
    two = ["a/two.zip/sub/y.npz", "a/two.zip/x_9.csv"]
    assert names("a/two.zip") == names("a/t*.zip") == names(*two) == two
    assert names("a") == ["cut.zip", "one.zip", "sub/y.csv", "two.zip/sub/y.npz", "two.zip/x_9.csv",
                          "x_9.csv", "x_10.csv"]  # fmt: skip
    assert names("phones.zip", "phone.zip", "bags.zip") == [
        *("phones.zip/s 1", "phones.zip/s 2", "phone.zip", "bags.zip/run1", "bags.zip/run2")
    ]
    assert names_one("phone.zip")
    assert names_one("a/one.zip")
    assert not names_one("a/two.zip")
    states = [checksum_of(Path(name)) for name in two]
    assert len(set(states)) == 2
    zipped("a/two.zip", "sub/y.npz", "other.csv", "x_9.csv")  # what stands beside them does not matter
    assert [checksum_of(Path(name)) for name in two] == states
    assert checksum_of(Path("a/gone.csv")) == checksum_of(Path("a/two.zip/gone.csv")) == ""


def test_lines_of_a_list_are_counted_from_here_and_else_from_the_list(tree):
    Path("far/away").mkdir(parents=True)
    Path("far/away/run 1.csv").write_text("")
    Path("far/away/x_9.csv").write_text("")
    Path("x_9.csv").write_text("")
    lines = ["run 1.csv", "x_9.csv", "run*.csv", "away", "nowhere.csv", "a\x85b.csv", "# not this"]
    Path("far/away/list.txt").write_bytes("\ufeff".encode() + "\r\n".join(lines).encode())
    assert names("@far/away/list.txt") == ["far/away/run 1.csv", "x_9.csv", "away", "nowhere.csv", "a\x85b.csv"]
    Path("far/list.txt").write_text("away\n")
    assert names("@far/list.txt") == ["run 1.csv", "x_9.csv"]


def test_a_url_of_a_local_file_is_a_path(tree):
    Path("c").mkdir()
    for name in ("a=b 1.csv", "#2.csv"):
        Path("c", name).write_text("")
    base = Path("c").absolute().as_uri()
    assert names(base) == names(f"{base}/*.csv") == [f"{base}/%232.csv", f"{base}/a%3Db%201.csv"]
    assert names("c/#2.csv", base) == ["c/#2.csv", f"{base}/a%3Db%201.csv"]  # each once


def test_a_file_whose_name_is_no_text_has_one(tree):
    Path("c").mkdir()
    Path("c", "x\udcff.csv").write_text("")
    assert names("c") == ["x\\udcff.csv"]


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("*.mat", "No file matches"),
        ("@none.txt", "list none.txt cannot be read"),
        ("@b/notes.md", None),
        ("nothing://x", "cannot be opened"),
    ],
)
def test_refused(tree, source, message):
    if "nothing" in source:
        pytest.importorskip("fsspec", reason="fsspec (extra `cloud`) is not installed")
    if message is None:
        assert names(source) == ["b/notes.md"]  # its only line
        return
    with pytest.raises(InputError, match=message):
        recordings([source])


def test_what_is_one_recording(tree):
    assert [names_one(text) for text in ("a/x_9.csv", "gone.csv", "file:///a.csv")] == [True] * 3
    assert [names_one(text) for text in ("a", "*.csv", "@list.txt")] == [False] * 3


def test_memory_is_listed_and_fetched():
    fsspec = pytest.importorskip("fsspec", reason="fsspec (extra `cloud`) is not installed")
    filesystem = fsspec.filesystem("memory")
    for name in ("/many/a.csv", "/many/.b.csv", "/many/c.txt", "/many/sub/d.npz"):
        filesystem.pipe_file(name, b"content of " + name.encode())
    assert names("memory://many") == ["memory:///many/a.csv", "memory:///many/sub/d.npz"]
    assert names("memory://many/a*.csv") == ["memory:///many/a.csv"]
    with at_hand("memory://many/a.csv") as path:
        assert path.name == "a.csv"
        assert path.read_bytes() == b"content of /many/a.csv"
    assert not path.exists()
    with pytest.raises(InputError, match="There is no file memory"), at_hand("memory://many/e.csv"):
        pass


def test_a_broken_connection_is_tried_again_and_then_told(monkeypatch):
    fsspec = pytest.importorskip("fsspec", reason="fsspec (extra `cloud`) is not installed")
    filesystem = fsspec.filesystem("memory")
    filesystem.pipe_file("/broken.csv", b"1234")
    fetch, breaks = type(filesystem).get_file, [2]

    def breaking(self, there, here, **named):
        fetch(self, there, here, **named)
        if breaks[0]:
            breaks[0] -= 1
            Path(here).write_bytes(b"12")  # ended early, and said nothing

    monkeypatch.setattr(type(filesystem), "get_file", breaking)
    monkeypatch.setattr("gyronorth.sources.remote.PAUSE", 0.0)
    with at_hand("memory://broken.csv") as path:
        assert path.read_bytes() == b"1234"
    breaks[0] = 3
    with pytest.raises(InputError, match="could not be fetched in 3 attempts"), at_hand("memory://broken.csv"):
        pass


def test_a_checksum_is_of_names_and_contents(tmp_path):
    for folder, name, content in (("a", "x", "1"), ("b", "x", "1"), ("c", "y", "1"), ("d", "x", "2")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / name).write_text(content)
    sums = [checksum_of(tmp_path / name) for name in "abcd"]
    assert sums[0] == sums[1]
    assert len(set(sums)) == 3


def test_a_list_may_come_from_standard_input(tree, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"# two\r\nx.csv\r\n\r\ny.csv\r\n")))
    assert names("@-") == ["x.csv", "y.csv"]


def test_what_cannot_be_looked_into_is_one_of_the_recordings(tree, monkeypatch):
    """A link whose file is gone and a folder that is closed: left out, they would be missed by nobody."""
    folder = tree / "survey"
    (folder / "closed").mkdir(parents=True)
    (folder / "a.csv").touch()
    (folder / "gone.csv").symlink_to("nowhere.csv")
    (folder / "loop").symlink_to(folder)
    scan = os.scandir

    def refusing(place):
        if Path(place).name == "closed":
            raise PermissionError(13, "Permission denied", str(place))
        return scan(place)

    monkeypatch.setattr(os, "scandir", refusing)
    assert names(str(folder)) == ["a.csv", "closed", "gone.csv"]
