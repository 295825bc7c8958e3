"""Frames of one stream to samples: which layout is taken, its scale, its rate, what is lost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gyronorth.arrays import Array, Index, Mask
from gyronorth.errors import InputError
from gyronorth.findings import Finding
from gyronorth.frames.catalogue import protocol_info
from gyronorth.frames.clock import Numbering, rate_of_clock, rate_of_spans, stride_of
from gyronorth.frames.framing import Framer, Frames, joined, split
from gyronorth.frames.merging import first_of, merged
from gyronorth.frames.protocol import Bytes, Fields, Options, Scale
from gyronorth.frames.registry import protocol_of
from gyronorth.frames.samples import Kind, Report, Samples, to_next, usable_ones
from gyronorth.frames.samples import joined as samples_joined
from gyronorth.frames.spacing import Spacing

#: Frames that are looked at before the first sample is given: they tell the layout, the rate and the ranges.
HELD = 64
#: Settings of the unit that are remembered.
KINDS = 8
#: Frames of one layout that must be there before it is taken: a false frame comes alone.
CONFIRMED = 3
#: Of frames that hold different data, what this share of them holds is read. Data at half the rate are in half of them.
MOSTLY = 0.75
#: Rates differ, where they are told twice, by more than this share.
RATE_CONFLICT = 0.02
_CHANGED = Finding(
    "configuration_changed",
    "The unit sent another configuration than at the start; its ranges and units are taken from there on.",
)
_RATE = "The unit sends at another rate than before, as {} shows; this one is taken from there on."
_ASSUMED = "The frames carry no time: their rate is taken as {:g} Hz, which is usual for the unit. Declare --rate HZ."
_OTHER_LAYOUT = Finding(
    "layout_changed",
    "The unit sends its inertial data in another layout than before; this one is taken from there on.",
)
_SLOWER_FORCE = Finding(
    "force_left_out",
    "The unit sends specific force less often than the rate, or in other messages; it is left out, and roll and pitch "
    "are not measured. Set the unit to send both at the same rate in one message.",
)


class FrameStream:
    """Decodes a stream of bytes of one protocol, piece by piece.

    Parameters
    ----------
    protocol : str
        A name of `gyronorth.frames.catalogue.NAMES`.
    options : Options
        What the user declares.
    facts : sequence of bytes
        Configuration frames of the same unit that came before, as `facts` gives them.

    Raises
    ------
    InputError
        If the protocol is not known; later, from `feed`, if the stream leaves something open that must be declared.
    """

    def __init__(self, protocol: str, options: Options | None = None, facts: Sequence[bytes] = ()) -> None:
        self._protocol = protocol_of(protocol)
        self._info = protocol_info(protocol)
        self._options = options or Options()
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
        self._strange = 0  # frames with data of other layouts since the last one of ours
        self._told = 0  # configurations that the settled layout, scale and rate rest on
        self._spacing = Spacing()
        self._zero = self._latest = (0, 0.0)  # a sample and its time, s: from it on samples are counted; the latest one
        self._settings = 0
        self.changed_at = 0  # byte of the stream from which on the latest setting holds
        self._kinds: tuple[Kind, ...] = ()
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
        """Bytes at the end of which it is not decided yet whether they are a frame."""
        return len(self._framer.tail)

    @property
    def pending(self) -> bytes:
        """Bytes of which it is not decided yet what they are: a stream that begins with them goes on as this one."""
        return b"".join(frames.data.tobytes() for frames in self._held) + self._framer.tail

    @property
    def report(self) -> Report:
        """The account up to now."""
        numbering = self._numbering
        return Report(
            protocol=self._info.name,
            axes=self._info.axes,
            rate_hz=self._rate,
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
        )

    def _take(self, frames: Frames, *, last: bool) -> Samples | None:
        parts: list[Samples] = []
        rest: Frames | None = frames
        while rest is not None:
            if self._layout is None:
                self._held.append(rest)
                self._data_held += int((rest.layout >= 0).sum())
                if self._data_held < HELD and not last:
                    break
                rest, self._held, self._data_held = joined(self._held), [], 0
                if not self._settle(rest):
                    self._other += len(rest)
                    break
            samples, rest = self._up_to_change(rest)
            parts += [] if samples is None else [samples]
        return samples_joined(parts) if parts else None

    def _up_to_change(self, frames: Frames) -> tuple[Samples | None, Frames | None]:
        """Samples up to where the unit was reset, and the frames from there on, for which all is settled again."""
        assert self._numbering is not None
        index = np.flatnonzero(self._ours(frames))
        fields = self._fields(frames, index) if len(index) else None
        shown, restarted = self._spacing.shown(frames, index)
        if fields is not None and fields.accel is None:
            self._look_for_force(split(frames, int(np.flatnonzero(self._alike(frames))[-1:].sum()))[0])
        change = self._change(frames, index, fields, shown)
        if change is None:
            return self._decode(frames, index, fields, shown, restarted), None
        before, after = split(frames, change)
        count = int(np.searchsorted(index, change))
        kept = first_of(fields, count) if fields is not None and count else None
        samples = self._decode(before, index[:count], kept, shown[:count], restarted[:count])
        self._layout, self._strange = None, 0
        self._settings += 1
        self.changed_at = int(after.start[0])
        return samples, after

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
        data, last = frames.layout >= 0, np.flatnonzero(self._alike(frames))[-1:]
        self._strange = int(data[last[0] + 1 :].sum()) if len(last) else self._strange + int(data.sum())
        if self._strange < HELD:
            return None
        self._tell(_OTHER_LAYOUT)
        return int(last[0]) + 1 if len(last) else 0

    def _look_for_force(self, frames: Frames) -> None:
        """Tell of specific force that comes between the frames that are read, which hold none."""
        if self._protocol.has_force is None or _SLOWER_FORCE in self._findings:
            return
        _, one_of_each = np.unique(frames.length << 1 | (frames.layout < 0), return_index=True)
        if any(self._protocol.has_force(frames.rows(np.array([place]))[0]) for place in one_of_each.tolist()):
            self._tell(_SLOWER_FORCE)

    def _is_new(self, fact: Bytes) -> bool:
        return not (self._facts and np.array_equal(fact, self._facts[-1]))

    def _other_rate(self, frames: Frames, place: int) -> bool:
        """Whether the configuration at `place` states another rate than the one taken."""
        assert self._layout is not None
        stated = self._protocol.scale(self._layout, [frames.rows(np.array([place]))], self._options).rate_hz
        return bool(stated and self._rate and abs(stated / self._rate - 1) > RATE_CONFLICT)

    def _tell(self, finding: Finding) -> None:
        """Say it once, however often it comes."""
        if finding not in self._findings:
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
        covered = self._covered(layouts, count)
        confirmed = [
            (bool(share < MOSTLY), self._protocol.rank(layout), -number, layout)
            for layout, number, share in zip(layouts.tolist(), count.tolist(), covered, strict=True)
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
        self._has_clock = fields.ticks is not None
        kind = Kind(self._rate, self._has_clock, fields.accel is not None)
        if self._kinds[-1:] != (kind,):
            self._kinds = (*self._kinds, kind)[-KINDS:]
        before = self._numbering
        self._numbering = Numbering(
            None if self._rate is None else 1 / self._rate, stride_of(fields), clock=self._has_clock
        )
        if before is not None:
            self._numbering.go_on(before)
            self._zero = self._latest
        self._spacing.settle(first, index)
        return True

    def _covered(self, layouts: Index, count: Index) -> list[float]:
        """Of the frames with data, the share that holds what is read of each layout."""
        if self._protocol.reads is None:
            return [1.0] * len(layouts)
        reads = [self._protocol.reads(layout) for layout in layouts.tolist()]
        return [float(count[(layouts & read) == read].sum() / count.sum()) for read in reads]

    def _needs_rate(self) -> bool:
        return self._scale.gyro_increments or self._scale.accel_increments

    def _choose_rate(self, measured: float | None, of_spans: float | None) -> None:
        told = (
            (measured, "unit's clock"),
            (of_spans, "its increments"),
            (self._scale.rate_hz, "configuration"),
            (self._options.rate_hz, "declared"),
            (self._scale.usual_rate_hz or self._info.usual_rate_hz, "usual for the unit"),
        )
        known = [(rate, source) for rate, source in told if rate is not None]
        if not known:
            return
        self._rate, self._rate_from = known[0]
        if len(known) == 1 and self._rate_from == told[-1][1]:
            self._tell(Finding("rate_assumed", _ASSUMED.format(self._rate), value=self._rate))
        for rate, source in known[1:]:
            usual_only = self._rate_from == "declared"  # what is usual says nothing against a declaration
            if not usual_only and abs(rate / self._rate - 1) > RATE_CONFLICT:
                message = (
                    f"The rate is {self._rate:g} Hz ({self._rate_from}), but {rate:g} Hz ({source}); "
                    f"{self._rate:g} Hz is taken."
                )
                self._tell(Finding("rate_conflict", message, value=self._rate, limit=rate))

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
            temperature=None if fields.temperature is None else fields.temperature[usable],
            start=start[usable],
            jumped=jumped[usable],
        )

    def _scaled(self, fields: Fields) -> tuple[Array, Array | None]:
        """SI: increments over the sample interval."""
        scale, rate = self._scale, self._rate or 1.0
        with np.errstate(over="ignore", invalid="ignore"):
            gyro = fields.gyro * (scale.gyro * (rate if scale.gyro_increments else 1.0))
            if fields.accel is None:
                return gyro, None
            return gyro, fields.accel * (scale.accel * (rate if scale.accel_increments else 1.0))

    def _fields(self, frames: Frames, index: Index) -> Fields:
        """Fields of the frames `index`, which may be of several lengths and, where these are read alike, layouts."""
        assert self._layout is not None
        if self._protocol.lines(self._layout):
            return self._protocol.fields(frames.lines(index), self._layout)
        kinds = frames.length[index]
        if self._protocol.reads is not None:
            _, which = np.unique(frames.layout[index], return_inverse=True)
            kinds = kinds + (int(kinds.max()) + 1) * which
        values = np.unique(kinds).tolist()
        groups = [np.flatnonzero(kinds == value) for value in values]
        parts = [self._protocol.fields(frames.rows(index[group]), self._layout) for group in groups]
        return merged(parts, np.concatenate(groups)) if len(parts) > 1 else parts[0]
