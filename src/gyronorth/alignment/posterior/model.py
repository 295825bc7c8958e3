"""The posterior of the heading: every hypothesis weighed by what gyro and accelerometer show, headings averaged."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gyronorth.alignment.posterior.blocks import Blocks, blocks_of
from gyronorth.alignment.posterior.density import Density, log_i0e, mixture
from gyronorth.alignment.posterior.law import DRIFT_PRIOR, DRIFTS, Axis, Law, law, unit_bias
from gyronorth.angles import DEG_PER_HOUR
from gyronorth.arrays import Array
from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY
from gyronorth.sensor import Sensor, TriadErrors

#: Turn-on bias over the profile's, and its prior where the in-run drift is as the profile says.
BIASES = np.array([0.1, 0.3, 1.0, 1.5, 2.2, 3.3, 5.0, 8.0, 12.0, 20.0])
BIAS_PRIOR = np.array([0.01, 0.02, 0.77, 0.06, 0.045, 0.035, 0.025, 0.015, 0.01, 0.01])
#: Without a profile: turn-on biases, rad/s, log-uniform up to the first size and falling as its inverse square beyond;
#: and the prior of the in-run drift over that which equals the white noise at `CORNER`, s.
UNKNOWN_BIASES = DEG_PER_HOUR * np.geomspace(0.003, 1000.0, 23)
UNKNOWN_KNEE, UNKNOWN_DRIFT, CORNER = 30 * DEG_PER_HOUR, (0.3, 0.2, 0.2, 0.2, 0.1), 100.0
#: An accelerometer without a profile: least white noise, (m/s^2) sqrt(s), and turn-on bias, m/s^2.
UNKNOWN_FORCE = (3e-6 * STANDARD_GRAVITY, 1e-3 * STANDARD_GRAVITY)
#: Rate about the vertical of a unit that tilts, over that about the horizontal axes.
TWIST = 0.1
#: Hypotheses less likely than the best by this, in the logarithm, are left out.
FAR = 12.0


@dataclass(frozen=True)
class HeadingDensity:
    """Posterior of the heading of one recording and what was inferred beside it."""

    density: Density
    rate_l: Array  # (3,) expected constant rate, rad/s
    scale: float  # of the turn-on bias over the profile, posterior mean of the logarithm
    drift_scale: float
    white_scale: float
    probability: dict[str, float]  # of settling, walk, tilt, sway
    variance: dict[str, float]  # of a horizontal rate by part, (rad/s)^2
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
) -> list[HeadingDensity]:
    """Posterior of each of the recordings (r, n, 3)."""
    blocks = blocks_of(gyro_b, accel_b, rate_hz=rate_hz, attitude=attitude)
    return [_one(blocks, index, latitude, sensor, known_attitude=attitude is not None) for index in range(len(gyro_b))]


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


def _one(blocks: Blocks, index: int, latitude: float, sensor: Sensor | None, *, known_attitude: bool) -> HeadingDensity:
    trace = None if blocks.trace is None else blocks.trace[index]
    measured = float(blocks.white[index])
    if trace is not None:  # what is free of motion bounds the noise
        bound = np.sqrt(np.mean(np.diff(trace, n=2, axis=0) ** 2) / blocks.seconds)
        measured = min(measured, 1.3 * float(bound))
    scales = scales_of(sensor, measured)
    whites, share = white_scales(measured, scales.sensor.gyro.white, known=scales.known)
    found = []
    for white, prior in zip(whites, share, strict=True):
        scaled = replace(scales.sensor, gyro=replace(scales.sensor.gyro, white=scales.sensor.gyro.white * white))
        if trace is not None:
            scaled = replace(scaled, accel=_accel(scaled, trace, blocks.seconds))
        law_ = law(blocks.seconds, scaled, accel=trace is not None)
        found.append((law_, *_weigh(law_, blocks.rate_l[index], trace), np.log(prior), white))
    return _conclude(found, blocks, index, latitude, scales, known_attitude=known_attitude)


def white_scales(measured: float, profile: float, *, known: bool) -> tuple[Array, Array]:
    """White noise over the profile's that is tried, and its prior: what short lags show, or less where they vibrate."""
    if profile == 0:
        return np.array([1.0]), np.array([1.0])
    ratio = measured / profile
    if known and abs(ratio - 1) < 0.12:
        return np.array([1.0]), np.array([1.0])
    ratio = 2 ** (round(4 * np.log2(max(ratio, 1e-3))) / 4)
    least = 1.0 if known else ratio / 8
    tried = [ratio]
    while tried[-1] > 1.1 * least:
        tried.append(max(tried[-1] / np.sqrt(2), least))
    share = np.array([1.0, *(0.3 / max(len(tried) - 1, 1) for _ in tried[1:])])
    if known and len(tried) > 1:
        share[-1] = 1.0
    return np.array(tried), share / share.sum()


def _accel(sensor: Sensor, trace: Array, seconds: float) -> TriadErrors:
    """The accelerometer's errors, its white noise raised to what the integrated rate less the tilt shows."""
    seen = float(np.mean(np.diff(trace, n=2, axis=0) ** 2))
    white = (sensor.accel.white / STANDARD_GRAVITY) ** 2 / seconds
    # Second differences of white noise: 1 + 4 + 1; of block means of a random walk of unit rate: 1.
    left = seen - sensor.gyro.white**2 * seconds
    if left < 2.2 * 6 * white or left <= 0:
        return sensor.accel
    factor = np.sqrt(left / 6 * seconds) * STANDARD_GRAVITY / max(sensor.accel.white, 1e-12)
    return replace(sensor.accel, white=max(sensor.accel.white, 1e-12) * 2 ** (round(2 * np.log2(factor)) / 2))


def _weigh(known: Law, rate: Array, trace: Array | None) -> tuple[Array, ...]:
    """Log weights, information and estimates: horizontal (b, s) and (2, b, s), vertical (v, s) and (v, s)."""
    seen = rate[:, :2] if trace is None else np.concatenate([rate[:, :2], trace])
    log_h, info_h, rate_h = _axes(known.horizontal, seen, known)
    log_v, info_v, rate_v = _axes(known.vertical, rate[:, 2:], known, tilting=TWIST)
    return log_h + known.log_prior[:, None], info_h, rate_h, log_v + known.yaw_log_prior[:, None], info_v, rate_v[0]


def _axes(axis: Axis, seen: Array, known: Law, *, tilting: float = 1.0) -> tuple[Array, Array, Array]:
    """Evidence of every base and shape over the axes `seen` (d, a): log weight (b, s), information, estimate (a, b, s)."""
    shapes, axes = known.shapes, seen.shape[1]
    white = axis.whiten @ seen  # (b, d, a)
    u_y = np.einsum("bd,bda->ab", axis.constant, white)
    c_y = np.einsum("bdc,bda->abc", axis.columns, white)
    y_y = np.sum(white**2, axis=(1, 2))
    b, s = len(axis.information), len(shapes.size)
    information = np.repeat(axis.information[:, None], s, axis=1)
    product = np.repeat(u_y[:, :, None], s, axis=2)
    residual = np.repeat(y_y[:, None], s, axis=1)
    log_det = np.zeros((b, s))
    one = np.flatnonzero(shapes.column >= 0)
    column, square = shapes.column[one], (shapes.size * np.where(shapes.tilts, tilting, 1.0))[one] ** 2
    pivot = 1 + square * axis.square[:, column]
    gain = square / pivot
    information[:, one] -= gain * axis.cross[:, column] ** 2
    product[:, :, one] -= gain * axis.cross[:, column] * c_y[:, :, column]
    residual[:, one] -= gain * np.sum(c_y[:, :, column] ** 2, axis=0)
    log_det[:, one] = np.log(pivot)
    u_m, m_y = np.einsum("bd,bdm->bm", axis.constant, axis.walk), np.einsum("bdm,bda->bma", axis.walk, white)
    for number in np.flatnonzero([kind == "walk" for kind in shapes.kind]):
        inner = np.eye(axis.walk.shape[2]) + np.swapaxes(axis.walk, 1, 2) @ axis.walk * shapes.size[number] ** 2
        solved = np.linalg.solve(inner, np.concatenate([u_m[:, :, None], m_y], axis=2)) * shapes.size[number] ** 2
        information[:, number] -= np.sum(u_m * solved[:, :, 0], axis=1)
        product[:, :, number] -= np.einsum("bm,bma->ab", u_m, solved[:, :, 1:])
        residual[:, number] -= np.sum(m_y * solved[:, :, 1:], axis=(1, 2))
        log_det[:, number] = np.linalg.slogdet(inner)[1]
    estimate = product / information
    residual = residual - np.sum(product * estimate, axis=0)
    log_weight = -axes * (axis.half_log_det[:, None] + 0.5 * log_det + 0.5 * np.log(information)) - 0.5 * residual
    return log_weight, information, estimate


def _bias_prior() -> Array:
    """Log prior of the turn-on bias's scale given the drift's, (drifts, biases)."""
    table = np.empty((len(DRIFTS), len(BIASES)))
    for row, drift in enumerate(DRIFTS):
        near = np.exp(-0.5 * (np.log(BIASES / drift) / 0.6) ** 2)
        share = 0.0 if drift == 1 else 0.5
        table[row] = (1 - share) * BIAS_PRIOR + share * near / near.sum()
    return np.log(table)


def _conclude(
    found: list[tuple], blocks: Blocks, index: int, latitude: float, scales: Scales, *, known_attitude: bool
) -> HeadingDensity:
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
    levelling = lean * ((EARTH_RATE * np.sin(latitude)) ** 2 + (north * np.tan(blocks.pitch[index])) ** 2)
    bias, prior = scales.biases**2, scales.log_prior
    pieces = []
    for number, (known, log_h, info_h, rate_h, log_v, info_v, rate_v, log_white, white) in enumerate(found):
        # The vertical, summed over its yaw: (drifts, shapes, biases).
        variance = 1 / info_v[:, :, None] + bias + constant
        each = (
            log_v[:, :, None]
            - 0.5 * np.log(variance * info_v[:, :, None])
            - (rate_v[:, :, None] - down) ** 2 / 2 / variance
        )
        each = each + 0.5 * np.log(info_v)[:, :, None]
        top = each.max(axis=0, keepdims=True)
        upright = np.stack(
            [np.log(np.exp(each[known.yaw_drift == d] - top).sum(axis=0)) + top[0] for d in range(len(DRIFTS))]
        )
        best = upright.max(axis=2)[known.drift] + log_h + known.shapes.log_prior
        pieces.append((number, known, log_h, info_h, rate_h, upright, best, log_white, white))
    rows = []
    ceiling = -np.inf
    for number, known, log_h, info_h, rate_h, upright, best, log_white, white in pieces:
        size = np.hypot(rate_h[0], rate_h[1])
        var = 1 / info_h[:, :, None] + bias + constant + levelling  # (b, s, k)
        c = size[:, :, None] * north / var
        log_w = (
            (log_h + np.log(info_h))[:, :, None]
            - np.log(info_h)[:, :, None]
            - np.log(var)
            + log_i0e(c)
            - (size[:, :, None] - north) ** 2 / 2 / var
            + upright[known.drift]
            + known.shapes.log_prior[None, :, None]
            + prior[known.drift][:, None, :]
            + log_white
        )
        ceiling = max(ceiling, float(log_w.max()))
        rows.append((known, log_w, c, var, rate_h, info_h, white))
    weight, centre, kappa, parts = [], [], [], []
    for known, log_w, c, var, rate_h, info_h, white in rows:
        b, s, k = np.nonzero(log_w > ceiling - FAR)
        weight.append(np.exp(log_w[b, s, k] - ceiling))
        centre.append(np.arctan2(-rate_h[1, b, s], rate_h[0, b, s]))
        kappa.append(c[b, s, k])
        parts.append(
            np.stack(
                [
                    np.log(scales.biases[k] / unit_bias(sensor)),
                    np.log(np.array(DRIFTS)[known.drift[b]]),
                    np.full(len(b), np.log(white)),
                    known.sway[b] > 0,
                    np.array([kind == "tilt" for kind in known.shapes.kind])[s],
                    np.array([kind == "settling" for kind in known.shapes.kind])[s],
                    np.array([kind == "walk" for kind in known.shapes.kind])[s],
                    rate_h[0, b, s],
                    rate_h[1, b, s],
                    bias[k] + constant,
                    1 / info_h[b, s],
                ]
            )
        )
    w = np.concatenate(weight)
    w /= w.sum()
    told = np.concatenate(parts, axis=1) @ w
    density = mixture(np.concatenate(centre), np.concatenate(kappa), w)
    return HeadingDensity(
        density=density,
        rate_l=np.array([told[7], told[8], blocks.rate_l[index, :, 2].mean()]),
        scale=float(np.exp(told[0])),
        drift_scale=float(np.exp(told[1])),
        white_scale=float(np.exp(told[2])),
        probability={"sway": told[3], "tilt": told[4], "settling": told[5], "walk": told[6]},
        variance={"turn_on_bias": told[9], "noise": told[10], "levelling": levelling},
        roll=float(blocks.roll[index]),
        pitch=float(blocks.pitch[index]),
    )
