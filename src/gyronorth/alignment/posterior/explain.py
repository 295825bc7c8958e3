"""Explanations of one recording: white noise, noise of the accelerometer, tones and bumps, each with every base.

The plain ones come first; tones and bumps are weighed only with the noise that does best without them, since each
costs as much as all that changes slowly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gyronorth.alignment.posterior.blocks import COUNT, Blocks
from gyronorth.alignment.posterior.law import Axis, Law, fitted_law, law, law_of, noisier
from gyronorth.alignment.posterior.tones import (
    BUMP,
    LINED,
    TONES,
    Cleaned,
    Propose,
    bumped_blocks,
    by_periodogram,
    cleaned,
    shows_tones,
    strongest,
)
from gyronorth.arrays import Array, Index
from gyronorth.conditioning import block_means
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.sensor import Sensor, TriadErrors

#: Gives what proposes tones and bumps, where there is one: loaded only for a recording that shows any.
Proposer = Callable[[], Propose | None]
#: Lags, in blocks, at which the accelerometer's noise is read.
FORCE_LAGS = (1, 3)
#: Rate about the vertical of a unit that tilts, over that about the horizontal axes.
TWIST = 0.1
#: Explanations less likely than the best by this, in the logarithm, are left out.
FAR = 12.0
#: Explanations of tones and bumps less likely than the best by this, whatever changes slowly, are not weighed.
NEAR = 5.0
#: Settings of the noise with which tones and bumps are weighed.
SETTINGS = 2
#: Prior of a unit whose white noise is what short lags show, over that of a quieter one that moves.
WORSE = 0.15
#: How much likelier a settling bias is in a recording with tones or bumps: they come together.
UNSTEADY = np.log(8.0)


@dataclass(frozen=True)
class Weighed:
    """Every base and shape under one explanation of white noise, tones and bumps."""

    law: Law
    log_h: Array  # (b, s) horizontal: log weight without what is known of the constant
    info_h: Array  # (b, s) (rad/s)^-2
    rate_h: Array  # (2, b, s) rad/s
    log_v: Array  # (v, s) vertical
    info_v: Array  # (v, s)
    rate_v: Array  # (v, s)
    log_prior: float
    white: float  # over the profile's
    tones: int
    masked_s: float

    @property
    def worth(self) -> float:
        """Logarithm of the weight of its best hypothesis, but for what is known of the constant."""
        upright = np.max(self.log_v, axis=0) + self.law.shapes.log_prior
        return float(np.max(np.max(self.log_h, axis=0) + upright)) + self.log_prior


@dataclass(frozen=True)
class Noise:
    """One setting of the noise."""

    sensor: Sensor
    white: float  # over the profile's
    log_prior: float


def explanations(blocks: Blocks, index: int, sensor: Sensor, *, known: bool, propose: Proposer | None) -> list[Weighed]:
    """Everything that may explain one recording's fast part, weighed with all that may change slowly.

    `sensor` is the profile (`known`), or stands for one.
    """
    rate, trace, fine = blocks.rate_l[index], None, blocks.fine_l[index]
    if blocks.trace is not None:
        trace = blocks.trace[index]
    rate_hz = blocks.fine_l.shape[1] / blocks.duration

    def weighed(noise: Noise, more: float, **options: Any) -> Weighed:
        make = law_of if options.get("tones") else law
        seen = weigh(
            made := make(blocks.seconds, noise.sensor, known=known, accel=trace is not None, **options), rate, trace
        )
        masked_s = len(options.get("bumped", ())) * blocks.seconds
        return Weighed(made, *seen, noise.log_prior + more, noise.white, len(options.get("tones", ())), masked_s)

    def refitted(noise: Noise, one: Cleaned) -> Weighed:
        white = noise.sensor.gyro.white
        more = one.covariance * (white / one.white) ** 2 - np.eye(COUNT) * white**2 / blocks.seconds
        made = noisier(fitted_law(blocks.seconds, noise.sensor, known=known), more)
        seen = weigh(made, one.rate_l, None)
        seen[0][:, made.shapes.settles] += UNSTEADY
        return Weighed(made, *seen, noise.log_prior + one.log_weight, noise.white, one.tones, one.bumped / rate_hz)

    settings = _settings(measured_white(blocks, index), sensor, trace, blocks.seconds, known=known)
    sways = shows_tones(fine, rate_hz=rate_hz, errors=sensor.gyro)
    if trace is None:
        explained: list[Cleaned] = []
        if sways:
            explained = cleaned(
                fine, (propose() if propose else None) or by_periodogram, rate_hz=rate_hz, errors=sensor.gyro
            )
            best = max(one.log_weight for one in explained)
            explained = sorted(explained, key=lambda one: -one.log_weight)
            explained = [one for one in explained if one.log_weight > best - NEAR]
        plain = [one for one in explained if not (one.tones or one.bumped)]
        found: list[Weighed] = []
        if plain or not explained:
            more = plain[0].log_weight if plain else 0.0
            found += [weighed(noise, more) for noise in settings]
        for one in explained:
            if one.tones or one.bumped:
                each = [refitted(noise, one) for noise in settings]
                found += each
                settings = [noise for _, noise in _best(each, settings)]
    else:
        found = [weighed(noise, 0.0) for noise in settings]
        kept = [noise for _, noise in _best(found, settings)]
        lines = strongest(fine, rate_hz=rate_hz) if sways else []
        chance = float(np.log(BUMP * blocks.duration / 100 / COUNT))
        for noise in kept:
            for number, probability in LINED.items() if sways else ():
                more = float(np.log(probability / TONES[0]))
                found.append(weighed(noise, more, tones=tuple(lines[:number])))
            for hit in bumped_blocks(fine):
                found.append(weighed(noise, len(hit) * chance, bumped=hit))
    ceiling = max(one.worth for one in found)
    return [one for one in found if one.worth > ceiling - FAR]


def _best(found: list[Weighed], settings: list[Noise]) -> list[tuple[Weighed, Noise]]:
    """Those of `settings` that do best, in their order."""
    order = np.argsort([-one.worth for one in found])[:SETTINGS]
    return [(found[i], settings[i]) for i in sorted(order)]


def measured_white(blocks: Blocks, index: int) -> float:
    """Noise density at short lags, rad/sqrt(s), or what is free of motion shows, if less."""
    measured = float(blocks.white[index])
    if blocks.trace is None:
        return measured
    trace = blocks.trace[index]
    seen = [np.mean(np.diff(block_means(trace, k), n=2, axis=0) ** 2) / (k * blocks.seconds) for k in FORCE_LAGS]
    return min(measured, 1.3 * float(np.sqrt(min(seen))))


def _settings(measured: float, sensor: Sensor, trace: Array | None, seconds: float, *, known: bool) -> list[Noise]:
    """White noise of gyro and accelerometer that is tried."""
    found: list[Noise] = []
    for white, prior in zip(*white_scales(measured, sensor.gyro.white, known=known), strict=True):
        scaled = replace(sensor, gyro=replace(sensor.gyro, white=sensor.gyro.white * float(white)))
        accels = [scaled.accel] if trace is None else _accels(scaled, trace, seconds)
        each = float(np.log(prior / len(accels)))
        found += [Noise(replace(scaled, accel=accel), float(white), each) for accel in accels]
    return found


def white_scales(measured: float, profile: float, *, known: bool) -> tuple[Array, Array]:
    """White noise over the profile's that is tried, and its prior: what short lags show, or less where they vibrate."""
    if profile == 0:
        return np.array([1.0]), np.array([1.0])
    ratio = measured / profile
    if known and abs(ratio - 1) < 0.12:
        return np.array([1.0]), np.array([1.0])
    ratio = 2 ** (round(4 * np.log2(max(ratio, 1e-3))) / 4)
    least, step = (1.0, np.sqrt(2)) if known else (ratio / 8, 2.0)
    tried = [ratio]
    while tried[-1] > 1.1 * least:
        tried.append(max(tried[-1] / step, least))
    between = np.full(len(tried) - 1, 0.3 / max(len(tried) - 1, 1))
    share = np.concatenate([[WORSE if known else 1.0], between * (WORSE if known else 1.0)])
    if known and len(tried) > 1:
        share[-1] = 1.0
    return np.array(tried), share / share.sum()


def _accels(sensor: Sensor, trace: Array, seconds: float) -> list[TriadErrors]:
    """The accelerometer's errors with white noise as the integrated rate less the tilt shows it, if more, by lag.

    Second differences of means over k blocks are, of white noise, 6 / k of its variance in a block, of the integrated
    gyro noise k. Swaying at periods of a few blocks raises the shortest lag only.
    """
    white = max(sensor.accel.white, 1e-12)
    found: dict[float, TriadErrors] = {}
    for k in FORCE_LAGS:
        seen = float(np.mean(np.diff(block_means(trace, k), n=2, axis=0) ** 2))
        left = k * (seen - k * sensor.gyro.white**2 * seconds) / 6
        if left < 2.2 * (white / STANDARD_GRAVITY) ** 2 / seconds:
            factor = sensor.accel.white / white
        else:
            factor = 2 ** (round(2 * np.log2(np.sqrt(left * seconds) * STANDARD_GRAVITY / white)) / 2)
        found[factor] = replace(sensor.accel, white=factor * white)
    return list(found.values())


def weigh(under: Law, rate: Array, trace: Array | None) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Log weights, information and estimates: horizontal (b, s) and (2, b, s), vertical (v, s) and (v, s)."""
    seen = rate[:, :2] if trace is None else np.concatenate([rate[:, :2], trace])
    log_h, info_h, rate_h = _axes(under.horizontal, seen, under)
    log_v, info_v, rate_v = _axes(under.vertical, rate[:, 2:], under, tilting=TWIST)
    return log_h + under.log_prior[:, None], info_h, rate_h, log_v + under.yaw_log_prior[:, None], info_v, rate_v[0]


def _axes(axis: Axis, seen: Array, under: Law, *, tilting: float = 1.0) -> tuple[Array, Array, Array]:
    """Evidence of every base and shape over the axes `seen` (d, a): log weight, information, estimate (a, b, s)."""
    shapes, axes = under.shapes, seen.shape[1]
    white = axis.whiten @ seen  # (b, d, a)
    across = np.swapaxes(white, 1, 2)  # (b, a, d)
    u_y = (across @ axis.constant[:, :, None])[..., 0].T
    c_y = np.swapaxes(across @ axis.columns, 0, 1)
    y_y = np.sum(white**2, axis=(1, 2))
    # What is no rank-one shape has size 0 here.
    column: Index = np.maximum(shapes.column, 0)
    size = np.where(shapes.column >= 0, shapes.size * np.where(shapes.tilts, tilting, 1.0), 0.0)
    pivot = 1 + size**2 * axis.square[:, column]
    gain, cross = size**2 / pivot, axis.cross[:, column]
    information = axis.information[:, None] - gain * cross**2
    projected = u_y[:, :, None] - gain * cross * c_y[:, :, column]
    residual = y_y[:, None] - gain * np.sum(c_y**2, axis=0)[:, column]
    log_det = np.log(pivot)
    m_y, scale = np.swapaxes(axis.walk, 1, 2) @ white, shapes.size[shapes.walks, None, None] ** 2
    gain = scale / (1 + scale * axis.walk_square)  # (w, b, m)
    information[:, shapes.walks] -= np.sum(gain * axis.walk_cross**2, axis=2).T
    projected[:, :, shapes.walks] -= np.swapaxes(((gain * axis.walk_cross)[:, :, None] @ m_y)[:, :, 0], 0, 2)
    residual[:, shapes.walks] -= np.sum(gain * np.sum(m_y**2, axis=2), axis=2).T
    log_det[:, shapes.walks] = np.sum(np.log1p(scale * axis.walk_square), axis=2).T
    estimate = projected / information
    residual = residual - np.sum(projected * estimate, axis=0)
    log_weight = -axes * (axis.half_log_det[:, None] + 0.5 * log_det + 0.5 * np.log(information)) - 0.5 * residual
    return log_weight, information, estimate
