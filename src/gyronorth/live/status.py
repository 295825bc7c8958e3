"""What a session shows of itself at one moment: a frozen picture that any thread may read."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from gyronorth.estimate import HeadingEstimate
from gyronorth.findings import Finding
from gyronorth.live.estimation import LiveEstimate

#: waiting: no row has come yet. ended: the source has nothing more.
State = Literal["waiting", "running", "stopped", "ended", "failed"]


@dataclass(frozen=True)
class Counters:
    """What came, and what went wrong, since the program started."""

    lines: int = 0  # that should have been rows
    good: int = 0  # rows that were used
    garbage: int = 0  # lines that were no rows
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
    trouble: str = ""  # why the source is not delivering, empty when it is
    silent: float = 0.0  # s since the last bytes
    rate_hz: float | None = None
    seconds: float = 0.0  # of the present stretch
    counters: Counters = Counters()
    last_garbage: str = ""
    found: LiveEstimate | None = None
    findings: tuple[Finding, ...] = ()  # reasons beside those of the estimate
    marks: tuple[Mark, ...] = ()
    message: str = ""  # what last happened, for people
    saving: bool = False  # whether a recording was asked for
    recording: Path | None = None  # the latest file; None until the first is made, with the first rows
    recording_bytes: int = 0
    recording_error: str | None = None
    heading_true: float | None = field(default=None)  # rad, when the stream states it

    @property
    def estimate(self) -> HeadingEstimate | None:
        """The latest estimate, with every reason not to use it."""
        if self.found is None:
            return None
        estimate = self.found.estimate
        return replace(estimate, reasons=(*estimate.reasons, *self.findings)) if self.findings else estimate

    @property
    def current(self) -> bool:
        """Whether the heading is being measured now: only then may it steer anything."""
        return self.state == "running"

    def to_json(self) -> dict[str, Any]:
        """The object of one line of `live --json`: that of `heading --json`, and `live`."""
        estimate = self.estimate
        document = {} if estimate is None else estimate.to_json()
        live = {
            "state": self.state,
            "source": self.source,
            "connected": self.connected,
            "trouble": self.trouble or None,
            "recording": None if self.recording is None else str(self.recording),
            "recording_error": self.recording_error,
            **asdict(self.counters),
        }
        return {**document, "live": live}
