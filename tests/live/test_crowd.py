"""How many the server of a session answers at a time, and for how long it waits for a request."""

from __future__ import annotations

import socket
import time
import urllib.error
import urllib.request
from collections.abc import Iterator

import pytest
from live_stream import Played
from websockets.exceptions import ConnectionClosedError, InvalidStatus
from websockets.sync.client import connect

from gyronorth.live import access, nmea_out, serving
from gyronorth.live.binding import bound_socket
from gyronorth.live.nmea_out import NmeaOut, parse_target
from gyronorth.live.serving import Server
from gyronorth.live.session import LiveSettings, Session
from gyronorth.live.status import Status
from gyronorth.readers import ReadOptions


@pytest.fixture
def port() -> Iterator[int]:
    """The port of a server whose session has not begun, and has not ended."""
    listener = bound_socket("127.0.0.1", 0, socket.SOCK_STREAM)
    number = listener.getsockname()[1]
    server = Server(Session(Played(), LiveSettings(ReadOptions())), listener, host="127.0.0.1", token=None, page=False)
    server.start()
    yield number
    server.close()


def test_more_streams_than_are_served_are_turned_away_and_other_requests_are_not(port, monkeypatch):
    monkeypatch.setattr(access, "MOST_STREAMS", 2)
    address = f"http://127.0.0.1:{port}/"
    first = urllib.request.urlopen(f"{address}api/stream?hz=20", timeout=300)
    assert first.readline().startswith(b"data: ")
    with connect(f"ws://127.0.0.1:{port}/api/socket?hz=20") as second:
        assert second.recv()
        with pytest.raises(urllib.error.HTTPError, match="503"):
            urllib.request.urlopen(f"{address}api/stream", timeout=300)
        with pytest.raises(InvalidStatus):
            connect(f"ws://127.0.0.1:{port}/api/socket")
        assert urllib.request.urlopen(f"{address}api/heading", timeout=300).status == 200
    first.close()  # there is room again, once the server has seen it
    deadline = time.monotonic() + 300
    while time.monotonic() < deadline:
        try:
            urllib.request.urlopen(f"{address}api/stream", timeout=300).close()
            return
        except urllib.error.HTTPError:
            time.sleep(0.05)
    raise AssertionError("no room after both have gone")


def test_a_message_without_end_is_not_taken(port):
    with connect(f"ws://127.0.0.1:{port}/api/socket?hz=20") as heard:
        heard.send(b"x" * (serving.LARGEST_MESSAGE + 1))
        with pytest.raises(ConnectionClosedError, match="1009"):
            list(heard)


def test_listeners_leave_room_for_the_recording(monkeypatch):
    monkeypatch.setattr(nmea_out, "descriptors", lambda: 8)
    out = NmeaOut(parse_target("tcp:127.0.0.1:0"), rate_hz=20.0, status=lambda: Status("waiting", "here"))
    out.start()
    listening = [socket.create_connection(("127.0.0.1", out.port), timeout=300) for _ in range(3)]
    first = [client.recv(100) for client in listening]
    for client in listening:
        client.close()
    out.close()
    assert sorted(part[:6] for part in first) == [b"", b"$HETHS", b"$HETHS"]


@pytest.mark.parametrize("asked", [b"", b"GET /api/heading HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"])
def test_half_a_request_is_not_waited_for_first_or_later(port, monkeypatch, asked):
    monkeypatch.setattr(serving, "HEADER_TIME", 0.2)
    with socket.create_connection(("127.0.0.1", port), timeout=300) as client:
        client.sendall(asked)
        heard = client.recv(1 << 16) if asked else b"HTTP/1.1 200"
        assert heard.startswith(b"HTTP/1.1 200")
        client.sendall(b"GET /api/heading HTTP/1.1\r\nHost: ")
        while client.recv(1 << 16):
            pass
