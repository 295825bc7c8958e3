"""What a stream sends, recognised by its content: lines of numbers, or the frames of a unit whose checksums hold."""

from __future__ import annotations

from dataclasses import replace

from gyronorth.errors import InputError
from gyronorth.findings import Finding
from gyronorth.frames import no_inertial_data, others_of, recognise
from gyronorth.frames.recognition import LOOK
from gyronorth.live.frames import FrameReader
from gyronorth.live.lines import LineReader, columns_by_width
from gyronorth.live.rows import RowBatch, StreamTally
from gyronorth.live.texts import TextReader
from gyronorth.readers.asking import OpenQuestion
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.source import Facts

#: Bytes that are looked at for the first time, and by how much more than the last time each time after.
FIRST_LOOK, GROWTH = 64, 1.5
#: Bytes by which frames without inertial data are told.
ENOUGH = 4096
#: Lines by which the layout of a text that is not ours is told.
TOLD_BY = 40
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
        self._next_lines = TOLD_BY
        self._in_si = False
        self._refused: InputError | None = None  # why these are no lines of ours
        self._reader: LineReader | FrameReader | TextReader = LineReader(name, options)
        self._settled = options.protocol is not None
        if options.gyro_scale is not None or options.accel_scale is not None:
            self._in_si = True  # a recording of such lines would not say what they are: rows leave in SI
            self._refused = InputError(f"{name} sends no rows of numbers that --gyro-scale and --accel-scale are for.")
        if options.protocol is not None:
            self._reader = FrameReader(name, options.protocol, options)

    @property
    def protocol(self) -> str:
        """The protocol of the frames, "lines", or "" before anything is known."""
        if isinstance(self._reader, FrameReader):
            return self._reader.protocol
        return UNKNOWN if self._reader.form is None else LINES

    @property
    def tally(self) -> StreamTally:
        """Counts of the input."""
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
        lines = not isinstance(self._reader, FrameReader)
        return data + b"\n" if lines and not data.endswith(b"\n") else data

    def push(self, data: bytes) -> list[RowBatch]:
        """The rows that `data` completes."""
        if not self._settled:
            self._held += data
            if self._looked():
                data, self._held = self._held, b""
        batches = self._lines(data)
        if isinstance(self._reader, LineReader) and (self._reader.form is not None or len(self._held) > LOOK):
            self._settled, self._held = True, b""
        return batches

    def end(self) -> list[RowBatch]:
        """The last rows."""
        if not self._settled and self._held and self._reader.form is None:
            self._refuse_others()
        if self._refused is not None or (not self._settled and self._held and self._reader.form is None):
            batches = self._as_text()
            return [*batches, *self._reader.end()]
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

    def _lines(self, data: bytes) -> list[RowBatch]:
        """Rows of lines of ours, else of a text in another layout as soon as enough of it is there."""
        batches: list[RowBatch] = []
        if self._refused is None:
            try:
                batches = self._reader.push(data)
            except InputError as error:
                if self._settled or not isinstance(self._reader, LineReader):
                    raise
                self._refused = error
        if self._refused is None and (self._settled or self._reader.form is not None):
            return batches
        count = self._held.count(b"\n")
        if count < self._next_lines and (self._refused is None or len(self._held) <= LOOK):
            return batches
        self._next_lines = int(count * GROWTH)
        return self._as_text()

    def _as_text(self) -> list[RowBatch]:
        """The rows that are held, read as the first lines of a file are."""
        held, options = self._held, self._options
        if self._in_si and not options.columns:
            options = replace(options, columns=columns_by_width(held))
        try:
            reader = TextReader(self._name, held[: held.rfind(b"\n") + 1] or held, options)
        except InputError as error:
            if self._refused is not None or isinstance(error, OpenQuestion):
                raise self._better(error) from None
            return []
        self._reader, self._settled, self._held, self._refused = reader, True, b"", None
        return reader.push(held)

    def _better(self, error: InputError) -> InputError:
        """What asks for the least: a question with its answer, else why these are no lines of ours."""
        self._refuse_others()
        return error if isinstance(error, OpenQuestion) or self._refused is None or self._in_si else self._refused

    def _refuse_others(self) -> None:
        """InputError where the bytes are frames of a known protocol without inertial data."""
        others = others_of(self._held[-LOOK:])
        if others is not None:
            raise InputError(no_inertial_data(self._name, *others))

    def _looked(self) -> bool:
        """Whether frames are recognised now."""
        if len(self._held) < self._next_look:
            return False
        self._next_look = int(len(self._held) * GROWTH)
        protocol = recognise(self._held)
        if protocol is None:
            if len(self._held) >= ENOUGH:
                self._refuse_others()
            return False
        self._reader, self._settled = FrameReader(self._name, protocol, self._options), True
        return True
