"""Recordings behind real servers, whose connections break in the middle: fetched again, or told in their rows."""

from __future__ import annotations

import csv
import socket
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from math import radians
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import gyronorth as gn
from gyronorth.cli import app

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
def served(folder: Path, cuts: dict[str, int]) -> Iterator[Cutter]:
    """A web server with the files of a folder, behind a relay."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(folder)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    cutter = Cutter(server.server_address[1], cuts)
    try:
        yield cutter
    finally:
        cutter.close()
        server.shutdown()
        server.server_close()


@pytest.fixture
def recordings(tmp_path, monkeypatch):
    folder = tmp_path / "rec"
    folder.mkdir()
    rng = np.random.default_rng(5)
    for name in ("whole", "once", "always"):
        recording = gn.simulate("hg9900", latitude=radians(32), heading=1.0, duration=60.0, rate_hz=10.0, rng=rng)
        gn.write(recording, folder / f"{name}.csv")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("gyronorth.many.remote.PAUSE", 0.0)
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


def test_a_web_server(recordings):
    with served(recordings, {"whole.csv": 0, "once.csv": 1, "always.csv": 1000}) as cutter:
        check(cutter, *(f"http://127.0.0.1:{cutter.port}/{name}.csv" for name in ("whole", "once", "always")))


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
    finally:
        cutter.close()
        server.stop()
