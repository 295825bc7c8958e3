"""Frames of one stream to samples: which layout is taken, its scale, its rate, what is lost."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gyronorth.arrays import Array, Index, Mask
from gyronorth.errors import InputError
from gyronorth.findings import Finding
from gyronorth.frames.catalogue import protocol_info
from gyronorth.frames.clock import Numbering, rate_of_clock, stride_of
from gyronorth.frames.framing import Framer, Frames, joined, split
from gyronorth.frames.protocol import Bytes, Fields, Options, Scale
from gyronorth.frames.registry import protocol_of
from gyronorth.frames.samples import Report, Samples

#: Frames that are looked at before the first sample is given: they tell the layout, the rate and the ranges.
HELD = 64
#: Frames of one layout that must be there before it is taken: a false frame comes alone.
CONFIRMED = 3
#: Rates differ, where they are told twice, by more than this share.
RATE_CONFLICT = 0.02
#: Rates, rad/s, and specific forces, m/s^2, beyond these come from no sensor.
LARGEST_RATE, LARGEST_FORCE = 1e5, 1e6


_CHANGED = Finding(
    "configuration_changed",
    "The unit sent another configuration than at the start; its ranges and units are taken from there on.",
)


_OTHER_LAYOUT = Finding(
    "layout_changed",
    f"The unit has sent {HELD} frames of inertial data in another layout than at the start. Start anew.",
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
    def tail(self) -> bytes:
        """Bytes of which it is not decided yet whether they are a frame."""
        return self._framer.tail

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
            saturated=self._saturated,
            sensor_fault=self._fault,
            findings=self._findings,
        )

    def _take(self, frames: Frames, *, last: bool) -> Samples | None:
        if self._layout is None:
            self._held.append(frames)
            self._data_held += int((frames.layout >= 0).sum())
            if self._data_held < HELD and not last:
                return None
            frames, self._held = joined(self._held), []
            if not self._settle(frames):
                self._other += len(frames)
                return None
        return self._decode(frames)

    def _settle(self, frames: Frames) -> bool:
        """Take a layout, its scale and its rate by the first `HELD` frames with data; False if there is none."""
        data = np.flatnonzero(frames.layout >= 0)
        end = int(data[min(HELD, len(data)) - 1]) + 1 if len(data) else len(frames)
        first, _ = split(frames, end)
        layouts, count = np.unique(first.layout[first.layout >= 0], return_counts=True)
        confirmed = [
            (self._protocol.rank(layout), -number, layout)
            for layout, number in zip(layouts.tolist(), count.tolist(), strict=True)
            if number >= CONFIRMED
        ]
        if not confirmed:
            return False
        self._layout = layout = min(confirmed)[2]
        for i in np.flatnonzero(first.layout < -1).tolist():
            self._facts.append(first.rows(np.array([i])))
        index = np.flatnonzero(first.layout == self._layout)
        fields = self._fields(first, index)
        self._scale = self._protocol.scale(layout, self._facts, self._options)
        self._choose_rate(rate_of_clock(fields))
        self._scale, findings = self._protocol.infer(fields, self._scale, self._options, self._rate)
        self._findings += findings
        if self._rate is None and self._needs_rate():
            raise InputError(
                f"The {self._info.title} stream holds increments per sample and no time; their rate is not known. "
                "Pass --rate HZ, the rate to which the unit is set."
            )
        self._has_clock = fields.ticks is not None
        interval = None if self._rate is None else 1 / self._rate
        self._numbering = Numbering(
            interval, stride_of(fields), float(first.length[index].mean()), clock=self._has_clock
        )
        return True

    def _needs_rate(self) -> bool:
        return self._scale.gyro_increments or self._scale.accel_increments

    def _choose_rate(self, measured: float | None) -> None:
        told = (
            (measured, "unit's clock"),
            (self._scale.rate_hz, "configuration"),
            (self._options.rate_hz, "declared"),
            (self._scale.usual_rate_hz or self._info.usual_rate_hz, "usual for the unit"),
        )
        known = [(rate, source) for rate, source in told if rate is not None]
        if not known:
            return
        self._rate, self._rate_from = known[0]
        for rate, source in known[1:]:
            usual_only = self._rate_from == "declared"  # what is usual says nothing against a declaration
            if not usual_only and abs(rate / self._rate - 1) > RATE_CONFLICT:
                self._findings += (
                    Finding(
                        "rate_conflict",
                        f"The rate is {self._rate:g} Hz ({self._rate_from}), but {rate:g} Hz ({source}); "
                        f"{self._rate:g} Hz is taken.",
                        value=self._rate,
                        limit=rate,
                    ),
                )

    def _decode(self, frames: Frames) -> Samples | None:
        """Samples of frames after the layout is settled; a configuration among them changes the scale from there."""
        index = np.flatnonzero(frames.layout == self._layout)
        self._other += len(frames) - len(index)
        self._watch(frames.layout)
        if not len(index):
            return None
        fields = self._fields(frames, index)
        gyro, accel = self._scaled(fields)
        changes = np.flatnonzero(frames.layout < -1)
        for change in changes.tolist():
            facts = [frames.rows(np.array([change]))]
            if self._facts and np.array_equal(facts[0], self._facts[-1]):
                continue
            self._facts.append(facts[0])
            assert self._layout is not None
            self._findings += (_CHANGED,)
            self._scale = replace(self._protocol.scale(self._layout, facts, self._options), profile=self._scale.profile)
            after = index > change
            new_gyro, new_accel = self._scaled(fields)
            gyro[after] = new_gyro[after]
            if accel is not None and new_accel is not None:
                accel[after] = new_accel[after]
        usable = _usable(fields, gyro, accel)
        self._unusable += int((~usable).sum())
        if not usable.any():
            return None
        return self._samples_of(fields, gyro, accel, frames, index, usable)

    def _watch(self, layout: Index) -> None:
        """Tell it where only other layouts come for a while: the unit was set anew."""
        ours = np.flatnonzero(layout == self._layout)
        data = layout >= 0
        since = int(data[ours[-1] + 1 :].sum()) if len(ours) else self._strange + int(data.sum())
        if self._strange < HELD <= since:
            self._findings += (_OTHER_LAYOUT,)
        self._strange = since

    def _samples_of(
        self, fields: Fields, gyro: Array, accel: Array | None, frames: Frames, index: Index, usable: Mask
    ) -> Samples:
        assert self._numbering is not None
        number, t, jumped = self._numbering.number(fields, frames.skipped[index])
        if t is None and self._rate is not None:
            t = number / self._rate
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
            start=frames.start[index][usable],
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
        """Fields of the frames `index`, which may be of several lengths."""
        assert self._layout is not None
        lengths = frames.length[index]
        sizes = np.unique(lengths).tolist()
        if len(sizes) == 1:
            return self._protocol.fields(frames.rows(index), self._layout)
        groups = [np.flatnonzero(lengths == size) for size in sizes]
        parts = [self._protocol.fields(frames.rows(index[group]), self._layout) for group in groups]
        return _merged(parts, np.concatenate(groups))


def _merged(parts: Sequence[Fields], order: Index) -> Fields:
    """Fields of several groups of frames, whose members stood at `order`."""
    back = np.argsort(order)

    def merge(name: str) -> np.ndarray | None:
        arrays = [getattr(part, name) for part in parts]
        return None if any(array is None for array in arrays) else np.concatenate(arrays)[back]

    names = ("gyro", "accel", "ticks", "counter", "saturated", "fault", "temperature", "usable")
    return replace(parts[0], **{name: merge(name) for name in names})


def _usable(fields: Fields, gyro: Array, accel: Array | None) -> Mask:
    usable = np.asarray((np.abs(gyro) < LARGEST_RATE).all(axis=1))
    if accel is not None:
        usable &= (np.abs(accel) < LARGEST_FORCE).all(axis=1)
    if fields.temperature is not None:
        usable &= np.isfinite(fields.temperature)
    return usable if fields.usable is None else usable & fields.usable
