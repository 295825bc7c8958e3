"""The posterior of the heading: every hypothesis weighed by what gyro and accelerometer show, headings averaged."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gyronorth.alignment.posterior.blocks import Blocks, blocks_of
from gyronorth.alignment.posterior.density import Density, log_i0e, mixture
from gyronorth.alignment.posterior.explain import FAR, Proposer, Weighed, explanations, measured_white
from gyronorth.alignment.posterior.law import DRIFT_PRIOR, DRIFTS, unit_bias
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


def posterior(
    gyro_b: Array,
    accel_b: Array | None,
    *,
    rate_hz: float,
    latitude: float,
    sensor: Sensor | None,
    attitude: tuple[float, float] | None = None,
    propose: Proposer | None = None,
) -> list[Inferred]:
    """Posterior of each of the recordings (r, n, 3)."""
    blocks = blocks_of(gyro_b, accel_b, rate_hz=rate_hz, attitude=attitude)
    return [
        _one(blocks, index, latitude, sensor, propose, known_attitude=attitude is not None)
        for index in range(len(gyro_b))
    ]


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
class Piece:
    """Some hypotheses of one `Weighed`, each with all scales of the bias."""

    number: int
    base: Index  # (h,)
    shape: Index  # (h,)
    log_weight: Array  # (h, k)
    concentration: Array  # (h, k)
    rate: Array  # (2, h)
    info: Array  # (h,)


def _one(
    blocks: Blocks,
    index: int,
    latitude: float,
    sensor: Sensor | None,
    propose: Proposer | None,
    *,
    known_attitude: bool,
) -> Inferred:
    scales = scales_of(sensor, measured_white(blocks, index))
    found = explanations(blocks, index, scales.sensor, known=scales.known, propose=propose)
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
    levels = [(lean + FORCE_MEAN * one.law.force**2) * (0.0 if known_attitude else tilted) for one in found]
    bias, prior = scales.biases**2, scales.log_prior
    uprights: list[Array] = []
    bounds: list[Array] = []
    yaws: list[Array] = []
    for one, level in zip(found, levels, strict=True):
        # The vertical, summed over its yaw: (drifts, shapes, biases).
        known, variance = one.law, 1 / one.info_v[:, :, None] + bias + constant
        each = (one.rate_v[:, :, None] - down) ** 2 / variance
        each += np.log(variance, out=variance)
        each *= -0.5
        each += one.log_v[:, :, None]
        top = each.max(axis=0, keepdims=True)
        each -= top
        yaws.append(np.exp(each, out=each))
        upright = np.add.reduceat(each, np.searchsorted(known.yaw_drift, np.arange(len(DRIFTS))), axis=0)
        upright = (
            np.log(np.maximum(upright, np.finfo(float).tiny))
            + top
            + prior[:, None, :]
            + known.shapes.log_prior[:, None]
        )
        uprights.append(upright)
        least = 1 / one.info_h + bias.min() + constant + level[:, None]
        bounds.append(upright.max(axis=2)[known.drift] + one.log_h - np.log(least) + one.log_prior)
    flat = np.concatenate([bound.ravel() for bound in bounds])
    first = np.cumsum([0, *(bound.size for bound in bounds)])

    def weighed(some: Index) -> Iterator[Piece]:
        for number, one in enumerate(found):
            here = some[(some >= first[number]) & (some < first[number + 1])] - first[number]
            b, s = np.divmod(here, one.info_h.shape[1])
            rate, info = one.rate_h[:, b, s], one.info_h[b, s]
            size = np.hypot(rate[0], rate[1])[:, None]
            var = 1 / info[:, None] + bias + constant + levels[number][b, None]  # (h, k)
            c = size * north / var
            log_w = one.log_h[b, s, None] + uprights[number][one.law.drift[b], s] + one.log_prior
            log_w += log_i0e(c)
            log_w -= (size - north) ** 2 / 2 / var
            log_w -= np.log(var, out=var)
            yield Piece(number, b, s, log_w, c, rate, info)

    few = np.argpartition(-flat, min(FEW, len(flat) - 1))[:FEW]
    ceiling = max(float(piece.log_weight.max(initial=-np.inf)) for piece in weighed(few))
    pieces = list(weighed(np.flatnonzero(flat > ceiling - FAR)))
    ceiling = max(float(piece.log_weight.max(initial=-np.inf)) for piece in pieces)
    rate_z, variance_z = _upright(pieces, found, yaws)
    if np.sqrt(variance_z) > HIDDEN:
        variance_z = EARTH_RATE**2
    weight: list[Array] = []
    centre: list[Array] = []
    kappa: list[Array] = []
    told: Array = np.zeros(18)
    large = scales.biases > BEYOND * unit_bias(sensor)
    for piece in pieces:
        one = found[piece.number]
        known, b, s, rate, near = one.law, piece.base, piece.shape, piece.rate, piece.log_weight > ceiling - FAR
        w = np.where(near, np.exp(piece.log_weight - ceiling), 0.0)
        weight.append(w[near])
        centre.append(np.repeat(heading_of_rate(rate.T), np.count_nonzero(near, axis=1)))
        kappa.append(piece.concentration[near])
        # Sums of what depends on hypothesis and scale of the bias, then of what depends on the hypothesis alone.
        each, scaled, shapes = w.sum(axis=1), w.sum(axis=0), known.shapes
        lasting = np.log(np.hypot(scales.biases, shapes.lasting[:, None]) / unit_bias(sensor))
        faulty = (shapes.settles & (shapes.size > 1.3 * BEYOND * known.bias))[s]
        by_base = np.bincount(b, each, minlength=len(known.drift))
        by_shape = np.bincount(s, each, minlength=len(shapes.size))
        total = float(each.sum())
        beyond = each @ faulty + (scaled - w[faulty].sum(axis=0)) @ large
        own: list[float] = [
            float(np.sum(w * lasting[s])),
            float(by_base @ np.log(np.array(DRIFTS))[known.drift]),
            total * float(np.log(one.white)),
            float(by_base @ (known.sway > 0)),
            float(each @ (known.creep[b] | shapes.of("tilt")[s])),
            *(float(by_shape @ shapes.of(kind)) for kind in ("settling", "walk")),
            float(by_base @ (known.force > 0)),
            *map(float, rate @ each),
            float(scaled @ bias) + total * constant,
            float(each @ (1 / piece.info)),
            *map(float, rate**2 @ each),
            float(by_base @ levels[piece.number]),
            total * one.tones,
            total * one.masked_s,
            float(beyond),
        ]
        told = told + np.array(own)
    w = np.concatenate(weight)
    told /= w.sum()
    w /= w.sum()
    density = mixture(np.concatenate(centre), np.concatenate(kappa), w)
    x, y, constant_variance, noise_variance, x_square, y_square, levelling = map(float, told[8:15])
    spread = max((x_square + y_square - x**2 - y**2) / 2, 0.0)
    claimed = NoiseLaw(sensor.gyro).mean_variance(blocks.duration)
    noise = float(claimed["noise"] * np.exp(2 * told[2]))
    drift = float(claimed["drift"] * np.exp(2 * told[1]))
    return Inferred(
        density=density,
        rate_l=np.array([x, y, rate_z]),
        scale=float(np.exp(told[0])),
        drift_scale=float(np.exp(told[1])),
        white_scale=float(np.exp(told[2])),
        probability=dict(zip(("sway", "tilt", "settling", "walk", "force"), map(float, told[3:8]), strict=True)),
        variance={
            "noise": noise,
            "drift": drift,
            "turn_on_bias": constant_variance,
            "levelling": levelling,
        },
        rate_variance=constant_variance + noise_variance + spread + levelling,
        vertical_variance=constant_variance + variance_z,
        tones=float(told[15]),
        masked_s=float(told[16]),
        beyond=float(told[17]) if scales.known else 0.0,
        mean_l=blocks.rate_l[index].mean(axis=0),
        roll=float(blocks.roll[index]),
        pitch=float(blocks.pitch[index]),
    )


def _upright(pieces: list[Piece], found: list[Weighed], yaws: list[Array]) -> tuple[float, float]:
    """Vertical rate, rad/s, and its variance without the bias, under the likeliest hypothesis."""
    best = max(pieces, key=lambda piece: float(piece.log_weight.max(initial=-np.inf)))
    h, k = np.unravel_index(np.argmax(best.log_weight), best.log_weight.shape)
    one, shape = found[best.number], best.shape[h]
    yaw = np.flatnonzero(one.law.yaw_drift == one.law.drift[best.base[h]])
    weight = yaws[best.number][yaw, shape, k]
    weight = weight / max(float(weight.sum()), np.finfo(float).tiny)
    rate = one.rate_v[yaw, shape]
    mean = float(weight @ rate)
    return mean, float(weight @ (1 / one.info_v[yaw, shape] + (rate - mean) ** 2))
