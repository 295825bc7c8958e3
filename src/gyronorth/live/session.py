"""One session: a source through to estimates, recording and status. Survives whatever the stream does.

Longer than 400 lines: it is one state machine, whose events and answers are read together.
"""

from __future__ import annotations

import queue
import time
from dataclasses import dataclass, replace
from math import degrees, pi
from pathlib import Path
from threading import Event, Thread

from gyronorth.arrays import Array
from gyronorth.deviation import DeviationModel
from gyronorth.errors import InputError
from gyronorth.findings import Finding
from gyronorth.frames import protocol_info
from gyronorth.live.estimation import Estimation, LiveEstimate
from gyronorth.live.events import Bytes, ByteSource, Connected, Ended, Lost, SourceEvent
from gyronorth.live.holding import LONGEST_GAP, Holding
from gyronorth.live.position import Position
from gyronorth.live.reader import LINES, UNKNOWN, StreamReader
from gyronorth.live.recorder import RawRecorder, Recorder, utc_now
from gyronorth.live.rows import Form, LiveRows, RowBatch
from gyronorth.live.status import NO_FIX, Counters, Mark, Status
from gyronorth.live.stretch import Stretch
from gyronorth.live.timeline import Timeline
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.source import Facts
from gyronorth.sensor import Sensor
from gyronorth.streaming import StreamingHeading

#: Bytes are taken together for so long, s.
BATCH = 0.05
#: A source that sends nothing for so long, s, has stalled.
STALL = 2.0
#: Pieces of the source that may wait, of at most 64 kB each.
MOST_PIECES = 64
#: Bytes that are parsed at a time, about: parsing needs some times their room, and of half as many a quarter more time.
MOST_BYTES = 1 << 19
#: Marks that are kept for the page.
MOST_MARKS = 50


@dataclass(frozen=True)
class LiveSettings:
    """What is asked of a session; SI units and radians."""

    reading: ReadOptions
    sensor: Sensor | None = None
    method: str = "auto"
    gyro_bias: tuple[float, float, float] | None = None  # rad/s, body axes
    deviation: DeviationModel | None = None
    save: Path | None = None
    require_sigma: float | None = None  # rad
    alignment: float = 0.0  # rad, to begin with; `Session.align` sets another
    position: Position | None = None  # tells the latitude, where it is not declared
    targets: tuple[str, ...] = ()  # of the sentences, for the page


@dataclass(frozen=True)
class Command:
    """What the user wants, from the page."""

    name: str  # start, stop, mark, align, sync
    text: str = ""
    done: Event | None = None  # set when it is


class Session:
    """Runs a source in threads; `status` is always the latest picture."""

    def __init__(self, source: ByteSource, settings: LiveSettings) -> None:
        self._status = Status(
            "waiting",
            source.name,
            saving=settings.save is not None,
            require_sigma=settings.require_sigma,
            replay=not source.live,
            targets=settings.targets,
        )
        self._looked = time.monotonic()  # when that was
        self.ended = Event()  # the source has ended, or the session failed: nothing more will change by itself
        self.error: Exception | None = None  # why the session failed
        self._source, self.settings = source, settings
        self._queue: queue.Queue[SourceEvent | Command] = queue.Queue(MOST_PIECES)
        self._stop = Event()
        self._recorder = None if settings.save is None else Recorder(settings.save)
        self._estimation = Estimation(self._estimated, any_method=settings.method == "auto")
        self._raw_recorder = None if settings.save is None else RawRecorder(settings.save)
        self._reader = StreamReader(source.name, settings.reading)
        self._stretch: Stretch | None = None
        self._shown: Stretch | None = None  # the present one or, until the next begins, the last
        self._timeline: Timeline | None = None
        self._past = Counters()  # of the stretches behind
        self._strays_before = 0  # of the timeline, before the stretch
        self._good = self._implausible = 0
        self._connections = self._stalls = 0
        self._last_data = time.monotonic()
        self._broken = False  # the connection broke since the last row
        self._facts: Facts | None = None  # that the stream stated when the last stretch began
        self._statements = 0  # of the reader, at that time
        self._usable = True  # whether samples can be made of the rows of the stretch
        self._proven = False  # whether they could be of any
        self._marks: list[Mark] = []
        self._alignment = settings.alignment
        self._found: LiveEstimate | None = None
        self._holding: Holding | None = None
        self._held_from: LiveEstimate | None = None  # the latest estimate that it took
        self._failure: str | None = None  # of the estimator
        self._state = "waiting"
        self._trouble = "connecting"
        self._message = ""

    @property
    def _recorders(self) -> list[Recorder]:
        return [recorder for recorder in (self._recorder, self._raw_recorder) if recorder is not None]

    @property
    def status(self) -> Status:
        """The latest picture, and how old it is now."""
        status, now = self._status, time.monotonic()
        age = None if status.found is None else now - status.found.made
        return replace(status, age=age, unattended=now - self._looked)

    def start(self) -> None:
        """Start the threads."""
        self._estimation.start()
        if self.settings.position is None:
            self._begin_source()
        else:
            self.settings.position.start()
        self._thread = Thread(target=self.run, name="session", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop everything; the recording is complete and the last estimate made when this returns."""
        self._stop.set()
        self._thread.join()

    def command(self, name: str, text: str = "") -> None:
        """Start, stop or mark, as soon as the lines that came before are done."""
        self._queue.put(Command(name, text))

    def align(self, offset: float) -> None:
        """Set how far to starboard of the unit's forward axis the vehicle's lies, rad.

        Raises
        ------
        InputError
            If it is not within half a turn.
        """
        if not abs(offset) <= pi:
            raise InputError(f"The alignment offset is {degrees(offset):g} deg; -180 to 180 deg are expected.")
        self._queue.put(Command("align", repr(offset)))

    def saved(self) -> None:
        """Return when the recording is on the disk and the estimate is that of the latest sample."""
        if self._thread.is_alive():
            synced = Event()
            self._queue.put(Command("sync", done=synced))
            synced.wait(timeout=10)
            self._estimation.flush()

    def run(self) -> None:
        """Take what comes until the session ends: the body of its thread."""
        try:
            placed = self.settings.position is None
            while not self._stop.is_set() and self._state != "failed":
                begun = time.monotonic()
                self._take(self._waiting())
                if placed:
                    self._watch()
                else:
                    placed = self._placed()
                self._publish()
                if self._queue.empty():
                    self._stop.wait(max(0.0, begun + BATCH - time.monotonic()))
            while self._state != "failed" and (rest := self._waiting(timeout=0.0)):
                self._take(rest)
            if self._state != "failed":
                self._finish_stretch()
        except Exception as error:  # a fault of ours: what was recorded stays, and the command shows it
            self._fail(error)
        finally:
            for recorder in self._recorders:
                recorder.close()
            if self.settings.position is not None:
                self.settings.position.close()
            self._estimation.end()
            if self._state in ("waiting", "running"):
                self._state = "stopped"
            self._publish()
            self.ended.set()

    def _placed(self) -> bool:
        """Begin the source at the first fix of the receiver of the latitude, which the samples need; whether it is."""
        position = self.settings.position
        assert position is not None
        if not position.wait(0.0):
            why = f" ({position.trouble})" if position.trouble else ""
            self._trouble = f"{NO_FIX} from {position.name}{why}"
            return False
        self._trouble, self._last_data = "connecting", time.monotonic()
        self._begin_source()
        return True

    def _begin_source(self) -> None:
        Thread(target=self._source.run, args=(self._queue.put, self._stop), name="source", daemon=True).start()

    def _waiting(self, *, timeout: float = 0.1) -> list[SourceEvent | Command]:
        """What has come from the source and the page; waits for the first."""
        events: list[SourceEvent | Command] = []
        try:
            events.append(self._queue.get(timeout=timeout) if timeout else self._queue.get_nowait())
        except queue.Empty:
            return []
        while sum(len(event.bytes) for event in events if isinstance(event, Bytes)) < MOST_BYTES:
            try:
                events.append(self._queue.get_nowait())
            except queue.Empty:
                break
        return events

    def _take(self, events: list[SourceEvent | Command]) -> None:
        pieces: list[bytes] = []
        for event in [*events, None]:
            if isinstance(event, Bytes):
                pieces.append(self._reader.datagram(event.bytes) if event.whole else event.bytes)
                continue
            if pieces:
                self._data(b"".join(pieces))
                pieces = []
            match event:
                case Connected(midway):
                    self._connected(midway)
                case Lost(why):
                    self._reader.cut()
                    self._trouble = why
                    self._broken = True
                case Ended():
                    self._batches(self._reader.end())
                    self._end_of_source()
                case Command():
                    self._obey(event)

    def _obey(self, command: Command) -> None:
        match command:
            case Command("start"):
                self._restart()
            case Command("stop"):
                self._finish_stretch()
                self._estimation.flush()
                self._state = "stopped"
            case Command("mark", text):
                self._mark(text)
            case Command("align", text):
                self._alignment = float(text)
                self._mark(self._alignment_text())
            case Command("sync", done=Event() as done):
                for recorder in self._recorders:
                    recorder.sync(now=True)
                self._publish()
                done.set()

    def _connected(self, midway: bool) -> None:
        self._connections += 1
        if midway:
            self._reader.midway()
        self._trouble = ""
        self._last_data = time.monotonic()

    def _restart(self) -> None:
        """The user begins anew."""
        self._finish_stretch()
        self._reader.begin_raw()
        self._state, self._shown, self._found, self._failure = "waiting", None, None, None
        self._holding = None

    def _data(self, data: bytes) -> None:
        if "stalled" in self._trouble:
            self._trouble = ""
        batches = self._read(data)
        self._record_raw()
        self._batches(batches)
        self._last_data = time.monotonic()

    def _read(self, data: bytes) -> list[RowBatch]:
        before = self._reader.protocol
        try:
            return self._reader.push(data)
        except InputError as error:
            self._fail(error)
            return []
        finally:
            after = self._reader.protocol
            if after not in (before, LINES, UNKNOWN):
                self._message = f"Frames of {protocol_info(after).title} are recognised by their checksums."

    def _record_raw(self) -> None:
        """The bytes of frames to the disk, before what they hold."""
        for anew, data in self._reader.raw():
            if self._raw_recorder is None or not data or self._state not in ("waiting", "running"):
                continue
            if anew:
                self._raw_recorder.begin_file()
            self._raw_recorder.append(data)

    def _batches(self, batches: list[RowBatch]) -> None:
        for batch in batches:
            if self._state in ("stopped", "failed", "ended"):
                return
            try:
                self._rows(batch)
            except InputError as error:
                self._fail(error)

    def _rows(self, batch: RowBatch) -> None:
        """Good rows to their stretch, a new one where they do not go on from the last."""
        stretch = self._stretch
        if stretch is None or stretch.form != batch.form:
            stretch = self._begin(batch, "the columns changed" if stretch else "")
        elif batch.why:
            stretch = self._begin(batch, batch.why)
        elif self._broken and not batch.form.time:
            stretch = self._begin(batch, "the connection broke, and without a time column the gap is unknown")
        elif self._reader.statements != self._statements and self._stated_anew():
            stretch = self._begin(batch, "the stream states another unit, rate, place or session")
        self._broken = False
        usable = stretch.usable(batch.rows)
        self._implausible += int(len(usable) - usable.sum())
        rows = batch.rows if usable.all() else batch.rows.take(usable)
        pieces = [rows] if self._timeline is None else self._timeline.push(rows)
        stretch.strays = 0 if self._timeline is None else self._timeline.strays - self._strays_before
        for number, piece in enumerate(pieces):
            if number > 0:
                self._begin(batch, "the time stamps jumped", timeline=self._timeline)
            self._good += len(piece)
            self._push(piece)

    def _push(self, rows: LiveRows) -> None:
        """Rows to the grid and to the disk; what cannot be bridged begins a new stretch."""
        stretch = self._stretch
        assert stretch is not None
        samples = self._samples(stretch, rows) if self._usable else None
        if samples is None and self._usable:
            stretch = self._begin(RowBatch(stretch.form, rows), self._message, timeline=self._timeline)
            samples = self._samples(stretch, rows)
        if self._recorder is not None:
            self._recorder.rows(rows)
        if samples is not None:
            self._estimate(stretch, *samples)

    def _samples(self, stretch: Stretch, rows: LiveRows) -> tuple[Array, Array | None] | None:
        """Samples of rows; None where they do not go on from those before, or are of no use from the first on."""
        try:
            return stretch.push(rows)
        except InputError as error:
            if stretch.samples == 0:
                if not self._proven:
                    raise  # nothing has come of this stream yet: it was declared wrongly
                self._usable = False
            self._message = f"No heading from here on: {error}" if stretch.samples == 0 else str(error)
            return None

    def _estimate(self, stretch: Stretch, gyro_b: Array, accel_b: Array | None) -> None:
        if len(gyro_b) == 0:
            return
        rate_hz = stretch.rate_hz
        assert rate_hz is not None
        self._proven = True
        if stretch.samples == len(gyro_b):
            if self._recorder is not None:
                self._recorder.rate(rate_hz)
            self._holding = Holding(rate_hz, stretch.latitude, self.settings.sensor)
            self._estimation.begin(
                StreamingHeading(
                    rate_hz=rate_hz,
                    latitude=stretch.latitude,
                    accelerometer=accel_b is not None,
                    sensor=self.settings.sensor,
                    method=self.settings.method,
                    deviation=self.settings.deviation,
                    session=stretch.stated.session,
                )
            )
        if self.settings.gyro_bias is not None:
            gyro_b = gyro_b - self.settings.gyro_bias
        self._hold(gyro_b, broken=stretch.longest_gap > LONGEST_GAP * rate_hz)
        self._estimation.put(gyro_b, accel_b)

    def _hold(self, gyro_b: Array, *, broken: bool) -> None:
        """Carry the heading on by new samples, and from the latest estimate."""
        holding, found = self._holding, self._found
        if holding is None:
            return
        holding.add(gyro_b, broken=broken)
        if found is not None and found is not self._held_from:
            holding.found(found.estimate, found.samples)
            self._held_from = found

    def _begin(self, batch: RowBatch, why: str, *, timeline: Timeline | None = None) -> Stretch:
        """A new stretch, with a recording of its own."""
        stretch = self._new_stretch(batch.form)
        if self._stretch is not None:
            self._finish_stretch(held=timeline is None)
            self._past = replace(self._past, restarts=self._past.restarts + 1)
            self._message = f"Restarted: {why}" + ("" if why.endswith(".") else ".")
        self._stretch = self._shown = stretch
        if timeline is None:
            timeline = Timeline(stretch.declared.rate_hz) if batch.form.time else None
        self._timeline, self._strays_before = timeline, timeline.strays if timeline else 0
        if self._recorder is not None:
            self._recorder.begin(
                stretch,
                self._source.name,
                start_time_utc=utc_now() if self._source.live else None,
                raw=self._raw_recorder.path if self._raw_recorder and self._raw_recorder.files else None,
            )
        self._estimation.begin(None)
        self._holding = None
        self._state, self._marks, self._found, self._failure = "running", [], None, None
        self._usable = True
        if self._alignment:
            self._mark(self._alignment_text())
        return stretch

    def _new_stretch(self, form: Form) -> Stretch:
        """A stretch by what the stream states now or, where that does not hold, by what it stated before."""
        name, reading, known = self._source.name, self.settings.reading, self._facts
        if self.settings.position is not None:
            reading = replace(reading, latitude=self.settings.position.latitude)
        self._statements = self._reader.statements
        try:
            stated = self._reader.facts()
            if known is not None:  # only the first stretch begins when the stream says
                stated = replace(stated, start_time_utc=None)
            stretch = Stretch(name, form, stated, reading)
        except InputError:
            if known is None:
                raise
            stated, stretch = known, Stretch(name, form, known, reading)
        self._facts = replace(stated, start_time_utc=None)
        return stretch

    def _stated_anew(self) -> bool:
        """Whether the comment lines of the stream now mean something else, and hold."""
        self._statements = self._reader.statements
        try:
            stated = self._reader.facts()
        except InputError as error:
            self._message = f"What the stream now states is left aside: {error}"
            return False
        return replace(stated, start_time_utc=None) != self._facts

    def _finish_stretch(self, *, held: bool = True) -> None:
        """What is still held goes to the disk and the estimator, and the file is closed."""
        stretch = self._stretch
        if stretch is None:
            return
        if held and self._timeline is not None:
            rows = self._timeline.end()
            if rows is not None:
                self._good += len(rows)
                self._push(rows)
                stretch = self._stretch or stretch  # it may be another one now
        try:
            if self._usable:
                self._estimate(stretch, *stretch.end())
        except InputError as error:  # too few rows to know their rate
            self._message = str(error)
        if self._recorder is not None:
            self._recorder.close()
        counters = self._counters()
        self._past = replace(self._past, lost=counters.lost, gaps=counters.gaps)
        if held:
            self._past = replace(self._past, strays=counters.strays, time_jumps=counters.time_jumps)
            self._timeline = None
        self._stretch = None

    def _end_of_source(self) -> None:
        self._finish_stretch()
        self._estimation.flush()
        if self._state != "failed":
            self._state = "ended"
        self._trouble = ""
        self._publish()
        self.ended.set()

    def _mark(self, text: str) -> None:
        stretch = self._stretch
        if stretch is None:
            return
        seconds = stretch.samples / (stretch.rate_hz or 1.0)
        text = " ".join(text.split())[:200]
        self._marks = [*self._marks[1 - MOST_MARKS :], Mark(seconds, text)]
        if self._recorder is not None:
            self._recorder.mark(f"{seconds:.3f} s, {utc_now()}" + (f", {text}" if text else ""))

    def _alignment_text(self) -> str:
        return f"alignment offset {degrees(self._alignment):+.2f} deg"

    def _watch(self) -> None:
        """Once per batch: the disk, and a source that has gone silent."""
        for recorder in self._recorders:
            recorder.sync()
        silent = time.monotonic() - self._last_data
        if silent > STALL and self._queue.empty() and not self._trouble and self._state in ("waiting", "running"):
            if self._state == "running":
                self._stalls += 1
            self._trouble = "stalled" if self._state == "running" else "no data yet (stalled)"

    def _fail(self, error: Exception) -> None:
        self._state, self.error, self._message = "failed", error, str(error)

    def _estimated(self, found: LiveEstimate | None, failure: str | None) -> None:
        if found is not None:
            self._found = found
        self._failure = failure

    def _counters(self) -> Counters:
        stretch, timeline, past, tally = self._stretch, self._timeline, self._past, self._reader.tally
        return replace(
            past,
            lines=tally.lines,
            good=self._good,
            garbage=tally.garbage,
            skipped_bytes=tally.skipped_bytes,
            other_frames=tally.other_frames,
            implausible=self._implausible,
            strays=past.strays + (timeline.strays if timeline else 0),
            time_jumps=past.time_jumps + (timeline.jumps if timeline else 0),
            lost=past.lost + (stretch.missing if stretch else 0),
            gaps=past.gaps + (stretch.gaps if stretch else 0),
            connections=self._connections,
            reconnects=max(0, self._connections - 1),
            stalls=self._stalls,
        )

    def _publish(self) -> None:
        stretch, recorder, raw = self._shown, self._recorder, self._raw_recorder
        silent = time.monotonic() - self._last_data
        findings = list(stretch.findings() if stretch else ())
        if self._state == "running" and self._trouble:
            message = f"No data for {silent:.0f} s ({self._trouble}): the unit may have moved since."
            findings.append(Finding("stalled", message, silent, STALL))
        if self._failure:
            findings.append(Finding("not_computed", self._failure))
        holding, found = self._holding, self._found
        held = None
        if holding is not None and found is not None:
            held = holding.held(found.estimate, limit=self.settings.require_sigma)
        self._status = replace(
            self._status,
            held=held,
            alignment=self._alignment,
            rate_of_turn=None if holding is None or self._trouble else holding.rate_of_turn,
            state=self._state,  # type: ignore[arg-type]
            connected=not self._trouble,
            trouble=self._trouble,
            silent=silent,
            rate_hz=stretch.rate_hz if stretch else None,
            seconds=stretch.samples / (stretch.rate_hz or 1.0) if stretch else 0.0,
            counters=self._counters(),
            last_garbage=self._reader.tally.last_garbage,
            protocol=self._reader.protocol,
            warnings=self._reader.warnings,
            found=self._found,
            findings=tuple(findings),
            marks=tuple(self._marks),
            message=self._message,
            recording=recorder.path if recorder is not None and recorder.files else None,
            recording_bytes=0 if recorder is None else recorder.bytes,
            raw_recording=raw.path if raw is not None and raw.files else None,
            recording_error=None if recorder is None else recorder.error or (raw and raw.error),
            heading_true=stretch.declared.heading_true if stretch and not self._alignment else None,
        )
        self._looked = time.monotonic()
