"""Specific force that comes in other frames than rate, or in some of them only: found, and paired with the samples."""

from __future__ import annotations

import numpy as np

from gyronorth.arrays import Index
from gyronorth.findings import Finding
from gyronorth.frames.framing import Frames, joined, split
from gyronorth.frames.pairing import Pairing, Ratio, ratio_of
from gyronorth.frames.protocol import Force, Protocol
from gyronorth.frames.samples import LARGEST_FORCE, Samples

#: Frames with specific force that tell how often it comes.
TELLING = 3
#: Specific force has stopped where it has not come for this many of its intervals, or of this many samples of rate.
STOPPED, STOPPED_LEAST = 8, 512
LATE_FORCE = Finding(
    "force_left_out",
    "The unit began to send specific force on the way, or sends it less often than every 200th sample of the rate; it "
    "is left out, and roll and pitch are not measured. Set the unit to send both at the same rate, and start again.",
)
_AVERAGED = (
    "The unit sends {}; the means of both over intervals of {} are taken, {:g} a second. No value is held or "
    "interpolated, so that the noise densities stay what they are."
)


class ForceTrack:
    """Keeps the specific force of a stream whose frames with rate do not hold it.

    Parameters
    ----------
    protocol : Protocol
        Of the stream.
    """

    def __init__(self, protocol: Protocol) -> None:
        self._protocol = protocol
        self._pairing: Pairing | None = None
        self._per = 1
        self._interval = 0.0  # between specific forces, s
        self._recent: list[Frames] = []  # with the samples of an interval that is not full

    @property
    def per(self) -> int:
        """Samples of rate that became one since it was settled; 1 where nothing was paired."""
        return self._per

    @property
    def paired(self) -> bool:
        """Whether specific force is taken from frames of its own."""
        return self._pairing is not None

    @property
    def pending(self) -> bytes:
        """Frames of the interval that is not full yet."""
        return b"".join(frames.data.tobytes() for frames in self._recent)

    def open(self, frames: Frames) -> bool:
        """Whether these first frames do not show yet how often specific force comes, if at all."""
        return self._protocol.force is not None and int(self._in(frames, 1.0).here.sum()) < TELLING

    def settle(self, frames: Frames, index: Index, number: Index, begin: int, rate_hz: float | None) -> Finding | None:
        """Tell from the first frames how often it comes, beside the frames `index` with the samples `number`.

        Samples with both are numbered from `begin`.
        """
        self.none()
        if self._protocol.force is None:
            return None
        here = self._in(frames, 1.0).here
        behind = np.searchsorted(index, np.flatnonzero(here), side="right") - 1
        places = number[behind[behind >= 0]]
        ratio = ratio_of(places)
        if ratio is None or places[0] - number[0] > STOPPED * ratio.per:  # few, or they begin on the way
            return LATE_FORCE if ratio is None and here.any() else None
        interval = None if rate_hz is None else 1 / rate_hz
        self._pairing = Pairing(ratio, interval, int(number[0]), begin)
        self._per = ratio.per
        self._interval = ratio.mean * (interval or 1.0)
        return _averaged(ratio, rate_hz) if ratio.mean != 1 else None

    def none(self) -> None:
        """Nothing is paired from here on."""
        self.end()
        self._per = 1

    def take(self, frames: Frames, samples: Samples | None) -> Samples | None:
        """The samples that `frames` complete; `samples` are those with the rate alone."""
        assert self._pairing is not None
        given = self._pairing.feed(samples, frames.start, self._in(frames, self._interval))
        begin, kept = self._pairing.pending_from, joined([*self._recent, frames])
        place = len(kept) if begin is None else int(np.searchsorted(kept.start, begin))
        self._recent = [split(kept, place)[1]] if place < len(kept) else []
        return given

    def stops(self, frames: Frames, index: Index) -> int | None:
        """The frame behind which it comes no more, though frames with rate (`index`) do; None if it goes on."""
        if self._pairing is None or not len(frames):
            return None
        here = np.flatnonzero(self._in(frames, 1.0).here)
        begin = int(here[-1]) + 1 if len(here) else 0
        without = int((index >= begin).sum()) + (0 if len(here) else self._pairing.without)
        return begin if begin < len(frames) and without > max(STOPPED * self.per, STOPPED_LEAST) else None

    def comes(self, frames: Frames) -> bool:
        """Whether some of these frames hold it."""
        return self._protocol.force is not None and bool(self._in(frames, 1.0).here.any())

    def end(self) -> Samples | None:
        """What is left at the end; another setting of the unit may follow."""
        left = None if self._pairing is None else self._pairing.finish()
        self._pairing, self._recent = None, []
        return left

    def _in(self, frames: Frames, interval: float) -> Force:
        """The specific force of all frames."""
        assert self._protocol.force is not None
        force = Force.none(len(frames))
        for length in np.unique(frames.length[frames.layout > -2]).tolist():
            index = np.flatnonzero((frames.length == length) & (frames.layout > -2))
            with np.errstate(invalid="ignore"):
                part = self._protocol.force(frames.rows(index), interval)
            good = part.here & (np.abs(part.value) < LARGEST_FORCE).all(axis=1)
            force.here[index[good]], force.value[index[good]] = True, part.value[good]
            force.saturated[index[good]] = part.saturated[good]
        return force


def _averaged(ratio: Ratio, rate_hz: float | None) -> Finding:
    rate = rate_hz or 1.0
    sent = f"rate at {rate:g} Hz and specific force at {rate / max(ratio.mean, 1e-9):.4g} Hz"
    share = f"{ratio.per} samples of the rate" if ratio.per > 1 else "a sample of the rate"
    return Finding("force_paired", _AVERAGED.format(sent, share, rate / ratio.per), ratio.mean)
