"""The latitude from a receiver of satellite navigation: GGA and RMC sentences of NMEA 0183."""

from __future__ import annotations

import re
from functools import reduce
from math import radians
from threading import Event, Thread

from gyronorth.errors import InputError
from gyronorth.live.events import Bytes, ByteSource, SourceEvent

#: Of a line without an end so much is kept.
LONGEST = 1024
#: Quality of GGA and mode of RMC that are no fix of a receiver: none, typed in, simulated.
_NO_FIX, _NO_MODE = (b"", b"0", b"7", b"8"), (b"N", b"M", b"S")
_SENTENCE = re.compile(rb"\$([A-Z]{2})(GGA|RMC),([ -)+-~]*)\*([0-9A-Fa-f]{2})")


def latitude_of(line: bytes) -> float | None:
    """The latitude, rad, of a GGA or RMC sentence with a fix and a checksum that holds; None of anything else."""
    match = _SENTENCE.search(line)
    if match is None:
        return None
    body = line[match.start() + 1 : match.start(4) - 1]
    if reduce(lambda total, byte: total ^ byte, body, 0) != int(match[4], 16):
        return None
    fields = match[3].split(b",")
    if match[2] == b"GGA":
        place, fix = 1, len(fields) > 5 and fields[5] not in _NO_FIX
    else:
        place, fix = 2, fields[1:2] == [b"A"] and fields[11:12] not in [[mode] for mode in _NO_MODE]
    angle, half = re.fullmatch(rb"(\d{2})(\d{2}(?:\.\d+)?)", b"".join(fields[place : place + 1])), fields[place + 1 :]
    if not fix or angle is None or half[:1] not in ([b"N"], [b"S"]):
        return None
    minutes = float(angle[2])
    degrees = int(angle[1]) + minutes / 60
    if minutes > 60 or degrees > 90:
        return None
    return radians(degrees if half[0] == b"N" else -degrees)


class Position:
    """Listens to a receiver in a thread of its own; `latitude` is that of the latest fix."""

    def __init__(self, source: ByteSource) -> None:
        self.name = source.name
        self.latitude: float | None = None  # rad
        self.trouble = ""
        self._source, self._rest = source, b""
        self._known, self._stop = Event(), Event()

    def start(self) -> None:
        """Begin to listen."""
        Thread(target=self._source.run, args=(self._take, self._stop), name="position", daemon=True).start()

    def wait(self, timeout: float) -> bool:
        """Whether a fix has come, after `timeout` s at most."""
        return self._known.wait(timeout)

    def close(self) -> None:
        """Listen no more."""
        self._stop.set()

    def _take(self, event: SourceEvent) -> None:
        if not isinstance(event, Bytes):
            self._rest = b""
            self.trouble = getattr(event, "why", "")
            return
        *lines, rest = (self._rest + event.bytes + (b"\n" if event.whole else b"")).split(b"\n")
        self._rest = rest[-LONGEST:]
        for line in lines:
            latitude = latitude_of(line)
            if latitude is not None:
                self.latitude = latitude
                self._known.set()


def check_kind(text: str) -> None:
    """Refuse what is no receiver.

    Raises
    ------
    InputError
        If the text names neither a latitude nor a stream.
    """
    if not text.startswith(("tcp:", "udp:", "serial:")):
        raise InputError(
            f"--latitude {text!r} is neither a latitude of -90 to 90 degrees nor tcp:HOST:PORT, udp:[HOST:]PORT or "
            "serial:DEV[:BAUD], a stream of GGA or RMC sentences; example: --latitude 32.11."
        )
