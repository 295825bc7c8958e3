"""Headings of disturbed recordings by every method that `benchmark disturbed` compares."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gyronorth.alignment.inertial import align_inertial
from gyronorth.alignment.networks.bundle import shipped_bundle
from gyronorth.alignment.tones.evidence import grid_frequencies
from gyronorth.alignment.tones.search import TIME_CONSTANT_BINS, bayes
from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR, angle_error, wrap
from gyronorth.attitude import heading_of_rate
from gyronorth.earth import EARTH_RATE, normal_gravity
from gyronorth.sensor import TriadErrors, read_sensor
from gyronorth.simulation.disturbance import ReferenceSet, draw_disturbance, reference_set
from gyronorth.studies.methods import rounded
from gyronorth.uncertainty import von_mises

if TYPE_CHECKING:
    from gyronorth.alignment.networks.runtime import LoadedBundle

Array = NDArray[np.float64]

WHITE = 0.02 * DEG_PER_SQRT_HOUR
#: Huber's threshold in standard deviations: 95 % efficient for normal noise ("Robust Statistics", 1981, sec. 4.5).
HUBER, HUBER_ROUNDS = 1.345, 30
#: Tones and exponentials that harmonic least squares takes at most.
HARMONICS = 4


@dataclass(frozen=True)
class Part:
    """Recordings of a reference set with the accelerometer that goes with them."""

    made: ReferenceSet
    rows: slice
    kind: str
    bias: float  # rad/s
    seed: int
    white: float = WHITE

    @property
    def gyro(self) -> Array:
        """Angular rate (runs, n, 3), rad/s."""
        return self.made.gyro_b[self.rows]

    @property
    def errors(self) -> TriadErrors:
        """What is known of the gyro."""
        return TriadErrors(white=self.white, turn_on_bias=self.bias)

    def accel(self) -> Array:
        """Specific force (runs, n, 3), m/s^2, of the same motion, with the noise and bias of an SDC500."""
        runs, samples, _ = self.made.gyro_b.shape
        rng = np.random.default_rng(self.seed)
        rng.uniform(0, 2 * np.pi, runs)  # the headings, as `reference_set` draws them
        moved = draw_disturbance(self.kind, samples=samples, rate_hz=self.made.rate_hz, rng=rng, runs=runs)
        level = np.broadcast_to([0.0, 0.0, -float(normal_gravity(self.made.latitude))], (runs, samples, 3))
        accel = moved.apply(np.zeros((runs, samples, 3)), level)[1]
        assert accel is not None
        terms, rng = read_sensor("sdc500").accel, np.random.default_rng([self.seed, 1])
        accel = accel + rng.normal(0, terms.turn_on_bias, (runs, 1, 3))
        accel = accel + rng.normal(0, terms.white * np.sqrt(self.made.rate_hz), accel.shape)
        return accel[self.rows]


@dataclass(frozen=True)
class MethodHeadings:
    """Headings, rad, and the ends of their 95 % intervals, rad from them, where the method states any."""

    heading: Array
    low: Array | None = None
    high: Array | None = None


def judged(part: Part, methods: Mapping[str, Callable[[Part], MethodHeadings]]) -> dict[str, dict]:
    """Errors, deg, of some methods, and whether their intervals hold, by name."""
    errors, inside = {}, {}
    for name, method in methods.items():
        found = method(part)
        off = angle_error(part.made.heading[part.rows], found.heading)
        errors[name] = rounded(off)
        if found.low is not None and found.high is not None:
            inside[name] = ((off >= found.low) & (off <= found.high)).tolist()
    return {"error_deg": errors, "inside": inside}


def part_of(*, kind: str, duration: float, bias_deg_h: float, runs: int, rows: tuple[int, int], seed: int) -> Part:
    """Recordings `rows` of the reference set of a kind."""
    bias = bias_deg_h * DEG_PER_HOUR
    made = reference_set(kind, runs=runs, duration=duration, bias=bias, white=WHITE, seed=seed)
    return Part(made, slice(*rows), kind, bias, seed)


def by_mean(part: Part) -> MethodHeadings:
    """Plain averaging; its interval allows for noise and residual bias, not for disturbance."""
    rate = part.gyro.mean(axis=1)
    variance = part.white**2 * part.made.rate_hz / part.gyro.shape[1] + part.bias**2
    _, half = von_mises(np.hypot(rate[:, 0], rate[:, 1]) * EARTH_RATE * np.cos(part.made.latitude) / variance)
    return MethodHeadings(heading_of_rate(rate), -half, half)


def by_median(part: Part) -> MethodHeadings:
    """Median of each axis."""
    return MethodHeadings(heading_of_rate(np.median(part.gyro, axis=1)))


def by_huber(part: Part) -> MethodHeadings:
    """Huber's M-estimate of location of each axis, scale by the median absolute deviation."""
    x = part.gyro
    at = np.median(x, axis=1, keepdims=True)
    scale = 1.4826 * np.median(np.abs(x - at), axis=1, keepdims=True)
    for _ in range(HUBER_ROUNDS):
        weight = np.minimum(1.0, HUBER * scale / np.maximum(np.abs(x - at), 1e-300))
        at = np.sum(weight * x, axis=1, keepdims=True) / np.sum(weight, axis=1, keepdims=True)
    return MethodHeadings(heading_of_rate(at[:, 0]))


def by_harmonics(part: Part) -> MethodHeadings:
    """Least squares: a constant, then the tone or exponential that explains most, as long as the BIC falls.

    Outliers are left out first; there are no priors, and no average over models.
    """
    n, rate_hz = part.gyro.shape[1], part.made.rate_hz
    time, bins = (np.arange(n) + 0.5) / rate_hz, np.array(TIME_CONSTANT_BINS)
    phase = 2 * np.pi * time[:, None] * grid_frequencies(n, rate_hz)
    tones = np.stack([np.cos(phase), np.sin(phase)], axis=2)  # (n, f, 2)
    decays = np.exp(-time[:, None] / ((bins[1:] + bins[:-1]) / 2))[:, :, None]
    rate = [_harmonic_constant(x, [decays, tones]) for x in part.gyro]
    return MethodHeadings(heading_of_rate(np.array(rate)))


def _harmonic_constant(x: Array, candidates: list[Array]) -> Array:
    """Constant (3,) of x (n, 3) by greedy least squares over the candidates (n, f, c)."""
    free = ~_outlying(x)
    x, candidates = x[free], [c[free] for c in candidates]
    design, number = np.ones((len(x), 1)), x.size
    cost = _left(design, x)
    for _ in range(HARMONICS):
        tried = []
        for kind in candidates:
            best = kind[:, int(np.argmax(_explained(design, kind, x)))]
            wider = np.concatenate([design, best], axis=1)
            parameters = 3 * best.shape[1] + 1  # amplitudes, and the frequency or time constant
            tried.append((number * np.log(_left(wider, x) / cost) + parameters * np.log(number), wider))
        change, wider = min(tried, key=lambda one: one[0])
        if change >= 0:
            break
        design, cost = wider, _left(wider, x)
    return np.linalg.lstsq(design, x, rcond=None)[0][0]


def _left(design: Array, x: Array) -> float:
    basis = np.linalg.qr(design)[0]
    return float(np.sum((x - basis @ (basis.T @ x)) ** 2))


def _outlying(x: Array) -> NDArray[np.bool_]:
    """Samples whose distance from the median is beyond six times the usual one."""
    size = np.linalg.norm(x - np.median(x, axis=0), axis=1)
    return size > 6 * np.median(size)


def _explained(design: Array, candidates: Array, x: Array) -> Array:
    """Sum of squares that each candidate (n, f, c) explains of what the design leaves of x (n, 3)."""
    basis = np.linalg.qr(design)[0]
    flat = candidates.reshape(len(x), -1)
    flat = (flat - basis @ (basis.T @ flat)).reshape(candidates.shape)
    left = x - basis @ (basis.T @ x)
    gram = np.einsum("nfa,nfb->fab", flat, flat) + 1e-9 * len(x) * np.eye(candidates.shape[2])
    cross = np.einsum("nfa,nx->fax", flat, left)
    return np.sum(cross * np.linalg.solve(gram, cross), axis=(1, 2))


def by_bayes(part: Part) -> MethodHeadings:
    """Averaging over all models of a fine grid."""
    known = {"rate_hz": part.made.rate_hz, "latitude": part.made.latitude, "errors": part.errors}
    fits = [bayes(x, **known) for x in part.gyro]
    heading = np.array([fit.heading for fit in fits])
    whole = np.array([fit.interval95 == (0.0, 2 * np.pi) for fit in fits])
    low, high = (wrap(np.array([fit.interval95[side] for fit in fits]) - heading) for side in (0, 1))
    return MethodHeadings(heading, np.where(whole, -np.pi, low), np.where(whole, np.pi, high))


def by_inertial(part: Part) -> MethodHeadings:
    """Gravity followed in an inertial frame, with an accelerometer that no other method here has."""
    return MethodHeadings(
        align_inertial(part.gyro, part.accel(), rate_hz=part.made.rate_hz, latitude=part.made.latitude).heading
    )


def by_paper(part: Part) -> MethodHeadings:
    """The paper's pipeline as it ships: trained on recordings that stand still."""
    from gyronorth.alignment.networks.runtime import run

    return MethodHeadings(run(_bundle("paper"), part.gyro))


def by_learned(part: Part) -> MethodHeadings:
    """The `learned` bundle."""
    from gyronorth.alignment.networks.runtime import solve

    known = {"rate_hz": part.made.rate_hz, "latitude": part.made.latitude, "errors": part.errors}
    found = solve(_bundle("learned"), part.gyro, **known)
    return MethodHeadings(found.heading, found.low, found.high)


def by_periodogram(part: Part) -> MethodHeadings:
    """`learned` with a periodogram in place of its network: what the network is worth."""
    from gyronorth.alignment.tones.proposals import amortised

    known = {"rate_hz": part.made.rate_hz, "latitude": part.made.latitude, "errors": part.errors}
    fits = [amortised(x, periodogram, **known) for x in part.gyro]
    heading, low, high = (np.array([getattr(fit, name) for fit in fits]) for name in ("heading", "low", "high"))
    return MethodHeadings(heading, low, high)


def periodogram(rate: NDArray[np.float32], index: NDArray[np.float32], cycles: NDArray[np.float32]) -> tuple:
    """Proposals without a network: outliers are bumps, tones are where the spectrum, plain and tapered, is high."""
    x = rate.astype(float)
    bumped = _outlying(x)
    x = np.where(bumped[:, None], 0.0, x - x[~bumped].mean(axis=0))
    phase = 2 * np.pi * index.astype(float)[:, None] * cycles
    wave = np.concatenate([np.cos(phase), np.sin(phase)], axis=1)
    height = np.zeros(len(cycles))
    for taper in (np.ones(len(x)), 1 + np.cos(2 * np.pi * index / len(x))):
        power = np.sum(((taper[:, None] * x).T @ wave) ** 2, axis=0).reshape(2, -1).sum(axis=0)
        height += np.log1p(power * 2 / len(x))
    return np.where(bumped, 1.0, -1.0), height


@cache
def _bundle(method: str) -> LoadedBundle:
    from gyronorth.alignment.networks.runtime import load_bundle

    return load_bundle(shipped_bundle(method))


#: Row of the table -> how its headings are found.
METHODS: dict[str, Callable[[Part], MethodHeadings]] = {
    "mean": by_mean,
    "median": by_median,
    "Huber": by_huber,
    "harmonic least squares": by_harmonics,
    "inertial (with accelerometer)": by_inertial,
    "paper's pipeline, as shipped": by_paper,
    "bayes": by_bayes,
    "learned, periodogram for network": by_periodogram,
    "learned": by_learned,
}
