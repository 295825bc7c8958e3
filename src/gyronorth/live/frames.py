"""Bytes of a unit's frames to rows: like lines of a stream, but decoded, with the unit's clock and its status."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from gyronorth.errors import InputError
from gyronorth.findings import Finding
from gyronorth.frames import FrameStream, Report, Samples, no_inertial_data
from gyronorth.live.rows import Form, LiveRows, RowBatch, StreamTally
from gyronorth.readers.formats.frames import SI, frame_options, usual_facts
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.source import FLAGS, FORCES, RATES, TIME, Facts

#: Title of the unit's temperature in a recording.
TEMPERATURE = "temperature_degC"
#: Frames without inertial data after which a unit is not set to send any.
MOST_OTHERS = 400


class FrameReader:
    """Takes bytes as they come and returns rows.

    Parameters
    ----------
    name : str
        Of the source, for messages.
    protocol : str
        A name of `gyronorth.frames.NAMES`.
    options : ReadOptions
        What the user declares.

    Raises
    ------
    InputError
        If the protocol is not known, or something is declared that does not apply to it; later, from `push`, if the
        stream leaves something open that must be declared.
    """

    statements = 0  # of comments, which frames do not have

    def __init__(self, name: str, protocol: str, options: ReadOptions) -> None:
        self.form: Form | None = None
        self._name = name
        self.protocol = protocol
        self._options = frame_options(protocol, options, name)
        self._stream = FrameStream(protocol, self._options)
        self._past = StreamTally()  # of the streams before this one
        self._why = ""  # why the next rows behind a jump do not go on from those before
        self._cut = False  # the next rows do not go on from those before, jump or not
        self._raw = bytearray()
        self._raw_anew = True
        self._raw_parts: list[tuple[bool, bytes]] = []  # before these
        self._fed = 0  # bytes that the stream got
        self._latest = b""  # the last of them

    @property
    def tally(self) -> StreamTally:
        """Counts of the input."""
        report, past = self._stream.report, self._past
        return StreamTally(
            lines=past.lines + report.samples + report.unusable,
            garbage=past.garbage + report.unusable,
            skipped_bytes=past.skipped_bytes + report.skipped,
            other_frames=past.other_frames + report.other,
        )

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """What is assumed of the stream."""
        return self._stream.report.findings

    def facts(self) -> Facts:
        """What the frames say of themselves."""
        return SI

    def push(self, data: bytes) -> list[RowBatch]:
        """The rows that `data` completes."""
        stream, before = self._stream, self._stream.report.settings
        undecided = self._latest[-stream.undecided :] if stream.undecided else b""
        start = self._fed - len(undecided)
        self._fed += len(data)
        self._latest = undecided + data
        samples = stream.feed(data)
        report = stream.report
        if not report.samples and not report.unusable and report.other >= MOST_OTHERS and report.messages:
            raise InputError(no_inertial_data(self._name, self.protocol, report.messages))
        if stream.report.settings > before:
            self._why = "the unit was reset: it sends at another rate or in another layout"
            place = max(stream.changed_at - start, 0)
            old = max(place - len(undecided), 0)
            self._raw_parts.append((self._raw_anew, bytes(self._raw) + data[:old]))
            self._raw, self._raw_anew = bytearray(b"".join(stream.facts) + self._latest[place:]), True
        else:
            self._raw += data
        return self._batches(samples)

    def end(self) -> list[RowBatch]:
        """The rows that were held back at the end."""
        return self._batches(self._stream.finish())

    def cut(self) -> None:
        """The connection broke. Without a clock in the unit nobody knows for how long."""
        report = self._stream.report
        if report.samples and report.clock != "unit's clock":
            self._anew("the connection broke, and the unit sends no time: the gap is unknown")

    def midway(self) -> None:
        """What comes next may begin in the middle of a frame: the checksums tell."""

    def begin_raw(self) -> None:
        """From here on the bytes are to be those of a new file: the configuration, what is not decided, what comes."""
        self._raw = bytearray(b"".join(self._stream.facts) + self._stream.pending)
        self._raw_anew = True

    def raw(self) -> list[tuple[bool, bytes]]:
        """Bytes that came since last asked, each with whether they begin a file that replays to what follows."""
        parts, self._raw_parts = self._raw_parts, []
        if self._raw:
            parts.append((self._raw_anew, bytes(self._raw)))
            self._raw_anew = False
            self._raw.clear()
        return parts

    def _anew(self, why: str) -> None:
        facts = self._stream.facts
        self._past = self.tally
        self._stream, self._why, self._cut = FrameStream(self.protocol, self._options, facts), why, True
        self._raw, self._raw_anew = bytearray(b"".join(facts)), True
        self._fed, self._latest = 0, b""

    def _batches(self, samples: Samples | None) -> list[RowBatch]:
        """Rows in batches, each from one setting of the unit or its clock to the next."""
        if samples is None:
            return []
        rows, form = _rows(samples, self._stream.report)
        jumps = np.flatnonzero(samples.jumped).tolist()
        edges = [0, *(place for place in jumps if place > 0), len(samples)]
        clock = self._stream.report.clock == "unit's clock"
        anew = "the unit's clock was reset" if clock else "the unit restarted"
        batches = []
        for first, last in pairwise(edges):
            why = (self._why or anew) if samples.jumped[first] else ""
            if why or (self._cut and first == 0):
                why, self._why, self._cut = why or self._why, "", False
            batches.append(RowBatch(form, rows.take(range(first, last)), why))
        self.form = form
        return batches


def _rows(samples: Samples, report: Report) -> tuple[LiveRows, Form]:
    """Rows of samples, with time from the unit's clock or from the number of the sample."""
    columns = (TIME, *RATES, *(FORCES if samples.accel is not None else ()))
    assert samples.t is not None or report.rate_hz is None
    time = samples.number.astype(float) if samples.t is None else samples.t
    values = np.column_stack([time, samples.gyro, *([] if samples.accel is None else [samples.accel])])
    warm = [] if samples.temperature is None else [samples.temperature]
    extra = np.column_stack([*warm, samples.saturated, samples.sensor_fault]).astype(float)
    titles = (*columns, *([TEMPERATURE] if warm else []), *FLAGS)
    return LiveRows(values, None, extra), Form(titles, columns, tuple(range(len(columns))), usual_facts(report))
