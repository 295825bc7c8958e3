"""NMEA 0183 out: over TCP to any number of listeners, over UDP, or to a serial port.

HEHDT is sent only while the heading is valid and is being measured, never of a replay. A listener that does not keep
up is left behind, and dropped if it does not catch up; a serial port that is gone is opened anew.
"""

from __future__ import annotations

import re
import selectors
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass
from threading import Event, Thread

from gyronorth.errors import InputError
from gyronorth.live.binding import bound_socket, descriptors
from gyronorth.live.serial_out import SerialOut
from gyronorth.live.status import UNATTENDED, Status
from gyronorth.report.nmea import running_sentences

#: Baud rate of a serial port where none is given: that of IEC 61162-1.
SERIAL_BAUD = 4800
#: Bytes that may wait for a slow listener; it is dropped beyond.
PATIENCE = 64_000
#: Programs that may listen at a time, and of the files that may be open the part that they may be; more are turned
#: away, so that the recording can be opened.
MOST_LISTENERS, SHARE = 2000, 4
#: After an accept that failed, s.
PAUSE = 0.1


@dataclass(frozen=True)
class Target:
    """Where the sentences go."""

    kind: str  # tcp, udp, serial
    host: str  # or device
    port: int  # or baud rate


def parse_target(text: str) -> Target:
    """tcp:HOST:PORT, udp:HOST:PORT or serial:DEVICE[:BAUD].

    Raises
    ------
    InputError
        If it is none of these.
    """
    match = re.fullmatch(r"(tcp|udp):(.+):(\d{1,5})", text)
    if match is not None and int(match[3]) <= 65535:
        return Target(match[1], match[2].strip("[]"), int(match[3]))
    match = re.fullmatch(r"(serial):(.+?)(?::(\d{2,8}))?", text)
    if match is not None:
        return Target(match[1], match[2], int(match[3] or SERIAL_BAUD))
    raise InputError(
        f"--nmea-out {text!r} is not tcp:HOST:PORT, udp:HOST:PORT or serial:DEVICE[:BAUD]; "
        "example: tcp:127.0.0.1:10110."
    )


def status_sentences(status: Status, kind: str = "standard") -> str:
    """What is sent of a status, in the sentences of a set of `catalogue.NMEA_SETS`."""
    mode = "S" if status.replay else "E" if status.held is not None else "A"
    turn = status.rate_of_turn if status.state == "running" and status.unattended <= UNATTENDED else None
    return "".join(running_sentences(status.estimate, kind=kind, mode=mode, rate_of_turn=turn))


class NmeaOut:
    """Sends the sentences of the latest status at a fixed rate, from a thread of its own.

    Raises
    ------
    InputError
        If the address cannot be used.
    """

    def __init__(self, target: Target, *, rate_hz: float, status: Callable[[], Status], kind: str = "standard") -> None:
        self._interval, self._status, self._kind = 1 / rate_hz, status, kind
        self._serial = SerialOut(target.host, target.port, rate_hz=rate_hz) if target.kind == "serial" else None
        self._stop = Event()
        self._clients: dict[socket.socket, bytes] = {}
        self._selector = selectors.DefaultSelector()
        self._tcp = target.kind == "tcp"
        if self._serial is not None:
            self._thread = Thread(target=self._run, name="nmea", daemon=True)
            return
        try:
            if self._tcp:
                self._socket = bound_socket(target.host, target.port, socket.SOCK_STREAM)
            else:
                place = socket.getaddrinfo(target.host, target.port, type=socket.SOCK_DGRAM)[0]
                self._address = place[4]
                self._socket = socket.socket(place[0], socket.SOCK_DGRAM)
                self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        except OSError as error:
            why = error.strerror or error
            raise InputError(f"--nmea-out {target.kind}:{target.host}:{target.port}: {why}.") from None
        self._socket.setblocking(False)
        if self._tcp:
            self._selector.register(self._socket, selectors.EVENT_READ)
        self._thread = Thread(target=self._run, name="nmea", daemon=True)

    @property
    def port(self) -> int:
        """The port that is served, or sent from."""
        return self._socket.getsockname()[1]

    @property
    def listeners(self) -> int:
        """How many programs listen by TCP."""
        return len(self._clients)

    def start(self) -> None:
        """Begin to send."""
        self._thread.start()

    def close(self) -> None:
        """Send no more."""
        self._stop.set()
        self._thread.join()
        if self._serial is not None:
            self._serial.close()
            return
        for client in [*self._clients, self._socket]:
            client.close()

    def _run(self) -> None:
        due = time.monotonic()
        while not self._stop.is_set():
            now = time.monotonic()
            if now >= due:
                self._send(status_sentences(self._status(), self._kind).encode("ascii"))
                due = max(due + self._interval, now)
            self._serve(min(max(due - time.monotonic(), 0.0), 0.2))

    def _serve(self, timeout: float) -> None:
        """Take new listeners and let go of those that left, for some time."""
        if not self._tcp:
            self._stop.wait(timeout)
            return
        for key, _ in self._selector.select(timeout):
            connection = key.fileobj
            assert isinstance(connection, socket.socket)
            if connection is self._socket:
                self._welcome()
                continue
            try:
                gone = not connection.recv(4096)  # what a listener says is of no interest
            except BlockingIOError:
                gone = False
            except OSError:
                gone = True
            if gone:
                self._drop(connection)

    def _welcome(self) -> None:
        try:
            client, _ = self._socket.accept()
        except BlockingIOError:
            return
        except OSError:  # no descriptor is left: the connection stays waiting, and is not asked for at once
            self._stop.wait(PAUSE)
            return
        if len(self._clients) >= min(MOST_LISTENERS, descriptors() // SHARE):
            client.close()
            return
        client.setblocking(False)
        self._clients[client] = b""
        self._selector.register(client, selectors.EVENT_READ)

    def _send(self, data: bytes) -> None:
        if self._serial is not None:
            self._serial.send(data)
            return
        if not self._tcp:
            try:
                self._socket.sendto(data, self._address)
            except OSError:
                return  # nobody is there yet, or the network is down: the next one may arrive
            return
        for client, waiting in list(self._clients.items()):
            waiting += data
            try:
                waiting = waiting[client.send(waiting) :]
            except BlockingIOError:
                pass
            except OSError:
                self._drop(client)
                continue
            if len(waiting) > PATIENCE:
                self._drop(client)
            else:
                self._clients[client] = waiting

    def _drop(self, client: socket.socket) -> None:
        self._selector.unregister(client)
        del self._clients[client]
        client.close()
