"""The posterior of the heading: every hypothesis weighed by what gyro and accelerometer show, headings averaged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gyronorth.alignment.posterior.blocks import Blocks, blocks_of
from gyronorth.alignment.posterior.density import Density, log_i0e, mixture
from gyronorth.alignment.posterior.explain import FAR, Weighed, explaining, measured_white, seen_trace
from gyronorth.alignment.posterior.law import DRIFT_PRIOR, DRIFTS, unit_bias
from gyronorth.alignment.posterior.tones import periodograms
from gyronorth.alignment.tones.side_by_side import TOGETHER, ProposeMany, Search, searched
from gyronorth.angles import DEG_PER_HOUR
from gyronorth.arrays import Array, Index
from gyronorth.attitude import heading_of_rate
from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY
from gyronorth.sensor import Sensor, TriadErrors
from gyronorth.sensor.law import NoiseLaw

#: Turn-on bias over the profile's, and its prior where the in-run drift is as the profile says.
BIASES = np.array([0.1, 0.3, 1.0, 1.5, 2.2, 3.3, 5.0, 8.0, 12.0, 20.0])
BIAS_PRIOR = np.array([0.01, 0.02, 0.864, 0.034, 0.027, 0.019, 0.013, 0.008, 0.003, 0.002])
#: Without a profile: turn-on biases, rad/s, log-uniform up to a knee and falling as the inverse square beyond;
#: and the prior of the in-run drift over that which equals the white noise at `CORNER`, s.
UNKNOWN_BIASES = DEG_PER_HOUR * np.geomspace(0.003, 1000.0, 23)
UNKNOWN_KNEE, UNKNOWN_DRIFT, CORNER = 7 * DEG_PER_HOUR, (0.3, 0.2, 0.2, 0.2, 0.1), 100.0
#: An accelerometer without a profile: least white noise, (m/s^2) sqrt(s), and turn-on bias, m/s^2.
UNKNOWN_FORCE = (3e-6 * STANDARD_GRAVITY, 1e-3 * STANDARD_GRAVITY)
#: Bias over the profile's beyond which a mixture explains away a fault rather than a unit.
BEYOND = 9.0
#: Variance of the mean of what an accelerometer drifts over that at the end: of a line 1/4, of an early settling 3/4.
FORCE_MEAN = 0.5
#: Error of the vertical rate by yaw motion, rad/s, from which the vertical implies no latitude at all.
HIDDEN = 0.2 * EARTH_RATE
#: Hypotheses weighed first, to know how likely one has to be.
FEW = 100


@dataclass(frozen=True)
class Inferred:
    """Posterior of the heading of one recording and what was inferred beside it."""

    density: Density
    rate_l: Array  # (3,) expected constant rate, rad/s
    scale: float  # of what is constant in the bias over the profile's turn-on bias, posterior mean of the logarithm
    drift_scale: float
    white_scale: float
    probability: dict[str, float]  # of sway, tilt, settling, walk, force
    variance: dict[str, float]  # of a horizontal rate by part, (rad/s)^2
    rate_variance: float  # of a horizontal component of `rate_l`, (rad/s)^2, and of the vertical one
    vertical_variance: float
    tones: float  # expected number
    masked_s: float  # expected time in bumps, s
    beyond: float  # probability of a bias, constant or settling, of more than `BEYOND` times the profile's
    mean_l: Array  # (3,) plain mean of the rate in the level frame at the end, rad/s
    roll: float
    pitch: float
    sees_tilt: bool  # whether there is an accelerometer that shows a slow tilt


def posterior(
    gyro_b: Array,
    accel_b: Array | None,
    *,
    rate_hz: float,
    latitude: float,
    sensor: Sensor | None,
    attitude: tuple[float, float] | None = None,
    propose: ProposeMany | None = None,
) -> list[Inferred]:
    """Posterior of each of the recordings (r, n, 3), side by side.

    `propose` says where tones and bumps may be, a periodogram without it.
    """
    found: list[Inferred] = []
    for start in range(0, len(gyro_b), TOGETHER):
        some = slice(start, start + TOGETHER)
        accel = None if accel_b is None else accel_b[some]
        blocks = blocks_of(gyro_b[some], accel, rate_hz=rate_hz, attitude=attitude)
        searches = [
            _inferring(blocks, index, latitude, sensor, known_attitude=attitude is not None)
            for index in range(len(blocks.rate_l))
        ]
        found += searched(searches, propose or periodograms)
    return found


@dataclass(frozen=True)
class Scales:
    """What is known of the turn-on bias beforehand."""

    sensor: Sensor  # the profile, or one that stands for it
    known: bool
    biases: Array  # (k,) rad/s
    log_prior: Array  # (drifts, k)


def scales_of(sensor: Sensor | None, white: float) -> Scales:
    """The prior of bias and drift: about the profile, or of every size without one."""
    if sensor is not None:
        return Scales(sensor, True, BIASES * unit_bias(sensor), _bias_prior() + np.log(DRIFT_PRIOR)[:, None])
    white = 2 ** (round(4 * np.log2(white)) / 4)
    noise, bias = UNKNOWN_FORCE
    gyro = TriadErrors(white=white, flicker=white / np.sqrt(CORNER))
    force = TriadErrors(white=noise, flicker=noise / np.sqrt(30.0), turn_on_bias=bias)
    prior = 1 / (1 + (UNKNOWN_BIASES / UNKNOWN_KNEE) ** 2)
    table = np.log(prior / prior.sum()) + np.log(UNKNOWN_DRIFT)[:, None]
    return Scales(Sensor("unknown", gyro, force), False, UNKNOWN_BIASES, table)


@dataclass(frozen=True)
class Hypotheses:
    """Some hypotheses of one recording, each with all scales of the bias."""

    base: Index  # (h,) number among those of all `Weighed`, one after the other
    shape: Index  # (h,)
    log_weight: Array  # (h, k)
    concentration: Array  # (h, k)
    rate: Array  # (2, h)
    info: Array  # (h,)


def _inferring(
    blocks: Blocks, index: int, latitude: float, sensor: Sensor | None, *, known_attitude: bool
) -> Search[Inferred]:
    scales = scales_of(sensor, measured_white(blocks, index))
    found = yield from explaining(blocks, index, scales.sensor, known=scales.known)
    return _conclude(found, blocks, index, latitude, scales, known_attitude=known_attitude)


def _bias_prior() -> Array:
    """Log prior of the turn-on bias's scale given the drift's, (drifts, biases)."""
    table = np.empty((len(DRIFTS), len(BIASES)))
    for row, drift in enumerate(DRIFTS):
        near = np.exp(-0.5 * (np.log(BIASES / drift) / 0.6) ** 2)
        share = 0.0 if drift == 1 else 0.5
        table[row] = (1 - share) * BIAS_PRIOR + share * near / near.sum()
    return np.log(table)


def _conclude(
    found: list[Weighed], blocks: Blocks, index: int, latitude: float, scales: Scales, *, known_attitude: bool
) -> Inferred:
    sensor = scales.sensor
    north, down = EARTH_RATE * np.cos(latitude), -EARTH_RATE * np.sin(latitude)
    constant = (sensor.g_sensitivity * STANDARD_GRAVITY) ** 2 + (
        sensor.gyro.scale_factor**2 + sensor.gyro.misalignment**2
    ) * EARTH_RATE**2
    lean = (
        0.0
        if blocks.trace is None or known_attitude
        else (sensor.accel.turn_on_bias**2 + sensor.accel.flicker**2) / STANDARD_GRAVITY**2
        + sensor.accel.misalignment**2
    )
    tilted = (EARTH_RATE * np.sin(latitude)) ** 2 + (north * np.tan(blocks.pitch[index])) ** 2
    bias, prior = scales.biases**2, scales.log_prior
    beside = bias + constant
    # The vertical, summed over its yaw: (drifts of each, shapes, biases).
    upright = np.concatenate([_vertical(one, down, beside, prior) for one in found])
    # The bases of all, one after the other.
    owner = np.repeat(np.arange(len(found)), [len(one.law.drift) for one in found])
    drift, sway, creep, force = (
        np.concatenate([getattr(one.law, name) for one in found]) for name in ("drift", "sway", "creep", "force")
    )
    level = np.zeros(len(force)) if known_attitude else (lean + FORCE_MEAN * force**2) * tilted
    log_h = np.concatenate([one.log_h + one.log_prior for one in found])
    info_h = np.concatenate([one.info_h for one in found])
    rate_h = np.concatenate([one.rate_h for one in found], axis=1)
    drift_of_one = owner * len(DRIFTS) + drift
    bound = upright.max(axis=2)[drift_of_one] + log_h
    bound -= np.log(1 / info_h + beside.min() + level[:, None])

    def weighed(some: Index) -> Hypotheses:
        b, s = np.divmod(some, info_h.shape[1])
        rate, info = rate_h[:, b, s], info_h[b, s]
        size = np.hypot(rate[0], rate[1])[:, None]
        var = (1 / info + level[b])[:, None] + beside  # (h, k)
        c = size * north / var
        log_w = upright[drift_of_one[b], s] + log_h[b, s, None]
        log_w += log_i0e(c)
        log_w -= (size - north) ** 2 / 2 / var
        log_w -= np.log(var, out=var)
        return Hypotheses(b, s, log_w, c, rate, info)

    few = np.argpartition(-bound.ravel(), min(FEW, bound.size - 1))[:FEW]
    ceiling = float(weighed(few).log_weight.max())
    every = weighed(np.flatnonzero(bound > ceiling - FAR))
    ceiling = float(every.log_weight.max())
    h, k = np.unravel_index(np.argmax(every.log_weight), every.log_weight.shape)
    best, which = int(every.base[h]), int(every.shape[h])
    rate_z, variance_z = _upright(found[int(owner[best])], int(drift[best]), which, float(beside[k]), down)
    if np.sqrt(variance_z) > HIDDEN:
        variance_z = EARTH_RATE**2
    near, b, s = every.log_weight > ceiling - FAR, every.base, every.shape
    w = np.where(near, np.exp(every.log_weight - ceiling), 0.0)
    w /= w.sum()
    # Expectations of what depends on hypothesis and scale of the bias, then of what depends on the hypothesis alone.
    each, scaled, shapes, unit = w.sum(axis=1), w.sum(axis=0), [one.law.shapes for one in found], unit_bias(sensor)
    lasting = np.log(np.hypot(scales.biases, np.stack([one.lasting for one in shapes])[:, :, None]) / unit)
    faulty = np.stack([one.law.shapes.settles & (one.law.shapes.size > 1.3 * BEYOND * one.law.bias) for one in found])
    faulty, large = faulty[owner[b], s], scales.biases > BEYOND * unit
    by_base, by_shape = np.bincount(b, each, minlength=len(drift)), np.bincount(s, each, minlength=info_h.shape[1])
    by_one = np.bincount(owner, by_base)
    x, y = map(float, every.rate @ each)
    spread = max((float(np.sum(every.rate**2 @ each)) - x**2 - y**2) / 2, 0.0)
    constant_variance, noise_variance = float(scaled @ bias) + constant, float(each @ (1 / every.info))
    levelling = float(by_base @ level)
    bias_scale = float(np.exp(np.sum(w * lasting[owner[b], s])))
    drift_scale = float(np.exp(by_base @ np.log(np.array(DRIFTS))[drift]))
    white_scale = float(np.exp(by_one @ np.log([one.white for one in found])))
    centre = np.repeat(heading_of_rate(every.rate.T), np.count_nonzero(near, axis=1))
    density = mixture(centre, every.concentration[near], w[near])
    claimed = NoiseLaw(sensor.gyro).mean_variance(blocks.duration)
    return Inferred(
        density=density,
        rate_l=np.array([x, y, rate_z]),
        scale=bias_scale,
        drift_scale=drift_scale,
        white_scale=white_scale,
        probability={
            "sway": float(by_base @ (sway > 0)),
            "tilt": float(each @ (creep[b] | shapes[0].of("tilt")[s])),
            **{kind: float(by_shape @ shapes[0].of(kind)) for kind in ("settling", "walk")},
            "force": float(by_base @ (force > 0)),
        },
        variance={
            "noise": float(claimed["noise"]) * white_scale**2,
            "drift": float(claimed["drift"]) * drift_scale**2,
            "turn_on_bias": constant_variance,
            "levelling": levelling,
        },
        rate_variance=constant_variance + noise_variance + spread + levelling,
        vertical_variance=constant_variance + variance_z,
        tones=float(by_one @ np.array([one.tones for one in found])),
        masked_s=float(by_one @ np.array([one.masked_s for one in found])),
        beyond=float(each @ faulty + (scaled - w[faulty].sum(axis=0)) @ large) if scales.known else 0.0,
        mean_l=blocks.rate_l[index].mean(axis=0),
        roll=float(blocks.roll[index]),
        pitch=float(blocks.pitch[index]),
        sees_tilt=seen_trace(blocks, index, sensor) is not None,
    )


def _vertical(one: Weighed, down: float, beside: Array, prior: Array) -> Array:
    """Log weight of the vertical of one `Weighed`, summed over its yaw: (drifts, shapes, biases)."""
    variance = 1 / one.info_v[:, :, None] + beside
    each = (one.rate_v[:, :, None] - down) ** 2 / variance
    each += np.log(variance, out=variance)
    each *= -0.5
    each += one.log_v[:, :, None]
    top = each.max(axis=0)
    each -= top
    total = np.add.reduceat(np.exp(each, out=each), np.searchsorted(one.law.yaw_drift, np.arange(len(DRIFTS))), axis=0)
    total = np.log(np.maximum(total, np.finfo(float).tiny, out=total), out=total)
    total += top + one.law.shapes.log_prior[:, None]
    total += prior[:, None, :]
    return total


def _upright(one: Weighed, drift: int, shape: int, beside: float, down: float) -> tuple[float, float]:
    """Vertical rate, rad/s, and its variance without the bias, under one hypothesis."""
    yaw = np.flatnonzero(one.law.yaw_drift == drift)
    rate, variance = one.rate_v[yaw, shape], 1 / one.info_v[yaw, shape]
    log_weight = one.log_v[yaw, shape] - 0.5 * ((rate - down) ** 2 / (variance + beside) + np.log(variance + beside))
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    mean = float(weight @ rate)
    return mean, float(weight @ (variance + (rate - mean) ** 2))
