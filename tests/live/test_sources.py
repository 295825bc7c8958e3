"""Sources that break and come back, and what goes out: NMEA over TCP and UDP."""

from __future__ import annotations

import os
import pty
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from threading import Event, Thread
from typing import Any

import pytest
from live_stream import HEAD, seconds, session_of, timed_rows
from pynmeagps import NMEAReader

from gyronorth.errors import InputError
from gyronorth.live import nmea_out
from gyronorth.live import sources as sources_module
from gyronorth.live.events import Bytes, ByteSource, Connected, Ended, Lost, SourceEvent
from gyronorth.live.nmea_out import NmeaOut, Target, parse_target
from gyronorth.live.replay import Replay
from gyronorth.live.sources import open_source
from gyronorth.live.status import Status
from gyronorth.readers import ReadOptions

ROWS = timed_rows(seconds(0, 40))


@contextmanager
def running(source: ByteSource) -> Iterator[list[SourceEvent]]:
    """The events of a source that runs in a thread."""
    events: list[SourceEvent] = []
    stop = Event()
    thread = Thread(target=source.run, args=(events.append, stop), daemon=True)
    thread.start()
    yield events
    stop.set()


def until(condition: Callable[[], object]) -> None:
    deadline = time.monotonic() + 300
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def received(events: list[SourceEvent]) -> bytes:
    return b"".join(event.bytes for event in events if isinstance(event, Bytes))


def kinds(events: list[SourceEvent]) -> list[type]:
    """The kinds of events, data that follow each other as one."""
    found = [type(event) for event in events]
    return [kind for kind, before in zip(found, [None, *found[:-1]], strict=True) if not kind is before is Bytes]


def test_tcp_comes_back_when_the_server_does():
    server = socket.create_server(("127.0.0.1", 0))
    port = server.getsockname()[1]
    with running(open_source(f"tcp:127.0.0.1:{port}", ReadOptions(), speed=1)) as events:
        for number in range(3):
            connection, _ = server.accept()
            connection.sendall(b"%d,1,2,3\n" % number)
            connection.close()
        until(lambda: received(events) == b"0,1,2,3\n1,1,2,3\n2,1,2,3\n" and isinstance(events[-1], Lost))
        server.close()
        until(lambda: "refused" in getattr(events[-1], "why", ""))
    assert kinds(events[:9]) == [Connected, Bytes, Lost] * 3


def test_tcp_waits_for_a_server_that_is_not_there_yet():
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with running(open_source(f"tcp:127.0.0.1:{port}", ReadOptions(), speed=1)) as events:
        until(lambda: events)
        assert isinstance(events[0], Lost)
        with socket.create_server(("127.0.0.1", port)) as server:
            connection, _ = server.accept()
            until(lambda: Connected() in events)
            connection.close()


def test_tcp_connects_anew_when_nothing_comes(monkeypatch):
    monkeypatch.setattr(sources_module, "SILENCE", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as server:
        source = open_source(f"tcp:127.0.0.1:{server.getsockname()[1]}", ReadOptions(), speed=1)
        with running(source) as events:
            connections = [server.accept(), server.accept()]
            until(lambda: events.count(Connected()) == 2)
            assert Lost("no answer") in events
        for connection, _ in connections:
            connection.close()


def test_udp_takes_one_sender_whose_datagrams_are_whole():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        address = probe.getsockname()
    with running(open_source(f"udp:{address[1]}", ReadOptions(), speed=1)) as events:
        datagrams = (socket.AF_INET, socket.SOCK_DGRAM)
        with socket.socket(*datagrams) as ours, socket.socket(*datagrams) as theirs:
            ours.sendto(b"1,2,3\n4,5,6", address)
            until(lambda: received(events))
            theirs.sendto(b"7,7,7\n", address)
            ours.sendto(b"8,9,10\n", address)
            until(lambda: b"8,9" in received(events))
    assert [event.bytes for event in events if isinstance(event, Bytes) and event.whole] == [
        b"1,2,3\n4,5,6",
        b"8,9,10\n",
    ]


def test_a_udp_port_in_use_is_an_error():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        with pytest.raises(InputError, match="in use"):
            open_source(f"udp:{other.getsockname()[1]}", ReadOptions(), speed=1)


def test_serial_begins_midway_and_survives_being_unplugged(tmp_path):
    """A pair of pseudo-terminals; a link stands for the device, which another terminal takes over."""
    device = tmp_path / "ttyUSB0"

    def plug() -> int:
        ours, theirs = pty.openpty()
        device.unlink(missing_ok=True)
        device.symlink_to(os.ttyname(theirs))
        os.close(theirs)
        return ours

    ours = plug()
    with running(open_source(f"serial:{device}:921600", ReadOptions(), speed=1)) as events:
        until(lambda: events)
        os.write(ours, b"8,9\n1,2,3\n4,5,")
        os.write(ours, b"6\n")
        until(lambda: received(events) == b"8,9\n1,2,3\n4,5,6\n")
        os.close(ours)
        until(lambda: any(isinstance(event, Lost) for event in events))
        ours = plug()
        until(lambda: events.count(Connected(midway=True)) == 2)
        os.write(ours, b"5,5\n7,8,9\n")
        until(lambda: received(events) == b"8,9\n1,2,3\n4,5,6\n5,5\n7,8,9\n")
    os.close(ours)


def test_a_serial_port_that_may_not_be_opened_is_an_error(tmp_path, monkeypatch):
    (tmp_path / "ttyUSB0").touch()
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(InputError, match="dialout"):
        open_source(f"serial:{tmp_path / 'ttyUSB0'}", ReadOptions(), speed=1)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nothing.csv", "No such file"),
        ("", "is '', which names nothing; a file, -, tcp:HOST:PORT"),
        (" ", "names nothing"),
        (".", "is a folder; one file is expected"),
        ("tcp:4001", "no host and port"),
        ("tcp:here:0", "no host and port"),
        ("udp:99999", "no host and port"),
        ("usb:0", "of no known kind"),
        ("serial:", "names no device"),
        ("serial:/no/such/folder/tty", "no device"),
    ],
)
def test_sources_that_are_none(text, message):
    with pytest.raises(InputError, match=message):
        open_source(text, ReadOptions(), speed=1)


def test_a_file_is_replayed_to_the_last_line_at_its_speed(tmp_path):
    path = tmp_path / "rec.csv"
    path.write_text(HEAD + "".join(ROWS))
    stop, events = Event(), []
    begun = time.monotonic()
    Replay(path, ReadOptions(), speed=100).run(events.append, stop)
    assert time.monotonic() - begun > 0.3  # 40 s, 100 times as fast, but for the first step and the last
    assert received(events).decode() == HEAD + "".join(ROWS)
    assert kinds(events) == [Connected, Bytes, Ended]
    assert len(events) > 5


@pytest.mark.parametrize(
    ("text", "message"),
    [("a poem\nof two lines\n", "no header"), ("w_x,w_y,w_z\n1,2,3\n", "--rate"), ("", "no header")],
)
def test_files_that_cannot_be_replayed(tmp_path, text, message):
    (tmp_path / "rec.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        Replay(tmp_path / "rec.csv", ReadOptions(), speed=1)


@pytest.mark.parametrize("comment", ["axes: fud", "rate_hz: fast", "start_time_utc: yesterday"])
def test_a_bad_comment_of_a_replay_is_named_by_its_row(tmp_path, comment):
    lines = HEAD.splitlines(keepends=True)
    key = comment.partition(":")[0]
    lines = [line for line in lines if not line.startswith(f"# {key}:")]
    (tmp_path / "rec.csv").write_text("".join([*lines[:2], "\n", f"# {comment}\n", *lines[2:], *ROWS]))
    with pytest.raises(InputError, match=f"Row 4 of rec.csv: {key} is "):
        Replay(tmp_path / "rec.csv", ReadOptions(), speed=1)


@pytest.fixture(scope="module")
def status() -> Status:
    """A valid heading that is being measured."""
    return replace(session_of(HEAD, ROWS).status, state="running")


def parsed(line: bytes) -> Any:
    return NMEAReader.parse(line, validate=1)


def read_until(stream, start: bytes) -> list[bytes]:
    """Lines up to the first that begins so."""
    lines = [stream.readline()]
    while not lines[-1].startswith(start):
        lines.append(stream.readline())
    return lines


def read_lines(stream, count: int) -> list[bytes]:
    return [stream.readline() for _ in range(count)]


def test_nmea_over_tcp_is_invalid_until_valid(status):
    shown = [Status("waiting", "here")]
    out = NmeaOut(Target("tcp", "127.0.0.1", 0), rate_hz=20, status=lambda: shown[0])
    out.start()
    try:
        connections = [socket.create_connection(("127.0.0.1", out.port), timeout=300) for _ in range(2)]
        for connection in connections:
            with connection, connection.makefile("rb") as stream:
                shown[0] = Status("waiting", "here")
                heading, turn, verdict = read_lines(stream, 3)
                assert (heading, verdict.split(b",")[1]) == (b"$HETHS,,V*14\r\n", b"V")
                assert parsed(turn).valid == "V"
                shown[0] = status
                sentences = read_until(stream, b"$PGNRS,A,")
                assert status.estimate is not None
                assert [parsed(line).identity for line in sentences[-4:-2]] == ["HETHS", "HEHDT"]
                assert parsed(sentences[-3]).headingT == round(status.estimate.to_json()["heading_deg"], 1)
                assert (parsed(sentences[-4]).headt, parsed(sentences[-4]).mi) == (parsed(sentences[-3]).headingT, "A")
                shown[0] = replace(status, state="ended")
                sentences = read_until(stream, b"$PGNRS,V,")
                assert sentences[-3] == b"$HETHS,,V*14\r\n"
                assert b"source_ended" in sentences[-1]
    finally:
        out.close()


def test_nmea_over_udp(status):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(300)
        out = NmeaOut(Target("udp", *listener.getsockname()), rate_hz=50, status=lambda: status)
        out.start()
        try:
            for _ in range(3):
                _, heading, _, verdict = listener.recv(1000).splitlines(keepends=True)
                assert parsed(heading).headingT == round(status.estimate.to_json()["heading_deg"], 1)
                assert verdict.startswith(b"$PGNRS,A,")
        finally:
            out.close()


def test_a_listener_that_does_not_read_is_dropped_and_the_others_are_served(status, monkeypatch):
    monkeypatch.setattr(nmea_out, "status_sentences", lambda *_: "$" * 200_000 + "\n")
    out = NmeaOut(Target("tcp", "127.0.0.1", 0), rate_hz=100, status=lambda: status)
    out.start()
    try:
        with (
            socket.create_connection(("127.0.0.1", out.port)),
            socket.create_connection(("127.0.0.1", out.port)) as other,
            other.makefile("rb") as stream,
        ):
            until(lambda: len(stream.readline()) and out.listeners == 1)
            assert len(stream.readline()) == 200_001
    finally:
        out.close()


def test_a_port_in_use_and_an_address_that_is_none():
    with socket.create_server(("127.0.0.1", 0)) as other, pytest.raises(InputError, match="in use"):
        NmeaOut(Target("tcp", *other.getsockname()), rate_hz=1, status=lambda: Status("waiting", ""))
    for text in ("tcp:4001", "serial:", "udp:here:99999", ""):
        with pytest.raises(InputError, match="--nmea-out"):
            parse_target(text)


def test_sentences_must_fit_through_a_serial_port(tmp_path):
    assert parse_target("serial:/dev/ttyUSB1") == Target("serial", "/dev/ttyUSB1", 4800)
    with pytest.raises(InputError, match="Choose a lower --output-rate"):
        NmeaOut(Target("serial", str(tmp_path / "tty"), 4800), rate_hz=10, status=lambda: Status("waiting", ""))
    with pytest.raises(InputError, match="there is no device"):
        NmeaOut(Target("serial", "/none/tty", 38400), rate_hz=10, status=lambda: Status("waiting", ""))
