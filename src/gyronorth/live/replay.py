"""A file played back as if it came from the sensor, at any speed."""

from __future__ import annotations

import time
from pathlib import Path
from threading import Event

from gyronorth.errors import InputError
from gyronorth.frames import FrameStream, recognise
from gyronorth.frames.recognition import LOOK
from gyronorth.live.events import CHUNK, Bytes, Connected, Emit, Ended
from gyronorth.live.lines import LineReader
from gyronorth.live.rows import Form
from gyronorth.readers.formats.frames import frame_options
from gyronorth.readers.options import ReadOptions

#: Lines are handed over so often, s.
STEP = 0.05
#: A longer gap in the file, s, is not waited for.
LONGEST_PAUSE = 15.0
#: Bytes handed over in one step, at most.
LARGEST_STEP = CHUNK
#: Lines of the head among which the form must show.
HEAD_LINES = 200
#: Bytes of the head of a capture in which a sample must be, and bytes handed over before its rate is known.
HEAD_BYTES, FIRST_STEP = 1 << 20, 1 << 12


def open_replay(path: Path, options: ReadOptions, *, speed: float) -> Replay | FrameReplay:
    """A file of lines or of frames, played back `speed` times faster than it was measured.

    Raises
    ------
    InputError
        If the file cannot be read, or nothing tells when its samples were measured.
    """
    if path.is_dir():
        raise InputError(f"SOURCE {path} is a folder; one file is expected: a replay plays one recording.")
    try:
        with path.open("rb") as file:
            head = file.read(LOOK)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}.") from None
    protocol = options.protocol or recognise(head)
    if protocol is not None:
        return FrameReplay(path, protocol, options, speed=speed)
    return Replay(path, options, speed=speed)


class FrameReplay:
    """Hands over a capture of frames by the unit's clock or, without one, by the number of the sample.

    Raises
    ------
    InputError
        If no sample is in it, or its rate is not known.
    """

    live = False

    def __init__(self, path: Path, protocol: str, options: ReadOptions, *, speed: float) -> None:
        self.name = str(path)
        self._path, self._speed = path, speed
        self._protocol, self._options = protocol, frame_options(protocol, options, path.name)
        stream = FrameStream(protocol, self._options)
        with path.open("rb") as file:
            samples = stream.feed(file.read(HEAD_BYTES)) or stream.finish()
        if samples is None:
            raise InputError(f"{path.name} holds no sample of protocol {protocol} in its first {HEAD_BYTES} bytes.")
        if samples.t is None:
            raise InputError(
                f"The frames of {path.name} hold no time and do not state their rate. Declare it: --rate HZ."
            )

    def run(self, emit: Emit, stop: Event) -> None:
        """Hand over the bytes of the file at their times, until `stop` is set or it ends."""
        emit(Connected())
        begun = time.monotonic()
        stream = FrameStream(self._protocol, self._options)
        played, last, size, taken = 0.0, None, FIRST_STEP, 0
        with self._path.open("rb") as file:
            while not stop.is_set() and (data := file.read(size)):
                emit(Bytes(data))
                taken += len(data)
                samples = stream.feed(data)
                if samples is not None and samples.t is not None:
                    now = float(samples.t[-1])
                    step = now - (float(samples.t[0]) if last is None else last)
                    step, last = step if 0 < step < LONGEST_PAUSE else 0.0, now
                    played += step
                    if played > 0:
                        size = int(min(max(taken / played * STEP * self._speed, 1), LARGEST_STEP))
                stop.wait(max(0.0, begun + played / self._speed - time.monotonic()))
        emit(Ended())


class Replay:
    """Hands over the lines of a file at the times they were measured, `speed` times faster.

    Raises
    ------
    InputError
        If the file cannot be read, or neither has a time column nor a rate.
    """

    live = False

    def __init__(self, path: Path, options: ReadOptions, *, speed: float) -> None:
        self.name = str(path)
        self._path, self._speed = path, speed
        reader = LineReader(path.name, options)
        with path.open("rb") as file:
            head = b"".join(file.readline(CHUNK) for _ in range(HEAD_LINES))
        reader.push(head if head.endswith(b"\n") else head + b"\n")
        if reader.form is None:
            raise InputError(
                f"{path.name} has no header and no row that is understood among its first {HEAD_LINES} lines, and no "
                "frames of a known protocol; lines such as those of `gyronorth simulate -o FILE.csv` can be replayed. "
                "`gyronorth convert` makes them."
            )
        self._form: Form = reader.form
        self._rate_hz = options.rate_hz or reader.facts().rate_hz
        if self._rate_hz is None and not self._form.time:
            raise InputError(f"{path.name} has no time column and does not state its rate. Declare it: --rate HZ.")

    def run(self, emit: Emit, stop: Event) -> None:
        """Hand over the lines of the file at their times, until `stop` is set or it ends."""
        emit(Connected())
        begun = time.monotonic()
        played = 0.0  # s of the file's time
        size = 1  # bytes of a step
        last: float | None = None
        with self._path.open("rb") as file:
            while not stop.is_set():
                lines = file.readlines(size)  # whole lines
                if not lines:
                    break
                emit(Bytes(b"".join(lines)))
                now = self._time(lines)
                if now is None:
                    step = len(lines) / self._rate_hz if self._rate_hz else 0.0
                else:
                    step = now - (now if last is None else last)
                    step, last = step if 0 < step < LONGEST_PAUSE else 0.0, now
                played += step
                if step > 0:
                    size = min(round(sum(map(len, lines)) * STEP * self._speed / step), LARGEST_STEP)
                stop.wait(max(0.0, begun + played / self._speed - time.monotonic()))
        emit(Ended())

    def _time(self, lines: list[bytes]) -> float | None:
        """The time stamp of the last line that has one."""
        if not self._form.time:
            return None
        position = self._form.use[self._form.columns.index("t")]
        for line in reversed(lines):
            fields = line.split(b",")
            if len(fields) == len(self._form.titles):
                try:
                    return float(fields[position])
                except ValueError:
                    continue
        return None
