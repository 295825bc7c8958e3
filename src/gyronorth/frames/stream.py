"""Frames of one stream to samples: which layout is taken, its scale, its rate, what is lost.

Longer than 400 lines: it is one state machine, whose settings and samples are read together.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from gyronorth.arrays import Array, Index, Mask
from gyronorth.errors import InputError
from gyronorth.findings import Finding
from gyronorth.frames.catalogue import protocol_info
from gyronorth.frames.clock import Numbering, of_several_units, rate_of_clock, rate_of_spans, stride_of
from gyronorth.frames.doubt import Doubt
from gyronorth.frames.forces import LATE_FORCE, ForceTrack
from gyronorth.frames.framing import Framer, Frames, joined, split, without
from gyronorth.frames.merging import covered, fields_of, some_of
from gyronorth.frames.others import names_of
from gyronorth.frames.protocol import Bytes, Fields, Scale, StreamOptions
from gyronorth.frames.rates import RATE_CONFLICT, USUAL, findings_of_rates, rate_by_gravity
from gyronorth.frames.registry import protocol_of
from gyronorth.frames.samples import Kind, Report, Samples, held, to_next, usable_ones
from gyronorth.frames.samples import joined as samples_joined
from gyronorth.frames.spacing import Spacing

#: Frames that are looked at before the first sample is given, for layout, rate and ranges; more of those with rate
#: alone, as specific force may come far less often.
HELD, HELD_FOR_FORCE = 64, 512
#: Settings of the unit that are remembered, and findings of one kind.
KINDS, TOLD = 8, 3
#: Frames of one layout that must be there before it is taken: a false frame comes alone.
CONFIRMED = 3
#: Of frames that hold different data, what this share of them holds is read. Data at half the rate are in half of them.
MOSTLY = 0.75
_CHANGED = Finding(
    "configuration_changed",
    "The unit sent another configuration than at the start; its ranges and units are taken from there on.",
)
_RATE = "The unit sends at another rate than before, as {} shows; this one is taken from there on."
_OTHER_LAYOUT = Finding(
    "layout_changed",
    "The unit sends its inertial data in another layout than before; this one is taken from there on.",
)


class FrameStream:
    """Decodes a stream of bytes of one protocol, piece by piece.

    Parameters
    ----------
    protocol : str
        A name of `gyronorth.frames.catalogue.NAMES`.
    options : StreamOptions
        What the user declares.
    facts : sequence of bytes
        Configuration frames of the same unit that came before, as `facts` gives them.

    Raises
    ------
    InputError
        If the protocol is not known; later, from `feed`, if the stream leaves something open that must be declared.
    """

    def __init__(self, protocol: str, options: StreamOptions | None = None, facts: Sequence[bytes] = ()) -> None:
        self._protocol = protocol_of(protocol)
        self._info = protocol_info(protocol)
        self._options = options or StreamOptions()
        self._framer = Framer(self._protocol)
        self._held: list[Frames] = []
        self._data_held = 0
        self._layout: int | None = None
        self._facts: list[Bytes] = [np.frombuffer(fact, np.uint8)[None] for fact in facts]
        self._scale = Scale()
        self._rate: float | None = None
        self._rate_from = ""
        self._has_clock = False
        self._numbering: Numbering | None = None
        self._findings: tuple[Finding, ...] = ()
        self._forces = ForceTrack(self._protocol)
        self._given = 0  # samples with all that is told of them: the number of the next one
        self._warmth = np.nan  # the last temperature, degC
        self._strange = 0  # frames with data of other layouts since the last one of ours
        self._told = 0  # configurations that the settled layout, scale and rate rest on
        self._spacing = Spacing()
        self._doubt: Doubt | None = None  # where the checksum lets damaged frames pass
        self._doubtful: Frames | None = None  # from the first one on that waits for the next
        self._left = 0  # bytes of damaged frames behind the last one
        self._zero = self._latest = (0, 0.0)  # a sample and its time, s: from it on samples are counted; the latest one
        self._settings = 0
        self.changed_at = 0  # byte of the stream from which on the latest setting holds
        self._kinds: tuple[Kind, ...] = ()
        self._messages: Counter[str] = Counter()  # of frames without inertial data, while there are no others
        self._samples = self._other = self._unusable = self._saturated = self._fault = 0

    def feed(self, piece: bytes) -> Samples | None:
        """The samples that `piece` completes; None for none (the first `HELD` frames are held back)."""
        return self._take(self._framer.feed(piece), last=False)

    def finish(self) -> Samples | None:
        """The samples that were held back at the end of the stream."""
        return self._take(self._framer.feed(b"", last=True), last=True)

    @property
    def facts(self) -> tuple[bytes, ...]:
        """The configuration that holds now, as the unit sent it: at most one frame."""
        return tuple(fact.tobytes() for fact in self._facts[-1:])

    @property
    def undecided(self) -> int:
        """Bytes at the end of which it is not decided yet whether they are a frame, or samples."""
        return len(self._framer.tail) if self._doubtful is None else self._framer.end - int(self._doubtful.start[0])

    @property
    def pending(self) -> bytes:
        """Bytes of which it is not decided yet what they are: a stream that begins with them goes on as this one."""
        held = self._held if self._doubtful is None else [self._doubtful]
        return self._forces.pending + b"".join(frames.data.tobytes() for frames in held) + self._framer.tail

    @property
    def report(self) -> Report:
        """The account up to now."""
        numbering = self._numbering
        return Report(
            protocol=self._info.name,
            axes=self._info.axes,
            rate_hz=None if self._rate is None else self._rate / self._forces.per,
            rate_from=self._rate_from,
            clock="unit's clock" if self._has_clock else "counted" if self._rate else "",
            imu=self._scale.imu,
            profile=self._scale.profile,
            samples=self._samples,
            other=self._other,
            unusable=self._unusable,
            lost=numbering.lost if numbering else 0,
            lost_from=numbering.lost_from if numbering else "",
            skipped=self._framer.skipped,
            clock_jumps=numbering.jumps if numbering else 0,
            settings=self._settings,
            kinds=self._kinds,
            saturated=self._saturated,
            sensor_fault=self._fault,
            findings=self._findings,
            messages=tuple(self._messages),
        )

    def _take(self, frames: Frames, *, last: bool) -> Samples | None:
        parts: list[Samples] = []
        rest: Frames | None = frames
        while rest is not None:
            if self._layout is None:
                self._held.append(rest)
                self._data_held += int((rest.layout >= 0).sum())
                rest = joined(self._held)
                if not self._data_held:
                    self._pass_over(rest)
                    break
                if self._data_held < HELD and not last:
                    break
                if not last and self._data_held < HELD_FOR_FORCE and self._forces.open(rest):
                    self._held = [rest]
                    break
                self._held, self._data_held = [], 0
                if not self._settle(rest):
                    self._pass_over(rest)
                    break
            samples, rest = self._up_to_change(rest, last=last)
            parts += [] if samples is None else [samples]
        left = self._forces.end() if last else None
        parts += [] if left is None else [left]
        return samples_joined(parts) if parts else None

    def _pass_over(self, frames: Frames) -> None:
        """Frames before the first ones with inertial data; of configurations the last one is kept."""
        self._held, self._data_held = [], 0
        facts = np.flatnonzero(frames.layout < -1)[-1:]
        if len(facts):
            self._facts = [frames.rows(facts)]
        self._other += len(frames)
        if not self._samples:
            self._messages += names_of(self._protocol, frames)

    def _up_to_change(self, frames: Frames, *, last: bool) -> tuple[Samples | None, Frames | None]:
        """Samples up to where the unit was reset, and the frames from there on, for which all is settled again."""
        assert self._numbering is not None
        frames, index, fields = self._read(frames, last=last)
        shown, restarted = self._spacing.shown(frames, index)
        change = self._change(frames, index, fields, shown)
        if change is None:
            return self._paired(frames, self._decode(frames, index, fields, shown, restarted)), None
        before, after = split(frames, change)
        after, self._doubtful = after if self._doubtful is None else joined([after, self._doubtful]), None
        count = int(np.searchsorted(index, change))
        kept = some_of(fields, slice(count)) if fields is not None and count else None
        samples = self._paired(before, self._decode(before, index[:count], kept, shown[:count], restarted[:count]))
        parts = [part for part in (samples, self._forces.end()) if part is not None]
        samples = samples_joined(parts) if parts else None
        self._layout, self._strange = None, 0
        self._settings += 1
        self.changed_at = int(after.start[0])
        return samples, after

    def _read(self, frames: Frames, *, last: bool) -> tuple[Frames, Index, Fields | None]:
        """The frames that are decided, without the damaged ones; the places of those that are read, and what they hold.

        The neighbours of a frame tell whether it is damaged, where its checksum is a sum or short.
        """
        if self._doubtful is not None:
            frames, self._doubtful = joined([self._doubtful, frames]), None
        index = np.flatnonzero(self._ours(frames))
        fields = self._fields(frames, index) if len(index) else None
        if self._doubt is None or not len(frames):
            return frames, index, fields
        frames.skipped[0] += self._left
        self._left = 0
        if fields is None:
            return frames, index, fields
        gyro, accel = self._scaled(fields)
        values = gyro if accel is None else np.column_stack([gyro, accel])
        shown, _ = copy(self._spacing).shown(frames, index)
        usable, loose = usable_ones(fields, gyro, accel), frames.skipped[index] > 0
        damaged, end = self._doubt.sift(fields, values, usable, shown, loose, last=last)
        if end < len(index):
            frames, self._doubtful = split(frames, int(index[end]))
        if not damaged.any() and end == len(index):
            return frames, index, fields
        frames, self._left = without(frames, index[:end][damaged])
        self._unusable += int(damaged.sum())
        fields = some_of(fields, np.append(~damaged, np.zeros(len(index) - end, bool)))
        index = np.flatnonzero(self._ours(frames))
        return frames, index, fields if len(index) else None

    def _change(self, frames: Frames, index: Index, fields: Fields | None, shown: Index) -> int | None:
        """The first frame after a reset: another rate, by the configuration or the clock, or another layout."""
        assert self._numbering is not None
        facts, self._told = np.flatnonzero(frames.layout < -1)[self._told :], 0
        for place in facts.tolist():
            if self._is_new(frames.rows(np.array([place]))) and self._other_rate(frames, place):
                self._tell(Finding("rate_changed", _RATE.format("its configuration")))
                return place
        if fields is not None:
            place = self._numbering.other_rate(fields, shown)
            if place is not None:
                self._tell(Finding("rate_changed", _RATE.format("its clock")))
                return int(index[place])
        place = self._forces.stops(frames, index)
        if place is not None:
            self._tell(_OTHER_LAYOUT)
            return place
        data, last = frames.layout >= 0, np.flatnonzero(self._alike(frames))[-1:]
        self._strange = int(data[last[0] + 1 :].sum()) if len(last) else self._strange + int(data.sum())
        if self._strange < HELD:
            return None
        self._tell(_OTHER_LAYOUT)
        return int(last[0]) + 1 if len(last) else 0

    def _paired(self, frames: Frames, samples: Samples | None) -> Samples | None:
        """The samples with the specific force that comes between them; without, where none came at the start."""
        if self._forces.paired:
            samples = self._forces.take(frames, samples)
        elif samples is not None and samples.accel is None and LATE_FORCE not in self._findings:
            before = split(frames, int(np.flatnonzero(self._alike(frames))[-1:].sum()))[0]
            if self._forces.comes(before):
                self._tell(LATE_FORCE)
        if samples is not None:
            self._given = int(samples.number[-1]) + 1
        return samples

    def _is_new(self, fact: Bytes) -> bool:
        return not (self._facts and np.array_equal(fact, self._facts[-1]))

    def _other_rate(self, frames: Frames, place: int) -> bool:
        """Whether the configuration at `place` states another rate than the one taken."""
        assert self._layout is not None
        stated = self._protocol.scale(self._layout, [frames.rows(np.array([place]))], self._options).rate_hz
        return bool(stated and self._rate and abs(stated / self._rate - 1) > RATE_CONFLICT)

    def _tell(self, finding: Finding) -> None:
        """Say it once, however often it comes, and of a kind no more than is read."""
        if finding not in self._findings and [each.code for each in self._findings].count(finding.code) < TOLD:
            self._findings += (finding,)

    def _ours(self, frames: Frames) -> Mask:
        """Which frames are read."""
        assert self._layout is not None
        if self._protocol.reads is None:
            return np.asarray(frames.layout == self._layout)
        return np.asarray((frames.layout >= 0) & (frames.layout & self._layout == self._layout))

    def _alike(self, frames: Frames) -> Mask:
        """Which frames hold what is read and nothing more that would be."""
        ours = self._ours(frames)
        if self._protocol.reads is not None and ours.any():
            kinds, which = np.unique(frames.layout[ours], return_inverse=True)
            ours[ours] = np.array([self._protocol.reads(kind) == self._layout for kind in kinds.tolist()])[which]
        return ours

    def _settle(self, frames: Frames) -> bool:
        """Take a layout, its scale and its rate by the first `HELD` frames with data; False if there is none."""
        data = np.flatnonzero(frames.layout >= 0)
        end = int(data[min(HELD, len(data)) - 1]) + 1 if len(data) else len(frames)
        first, _ = split(frames, end)
        layouts, count = np.unique(first.layout[first.layout >= 0], return_counts=True)
        shares = covered(self._protocol, layouts, count)
        confirmed = [
            (bool(share < MOSTLY), self._protocol.rank(layout), -number, layout)
            for layout, number, share in zip(layouts.tolist(), count.tolist(), shares, strict=True)
            if number >= CONFIRMED
        ]
        if not confirmed:
            return False
        layout = min(confirmed)[3]
        self._layout = layout = layout if self._protocol.reads is None else self._protocol.reads(layout)
        stated = np.flatnonzero(first.layout < -1)
        self._told = len(stated)
        if len(stated):
            self._facts = [first.rows(stated[-1:])]
        index = np.flatnonzero(self._ours(first))
        fields = self._fields(first, index)
        in_turn = of_several_units(fields)
        if in_turn:
            raise InputError(
                f"The {self._info.title} stream holds frames of several units in turn: their {in_turn} goes to and fro "
                "from frame to frame. One unit on a line is expected. Record each from its own port."
            )
        self._scale = self._protocol.scale(layout, self._facts, self._options)
        self._choose_rate(rate_of_clock(fields), rate_of_spans(fields))
        self._scale, findings = self._protocol.infer(fields, self._scale, self._options, self._rate)
        for finding in findings:
            self._tell(finding)
        if self._rate is None and self._needs_rate():
            raise InputError(
                f"The {self._info.title} stream holds increments per sample and no time; their rate is not known. "
                "Pass --rate HZ, the rate to which the unit is set."
            )
        self._check_usual_rate(fields)
        self._has_clock = fields.ticks is not None
        before = self._numbering
        self._numbering = Numbering(
            None if self._rate is None else 1 / self._rate, stride_of(fields), clock=self._has_clock
        )
        if before is not None:
            self._numbering.go_on(before)
            self._zero = self._latest
        self._settle_force(frames, fields)
        doubt, numbering = self._protocol.doubt, self._numbering
        always = doubt == "always"
        self._doubt = None if doubt == "never" else Doubt(numbering.interval, numbering.stride, always=always)
        kind = Kind(self.report.rate_hz, self._has_clock, fields.accel is not None or self._forces.paired)
        if self._kinds[-1:] != (kind,):
            self._kinds = (*self._kinds, kind)[-KINDS:]
        self._spacing.settle(first, index)
        return True

    def _settle_force(self, frames: Frames, fields: Fields) -> None:
        """Tell from the frames at the start how often specific force comes that those with rate do not hold."""
        assert self._numbering is not None
        if fields.accel is not None:
            self._forces.none()
            return
        index = np.flatnonzero(self._ours(frames))
        number, _, _ = self._numbering.copy().number(self._fields(frames, index), np.ones(len(index), np.int64))
        finding = self._forces.settle(frames, index, number, self._given, self._rate)
        if finding is not None:
            self._tell(finding)

    def _check_usual_rate(self, fields: Fields) -> None:
        """Refuse a rate that is only usual where gravity says that the unit is set to another."""
        if self._rate is None or self._rate_from != USUAL or not self._scale.accel_increments:
            return
        _, force = self._scaled(fields)
        rate = None if force is None else rate_by_gravity(force, self._rate)
        if rate is not None:
            raise InputError(
                f"The {self._info.title} stream holds increments per sample and no time. At {self._rate:g} Hz, which "
                f"is usual for the unit, the specific force is not gravity; at {rate:g} Hz it is. Likely the unit is "
                f"set to that rate: pass --rate {rate:g}, or --rate {self._rate:g} if it is not."
            )

    def _needs_rate(self) -> bool:
        return self._scale.gyro_increments or self._scale.accel_increments

    def _choose_rate(self, measured: float | None, of_spans: float | None) -> None:
        told = (
            (measured, "unit's clock"),
            (of_spans, "its increments"),
            (self._scale.rate_hz, "configuration"),
            (self._options.rate_hz, "declared"),
            (self._scale.usual_rate_hz or self._info.usual_rate_hz, USUAL),
        )
        known = [(rate, source) for rate, source in told if rate is not None]
        if known:
            self._rate, self._rate_from = known[0]
            for finding in findings_of_rates(known):
                self._tell(finding)

    def _decode(
        self, frames: Frames, index: Index, fields: Fields | None, shown: Index, restarted: Mask
    ) -> Samples | None:
        """Samples of the frames `index`; a configuration among the frames changes the scale from there."""
        self._other += len(frames) - len(index)
        gyro, accel = (np.zeros((0, 3)), None) if fields is None else self._scaled(fields)
        for change in np.flatnonzero(frames.layout < -1).tolist():
            fact = frames.rows(np.array([change]))
            if not self._is_new(fact):
                continue
            self._facts = [fact]
            assert self._layout is not None
            self._tell(_CHANGED)
            scale = self._protocol.scale(self._layout, self._facts, self._options)
            self._scale = replace(scale, profile=self._scale.profile)
            if fields is not None:
                after = index > change
                new_gyro, new_accel = self._scaled(fields)
                gyro[after] = new_gyro[after]
                if accel is not None and new_accel is not None:
                    accel[after] = new_accel[after]
        if fields is None:
            return None
        usable = usable_ones(fields, gyro, accel)
        self._unusable += int((~usable).sum())
        return self._samples_of(fields, gyro, accel, frames.start[index], usable, shown, restarted)

    def _samples_of(
        self,
        fields: Fields,
        gyro: Array,
        accel: Array | None,
        start: Index,
        usable: Mask,
        shown: Index,
        restarted: Mask,
    ) -> Samples | None:
        assert self._numbering is not None
        number, t, jumped = self._numbering.number(fields, shown, restarted)
        if t is None and self._rate is not None:
            t = self._zero[1] + (number - self._zero[0]) / self._rate
            self._latest = (int(number[-1]), float(t[-1]))
        jumped = to_next(jumped, usable)
        if not usable.any():
            return None
        none = np.zeros(len(gyro), bool)
        saturated = none if fields.saturated is None else fields.saturated
        fault = none if fields.fault is None else fields.fault
        self._samples += int(usable.sum())
        self._saturated += int(saturated[usable].sum())
        self._fault += int(fault[usable].sum())
        return Samples(
            gyro=gyro[usable],
            accel=None if accel is None else accel[usable],
            number=number[usable],
            t=None if t is None else t[usable],
            saturated=saturated[usable],
            sensor_fault=fault[usable],
            temperature=None if fields.temperature is None else self._warm(fields.temperature)[usable],
            start=start[usable],
            jumped=jumped[usable],
        )

    def _warm(self, temperature: Array) -> Array:
        """Frames that hold none are as warm as the one before."""
        filled = held(temperature, self._warmth)
        self._warmth = float(filled[-1])
        return filled

    def _scaled(self, fields: Fields) -> tuple[Array, Array | None]:
        """SI: increments over the sample interval."""
        scale, rate = self._scale, self._rate or 1.0
        with np.errstate(over="ignore", invalid="ignore"):
            gyro = fields.gyro * (scale.gyro * (rate if scale.gyro_increments else 1.0))
            if fields.accel is None:
                return gyro, None
            return gyro, fields.accel * (scale.accel * (rate if scale.accel_increments else 1.0))

    def _fields(self, frames: Frames, index: Index) -> Fields:
        assert self._layout is not None
        return fields_of(self._protocol, self._layout, frames, index)
