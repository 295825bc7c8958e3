"""The streaming estimator in a thread of its own, so that the recording never waits for an estimate."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from threading import Condition, Thread

import numpy as np

from gyronorth import pipeline
from gyronorth.arrays import Array
from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY
from gyronorth.errors import InputError
from gyronorth.estimate import HeadingEstimate
from gyronorth.recording import Recording
from gyronorth.streaming import StreamingHeading

#: Estimates are this far apart, s, and take at most this share of the time: on a busy machine, or while samples come as
#: fast as they are read, one takes longer, and they are rarer.
INTERVAL, SHARE = 1.0, 0.1
#: Samples that may wait; the source waits with them.
MOST_WAITING = 60_000


@dataclass(frozen=True)
class LiveEstimate:
    """The latest estimate and how it came about, arrays of bounded length."""

    estimate: HeadingEstimate
    trace: Array  # (k, 4): time s, heading rad or NaN, half width of the 95 % interval rad, valid
    rate_norm: tuple[Array, Array]  # (k,) time s and norm of the mean rate rad/s
    samples: int = 0  # since the start of the stretch, up to the estimate
    made: float = field(default_factory=time.monotonic)  # when


class Estimation:
    """Samples in, estimates out, about once a second."""

    def __init__(self, done: Callable[[LiveEstimate | None, str | None], None], *, any_method: bool = True) -> None:
        """`done` gets each new estimate, or the message of why there can be none; with `any_method` all are warmed."""
        self._done, self._any_method = done, any_method
        self._condition = Condition()
        self._waiting: list[tuple[Array, Array | None]] = []
        self._count = 0
        self._present: StreamingHeading | None = None
        self._ending = self._flushing = False
        self._lost: tuple[StreamingHeading | None, str] = None, ""  # one that lacks samples, and why
        self._due = 0.0  # when the next estimate is made
        self._thread = Thread(target=self._run, name="estimation", daemon=True)

    def start(self) -> None:
        """Begin to work."""
        self._thread.start()

    def begin(self, heading: StreamingHeading | None) -> None:
        """Forget what waits and estimate afresh with this; None: not before the next call."""
        with self._condition:
            self._waiting, self._count, self._present = [], 0, heading
            self._due = time.monotonic() + INTERVAL
            self._condition.notify_all()

    def put(self, gyro_b: Array, accel_b: Array | None) -> None:
        """Hand over samples; waits where too many are waiting already."""
        if len(gyro_b) == 0:
            return
        with self._condition:
            self._condition.wait_for(lambda: self._count < MOST_WAITING or self._ending)
            self._waiting.append((gyro_b, accel_b))
            self._count += len(gyro_b)

    def end(self) -> None:
        """Work on what waits, estimate a last time, and stop."""
        with self._condition:
            self._ending = True
            self._condition.notify_all()
        self._thread.join()

    def flush(self) -> None:
        """Estimate at once, and return when that is done."""
        with self._condition:
            self._flushing = True
            self._condition.notify_all()
            self._condition.wait_for(lambda: not self._flushing or not self._thread.is_alive(), timeout=60)

    def _run(self) -> None:
        if self._any_method:
            with suppress(Exception):  # too little memory, say: the estimates will tell
                _warm()
        fresh = False  # whether samples came since the last estimate
        while True:
            with self._condition:
                self._condition.wait_for(lambda: self._ending or self._flushing, timeout=INTERVAL)
                ending, flushing = self._ending, self._flushing
                present = self._present
                waiting, self._waiting, self._count = self._waiting, [], 0
                self._condition.notify_all()
            if present is not None:
                self._take(present, waiting)
                fresh = fresh or bool(waiting)
                if ending or flushing or (fresh and time.monotonic() >= self._due):
                    begun, fresh = time.monotonic(), False
                    self._estimate(present)
                    self._due = time.monotonic() + (time.monotonic() - begun) / SHARE
            if flushing:
                with self._condition:
                    self._flushing = False
                    self._condition.notify_all()
            if ending:
                return

    def _take(self, heading: StreamingHeading, waiting: list[tuple[Array, Array | None]]) -> None:
        """Add samples; where that fails there is no heading any more, since these are missing."""
        try:
            self._add(heading, waiting)
        except Exception as error:
            self._lost = heading, f"The samples were not taken up ({type(error).__name__}: {error})."

    @staticmethod
    def _add(heading: StreamingHeading, waiting: list[tuple[Array, Array | None]]) -> None:
        if waiting:
            gyro = np.concatenate([gyro for gyro, _ in waiting])
            parts = [accel for _, accel in waiting if accel is not None]
            heading.add(gyro, np.concatenate(parts) if parts else None)

    def _estimate(self, heading: StreamingHeading) -> None:
        lost, failure = self._lost
        if lost is not heading and heading.duration == 0:
            return
        if lost is heading:
            self._tell(heading, None, failure)
            return
        found, failure = None, None
        try:
            estimate = heading.estimate()
            trace = np.array(heading.trace, dtype=float).reshape(-1, 4)
            found = LiveEstimate(estimate, trace, heading.rate_norm(), heading.store.samples)
        except InputError as error:
            failure = str(error)
        except Exception as error:  # a fault of ours: an old heading must not stay valid for it
            failure = f"The estimate failed ({type(error).__name__}: {error})."
        self._tell(heading, found, failure)

    def _tell(self, heading: StreamingHeading, found: LiveEstimate | None, failure: str | None) -> None:
        with self._condition:
            if self._present is heading:  # else it is of a stretch that is over
                self._done(found, failure)


@cache
def _warm() -> None:
    """Run once what `auto` may turn to later, so that it takes its memory at the start and not during a turn."""
    for recording in (_unit_at_rest(10.0), _unit_at_rest(200.0, turned=True)):
        pipeline.heading(recording, sensor="isa100c")


def _unit_at_rest(rate_hz: float, *, turned: bool = False) -> Recording:
    """Numbers like those of a unit that stands level for 100 s, turned half round in the middle or not."""
    times, latitude, rng = np.arange(round(100 * rate_hz)) / rate_hz, 0.8, np.random.default_rng(0)
    turning = (times >= 45) & (times < 55) & turned
    heading = np.cumsum(turning) * (np.pi / 10 / rate_hz)
    north, down = EARTH_RATE * np.cos(latitude), EARTH_RATE * -np.sin(latitude)
    gyro_b = np.column_stack([north * np.cos(heading), -north * np.sin(heading), down + np.pi / 10 * turning])
    accel_b = np.tile([0.0, 0.0, -STANDARD_GRAVITY], (len(times), 1))
    return Recording(
        gyro_b + 1e-6 * rng.standard_normal(gyro_b.shape),
        accel_b + 1e-3 * rng.standard_normal(accel_b.shape),
        rate_hz,
        latitude,
    )
