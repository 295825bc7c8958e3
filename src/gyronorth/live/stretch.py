"""One stretch of a stream without a break: rows to SI samples, as the offline reader makes them.

The grid, the bridging of gaps and the checks of units and axes are those of `readers`, fed
batch by batch, so that the recording of the stretch reads back to the same samples.
"""

from __future__ import annotations

import numpy as np

from gyronorth.arrays import Array, Mask
from gyronorth.errors import InputError
from gyronorth.findings import Finding
from gyronorth.live.rows import Form, LiveRows
from gyronorth.readers.declared import Declared
from gyronorth.readers.grid import MOST_MISSING
from gyronorth.readers.grid_stream import GridStream
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.plausible import check_axes, check_flags, check_units
from gyronorth.readers.source import Bad, Block, Clock, Facts, Source

#: Time stamps are looked at for so long, s, before the first sample: with a declared rate, and to measure it.
LOOK_DECLARED, LOOK_MEASURE = 1.0, 10.0
#: ... or for so many rows.
LOOK_ROWS = 10_000
#: Units and axes are judged from the first 2, 4, ... 32 s.
FIRST_CHECK, LAST_CHECK = 2.0, 32.0
#: So many stray rows are none too many, however short the stretch.
FEW = 20
#: Samples kept for that, at most.
CHECKED_SAMPLES = 40_000


class Stretch:
    """Takes good rows in order of time; returns samples on a uniform grid.

    Raises
    ------
    InputError
        If a unit, the rate or the latitude is not known, or declarations contradict each other.
    """

    def __init__(self, name: str, form: Form, stated: Facts, options: ReadOptions) -> None:
        self.form, self.stated = form, stated
        usual, decoded = form.decoded or Facts(), form.decoded is not None
        counted = None if usual.rate_hz is None else 1 / usual.rate_hz  # the time is that of counted samples
        clock = Clock(unit=1.0, step=counted) if form.time else None
        source = Source("live", name, form.columns, lambda: iter(()), stated, usual, clock=clock, decoded=decoded)
        self._stream = GridStream(source, options)
        self.declared: Declared = self._stream.declared
        if self.declared.latitude is None:
            raise InputError(
                "The latitude is not known: neither given nor in the stream. Pass --latitude DEG (north positive); "
                "Earth rate cannot be read without it."
            )
        self.samples = 0
        self.gaps = 0
        self.longest_gap = 0  # samples that were missing at one place, among the latest rows
        self.strays = 0  # rows left out before they came here: their time repeats or runs backwards
        self.objection: Finding | None = None  # what the checks of units and axes say
        self._rows = 0
        self._looking: list[LiveRows] | None = [] if form.time else None
        self._checked: list[Array] | None = []
        self._next_check = FIRST_CHECK

    @property
    def latitude(self) -> float:
        """Latitude, rad."""
        assert self.declared.latitude is not None
        return self.declared.latitude

    @property
    def rate_hz(self) -> float | None:
        """Sample rate, Hz; None while it is being measured."""
        settled = self._looking is None or self.declared.rate_hz is not None
        return self._stream.grid.rate_hz if settled else None

    @property
    def missing(self) -> int:
        """Samples that were missing and are bridged."""
        return self._stream.grid.missing

    def findings(self) -> tuple[Finding, ...]:
        """Why no heading of this stretch can be used, whatever it looks like."""
        found = [] if self.objection is None else [self.objection]
        if self.missing > MOST_MISSING * self.samples:
            share = self.missing / self.samples
            message = f"{share:.0%} of the samples are missing; up to {MOST_MISSING:.0%} are bridged."
            found.append(Finding("gaps", message, share, MOST_MISSING))
        if self.strays > max(FEW, MOST_MISSING * (self.strays + self.samples)):
            share = self.strays / (self.strays + self.samples)
            message = (
                f"{share:.0%} of the rows repeat a time or run backwards and are left out, {MOST_MISSING:.0%} may be. "
                "Likely the times are too coarse: leave them out (--columns t=-) and declare --rate."
            )
            found.append(Finding("gaps", message, share, MOST_MISSING))
        found += check_flags(self._stream.grid.flagged, self.samples, name=self._stream.source.name)
        return tuple(found)

    def usable(self, rows: LiveRows) -> Mask:
        """Which rows are plausible: within any sensor's range, and not all forces zero."""
        return self._stream.usable(rows.values)

    def push(self, rows: LiveRows) -> tuple[Array, Array | None]:
        """Gyro and accelerometer samples, (n, 3), SI in body axes, that the rows add."""
        if self._looking is not None:
            if len(rows):
                self._looking.append(rows)
            held = self._looking
            span = held[-1].values[-1, 0] - held[0].values[0, 0] if held else 0.0
            look = LOOK_MEASURE if self.declared.rate_hz is None else LOOK_DECLARED
            if span < look and sum(map(len, held)) < LOOK_ROWS:
                return self._stream.in_body_axes(np.zeros((0, self._stream.width)))
            rows, self._looking = LiveRows.joined(held), None
        return self._gridded(rows)

    def end(self) -> tuple[Array, Array | None]:
        """What was still looked at, or waited for later stamps, at the end of the stream."""
        held, self._looking = self._looking, None
        if held is not None and sum(map(len, held)) < 2:
            return self._stream.in_body_axes(np.zeros((0, self._stream.width)))
        return self._gridded(LiveRows.joined(held) if held else None, last=True)

    def _gridded(self, rows: LiveRows | None, *, last: bool = False) -> tuple[Array, Array | None]:
        samples = np.zeros((0, self._stream.width))
        if rows is not None and len(rows):
            numbers = np.arange(self._rows + 1, self._rows + 1 + len(rows))
            self._rows += len(rows)
            samples = self._stream.grid.push(Block(rows.values, numbers, Bad.none(), flags=rows.flags))
        if last:
            samples = np.concatenate([samples, self._stream.grid.flush()])
        self.samples += len(samples)
        self.gaps += len(self._stream.grid.gaps)
        self.longest_gap = max((gap.samples for gap in self._stream.grid.gaps), default=0)
        self._stream.grid.gaps.clear()
        self._check(samples)
        return self._stream.in_body_axes(samples)

    def _check(self, samples: Array) -> None:
        """Units and axes against Earth rate and gravity, on twice as much each time."""
        if self._checked is None or self.rate_hz is None:
            return
        self._checked.append(samples)
        if self.samples < min(self._next_check * self.rate_hz, CHECKED_SAMPLES):
            return
        seen = np.concatenate(self._checked)[:CHECKED_SAMPLES]
        self.objection = self._objection(seen, self.rate_hz)
        if self._next_check >= LAST_CHECK or self.samples >= CHECKED_SAMPLES:
            self._checked = None
        else:
            self._next_check, self._checked = 2 * self._next_check, [seen]

    def _objection(self, samples: Array, rate_hz: float) -> Finding | None:
        try:
            check_units(samples, self.declared, rate_hz=rate_hz, name=self._stream.source.name)
        except InputError as error:
            return Finding("units_suspect", str(error))
        notes = check_axes(samples, self.declared, name=self._stream.source.name)
        blocking = [Finding(note.code, note.message, note.value, note.limit) for note in notes if note.blocking]
        return blocking[0] if blocking else None
