"""Where the bytes come from: a file replayed, standard input, TCP, UDP, a serial port.

A source runs in a thread of its own and hands events to `emit`, which may make it wait. Network
and serial sources come back by themselves when the connection breaks.
"""

from __future__ import annotations

import re
import socket
import sys
from collections.abc import Callable
from pathlib import Path
from threading import Event

from gyronorth.errors import InputError
from gyronorth.live.binding import bound_socket
from gyronorth.live.events import CHUNK, Bytes, ByteSource, Connected, Emit, Ended, Lost, SourceEvent
from gyronorth.live.replay import open_replay
from gyronorth.live.serial_out import serial_of
from gyronorth.readers.options import ReadOptions

#: Waits between attempts to connect, s: the first, and the longest.
FIRST_WAIT, LONGEST_WAIT = 0.25, 5.0
#: A connection on which nothing comes for so long, s, is made anew: the other side may have lost its power.
SILENCE = 15.0
#: Room for datagrams in the kernel, bytes: some seconds of the fastest sensor.
DATAGRAM_ROOM = 4 << 20
#: A sender of datagrams that was silent for so long, s, may be followed by another.
SENDER_SILENCE = 5.0
#: What a source may be, for messages.
KINDS = "a file, -, tcp:HOST:PORT, udp:[HOST:]PORT or serial:DEVICE[:BAUD]"
#: Baud rate of a serial port where none is given.
BAUD = 115200


def open_source(text: str, options: ReadOptions, *, speed: float) -> ByteSource:
    """The source that a user named.

    Parameters
    ----------
    text : str
        A file, "-", "tcp:HOST:PORT", "udp:[HOST:]PORT" or "serial:DEVICE[:BAUD]".
    options : ReadOptions
        Declarations; a file is replayed by its time column, or by the declared rate.
    speed : float
        How many times faster than it was recorded a file is replayed.

    Raises
    ------
    InputError
        If it is none of these, or the file cannot be read.
    """
    kind, _, place = text.partition(":")
    if not text.strip():
        raise InputError(
            f"SOURCE is {text!r}, which names nothing; {KINDS} is expected. Was a variable of a script left unset?"
        )
    if text == "-":
        return StandardInput()
    if kind == "tcp":
        return TcpClient(text, *_host_and_port(text, place))
    if kind == "udp":
        return UdpListener(text, *_host_and_port(text, place if ":" in place else f"127.0.0.1:{place}"))
    if kind == "serial":
        match = re.fullmatch(r"(.+?)(?::(\d+))?", place)
        if match is None:
            raise InputError(f"SOURCE {text!r} names no device; example: serial:/dev/ttyUSB0:115200.")
        return SerialPort(text, match[1], int(match[2] or BAUD))
    if not Path(text).exists() and re.match(r"[a-z]{2,}:", text):
        raise InputError(f"SOURCE {text!r} is no file and of no known kind; {KINDS} is expected.")
    return open_replay(Path(text), options, speed=speed)


class StandardInput:
    """What another program prints; the end of its output is the end."""

    name, live = "standard input", True

    def run(self, emit: Emit, stop: Event) -> None:
        """Hand over everything that comes, until `stop` is set or nothing more can come."""
        emit(Connected())
        while not stop.is_set():
            data = sys.stdin.buffer.raw.read(CHUNK)  # type: ignore[attr-defined]
            if not data:
                break
            emit(Bytes(data))
        emit(Ended())


class TcpClient:
    """Lines or frames from a server."""

    live = True

    def __init__(self, name: str, host: str, port: int) -> None:
        self.name, self._address = name, (host, port)

    def run(self, emit: Emit, stop: Event) -> None:
        """Hand over everything that comes, until `stop` is set or nothing more can come."""
        _again_and_again(self._session, emit, stop)

    def _session(self, emit: Emit, stop: Event) -> None:
        with socket.create_connection(self._address, timeout=5.0) as connection:
            connection.settimeout(SILENCE)
            emit(Connected())
            while not stop.is_set():
                data = connection.recv(CHUNK)
                if not data:
                    raise ConnectionError("closed by the other side")
                emit(Bytes(data))


class UdpListener:
    """Lines or frames in datagrams, of one sender at a time."""

    live = True

    def __init__(self, name: str, host: str, port: int) -> None:
        self.name = name
        try:
            self._socket = bound_socket(host, port, socket.SOCK_DGRAM, receive=DATAGRAM_ROOM)
        except OSError as error:
            raise InputError(f"SOURCE {name}: cannot listen there: {error.strerror or error}.") from None

    def run(self, emit: Emit, stop: Event) -> None:
        """Hand over everything that comes, until `stop` is set or nothing more can come."""
        self._socket.settimeout(SENDER_SILENCE)
        sender = None
        emit(Connected())
        with self._socket:
            while not stop.is_set():
                try:
                    data, address = self._socket.recvfrom(CHUNK)
                except TimeoutError:
                    sender = None
                    continue
                sender = sender or address
                if address == sender and data:
                    emit(Bytes(data, whole=True))


class SerialPort:
    """Lines or frames from a serial port. What comes first may be the rest of one."""

    live = True

    def __init__(self, name: str, device: str, baud: int) -> None:
        self._serial = serial_of(f"SOURCE {name}", device)
        self.name, self._device, self._baud = name, device, baud

    def run(self, emit: Emit, stop: Event) -> None:
        """Hand over everything that comes, until `stop` is set or nothing more can come."""
        _again_and_again(self._session, emit, stop)

    def _session(self, emit: Emit, stop: Event) -> None:
        with self._serial.Serial(self._device, self._baud, timeout=0.2) as port:
            emit(Connected(midway=True))
            while not stop.is_set():
                data = port.read(max(1, min(port.in_waiting, CHUNK)))
                if data:
                    emit(Bytes(data))


def _again_and_again(session: Callable[[Emit, Event], None], emit: Emit, stop: Event) -> None:
    """Run a session anew each time it breaks, after waits that grow while nothing comes."""
    wait = FIRST_WAIT

    def passing(event: SourceEvent) -> None:
        nonlocal wait
        if isinstance(event, Bytes):
            wait = FIRST_WAIT
        emit(event)

    while not stop.is_set():
        try:
            session(passing, stop)
        except OSError as error:  # TimeoutError and the errors of pyserial are such
            silent = isinstance(error, TimeoutError)
            emit(Lost("no answer" if silent else str(error.strerror or error)))
        stop.wait(wait)
        wait = min(2 * wait, LONGEST_WAIT)


def _host_and_port(text: str, place: str) -> tuple[str, int]:
    host, _, port = place.rpartition(":")
    if not host or not re.fullmatch(r"\d{1,5}", port) or not 0 < int(port) < 65536:
        raise InputError(f"SOURCE {text!r} has no host and port; examples: tcp:192.168.1.5:4001, udp:4001.")
    return host.strip("[]"), int(port)
