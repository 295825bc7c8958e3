"""What a stream sends, told by itself: lines of numbers, or the frames of a unit whose checksums hold."""

from __future__ import annotations

from gyronorth.findings import Finding
from gyronorth.frames import recognise
from gyronorth.frames.recognition import LOOK
from gyronorth.live.frames import FrameReader
from gyronorth.live.lines import LineReader
from gyronorth.live.rows import RowBatch, Tally
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.source import Facts

#: Bytes that are looked at for the first time, and by how much more than the last time each time after.
FIRST_LOOK, GROWTH = 64, 1.5
#: What `protocol` is for lines of numbers, and before anything is known.
LINES, UNKNOWN = "lines", ""


class StreamReader:
    """Takes bytes as they come and returns rows, of lines until frames are recognised.

    Parameters
    ----------
    name : str
        Of the source, for messages.
    options : ReadOptions
        What the user declares; `protocol` decides at once.

    Raises
    ------
    InputError
        As `LineReader` and `FrameReader`.
    """

    def __init__(self, name: str, options: ReadOptions) -> None:
        self._name, self._options = name, options
        self._held = b""  # bytes by which the protocol may still be told
        self._next_look = FIRST_LOOK
        self._reader: LineReader | FrameReader = LineReader(name, options)
        self._settled = options.protocol is not None
        if options.protocol is not None:
            self._reader = FrameReader(name, options.protocol, options)

    @property
    def protocol(self) -> str:
        """The protocol of the frames, "lines", or "" before anything is known."""
        if isinstance(self._reader, FrameReader):
            return self._reader.protocol
        return UNKNOWN if self._reader.form is None else LINES

    @property
    def tally(self) -> Tally:
        """What came."""
        return self._reader.tally

    @property
    def statements(self) -> int:
        """How often the stream has said something new of itself."""
        return self._reader.statements

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """What is assumed of the stream."""
        return self._reader.warnings if isinstance(self._reader, FrameReader) else ()

    def facts(self) -> Facts:
        """What the stream states; InputError where it makes no sense."""
        return self._reader.facts()

    def datagram(self, data: bytes) -> bytes:
        """The bytes of a datagram: lines in it are whole, with or without an end."""
        lines = isinstance(self._reader, LineReader)
        return data + b"\n" if lines and not data.endswith(b"\n") else data

    def push(self, data: bytes) -> list[RowBatch]:
        """The rows that `data` completes."""
        if not self._settled:
            self._held += data
            if self._looked():
                data, self._held = self._held, b""
        batches = self._reader.push(data)
        if isinstance(self._reader, LineReader) and (self._reader.form is not None or len(self._held) > LOOK):
            self._settled, self._held = True, b""
        return batches

    def end(self) -> list[RowBatch]:
        """The last rows."""
        return self._reader.end()

    def cut(self) -> None:
        """The connection broke."""
        self._reader.cut()

    def midway(self) -> None:
        """What comes next may begin in the middle of a line or of a frame."""
        self._reader.midway()

    def begin_raw(self) -> None:
        """The bytes from here on are to be those of a new file."""
        if isinstance(self._reader, FrameReader):
            self._reader.begin_raw()

    def raw(self) -> list[tuple[bool, bytes]]:
        """Bytes of frames since last asked, each with whether they begin a new file; none of lines, which rows keep."""
        return self._reader.raw() if isinstance(self._reader, FrameReader) else []

    def _looked(self) -> bool:
        """Whether frames are recognised now."""
        if len(self._held) < self._next_look:
            return False
        self._next_look = int(len(self._held) * GROWTH)
        protocol = recognise(self._held)
        if protocol is None:
            return False
        self._reader, self._settled = FrameReader(self._name, protocol, self._options), True
        return True
