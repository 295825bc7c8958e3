"""A serial port: opened with the right words where it cannot be, and written to without ever waiting for it."""

from __future__ import annotations

import os
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from gyronorth.errors import InputError

#: A port that is gone is opened anew so often, s.
RETRY = 1.0
#: A write may take so long, s.
PATIENCE = 0.2
#: Bits on the line for one byte (8N1), and bytes of the sentences of one moment, at least.
BITS, SENTENCES = 10, 140


def serial_of(what: str, device: str) -> Any:
    """The module of pyserial, where a device can be opened with it; `what` begins the message where it cannot.

    Raises
    ------
    InputError
        If pyserial is missing, the device may not be opened, or cannot ever be there.
    """
    try:
        import serial
    except ImportError:
        raise InputError("A serial port needs pyserial: install gyronorth[live].") from None
    if Path(device).exists() and not os.access(device, os.R_OK | os.W_OK):
        raise InputError(
            f"{what}: {device} may not be opened by this user. On Debian: sudo adduser $USER dialout, and log in again."
        )
    if not Path(device).exists() and not Path(device).parent.is_dir():
        raise InputError(f"{what}: there is no device {device}; example: serial:/dev/ttyUSB0:115200.")
    return serial


class SerialOut:
    """Sends to a serial port, which may be unplugged and come back; what cannot be sent then is not sent later.

    Raises
    ------
    InputError
        As `serial_of`, or if so many sentences a second do not fit through the port.
    """

    def __init__(self, device: str, baud: int, *, rate_hz: float) -> None:
        self._serial = serial_of(f"--nmea-out serial:{device}", device)
        if SENTENCES * BITS * rate_hz > baud:
            raise InputError(
                f"--nmea-out serial:{device}:{baud}: sentences {rate_hz:g} times a second need about "
                f"{SENTENCES * BITS * rate_hz:g} baud. Choose a lower --output-rate, or a faster port: "
                f"serial:{device}:38400."
            )
        self._device, self._baud = device, baud
        self._port: Any = None
        self._tried = -RETRY

    def send(self, data: bytes) -> None:
        """Send, or not where the port is gone."""
        if self._port is None:
            if time.monotonic() - self._tried < RETRY:
                return
            self._tried = time.monotonic()
            with suppress(OSError):  # the errors of pyserial are such
                self._port = self._serial.Serial(self._device, self._baud, write_timeout=PATIENCE)
        if self._port is None:
            return
        try:
            self._port.write(data)
        except OSError:
            self.close()

    def close(self) -> None:
        """Let the port go."""
        port, self._port = self._port, None
        if port is not None:
            with suppress(OSError):
                port.close()
