"""Read a recording: the whole file at once, or chunk after chunk."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator
from dataclasses import field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyronorth import catalogue
from gyronorth.errors import InputError
from gyronorth.frozen import frozen
from gyronorth.given import checked_path, of_kind
from gyronorth.readers.asking import OpenQuestion, ask, declared_options, in_pairs
from gyronorth.readers.declared import forgotten_accelerometer, in_place_of, resolve
from gyronorth.readers.gaps import even_gaps
from gyronorth.readers.grid import JITTER
from gyronorth.readers.grid_stream import GridStream
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.plausible import Misfit, check_axes, check_flags, check_units
from gyronorth.readers.presets import load
from gyronorth.readers.registry import open_source
from gyronorth.readers.source import Question
from gyronorth.recording import AxesOrigin, Gap, Note, Recording, clip_gaps, gap_notes, shift_utc

#: Called with the share of the file that is read, as the reading goes on.
Progress = Callable[[float], None]
#: Samples per chunk by default: 24 bytes a triad and sample, so a few MiB.
CHUNK_SAMPLES = 1 << 16


@frozen
class RecordingInfo:
    """What is known of a file before its samples are read."""

    source: str  # file name
    format: str  # name of the format
    topic: str | None  # of a bag or an MCAP file
    columns: tuple[str, ...]  # of t, w_x ... f_z, those the file has
    rate_hz: float  # Hz
    gyro_unit: str  # in the file
    accel_unit: str | None  # in the file; None without an accelerometer
    axes: str  # in the file, three letters
    axes_declared: bool  # by the user or in the file, not by the format's convention
    axes_origin: AxesOrigin
    increments: bool  # whether the file holds increments
    latitude: float | None  # rad
    heading_true: float | None  # rad
    session: str | None
    start_time_utc: str | None
    notes: tuple[Note, ...] = field(default=())  # remarks on the axes, from the first chunk
    read_as: str = ""  # what each column was taken for, for people


def read(
    path: str | Path, options: ReadOptions | None = None, *, progress: Progress | None = None, **declared: Any
) -> Recording:
    """Read a recording.

    Parameters
    ----------
    path : str or Path
        A file in any format that `gyronorth info` reads, recognised by its content, or by its suffix.
    options : ReadOptions, optional
        What the file does not say about itself.
    progress : callable, optional
        Called with the share of the file that is read, in (0, 1]; text formats only, the others
        are unpacked in one go.
    **declared
        The fields of `ReadOptions` by name, instead of `options`: rate_hz, axes, gyro_unit,
        accel_unit, columns, ...

    Returns
    -------
    Recording
        SI, body axes forward-right-down, uniform in time.

    Raises
    ------
    InputError
        If the file is damaged, or what it holds cannot be or is not known.
    """
    reading = Reading(path, options_of(options, declared), progress)
    samples = _joined(reading.samples(), reading.rows)
    grid = reading.grid
    grid.finish()
    notes = reading.check(samples)
    return reading.recording(samples, first=0, gaps=tuple(grid.gaps), rows_dropped=grid.rows_dropped, notes=notes)


def read_chunks(
    path: str | Path,
    options: ReadOptions | None = None,
    *,
    chunk_samples: int = CHUNK_SAMPLES,
    progress: Progress | None = None,
    keep_gaps: bool = False,
    **declared: Any,
) -> tuple[RecordingInfo, Iterator[Recording]]:
    """Read a long recording in chunks; concatenated they are what `read` returns.

    Parameters
    ----------
    path, options, progress, **declared
        As for `read`.
    chunk_samples : int
        Samples per chunk; the last one may be shorter.
    keep_gaps : bool
        Bridge gaps of up to a day, and any number of them: whoever takes the chunks judges them by their `gaps`.

    Returns
    -------
    info : RecordingInfo
        What is known before the samples.
    chunks : iterator of Recording
        Each with its own start time, gaps and dropped rows.

    Raises
    ------
    InputError
        As for `read`, here or while iterating: a chunk is checked when it is made, and the
        shares of missing and of dropped rows at the end. Units and axes are judged from
        the first chunk alone.
    """
    reading = Reading(path, options_of(options, declared), progress)
    if keep_gaps:
        reading.grid.keep_gaps()
    return chunks_of(reading, chunk_samples)


def chunks_of(reading: Reading, chunk_samples: int) -> tuple[RecordingInfo, Iterator[Recording]]:
    """What `read_chunks` returns of a reading that has not begun."""
    if chunk_samples < 1:
        raise InputError(f"chunk_samples is {chunk_samples}; at least 1 is expected.")
    stream = _rechunked(reading, chunk_samples)
    first = next(stream)
    notes = reading.check(first)
    return reading.info(notes), _chunks(reading, first, stream, notes)


class Reading(GridStream):
    """One pass through a file."""

    def __init__(self, path: str | Path, options: ReadOptions, progress: Progress | None) -> None:
        if options.preset is not None:
            options = load(options.preset).onto(options)
        path = checked_path("path", path)
        try:
            super().__init__(open_source(path, options), options, path)
        except OpenQuestion as question:
            raise _with_accelerometer(question, path, options) from None
        self._path = path
        self.progress = progress
        if (beside := forgotten_accelerometer(self.source, options, path)) is not None:
            message = (
                f"{beside.name} lies beside {self.source.name} and is likely its accelerometer, which was left out: "
                f"--accel {shlex.quote(str(beside))} takes it."
            )
            self.source = replace(self.source, notes=(*self.source.notes, Note("accelerometer_beside", message)))
        self.length_notes: tuple[Note, ...] = ()

    @property
    def rate_hz(self) -> float:
        """Sample rate, Hz, once the first rows have been read."""
        if self.grid.rate_hz is None:
            raise InputError(f"{self.source.name} holds no rows of data.")
        return self.grid.rate_hz

    @property
    def rows(self) -> int:
        """How many rows to make room for: those of the whole file, about, and no more than it can have bytes for."""
        parts = self.source.parts
        return 0 if parts is None or not self._path.is_file() else min(parts.rows, self._path.stat().st_size)

    def samples(self) -> Iterator[NDArray[np.float64]]:
        """SI samples in file axes, block after block."""
        try:
            for block in self.source.blocks():
                if self.progress is not None and block.share > 0:
                    self.progress(block.share)
                if block.cut_off:
                    message = (
                        f"{self.source.name} ends in the middle of a line, which is left out: the recorder was killed."
                    )
                    self.length_notes = (Note("cut_off", message),)
                yield from self.grid.pushed(block)
                if self.grid.done:
                    break
            yield from self.grid.flushed()
        except OSError as error:
            raise InputError(f"{self.source.name} cannot be read: {error}.") from None
        self._check_length()

    def _check_length(self) -> None:
        """Whether all rows came that the file says it holds."""
        expected, rows = self.source.stated.samples, self.grid.rows
        if expected is None or self.options.window or rows == expected:
            return
        self.grid.raise_bad()
        if not self.options.drop_bad_rows:
            raise InputError(
                f"{self.source.name} states {expected} samples but has {rows} rows: it is cut off or damaged. Pass "
                "--drop-bad-rows to take what there is."
            )
        message = f"{self.source.name} states {expected} samples but has {rows} rows."
        self.length_notes = (Note("cut_off", message, value=float(rows), limit=float(expected)),)

    def check(self, samples: NDArray[np.float64]) -> tuple[Note, ...]:
        """Units and axes against Earth rate and gravity."""
        if not (self.source.ours and self.source.stated.gyro_unit == "rad/s"):
            try:
                check_units(samples, self.declared, rate_hz=self.rate_hz, name=self.source.name)
            except Misfit as misfit:
                cure = misfit.options
                if misfit.sensor:
                    cure = in_place_of(self.source, self.declared, misfit.sensor, misfit.unit, misfit.increments)
                if not cure:
                    raise
                raise ask(self.source.name, self.options, [Question(str(misfit), cure, certain=False)]) from None
        return check_axes(samples, self.declared, name=self.source.name)

    def info(self, notes: tuple[Note, ...]) -> RecordingInfo:
        """What is known once the first samples have passed, with the remarks of `check` on these."""
        source, resolved, stated = self.source, self.declared, self.source.stated
        return RecordingInfo(
            source=source.name,
            format=source.format,
            topic=source.topic,
            columns=source.columns,
            rate_hz=self.rate_hz,
            gyro_unit=resolved.gyro_unit,
            accel_unit=resolved.accel_unit or None,
            axes=resolved.axes,
            axes_declared=resolved.axes_declared,
            axes_origin=resolved.axes_origin,
            increments=resolved.increments,
            latitude=resolved.latitude,
            heading_true=resolved.heading_true,
            session=stated.session,
            start_time_utc=self.start_time(0),
            notes=notes,
            read_as=source.read_as,
        )

    def start_time(self, first: int) -> str | None:
        """UTC of a sample, counted from the first one returned."""
        stated = self.source.stated.start_time_utc
        before = self.grid.leading / self.rate_hz + (self.options.window[0] if self.options.window else 0.0)
        shift = before + first / self.rate_hz
        return shift_utc(stated, shift) if shift else stated

    def recording(
        self,
        samples: NDArray[np.float64],
        *,
        first: int,
        gaps: tuple[Gap, ...],
        rows_dropped: int,
        notes: tuple[Note, ...],
    ) -> Recording:
        """The recording of `samples`, of which the first is sample `first` of those returned."""
        stated, rate_hz = self.source.stated, self.rate_hz
        offset = round(self.options.window[0] * rate_hz) if self.options.window else 0
        gaps += clip_gaps(stated.gaps, offset + first, offset + first + len(samples), rate_hz=rate_hz)
        if first == 0:
            rows_dropped += stated.rows_dropped
        gyro, accel = self.in_body_axes(samples)
        return Recording(
            gyro_b=gyro,
            accel_b=accel,
            rate_hz=rate_hz,
            latitude=self.declared.latitude,
            heading_true=self.declared.heading_true,
            session=stated.session,
            start_time_utc=self.start_time(first),
            source=self.source.name,
            read_as=self.source.read_as,
            rows_dropped=rows_dropped,
            gaps=gaps,
            notes=(*notes, *self.remarks(len(samples), gaps, rows_dropped)),
            axes="frd" if any(self.options.boresight) else self.declared.axes,
            axes_origin=self.declared.axes_origin,
            units=self.declared.units,
        )

    def remarks(self, samples: int, gaps: tuple[Gap, ...], rows_dropped: int) -> tuple[Note, ...]:
        """What there is to say of the file, and of `samples` samples with these gaps and dropped rows."""
        notes = self.source.notes + self.source.remarks() + gap_notes(gaps, samples=samples) + self.length_notes
        if rows_dropped:
            message = f"{rows_dropped} bad row(s) of {self.source.name} were left out."
            notes += (Note("rows_dropped", message, value=float(rows_dropped)),)
        notes += check_flags(self.grid.flagged, self.grid.samples, name=self.source.name)
        counts = self.grid.counts
        if self.grid.jitter > JITTER:
            message = (
                f"The time stamps of {self.source.name} scatter by {self.grid.jitter:.2f} sample intervals "
                f"about an even grid; the samples are taken as evenly spaced, at {self.rate_hz:.6g} Hz, which such "
                "stamps may miss by some per cent."
            )
            if self.source.topic is None:
                message += " If the unit's rate is another one: --columns t=- --rate HZ."
            notes += (Note("time_jitter", message, value=self.grid.jitter, limit=JITTER),)
        notes += even_gaps(gaps, samples, self.rate_hz, self.source)
        if counts.wraps:
            causes = " and as ".join(dict.fromkeys(counts.wraps))
            message = (
                f"The clock of {self.source.name} starts again from 0 as {causes}; the samples are taken to go on "
                "without a break."
            )
            notes += (Note("time_wraps", message, value=float(len(counts.wraps))),)
        return (*notes, *self._said_before({note.code for note in notes}))

    def _said_before(self, codes: set[str]) -> tuple[Note, ...]:
        """What was said of the recording before it was written to this file, but for `codes`."""
        summaries = {each.code: each.summary for each in catalogue.FINDINGS}
        said = ((code, value) for code, value in self.source.stated.warnings if code not in codes)
        return tuple(
            Note(code, f"{self.source.name} was written from a recording of which is known: {summaries[code]}", value)
            for code, value in said
        )


def _with_accelerometer(question: OpenQuestion, path: str | Path, options: ReadOptions) -> OpenQuestion:
    """The question with what the accelerometer's file leaves open, where the question proposes one."""
    beside = in_pairs(question.added).get("--accel")
    if beside is None:
        return question
    of_two = replace(options, accel_file=beside)
    try:
        resolve(open_source(path, of_two), of_two, path)
    except OpenQuestion as whole:
        text = f"{whole.text} {Path(beside).name} beside it is likely its accelerometer."
        return OpenQuestion(text, str(path), declared_options(options), (*whole.added, "--accel", beside))
    except InputError:
        pass
    return question


def _joined(pieces: Iterator[NDArray[np.float64]], rows: int) -> NDArray[np.float64]:
    """The pieces (m, k) as one array, about `rows` long, without holding both: what they fill grows where it lies."""
    rows = max(rows, 0)  # guessed from the length of a first row, which may be more than there is
    joined, count = np.empty((rows, 3)), 0
    for piece in pieces:
        if joined.shape[1] != piece.shape[1]:
            joined = np.empty((rows, piece.shape[1]))
        if count + len(piece) > len(joined):
            joined.resize((max(count + len(piece), len(joined) + len(joined) // 8), piece.shape[1]), refcheck=False)
        joined[count : count + len(piece)] = piece
        count += len(piece)
    joined.resize((count, joined.shape[1]), refcheck=False)
    return joined


def options_of(options: ReadOptions | None, declared: dict[str, Any]) -> ReadOptions:
    """The options, or the declarations by name as such."""
    if options is not None and declared:
        raise TypeError("Give options or single declarations, not both.")
    unknown = set(declared) - {item.name for item in fields(ReadOptions)}
    if unknown:
        known = ", ".join(item.name for item in fields(ReadOptions))
        raise TypeError(f"read() has no declaration {', '.join(sorted(unknown))}; there are {known}.")
    if options is not None:
        of_kind("options", options, ReadOptions, "ReadOptions")
    return options or ReadOptions(**declared)


def _rechunked(reading: Reading, chunk_samples: int) -> Iterator[NDArray[np.float64]]:
    """Samples in pieces of `chunk_samples`; bad rows are complained of as they come."""
    held, count = list[NDArray[np.float64]](), 0
    for samples in reading.samples():
        reading.grid.raise_bad()
        held.append(samples)
        count += len(samples)
        while count >= chunk_samples:
            joined = np.concatenate(held)
            yield joined[:chunk_samples]
            held, count = [joined[chunk_samples:]], count - chunk_samples
    reading.grid.finish()
    if count:
        yield np.concatenate(held)


def _chunks(
    reading: Reading, first: NDArray[np.float64], stream: Iterator[NDArray[np.float64]], notes: tuple[Note, ...]
) -> Iterator[Recording]:
    start = dropped = 0
    samples: NDArray[np.float64] | None = first
    while samples is not None:
        end = start + len(samples)
        gaps = clip_gaps(reading.grid.gaps, start, end, rate_hz=reading.rate_hz)
        yield reading.recording(
            samples, first=start, gaps=gaps, rows_dropped=reading.grid.rows_dropped - dropped, notes=notes
        )
        dropped, start = reading.grid.rows_dropped, end
        reading.grid.forget_gaps(before=end / reading.rate_hz)
        samples = next(stream, None)
