"""The pipeline for a unit that is still running: samples come in pieces, the heading of all so far comes out.

Samples are gathered into rows of equal length, and the pipeline runs on the rows as on a recording
of a lower rate. The store holds a bounded number of rows: when it is full, neighbouring rows are
merged and rows are longer from then on. A row of the accelerometer is the mean of its samples; a
row of the gyro is the steady rate that turns the unit as its samples did, one after another. Both
are exact under merging, so that a row is the same whatever rows it went through.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import repeat
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from gyronorth.alignment import registry, verdict
from gyronorth.alignment.gates import FEWEST_SAMPLES, SHORTEST, saturation_gates
from gyronorth.alignment.problem import Problem
from gyronorth.alignment.registry import LENGTH_SLACK, Options
from gyronorth.alignment.turned.segments import CHUNK
from gyronorth.arrays import Array
from gyronorth.attitude import from_rotation_vector, multiply
from gyronorth.conditioning import block_means
from gyronorth.deviation import DeviationModel
from gyronorth.earth import STANDARD_GRAVITY, earth_rate_n
from gyronorth.errors import InputError
from gyronorth.estimate import HeadingEstimate
from gyronorth.findings import Finding
from gyronorth.given import checked_latitude, checked_path, number, of_kind
from gyronorth.recording import Recording
from gyronorth.sensor import Sensor, read_sensor

#: Rows that the store holds at most, and with them the work of one estimate and the memory.
MOST_ROWS = 24_000
#: Samples that wait for the next estimate before they are made into rows.
WAITING = 1024
#: Poses that the fit of a turned recording takes at most; what lies before them is dropped.
MOST_POSES = 16
#: Rate, Hz, below which rows of a method that looks at its last window are not merged: older ones are dropped.
STEADY_RATE = 3.0
#: Points of the traces at most.
TRACE_POINTS = 1000
#: Shortest piece of the trace of the rate norm, s.
TRACE_SECONDS = 1.0


class StreamingHeading:
    """Heading of a running unit, of all samples since the start or `restart`.

    Parameters
    ----------
    rate_hz : float
        Sample rate, Hz; samples are taken to lie on a uniform grid.
    latitude : float
        Geodetic latitude, rad.
    accelerometer : bool
        Whether specific force comes with the angular rate.
    sensor, method, model, attitude, deviation
        As in `heading`.
    session : str, optional
        Power-up session of the unit, which `deviation` is asked about.

    Raises
    ------
    InputError
        If a setting is wrong in itself: found at once, not after the first samples.

    Notes
    -----
    Rows are as long as a sample at first. At 600 Hz they grow to 0.1 s within 40 minutes, to 0.2 s
    within 80, and double with the time from then on (3.2 s after 24 h): motion shorter than a row
    is then seen only by what it leaves, and poses shorter than about five rows are lost (warning
    `older_merged`). Up to one row of the newest samples waits for its completion. Of a turned
    record the newest 16 poses are used, and "bayes", "paper" and "baseline", which look at their last
    window only, have older samples dropped rather than merged (warning `older_dropped`).
    """

    def __init__(
        self,
        *,
        rate_hz: float,
        latitude: float,
        accelerometer: bool,
        sensor: Sensor | str | None = None,
        method: str = "auto",
        attitude: tuple[float, float] | None = None,
        model: str | Path | None = None,
        deviation: DeviationModel | None = None,
        session: str | None = None,
    ) -> None:
        self.rate_hz = number("rate_hz", rate_hz)
        self.latitude = checked_latitude(latitude)
        of_kind("accelerometer", accelerometer, bool | np.bool_, "true or false")
        self.accelerometer = bool(accelerometer)
        self._sensor = None if sensor is None else read_sensor(sensor)
        self._method, self._attitude = method, attitude
        self._model = None if model is None else checked_path("model", model)
        if deviation is not None:
            of_kind("deviation", deviation, DeviationModel, "a curve, as `read_deviation` gives it,")
        self._deviation, self._session = deviation, session
        trial = _still_unit(self.rate_hz, self.latitude, self.accelerometer)
        self.restart()
        several = registry.METHODS.info(method).least_poses > 1 and attitude is None
        trial_method = "auto" if several else method
        self._solved(self._of(trial.gyro_b, trial.accel_b, trial.rate_hz), trial_method)

    def restart(self) -> None:
        """Forget all samples and the trace."""
        info = registry.METHODS.info(self._method)
        lowest_hz = STEADY_RATE if info.memory == "last_window" else 0.0
        self.store = RowStore(self.rate_hz, 6 if self.accelerometer else 3, lowest_hz)
        self._trace: list[tuple[float, float, float, bool]] = []
        self._spacing = 0.0

    @property
    def duration(self) -> float:
        """Time since the start, s."""
        return self.store.samples / self.rate_hz

    @property
    def trace(self) -> list[tuple[float, float, float, bool]]:
        """(time in s, heading in rad or NaN, half width of the 95 % interval in rad, valid) of past estimates."""
        return list(self._trace)

    def add(self, gyro_b: ArrayLike, accel_b: ArrayLike | None = None) -> None:
        """Add samples.

        Parameters
        ----------
        gyro_b, accel_b : array_like, shape (n, 3)
            Angular rate, rad/s, and specific force, m/s^2, of any number of samples.

        Raises
        ------
        InputError
            If they are not (n, 3) and finite, or there is specific force where none was announced
            or none where it was. Nothing of the piece is taken then.
        """
        if (accel_b is not None) != self.accelerometer:
            said, came = ("with", "without") if self.accelerometer else ("without", "with")
            raise InputError(f"The stream was opened {said} an accelerometer, samples came {came} specific force.")
        if np.size(gyro_b) == 0 and (accel_b is None or np.size(accel_b) == 0):
            return
        piece = Recording(gyro_b, accel_b, self.rate_hz)  # type: ignore[arg-type]  # it checks and converts
        self.store.add(piece.gyro_b if piece.accel_b is None else np.hstack([piece.gyro_b, piece.accel_b]))

    def estimate(self) -> HeadingEstimate:
        """The heading of all that was added, as `heading` gives it, with one entry of the trace."""
        self.store.settle()
        found = self.solve()
        self._remember(found)
        return found

    def rate_norm(self) -> tuple[Array, Array]:
        """Norm of the mean rate over consecutive pieces, to be drawn beside Earth rate.

        Returns
        -------
        times : ndarray, shape (k,)
            Middle of each piece since the start, s; k is at most `TRACE_POINTS`.
        norm : ndarray, shape (k,)
            rad/s.
        """
        store = self.store
        store.settle()
        size = max(1, round(TRACE_SECONDS * store.rate_hz), -(-store.count // TRACE_POINTS))
        rate_b = block_means(store.rows[: store.count, :3], size)
        middle = np.arange(len(rate_b), dtype=float) + 0.5
        times: Array = (store.dropped + middle * size * store.size) / self.rate_hz
        return times, np.linalg.norm(rate_b, axis=1)

    def _solved(self, problem: Problem, method: str) -> HeadingEstimate:
        """The estimate of the rows, with the peaks and the rate of the samples that they are made of."""
        options = Options(self._model, deviation=self._deviation)
        result = registry.solve(method, problem, options)
        return verdict.estimate(problem, result, peaks=self.store.peaks, rate_hz=self.rate_hz)

    def solve(self) -> HeadingEstimate:
        """The heading of all that was added, without an entry of the trace."""
        store = self.store
        if store.count == 0:
            return self._too_short(f"no sample has come yet; at least {FEWEST_SAMPLES} and {SHORTEST:g} s are needed.")
        problem, info = self._problem(), registry.METHODS.info(self._method)
        if info.memory == "last_window" and problem.duration > info.longest_s + LENGTH_SLACK:
            problem = problem.part(-info.longest_s)
        try:
            found = self._solved(problem, self._method)
        except InputError as error:  # the settings are right, so it is the recording that will not do yet
            return self._too_short(str(error))
        if len(found.poses) > MOST_POSES:
            store.drop(round(found.poses[-MOST_POSES].start * store.rate_hz))
            return self.solve()
        return replace(found, warnings=(*found.warnings, *self._limits(problem.duration)))

    def _problem(self) -> Problem:
        """The rows as a problem."""
        store = self.store
        gyro_b, accel_b = store.rows[: store.count, :3], store.rows[: store.count, 3:]
        return self._of(gyro_b, accel_b if self.accelerometer else None, store.rate_hz)

    def _of(self, gyro_b: Array, accel_b: Array | None, rate_hz: float) -> Problem:
        return Problem(gyro_b, accel_b, rate_hz, self.latitude, self._sensor, self._attitude, self._session)

    def _limits(self, used: float) -> list[Finding]:
        """Warnings of what was left out, where `used` s are left."""
        store, found = self.store, []
        if store.size > 1 and store.rate_hz < 0.99 / CHUNK:
            message = (
                f"After {self.duration / 3600:.1f} h samples are kept as means over {1 / store.rate_hz:.1f} s: "
                "shorter motion is averaged out, shorter poses are lost. Restart before a new set of poses."
            )
            found.append(Finding("older_merged", message, 1 / store.rate_hz, CHUNK))
        dropped = store.dropped / self.rate_hz + store.duration - used
        if dropped > 0:
            message = (
                f"The first {dropped:.0f} s are not used, to bound the work of an estimate; times of poses and turns "
                "count from there."
            )
            found.append(Finding("older_dropped", message, dropped))
        return found

    def _too_short(self, why: str) -> HeadingEstimate:
        """No heading yet."""
        store = self.store
        message = f"No heading after {self.duration:.2f} s: {why}"
        rate = store.rows[: store.count, :3].mean(axis=0) if store.count else np.zeros(3)
        found = verdict.refusal(
            Finding("too_short", message, self.duration, SHORTEST),
            method=self._method,
            latitude=self.latitude,
            duration=self.duration,
            rate_hz=self.rate_hz,
            sensor=None if self._sensor is None else self._sensor.name,
        )
        saturated = (gate.finding() for gate in saturation_gates(self._sensor, store.peaks))
        return replace(
            found,
            reasons=(*found.reasons, *(finding for finding in saturated if finding)),
            warnings=tuple(self._limits(store.duration)),
            rate_mean=(float(rate[0]), float(rate[1]), float(rate[2])),
            rate_norm=float(np.linalg.norm(rate)),
        )

    def _remember(self, found: HeadingEstimate) -> None:
        """One more entry of the trace; when there are too many, every second goes and new ones lie wider apart."""
        low, high = found.interval95
        half = np.pi if high - low >= 2 * np.pi else ((high - low) % (2 * np.pi)) / 2
        angle = np.nan if found.heading is None else found.heading
        trace = self._trace
        if len(trace) > 1 and trace[-1][0] - trace[-2][0] < self._spacing:
            trace.pop()
        trace.append((self.duration, angle, float(half), found.valid))
        if len(trace) > TRACE_POINTS:
            del trace[1:-1:2]
            self._spacing = 2 * self.duration / TRACE_POINTS


class RowStore:
    """All samples so far in at most `MOST_ROWS` rows of equal length."""

    def __init__(self, rate_hz: float, columns: int, lowest_hz: float) -> None:
        self.samples = 0  # since the start
        self.dropped = 0  # of them, the oldest, no more in the rows
        self.size = 1  # samples per row
        self.count = 0  # rows in use
        self.rows = np.empty((MOST_ROWS, columns))  # rate, rad/s, and specific force, m/s^2
        self.peak = np.zeros(2)  # largest component of either since the start
        self._sample_hz, self._lowest_hz = rate_hz, lowest_hz
        self._waiting, self.waiting = np.empty((WAITING, columns)), 0
        self._factors = _factors(max(1, round(CHUNK * rate_hz)))
        self._factor = next(self._factors)

    @property
    def rate_hz(self) -> float:
        """Rate of the rows, Hz."""
        return self._sample_hz / self.size

    @property
    def peaks(self) -> tuple[Array, Array | None]:
        """Largest component of angular rate and specific force, which rows, being means, do not show."""
        accel = np.asarray(self.peak[1]) if self.rows.shape[1] > 3 else None
        return np.asarray(self.peak[0]), accel

    @property
    def duration(self) -> float:
        """Time that the rows cover, s."""
        return self.count / self.rate_hz

    def add(self, samples: Array) -> None:
        """Put samples, shape (n, columns), behind the others."""
        self.samples += len(samples)
        while len(samples):
            part = samples[: len(self._waiting) - self.waiting]
            self._waiting[self.waiting : self.waiting + len(part)] = part
            self.waiting += len(part)
            samples = samples[len(part) :]
            if self.waiting == len(self._waiting):
                self.settle()

    def settle(self) -> None:
        """Make rows of the samples that wait, but for an incomplete last row."""
        waiting = self._waiting[: self.waiting]
        for place, triad in enumerate((waiting[:, :3], waiting[:, 3:])):
            self.peak[place] = max(self.peak[place], np.abs(triad).max(initial=0.0))
        done = 0
        while self.waiting - done >= self.size:
            full = MOST_ROWS // self._factor * self._factor
            rows = min((self.waiting - done) // self.size, full - self.count)
            part = waiting[done : done + rows * self.size]
            self.rows[self.count : self.count + rows] = merged_rows(part, self.size, rate_hz=self._sample_hz)
            self.count, done = self.count + rows, done + rows * self.size
            if self.count == full:
                self._make_room()
        rest = waiting[done:].copy()
        if len(self._waiting) < self.size:
            self._waiting = np.empty((2 * self.size, self.rows.shape[1]))
        self.waiting = len(rest)
        self._waiting[: self.waiting] = rest

    def drop(self, rows: int) -> None:
        """Leave out the oldest rows."""
        self.rows[: self.count - rows] = self.rows[rows : self.count].copy()
        self.count, self.dropped = self.count - rows, self.dropped + rows * self.size

    def _make_room(self) -> None:
        if self.rate_hz / self._factor < self._lowest_hz:
            self.drop(self.count // 2)
            return
        merged = merged_rows(self.rows[: self.count], self._factor, rate_hz=self.rate_hz)
        self.size, self.count = self.size * self._factor, len(merged)
        self.rows[: self.count] = merged
        self._factor = next(self._factors)


def _factors(chunk: int) -> Iterator[int]:
    """Factors by which rows grow: the prime factors of `chunk` samples, largest first, and then 2 for ever.

    Rows so divide the chunks in which motion is looked for, which find the same poses as at the full rate.
    """
    left, primes, divisor = chunk, [], 2
    while left > 1:
        while left % divisor == 0:
            primes.append(divisor)
            left //= divisor
        divisor += 1
    yield from reversed(primes)
    yield from repeat(2)


def merged_rows(rows: Array, size: int, *, rate_hz: float) -> Array:
    """Every `size` rows (n, columns) as one: the steady rate of their rotation, the mean of the rest."""
    if size == 1:
        return rows
    groups = rows.reshape(-1, size, rows.shape[1])
    angle = _rotation(groups[..., :3] / rate_hz)
    return np.hstack([angle * (rate_hz / size), groups[..., 3:].mean(axis=1)])


def _rotation(step: Array) -> Array:
    """Rotation vector (n, 3) of consecutive rotations (n, size, 3), of the revolution nearest to their sum, rad."""
    product = from_rotation_vector(step)
    while product.shape[1] > 1:  # neighbours in pairs: the order stays
        if product.shape[1] % 2:
            product = np.concatenate([product, np.broadcast_to([0.0, 0.0, 0.0, 1.0], (len(step), 1, 4))], axis=1)
        product = multiply(product[:, ::2], product[:, 1::2])
    total = step.sum(axis=1)
    size = np.linalg.norm(total, axis=1, keepdims=True)
    vector, real = product[:, 0, :3], product[:, 0, 3:]
    sine = np.linalg.norm(vector, axis=1, keepdims=True)
    axis = np.where(sine > 1e-9, vector / np.maximum(sine, 1e-300), total / np.maximum(size, 1e-300))
    angle = 2 * np.arctan2(sine, real)
    revolutions = np.round(((total * axis).sum(axis=1, keepdims=True) - angle) / (2 * np.pi))
    return (angle + 2 * np.pi * revolutions) * axis


def _still_unit(rate_hz: float, latitude: float, accelerometer: bool) -> Recording:
    """Half a minute of a level unit with a little noise, on which any right setting works."""
    Recording(np.zeros((1, 3)), None, rate_hz)  # checks the rate
    rate_hz = min(rate_hz, 10.0)
    noise = np.random.default_rng(0).standard_normal((2, max(FEWEST_SAMPLES, round(31 * rate_hz)), 3))
    force = [0.0, 0.0, -STANDARD_GRAVITY] + 1e-3 * noise[1] if accelerometer else None
    return Recording(earth_rate_n(latitude) + 1e-5 * noise[0], force, rate_hz, latitude=latitude)
