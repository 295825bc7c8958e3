"""What disturbs a unit that should stand still: sway, bumps, knocks, warm-up, slow tilt.

Every disturbance is a rotation of the unit against the Earth or a gyro bias that settles. A
rotation acts on both sensors: the gyro measures its rate and an Earth rate seen from the
turned body; the accelerometer, about which the unit rotates, sees gravity from the turned
body. A bias acts on the gyro only.
Every parameter is drawn from the distribution that `DISTRIBUTIONS` states.

Samples are means over the sample interval, so the sum of rate x interval is the rotation
whatever the sample rate: a bump of 0.3 s keeps its angle at 3 Hz.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR
from gyronorth.arrays import Array
from gyronorth.attitude import mat_bn
from gyronorth.earth import earth_rate_n

DEG = np.pi / 180

#: The distribution of each parameter, in words, for the documentation and the model card.
DISTRIBUTIONS = {
    "sway tone": "rate amplitude per axis half-normal, sigma 0.002 deg/s; frequency log-uniform 0.008-0.3 Hz; "
    "phase per axis uniform; mixed: two tones, each present with probability 0.7; sway: the first always",
    "bump": "Poisson, mean 1 per 100 s; constant rate vector normal, sigma 0.02 deg/s per axis; "
    "length uniform 0.3-2 s; start uniform; the unit stays turned (shock: at least one)",
    "knock": "Poisson, mean 1 per 100 s (shock only); one period of a sine, rate amplitude per axis normal, "
    "sigma 0.1 deg/s; length uniform 0.1-0.5 s; no net rotation",
    "warm-up": "gyro bias a exp(-t / tau), a normal per axis, sigma 2 deg/h; tau uniform 15-120 s",
    "slow tilt": "angle a (1 - exp(-t / tau)) about the two horizontal axes, a normal, sigma 0.01 deg; "
    "tau uniform 30-300 s",
    "soak": "gyro bias a exp(-t / tau), a normal per axis, sigma 2 deg/h; tau log-uniform 2-20 min",
    "square": "held out: square wave of rate, amplitude per axis half-normal, sigma 0.002 deg/s; "
    "period log-uniform 5-60 s",
    "ramp": "held out: gyro bias growing linearly from zero, slope per axis normal, sigma 4 deg/h per 100 s",
    "beat": "held out: two tones of equal amplitude per axis, half-normal, sigma 0.002 deg/s; the first log-uniform "
    "0.008-0.3 Hz, the second 0.002-0.01 Hz above it",
}


@dataclass(frozen=True)
class Disturbance:
    """Disturbance of one recording, or of many with leading dimensions (..., n, 3)."""

    kind: str
    rate_hz: float
    rate_b: Array  # (..., n, 3) mean rate of the body against the Earth over each sample, rad/s
    bias_b: Array  # (..., n, 3) gyro bias that is settling, rad/s

    @property
    def angle_b(self) -> Array:
        """Rotation vector since the start, in the middle of each sample, rad, shape (..., n, 3).

        The plain sum of rates: angles stay below a degree, so that the order of
        rotations matters by less than angle^2 / 2.
        """
        step = self.rate_b / self.rate_hz
        return np.cumsum(step, axis=-2) - step / 2

    def apply(self, gyro_b: Array, accel_b: Array | None) -> tuple[Array, Array | None]:
        """Disturbed rate and specific force from undisturbed, error-free ones, shape (..., n, 3).

        gyro -> R(angle)^T gyro + rate + bias; accel -> R(angle)^T accel.
        """
        angle = self.angle_b
        accel = None if accel_b is None else _turned_back(accel_b, angle)
        return _turned_back(gyro_b, angle) + self.rate_b + self.bias_b, accel


def drawn(kind: str, times: Array, *, runs: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Rotation and settling bias of `runs` disturbances of a kind at given times.

    Parameters
    ----------
    kind : str
        One of `KINDS`, `SLOW` or `HELD_OUT`.
    times : ndarray, shape (k,)
        Times from 0 to the end of the recording, s.
    runs : int
        Number of independent disturbances.
    rng : numpy.random.Generator
        Source of every drawn number.

    Returns
    -------
    angle, bias_angle : ndarray, shape (runs, k, 3)
        Rotation vector of the body, and integral of the gyro bias up to a constant, rad.
    """
    if kind not in _KINDS:
        raise ValueError(f"disturbance is {kind!r}; one of {', '.join(_KINDS)} is expected.")
    angle, bias_angle = _KINDS[kind](Draw(runs, times, rng))
    shape = (runs, len(times), 3)
    return np.broadcast_to(angle, shape), np.broadcast_to(bias_angle, shape)


def draw_disturbance(
    kind: str, *, samples: int, rate_hz: float, rng: np.random.Generator, runs: int | None = None
) -> Disturbance:
    """A disturbance of a kind of `KINDS`, `SLOW` or `HELD_OUT`, with parameters drawn from `DISTRIBUTIONS`.

    Parameters
    ----------
    kind : str
        "quiet", "sway", "shock", "warmup", "tilt", "mixed", "soak", or held out "square", "ramp", "beat".
    samples : int
        Number of samples n.
    rate_hz : float
        Sample rate, Hz.
    rng : numpy.random.Generator
        Source of every drawn number.
    runs : int, optional
        Draw that many at once: arrays of shape (runs, n, 3). Without it (n, 3).
    """
    angle, bias_angle = drawn(kind, np.arange(samples + 1) / rate_hz, runs=runs or 1, rng=rng)
    rate, bias = np.diff(angle, axis=1) * rate_hz, np.diff(bias_angle, axis=1) * rate_hz
    return Disturbance(kind, rate_hz, rate, bias) if runs else Disturbance(kind, rate_hz, rate[0], bias[0])


@dataclass(frozen=True)
class Draw:
    """Draws of single disturbances: angles, or integrals of biases, (runs, k, 3) at the times."""

    runs: int
    times: Array  # (k,) s
    rng: np.random.Generator

    @property
    def duration(self) -> float:
        """Time from the first to the last, s."""
        return float(self.times[-1])

    def log_uniform(self, low: float, high: float) -> Array:
        """One number of each run between low and high, its logarithm uniform, (runs,)."""
        return np.exp(self.rng.uniform(np.log(low), np.log(high), self.runs))

    def sine(self, amplitude: Array, frequency: Array) -> Array:
        """Angle of a tone of rate; amplitude (runs, 3) rad/s, frequency (runs,) Hz."""
        omega = 2 * np.pi * frequency[:, None, None]
        phase = self.rng.uniform(0, 2 * np.pi, (self.runs, 1, 3))
        return -amplitude[:, None] / omega * np.cos(omega * self.times[:, None] + phase)

    def half_normal(self, sigma: float) -> Array:
        """Sizes along three axes, (runs, 3), in the unit of sigma."""
        return np.abs(self.rng.normal(0, sigma, (self.runs, 3)))

    def tones(self, present: tuple[float, ...]) -> Array:
        """Angle of sway: one tone of rate for each probability that it is there."""
        total = np.zeros((self.runs, len(self.times), 3))
        for probability in present:
            on = self.rng.random(self.runs) < probability
            tone = self.sine(self.half_normal(0.002 * DEG), self.log_uniform(0.008, 0.3))
            total += np.where(on[:, None, None], tone, 0.0)
        return total

    def bursts(self, sigma: float, length: tuple[float, float], at_least: int, *, knock: bool) -> Array:
        """Angle of pulses of rate (sigma in rad/s, lengths in s), one in 100 s or `at_least`; a knock swings back."""
        count = np.maximum(self.rng.poisson(self.duration / 100, self.runs), at_least)
        total = np.zeros((self.runs, len(self.times), 3))
        for number in range(int(count.max(initial=0))):
            long = self.rng.uniform(*length, self.runs)[:, None]
            start = self.rng.uniform(0, self.duration, self.runs)[:, None]
            vector = self.rng.normal(0, sigma, (self.runs, 3)) * (number < count)[:, None]
            inside = np.clip(self.times - start, 0, long)
            if knock:  # integral of one period of a sine
                inside = long / (2 * np.pi) * (1 - np.cos(2 * np.pi * inside / long))
            total += inside[:, :, None] * vector[:, None]
        return total

    def bumps(self, at_least: int) -> Array:
        """Angle of bumps of 0.3 to 2 s, after which the unit stands turned."""
        return self.bursts(0.02 * DEG, (0.3, 2.0), at_least, knock=False)

    def knocks(self, at_least: int) -> Array:
        """Angle of knocks of 0.1 to 0.5 s, after which the unit stands as before."""
        return self.bursts(0.1 * DEG, (0.1, 0.5), at_least, knock=True)

    def warm_up(self) -> Array:
        """Integral of a bias that settles within 15 to 120 s."""
        amplitude = self.rng.normal(0, 2 * DEG_PER_HOUR, (self.runs, 1, 3))
        return self._settling(amplitude, self.rng.uniform(15, 120, self.runs))

    def soak(self) -> Array:
        """Integral of a bias that settles within 2 to 20 minutes."""
        amplitude = self.rng.normal(0, 2 * DEG_PER_HOUR, (self.runs, 1, 3))
        return self._settling(amplitude, self.log_uniform(120, 1200))

    def _settling(self, amplitude: Array, tau: Array) -> Array:
        tau = tau[:, None, None]
        return -amplitude * tau * np.exp(-self.times[:, None] / tau)

    def slow_tilt(self) -> Array:
        """Angle of a tripod that sinks to one side, about the level axes."""
        amplitude = self.rng.normal(0, 0.01 * DEG, (self.runs, 1, 3)) * [1, 1, 0]
        tau = self.rng.uniform(30, 300, self.runs)[:, None, None]
        return amplitude * (1 - np.exp(-self.times[:, None] / tau))

    def square(self) -> Array:
        """Angle of a square wave of rate with a period of 5 to 60 s."""
        amplitude = self.half_normal(0.002 * DEG)[:, None]
        period = self.log_uniform(5, 60)[:, None, None]
        cycles = (self.times[:, None] / period + self.rng.uniform(0, 1, (self.runs, 1, 3))) % 1
        return amplitude * period * np.minimum(cycles, 1 - cycles)  # the integral is a triangle

    def ramp(self) -> Array:
        """Integral of a bias that grows steadily."""
        return self.rng.normal(0, 4 * DEG_PER_HOUR / 100, (self.runs, 1, 3)) * self.times[:, None] ** 2 / 2

    def beat(self) -> Array:
        """Angle of two tones of rate that are close to each other."""
        amplitude, first = self.half_normal(0.002 * DEG), self.log_uniform(0.008, 0.3)
        second = first + self.rng.uniform(0.002, 0.01, self.runs)
        return self.sine(amplitude, first) + self.sine(amplitude, second)


#: kind -> (angle, integral of the settling bias)
_KINDS: dict[str, Callable[[Draw], tuple[Array | float, Array | float]]] = {
    "quiet": lambda _: (0.0, 0.0),
    "sway": lambda draw: (draw.tones((1.0, 0.7)), 0.0),
    "shock": lambda draw: (draw.bumps(1) + draw.knocks(1), 0.0),
    "warmup": lambda draw: (0.0, draw.warm_up()),
    "tilt": lambda draw: (draw.slow_tilt(), 0.0),
    "mixed": lambda draw: (draw.tones((0.7, 0.7)) + draw.bumps(0), draw.warm_up()),
    "soak": lambda draw: (0.0, draw.soak()),
    "square": lambda draw: (draw.square(), 0.0),
    "ramp": lambda draw: (0.0, draw.ramp()),
    "beat": lambda draw: (draw.beat(), 0.0),
}


def _turned_back(vector: Array, angle: Array) -> Array:
    """R(angle)^T vector: what the body, turned by a rotation vector, sees (Rodrigues)."""
    size = np.linalg.norm(angle, axis=-1, keepdims=True)
    cross = np.cross(angle, vector)
    sine = np.sinc(size / np.pi)
    versine = np.sinc(size / (2 * np.pi)) ** 2 / 2
    return vector - sine * cross + versine * np.cross(angle, cross)


@dataclass(frozen=True)
class ReferenceSet:
    """Simulated recordings of a level, gyro-only unit at 32.11 N that define a benchmark."""

    gyro_b: Array  # (runs, n, 3) rad/s
    heading: Array  # (runs,) rad, true
    rate_hz: float
    latitude: float  # rad
    sha256: str  # of the rates in units of 1e-12 rad/s and of the headings in units of 1e-9 rad


def reference_set(
    kind: str = "mixed",
    *,
    runs: int = 2000,
    duration: float = 100.0,
    rate_hz: float = 3.0,
    bias: float = 0.1 * DEG_PER_HOUR,
    white: float = 0.02 * DEG_PER_SQRT_HOUR,
    seed: int = 20240611,
) -> ReferenceSet:
    """The test recordings of `benchmark disturbed`: by default the 2000 of the reference mix.

    Headings are uniform on the circle, the residual bias is normal with `bias` rad/s per
    axis, the noise white with `white` rad/sqrt(s). The heading of a disturbed recording is
    the mean over it. The same arguments give the same recordings, which `sha256` proves.
    """
    rng = np.random.default_rng(seed)
    latitude, samples = 32.11 * DEG, round(duration * rate_hz)
    start = rng.uniform(0, 2 * np.pi, runs)
    disturbance = draw_disturbance(kind, samples=samples, rate_hz=rate_hz, rng=rng, runs=runs)
    level = np.zeros(runs)
    ideal = mat_bn(level, level, start) @ earth_rate_n(latitude)
    gyro, _ = disturbance.apply(np.broadcast_to(ideal[:, None], (runs, samples, 3)), None)
    gyro = gyro + rng.normal(0, bias, (runs, 1, 3)) + rng.normal(0, white * np.sqrt(rate_hz), (runs, samples, 3))
    heading = (start + disturbance.angle_b[..., 2].mean(axis=1)) % (2 * np.pi)
    digest = hashlib.sha256(np.round(gyro * 1e12).astype("<i8").tobytes())
    digest.update(np.round(heading * 1e9).astype("<i8").tobytes())
    return ReferenceSet(gyro, heading, rate_hz, latitude, digest.hexdigest())
