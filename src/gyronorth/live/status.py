"""What a session shows of itself at one moment: a frozen picture that any thread may read.

Whether the heading may be used is decided here alone; page, JSON lines and NMEA only show it.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from math import degrees, pi
from pathlib import Path
from typing import Any, Literal

import numpy as np

from gyronorth.attitude import angles_of, mat_bn, rotation
from gyronorth.estimate import HeadingEstimate
from gyronorth.findings import Finding
from gyronorth.live.estimation import LiveEstimate
from gyronorth.live.holding import Held

#: waiting: no row has come yet. ended: the source has nothing more.
State = Literal["waiting", "running", "stopped", "ended", "failed"]
#: held: carried on by the gyro since the unit moved; the rest as of an estimate.
LiveFitness = Literal["aligning", "degraded", "valid", "held", "invalid"]
#: A session that has not looked at its source for so long, s, answers for nothing.
UNATTENDED = 3.0
#: Trouble of a session that waits for a receiver, before its name.
NO_FIX = "waiting for a fix of the latitude"
#: Half width of the 95 % interval of a normal law, sigma.
NORMAL_95 = 1.96


@dataclass(frozen=True)
class Counters:
    """Counts of the input and of its faults since the program started."""

    lines: int = 0  # or frames, that should have been rows
    good: int = 0  # rows that were used
    garbage: int = 0  # lines that were no rows, frames whose numbers are none
    skipped_bytes: int = 0  # of no whole frame
    other_frames: int = 0  # whole ones without inertial data
    implausible: int = 0  # rows that no sensor gives
    strays: int = 0  # rows repeated, late, or with a time stamp that fits nowhere
    lost: int = 0  # samples missing by the time stamps, bridged
    gaps: int = 0  # in so many places
    connections: int = 0
    reconnects: int = 0
    stalls: int = 0
    time_jumps: int = 0
    restarts: int = 0  # new stretches, with a new recording each


@dataclass(frozen=True)
class Mark:
    """A moment that the user marked."""

    time: float  # s from the start of the stretch
    text: str


@dataclass(frozen=True)
class Status:
    """A session at one moment."""

    state: State
    source: str
    connected: bool = False
    protocol: str = ""  # of the frames, or "lines"; empty before it is known
    trouble: str = ""  # why the source is not delivering, empty when it is
    silent: float = 0.0  # s since the last bytes
    rate_hz: float | None = None
    seconds: float = 0.0  # of the present stretch
    counters: Counters = Counters()
    last_garbage: str = ""
    found: LiveEstimate | None = None
    held: Held | None = None  # the heading carried on, where the unit has moved since the last valid estimate
    rate_of_turn: float | None = None  # rad/s, positive to starboard
    age: float | None = None  # s since the estimate was made
    unattended: float = 0.0  # s since the session last looked at its source
    findings: tuple[Finding, ...] = ()  # reasons beside those of the estimate
    warnings: tuple[Finding, ...] = ()  # beside those of the estimate
    alignment: float = 0.0  # rad; how far to starboard of the unit's forward axis the vehicle's lies
    require_sigma: float | None = None  # rad; a heading that is less certain is not given out
    replay: bool = False  # whether the samples are played back
    marks: tuple[Mark, ...] = ()
    targets: tuple[str, ...] = ()  # of the sentences, as they were named
    message: str = ""  # what last happened, for people
    saving: bool = False  # whether a recording was asked for
    recording: Path | None = None  # the latest file; None until the first is made, with the first rows
    recording_bytes: int = 0
    raw_recording: Path | None = None  # of frames: the bytes as they came
    recording_error: str | None = None
    heading_true: float | None = field(default=None)  # rad, when the stream states it

    @property
    def measured(self) -> HeadingEstimate | None:
        """The latest estimate as it was when it was made: what the samples say, now or before the end."""
        if self.found is None:
            return None
        estimate = self.found.estimate
        reasons = (*estimate.reasons, *self.findings)
        warnings = (*estimate.warnings, *self.warnings)
        estimate = replace(estimate, reasons=reasons, warnings=warnings).required(self.require_sigma)
        return self._aligned(estimate) if self.alignment else estimate

    @property
    def estimate(self) -> HeadingEstimate | None:
        """What is given out: the latest estimate, or the heading that is held, with every reason not to use it now."""
        measured = self.measured
        if measured is not None and self.held is not None:
            measured = self._carried(measured, self.held)
        return measured and replace(measured, reasons=(*measured.reasons, *self._past()))

    def _carried(self, estimate: HeadingEstimate, held: Held) -> HeadingEstimate:
        """The heading that is held, in the words of an estimate."""
        held = replace(held, **_turned(held, self.alignment))
        half = min(NORMAL_95 * held.sigma, pi)
        low, high = (held.heading - half) % (2 * pi), (held.heading + half) % (2 * pi)
        carried = replace(
            estimate,
            heading=held.heading,
            sigma=held.sigma,
            interval95=(low, high) if half < pi else (0.0, 2 * pi),
            method="held",
            method_reason=f"carried on by the gyro for {held.since:.0f} s, as the unit has moved",
            roll=held.roll,
            pitch=held.pitch,
            sigma_parts={},
        )
        return replace(carried, reasons=self.findings).required(self.require_sigma)

    def _aligned(self, estimate: HeadingEstimate) -> HeadingEstimate:
        """The attitude of the vehicle, whose forward axis lies beside the unit's."""
        message = f"An alignment offset of {degrees(self.alignment):+.2f} deg is set: the heading is the vehicle's."
        estimate = replace(estimate, warnings=(*estimate.warnings, Finding("alignment_offset", message)))
        if estimate.heading is None:
            return estimate
        turned = _turned(estimate, self.alignment)
        low, high = estimate.interval95
        if high - low < 2 * pi:
            shift = turned["heading"] - estimate.heading
            low, high = (low + shift) % (2 * pi), (high + shift) % (2 * pi)
        return replace(estimate, interval95=(low, high), posterior=None, **turned)  # no density is turned here

    @property
    def fitness(self) -> LiveFitness:
        """What the heading is good for now."""
        estimate = self.estimate
        if estimate is None:
            return "aligning" if self.state in ("waiting", "running") and not self.findings else "invalid"
        return "held" if estimate.fitness == "valid" and self.held is not None else estimate.fitness

    def _past(self) -> tuple[Finding, ...]:
        """Why the heading is not one of this moment."""
        if self.state == "ended":
            return (Finding("source_ended", "The source has ended; the heading is that of its last sample."),)
        if self.state != "running":
            return (Finding("not_running", f"The session is {self.state}."),)
        if self.unattended > UNATTENDED:
            message = f"The program has not looked at its source for {self.unattended:.0f} s."
            return (Finding("stalled", message, self.unattended, UNATTENDED),)
        return ()

    def to_json(self) -> dict[str, Any]:
        """The object of one line of `live --json`: that of `heading --json`, and `live`."""
        estimate = self.estimate
        document = {} if estimate is None else estimate.to_json()
        live = {
            "state": self.state,
            "fitness": self.fitness,
            "age_s": self.age,
            "held_s": None if self.held is None else self.held.since,
            "alignment_deg": round(degrees(self.alignment), 9),
            "rate_of_turn_deg_min": None if self.rate_of_turn is None else degrees(self.rate_of_turn) * 60,
            "replay": self.replay,
            "source": self.source,
            "protocol": self.protocol or None,
            "connected": self.connected,
            "trouble": self.trouble or None,
            "recording": None if self.recording is None else str(self.recording),
            "raw_recording": None if self.raw_recording is None else str(self.raw_recording),
            "recording_error": self.recording_error,
            **asdict(self.counters),
        }
        return {**document, "live": live}


def _turned(attitude: HeadingEstimate | Held, offset: float) -> dict[str, Any]:
    """Heading, roll and pitch, rad, of axes turned by an offset to starboard in the plane of the given ones."""
    heading, roll, pitch = attitude.heading, attitude.roll, attitude.pitch
    assert heading is not None
    if roll is None or pitch is None:
        return {"heading": (heading + offset) % (2 * pi)}
    mat = rotation(np.array([0.0, 0.0, -offset])) @ mat_bn(roll, pitch, heading)
    heading, roll, pitch = (float(angle) for angle in angles_of(mat.T))
    return {"heading": heading % (2 * pi), "roll": roll, "pitch": pitch}
