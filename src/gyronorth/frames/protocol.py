"""What a protocol has to say to the frame layer: where frames may start, whether one is whole, what it holds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gyronorth.arrays import Array, Index, Mask
from gyronorth.findings import Finding

Bytes = NDArray[np.uint8]

#: Layout of a whole frame that holds no inertial data. Layouts below it (-2, ...) state facts: a configuration.
OTHER = -1


@dataclass(frozen=True)
class StreamOptions:
    """Declarations about a stream; None: as the frames state, else the usual value."""

    rate_hz: float | None = None  # sample rate, Hz
    gyro_unit: Literal["rad/s", "deg/s"] | None = None  # for KVH: the unit of rate (or of angle, per sample)
    increments: Literal["none", "gyro", "accel", "both"] | None = None  # for STIM and KVH: what is per sample
    accel_range_g: float | None = None  # for STIM: 5, 10, 30 or 80
    imu: str | None = None  # for NovAtel RAWIMU and RAWIMUS: name of the IMU type


@dataclass(frozen=True)
class Scale:
    """From the numbers of `Fields` to SI, and what else is stated of the stream."""

    gyro: float = 1.0  # rad/s, or rad for increments, of one unit
    accel: float = 1.0  # m/s^2, or m/s for increments, of one unit
    gyro_increments: bool = False
    accel_increments: bool = False
    rate_hz: float | None = None  # Hz, as the frames (a configuration) state it
    usual_rate_hz: float | None = None  # Hz, as is usual for the unit
    stated: bool = False  # a configuration of the unit states all of it
    imu: str | None = None  # name of the IMU where the frames tell it
    profile: str | None = None  # name of the shipped sensor profile that fits it


@dataclass(frozen=True)
class Fields:
    """The numbers of n frames of one layout, before `Scale`."""

    gyro: Array  # (n, 3)
    accel: Array | None  # (n, 3)
    ticks: Index | None = None  # (n,) the unit's clock
    tick: float = 1.0  # s of one tick
    tick_wrap: int | None = None  # value at which the clock starts again from 0
    span: Array | None = None  # (n,) s over which increments were taken that the frames hold as rates here
    counter: Index | None = None  # (n,)
    counter_wrap: int = 1
    saturated: Mask | None = None  # (n,)
    fault: Mask | None = None  # (n,)
    temperature: Array | None = None  # (n,) degC
    usable: Mask | None = None  # (n,) None: all


class Force(NamedTuple):
    """What k frames say of specific force."""

    here: Mask  # (k,) which frames hold it
    value: Array  # (k, 3) m/s^2; 0 where there is none
    saturated: Mask  # (k,)

    @classmethod
    def none(cls, count: int) -> Force:
        """Of frames that hold none."""
        return cls(np.zeros(count, bool), np.zeros((count, 3)), np.zeros(count, bool))


def scale_as_sent(_layout: int, _facts: Sequence[Bytes], _options: StreamOptions) -> Scale:
    """For protocols whose fields are in SI already."""
    return Scale()


def nothing_to_infer(
    _fields: Fields, scale: Scale, _options: StreamOptions, _rate_hz: float | None
) -> tuple[Scale, tuple[Finding, ...]]:
    """For protocols whose frames leave nothing open."""
    return scale, ()


@dataclass(frozen=True)
class Protocol:
    """One protocol, as functions over all frames at once."""

    name: str
    #: Bytes from a start that must be there to judge it.
    head: int
    #: Possible starts in a buffer, and the lengths of the frames that would begin there: beyond the end of the buffer
    #: where a frame is not complete, and then no longer than it is sure to be.
    starts: Callable[[Bytes], tuple[Index, Index]]
    #: Which rows (k, length) are whole frames, by their checksums.
    whole: Callable[[Bytes], Mask]
    #: The layout of each whole frame of one length, (k,).
    layouts: Callable[[Bytes], Index]
    #: The numbers of frames of one layout and length.
    fields: Callable[[Bytes, int], Fields]
    #: For protocols whose frames are lines of text, or some of them: which lines of a buffer, by their starts and
    #: lengths, are whole, and their layouts. Lines differ in length too much to be taken as rows.
    judge_lines: Callable[[Bytes, Index, Index], tuple[Mask, Index]] | None = None
    #: What of a layout is read, as bits of it: a frame whose layout has all of them is read like it, whatever else it
    #: holds. None: only frames of the very layout are.
    reads: Callable[[int], int] | None = None
    #: The specific force in frames (k, length) whose interval between forces is given, s: for protocols whose frames
    #: may hold it less often than rate, or without it.
    force: Callable[[Bytes, float], Force] | None = None
    #: Order among layouts of one stream: the smallest is taken.
    rank: Callable[[int], int] = lambda _layout: 0
    scale: Callable[[int, Sequence[Bytes], StreamOptions], Scale] = scale_as_sent
    #: What the frames at the start tell beyond what is stated: units, ranges.
    infer: Callable[[Fields, Scale, StreamOptions, float | None], tuple[Scale, tuple[Finding, ...]]] = nothing_to_infer
    #: The checksum is so short that a cut frame and the begin of the next one pass for a whole frame too often: one in
    #: which another whole one begins that ends later is none.
    weak: bool = False
    #: When the neighbours of a frame are asked too whether it is damaged. "always": its checksum is a sum, in which two
    #: errors can undo each other. "beside damage": it is a CRC-16, which one damaged frame of 65,536 passes.
    doubt: Literal["never", "beside damage", "always"] = "never"
    #: Whether frames of a layout are lines whose fields are counted from the end: `fields` takes those of all lengths
    #: at once, with commas in front.
    lines: Callable[[int], bool] = lambda _layout: False
    #: What a frame that is not read is called by the unit's manual, for messages.
    message: Callable[[Bytes], str] = lambda _row: "other frames"
    #: CR and LF between frames belong to them.
    line_ends: bool = False


def at_sync(data: Bytes, sync: Sequence[int]) -> Index:
    """Positions at which all bytes of `sync` stand."""
    last = len(data) - len(sync) + 1
    if last <= 0:
        return np.empty(0, np.int64)
    here = np.ones(last, bool)
    for offset, value in enumerate(sync):
        here &= data[offset : offset + last] == value
    return np.flatnonzero(here)


def with_head(data: Bytes, starts: Index, head: int) -> Index:
    """Those starts after which `head` bytes stand in the buffer."""
    return starts[starts + head <= len(data)]


def u16(data: Bytes, at: Index, *, big: bool = False) -> Index:
    """16-bit numbers at positions of a buffer."""
    low, high = (1, 0) if big else (0, 1)
    return data[at + low].astype(np.int64) | (data[at + high].astype(np.int64) << 8)
