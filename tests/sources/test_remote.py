"""Recordings behind real servers, whose connections break in the middle: fetched again, or told in their rows."""

from __future__ import annotations

import csv
import gzip
import os
import socket
import threading
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from http.server import BaseHTTPRequestHandler, SimpleHTTPRequestHandler, ThreadingHTTPServer
from math import radians
from pathlib import Path
from urllib.parse import quote

import numpy as np
import pytest
from typer.testing import CliRunner

import gyronorth as gn
from gyronorth.cli import app
from gyronorth.sources import cache
from gyronorth.sources.remote import NotFetched, at_hand

pytest.importorskip("fsspec", reason="fsspec (extra `cloud`) is not installed")
#: What aiohttp says of a connection that was cut, on purpose.
pytestmark = pytest.mark.filterwarnings("default")
#: Bytes of an answer that come before the connection is cut: the head and a part of the recording.
CUT_AFTER = 3000


class Cutter:
    """A relay before a server that cuts answers to a request for some names, as often as `cuts` says."""

    def __init__(self, port: int, cuts: dict[str, int]) -> None:
        self.cuts, self.asked = Counter(cuts), Counter[str]()
        self._server = port
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        self._listener.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                connection, _ = self._listener.accept()
                threading.Thread(target=self._relay, args=(connection,), daemon=True).start()

    def _relay(self, client: socket.socket) -> None:
        with client, socket.create_connection(("127.0.0.1", self._server)) as server, suppress(OSError):
            left: list[float] = [np.inf]
            threading.Thread(target=self._answers, args=(server, client, left), daemon=True).start()
            while data := client.recv(1 << 16):
                line = data.split(b"\r\n", 1)[0].decode("latin-1")
                if line.startswith("GET "):
                    left[0] = np.inf
                    for name in self.cuts:
                        if name in line.split("?")[0]:
                            self.asked[name] += 1
                            if self.cuts[name] > 0:
                                self.cuts[name] -= 1
                                left[0] = CUT_AFTER
                server.sendall(data)

    @staticmethod
    def _answers(server: socket.socket, client: socket.socket, left: list[float]) -> None:
        with suppress(OSError):
            while data := server.recv(1 << 16):
                client.sendall(data[: int(min(left[0], len(data)))])
                left[0] -= len(data)
                if left[0] <= 0:
                    break
            client.shutdown(socket.SHUT_RDWR)
            server.shutdown(socket.SHUT_RDWR)


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None: ...  # pyright: ignore[reportIncompatibleMethodOverride]


@contextmanager
def web_server(handler: Callable[..., BaseHTTPRequestHandler]) -> Iterator[int]:
    """The port of a web server."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)  # type: ignore[arg-type]
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield server.server_address[1]
    finally:
        server.shutdown()
        server.server_close()


@contextmanager
def served(folder: Path, cuts: dict[str, int]) -> Iterator[Cutter]:
    """A web server with the files of a folder, behind a relay."""
    with web_server(partial(Quiet, directory=str(folder))) as port:
        cutter = Cutter(port, cuts)
        try:
            yield cutter
        finally:
            cutter.close()


@pytest.fixture
def recordings(tmp_path, monkeypatch):
    folder = tmp_path / "rec"
    folder.mkdir()
    rng = np.random.default_rng(5)
    for name in ("whole", "once", "always"):
        recording = gn.simulate("hg9900", latitude=radians(32), heading=1.0, duration=60.0, rate_hz=10.0, rng=rng)
        gn.write(recording, folder / f"{name}.csv")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("gyronorth.sources.remote.PAUSE", 0.0)
    return folder


def check(cutter: Cutter, *sources: str) -> None:
    """Two valid rows, one that tells of the connection; the next run, with nothing cut, does that one alone."""
    run = ["heading", *sources, "--sensor", "hg9900", "--out", "t.csv"]
    result = CliRunner().invoke(app, run)
    assert result.exit_code == 2, result.output
    with open("t.csv", newline="") as file:
        rows = {Path(row["file"]).stem: row for row in csv.DictReader(file)}
    assert {name: row["valid"] for name, row in rows.items()} == {"whole": "true", "once": "true", "always": "false"}
    assert "could not be fetched in 3 attempts" in rows["always"]["message"]
    assert rows["always"]["checksum"] == ""
    assert cutter.asked["once.csv"] >= 2
    assert cutter.cuts["once.csv"] == 0
    cutter.cuts["always.csv"], before = 0, cutter.asked["whole.csv"]
    assert CliRunner().invoke(app, [*run, "--resume"]).exit_code == 0
    return None if "s3://" not in sources[0] else _not_fetched_again(cutter, before)


def _not_fetched_again(cutter: Cutter, before: int) -> None:
    """A server that states an ETag is believed without sending the file again."""
    assert cutter.asked["whole.csv"] == before


@pytest.mark.slow
def test_a_web_server(recordings):
    with served(recordings, {"whole.csv": 0, "once.csv": 1, "always.csv": 1000}) as cutter:
        check(cutter, *(f"http://127.0.0.1:{cutter.port}/{name}.csv" for name in ("whole", "once", "always")))


def headings_of(*sources: str) -> dict[str, str]:
    """Heading of each row by its name, all valid."""
    result = CliRunner().invoke(app, ["heading", *sources, "--sensor", "hg9900", "--out", "t.csv", "--resume"])
    assert result.exit_code == 0, result.output
    with open("t.csv", newline="") as file:
        return {row["file"]: row["heading_deg"] for row in csv.DictReader(file)}


def packed(folder: Path) -> dict[str, str]:
    """Put recordings into an archive and into packed files; names within the folder with their headings."""
    with zipfile.ZipFile(folder / "both of.zip", "w") as archive:
        archive.write(folder / "whole.csv", "a b.csv")
        archive.writestr("sub/once.csv.gz", gzip.compress((folder / "once.csv").read_bytes()))
    (folder / "always.csv.gz").write_bytes(gzip.compress((folder / "always.csv").read_bytes()))
    names = {"whole.csv": "both of.zip/a b.csv", "once.csv": "both of.zip/sub/once.csv.gz"}
    names["always.csv"] = "always.csv.gz"
    found = headings_of(str(folder))
    assert len(set(found.values())) == 3
    Path("t.csv").unlink()
    for name, inside in names.items():
        assert found[inside] == found[name]
        (folder / name).unlink()
    return {inside: found[name] for name, inside in names.items()}


@pytest.mark.slow
def test_archives_and_packed_files_behind_urls_are_as_on_the_disk(recordings, monkeypatch):
    import fsspec

    monkeypatch.setattr("tempfile.tempdir", str(recordings.parent))
    expected = packed(recordings)
    assert headings_of(recordings.as_uri()) == {f"{recordings.as_uri()}/{quote(n)}": h for n, h in expected.items()}
    memory = fsspec.filesystem("memory")
    memory.put(f"{recordings}/", "/packed/", recursive=True)
    Path("t.csv").unlink()
    assert headings_of("memory://packed") == {f"memory:///packed/{name}": h for name, h in expected.items()}
    Path("t.csv").unlink()
    with served(recordings, {"both": 1, "always": 0}) as cutter:
        base = f"http://127.0.0.1:{cutter.port}/"
        sources = (f"{base}both%20of.zip?v=1", f"{base}always.csv.gz")
        found = headings_of(*sources)
        there = {f"{base}{quote(name)}{'?v=1' if 'zip' in name else ''}": h for name, h in expected.items()}
        assert found == there
        assert cutter.cuts["both"] == 0  # a connection was cut in the middle
        before = cutter.asked["always"]
        assert headings_of(*sources) == there
        assert cutter.asked["always"] > before  # without a state of the server its content has to come
    assert not list(recordings.parent.glob("gyronorth-url-*/*.csv*"))


@pytest.mark.slow
def test_an_archive_that_is_gone_or_damaged_is_a_row(recordings):
    (recordings / "torn.zip").write_bytes(b"PK\x03\x04" + bytes(200))
    with served(recordings, {}) as cutter:
        base = f"http://127.0.0.1:{cutter.port}/"
        sources = [f"{base}{name}" for name in ("gone.zip", "torn.zip", "gone.zip/a.csv", "whole.csv")]
        result = CliRunner().invoke(app, ["heading", *sources, "--sensor", "hg9900", "--out", "t.csv"])
    assert result.exit_code == 2
    with open("t.csv", newline="") as file:
        rows = {row["file"]: row for row in csv.DictReader(file)}
    assert list(rows) == sources
    assert "There is no file" in rows[sources[0]]["message"]
    assert "zip" in rows[sources[1]]["message"]
    assert "There is no file" in rows[sources[2]]["message"]
    assert rows[sources[3]]["valid"] == "true"


CONTENT = b"0,1,2,3\n" * 1000


class Faulty(BaseHTTPRequestHandler):
    """Answers as the name of the file says."""

    protocol_version = "HTTP/1.1"
    over = threading.Event()  # the test has ended: who stalls can go

    def log_message(self, *_: object) -> None: ...  # pyright: ignore[reportIncompatibleMethodOverride]

    def do_HEAD(self) -> None:
        self.answer(b"")

    def do_GET(self) -> None:
        self.answer(CONTENT)

    def answer(self, body: bytes) -> None:
        name = self.path.strip("/")
        status = int(name) if name.isdigit() else 302 if name in ("circle", "moved") else 200
        self.send_response(status)
        sent = gzip.compress(CONTENT) if name == "packed" else CONTENT
        if name in ("circle", "moved"):
            self.send_header("Location", "/circle" if name == "circle" else "/whole")
        if name == "packed":
            self.send_header("Content-Encoding", "gzip")
        if name in ("unstated", "endless"):
            self.send_header("Connection", "close")
        elif name == "pieces":
            self.send_header("Transfer-Encoding", "chunked")
        else:
            self.send_header("Content-Length", str(0 if status != 200 else len(sent) + 10 * (name == "longer")))
        self.end_headers()
        if name == "silent":
            self.over.wait()
        while body and status == 200:
            self.wfile.write(b"%x\r\n%b\r\n0\r\n\r\n" % (len(sent), sent) if name == "pieces" else sent)
            if name != "endless":
                break
        self.close_connection = name in ("unstated", "longer", "endless", "silent")


@pytest.fixture(scope="module")
def faulty():
    Faulty.over.clear()
    with web_server(Faulty) as port:
        yield f"http://127.0.0.1:{port}"
        Faulty.over.set()


@pytest.mark.parametrize("name", ["whole", "moved", "packed", "unstated", "pieces"])
def test_what_comes_whole_however_it_is_sent_is_taken(faulty, name):
    with at_hand(f"{faulty}/{name}") as path:
        assert path.read_bytes() == CONTENT
        folder = path.parent
    assert not folder.exists()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("404", "There is no file"),
        ("403", r"may not be read \(403 Forbidden\)"),
        ("503", r"could not be fetched in 3 attempts \(503 Service Unavailable\)"),
        ("circle", r"in 3 attempts \(too many redirects\)"),
        ("longer", "in 3 attempts .*not completed"),
        ("silent", r"in 3 attempts \(nothing came for 0.2 s\)"),
        ("endless", "is larger than"),
    ],
)
def test_what_does_not_come_is_told_and_leaves_nothing(faulty, tmp_path, monkeypatch, name, message):
    monkeypatch.setattr("gyronorth.sources.remote.PAUSE", 0.0)
    monkeypatch.setattr("gyronorth.sources.remote.SILENCE", 0.2)
    monkeypatch.setattr("gyronorth.sources.cache.MOST", 1 << 20)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with pytest.raises(NotFetched, match=message), at_hand(f"{faulty}/{name}"):
        pass
    assert not list(tmp_path.iterdir())


def test_what_a_killed_process_left_goes_and_what_is_held_stays(tmp_path, monkeypatch):
    pytest.importorskip("fcntl", reason="this system cannot lock files so")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    left, young = tmp_path / "gyronorth-url-left", tmp_path / "gyronorth-url-young"
    with cache.private_folder() as held:
        for folder in (left, young):
            folder.mkdir()
            (folder / "x.csv").write_text("x")
        for folder in (left, held):
            os.utime(folder, (0, 0))
        cache.sweep.cache_clear()
        with cache.private_folder():
            assert not left.exists()
            assert young.exists()
            assert held.exists()


@pytest.mark.slow
def test_an_object_store(recordings, monkeypatch):
    pytest.importorskip("s3fs", reason="s3fs is not installed")
    moto = pytest.importorskip("moto.server", reason="moto with its server is not installed")
    server = moto.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    cutter = Cutter(server.get_host_and_port()[1], {"whole.csv": 0, "once.csv": 1, "always.csv": 1000})
    for name, value in {
        "AWS_ACCESS_KEY_ID": "testing",
        "AWS_SECRET_ACCESS_KEY": "testing",
        "AWS_DEFAULT_REGION": "us-east-1",
        "AWS_ENDPOINT_URL": f"http://127.0.0.1:{cutter.port}",
        "AWS_MAX_ATTEMPTS": "1",
    }.items():
        monkeypatch.setenv(name, value)
    try:
        import s3fs

        s3fs.S3FileSystem.clear_instance_cache()
        store = s3fs.S3FileSystem()
        store.mkdir("survey")
        store.put(str(recordings) + "/", "survey/", recursive=True)
        check(cutter, "s3://survey")
        expected = packed(recordings)
        store.mkdir("packed")
        store.put(str(recordings) + "/", "packed/", recursive=True)
        Path("t.csv").unlink(missing_ok=True)
        cutter.cuts["both"] = 1
        there = {f"s3://packed/{name}": heading for name, heading in expected.items()}
        assert headings_of("s3://packed") == there
        asked = cutter.asked["both"]
        assert asked == 2  # cut, then once for the list and both recordings
        assert headings_of("s3://packed") == there
        assert cutter.asked["always.csv.gz"] == 0
    finally:
        cutter.close()
        server.stop()
