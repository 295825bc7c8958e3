"""Explanations of one recording: white noise, noise of the accelerometer, tones and bumps, each with every base.

The plain ones come first; tones and bumps are weighed only with the noise that does best without them, since each
costs as much as all that changes slowly.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from gyronorth.alignment.posterior.axis import Axis
from gyronorth.alignment.posterior.blocks import COUNT, Blocks
from gyronorth.alignment.posterior.force import force_difference
from gyronorth.alignment.posterior.law import Law, law, tone_root
from gyronorth.alignment.posterior.tones import (
    BUMP,
    LINED,
    TONES,
    Cleaned,
    bumped_blocks,
    cleaning,
    shows_tones,
    strongest,
)
from gyronorth.alignment.tones.side_by_side import Search
from gyronorth.arrays import Array, Index
from gyronorth.conditioning import block_means
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.sensor import Sensor, TriadErrors

#: Lags, in blocks, at which the accelerometer's noise is read, and the share of what the profiles say of a difference's
#: square below which it is quieter: one in a hundred at most is so by chance. The least scale that is tried.
FORCE_LAGS = {1: 0.35, 3: 0.2}
QUIETEST = 0.1
#: Rate about the vertical of a unit that tilts, over that about the horizontal axes.
TWIST = 0.1
#: Explanations less likely than the best by this, in the logarithm, are left out.
FAR = 12.0
#: An accelerometer's noise less likely than another by this with one white noise of the gyro is not weighed with less.
EXCLUDED = 1.5 * FAR
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


def explaining(blocks: Blocks, index: int, sensor: Sensor, *, known: bool) -> Search[list[Weighed]]:
    """Everything that may explain one recording's fast part, weighed with all that may change slowly, for `searched`.

    `sensor` is the profile (`known`), or stands for one.
    """
    rate, trace, fine = blocks.rate_l[index], seen_trace(blocks, index, sensor), blocks.fine_l[index]
    rate_hz = blocks.fine_l.shape[1] / blocks.duration

    def weighed(noise: Noise, more: float, bumped: tuple[int, ...] = ()) -> Weighed:
        made = law(blocks.seconds, noise.sensor, known=known, accel=trace is not None, bumped=bumped)
        seen = weigh(made, rate[None], None if trace is None else trace[None])
        return _weighed(made, seen, 0, noise, more, 0, len(bumped) * blocks.seconds)

    def toned(noise: Noise, lines: list[tuple[float, float]]) -> list[Weighed]:
        assert trace is not None
        made = law(blocks.seconds, noise.sensor, known=known, accel=True, tones=True)
        added = _alike([_roots(blocks.seconds, lines[:number]) for number in LINED])
        same = [0] * len(LINED)
        seen = weigh(made, rate[None][same], trace[None][same], added)
        return [
            _weighed(made, seen, place, noise, float(np.log(weight / TONES[0])), number, 0.0)
            for place, (number, weight) in enumerate(LINED.items())
        ]

    def refitted(ones: Sequence[Cleaned], settings: Sequence[Noise]) -> list[Weighed]:
        found: list[Weighed] = []
        for noise in settings if ones else ():
            made = law(blocks.seconds, noise.sensor, known=known, accel=False, tones=True)
            added = _alike([one.added * (noise.sensor.gyro.white / one.white) for one in ones])
            seen = weigh(made, np.stack([one.rate_l for one in ones]), None, added)
            seen[0][..., made.shapes.settles] += UNSTEADY
            found += [
                _weighed(made, seen, number, noise, one.log_weight, one.tones, one.bumped / rate_hz)
                for number, one in enumerate(ones)
            ]
        return found

    settings = _settings(measured_white(blocks, index), sensor, trace, blocks.seconds, known=known)
    sways = shows_tones(fine, rate_hz=rate_hz, errors=sensor.gyro)
    if trace is None:
        explained: list[Cleaned] = []
        if sways:
            explained = yield from _likely(fine, rate_hz=rate_hz, errors=sensor.gyro)
        plain = [one for one in explained if not (one.tones or one.bumped)]
        found = (
            []
            if explained and not plain
            else [weighed(noise, plain[0].log_weight if plain else 0.0) for noise in settings]
        )
        others = [one for one in explained if one.tones or one.bumped]
        # Where there are more settings, those that do best with the likeliest explanation weigh the others.
        first = others if len(settings) <= SETTINGS else others[:1]
        found += (tried := refitted(first, settings))
        if len(first) < len(others):
            found += refitted(others[1:], _best(tried, settings))
    else:
        found, weighed_settings = _every_accelerometer(settings, lambda noise: weighed(noise, 0.0))
        kept = _best(found, weighed_settings)
        lines = strongest(fine, rate_hz=rate_hz) if sways else []
        bumps, chance = bumped_blocks(fine), float(np.log(BUMP * blocks.duration / 100 / COUNT))
        for noise in kept:
            found += toned(noise, lines) if sways else []
            for hit in bumps:
                found.append(weighed(noise, len(hit) * chance, hit))
    ceiling = max(one.worth for one in found)
    return [one for one in found if one.worth > ceiling - FAR]


def _likely(fine_l: Array, *, rate_hz: float, errors: TriadErrors) -> Search[list[Cleaned]]:
    """Explanations of tones and bumps that are worth weighing, the likeliest first."""
    found = yield from cleaning(fine_l, rate_hz=rate_hz, errors=errors)
    found.sort(key=lambda one: -one.log_weight)
    return [one for one in found if one.log_weight > found[0].log_weight - NEAR]


def _weighed(
    made: Law, seen: tuple[Array, ...], number: int, noise: Noise, more: float, tones: int, masked_s: float
) -> Weighed:
    """One of the explanations that were weighed together."""
    log_h, info_h, rate_h, *vertical = seen
    log_v, info_v, rate_v = (each[number] for each in vertical)
    horizontal = log_h[number], info_h[number], rate_h[:, number]
    return Weighed(made, *horizontal, log_v, info_v, rate_v, noise.log_prior + more, noise.white, tones, masked_s)


def _every_accelerometer(
    settings: Sequence[Noise], weighed: Callable[[Noise], Weighed]
) -> tuple[list[Weighed], list[Noise]]:
    """All `settings`, the loudest first, but those of an accelerometer that the recording has already excluded.

    Of two noises of the accelerometer one may be so far behind the other that nothing of it is left at the end. With
    less white noise of the gyro, of which both see the same, it stays behind the same other one.
    """
    found: list[Weighed] = []
    taken: list[Noise] = []
    behind: set[tuple[TriadErrors, ...]] = set()  # the accelerometers that are left out, each before the better one
    for _, group in groupby(settings, key=lambda noise: noise.white):
        both = list(group)
        order = [noise.sensor.accel for noise in both]
        each = [noise for noise, pair in zip(both, (order, order[::-1]), strict=False) if tuple(pair) not in behind]
        ones = [weighed(noise) for noise in each]
        found, taken = found + ones, taken + each
        if len(ones) > 1 and abs(ones[0].worth - ones[1].worth) > EXCLUDED:
            behind.add(tuple(order if ones[0].worth < ones[1].worth else order[::-1]))
    return found, taken


def _best(found: Sequence[Weighed], settings: Sequence[Noise]) -> list[Noise]:
    """Those of `settings` that do best, in their order."""
    order = np.argsort([-one.worth for one in found])[:SETTINGS]
    return [settings[i] for i in sorted(order)]


def _roots(seconds: float, lines: Sequence[tuple[float, float]]) -> Array:
    """Root (COUNT, 4 k) of the covariance of block means of k lines."""
    return np.concatenate([tone_root(seconds, frequency, size) for frequency, size in lines], axis=1)


def _alike(roots: Sequence[Array]) -> Array:
    """Roots (COUNT, r) of covariances, one of each explanation, as (e, COUNT, r): zeros beyond the own columns."""
    every = np.zeros((len(roots), COUNT, max(root.shape[1] for root in roots)))
    for place, root in zip(every, roots, strict=True):
        place[:, : root.shape[1]] = root
    return every


def seen_trace(blocks: Blocks, index: int, sensor: Sensor) -> Array | None:
    """The integrated rate less the tilt, (COUNT, 2) rad, of an accelerometer that shows a slow tilt.

    One that is rounded beyond its noise shows none below its step: what is slower is judged by the gyro alone.
    """
    if blocks.trace is None or blocks.rounding[index] ** 2 > force_difference(sensor.accel, blocks.seconds, 1):
        return None
    return blocks.trace[index]


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
    """The accelerometer's errors as the integrated rate less the tilt shows them, by lag: louder or quieter.

    Second differences of means over k blocks are, of white noise, 6 / k of its variance in a block, of the integrated
    gyro noise k. Swaying at periods of a few blocks raises the shortest lag only. What is more is white noise, what is
    far less than all that the profiles say an accelerometer better than its own in noise and in-run drift.
    """
    accel, white = sensor.accel, max(sensor.accel.white, 1e-12)
    found: dict[float, TriadErrors] = {}
    for k, quiet in FORCE_LAGS.items():
        seen = float(np.mean(np.diff(block_means(trace, k), n=2, axis=0) ** 2))
        gyro, force = k * sensor.gyro.white**2 * seconds, force_difference(accel, seconds, k)
        left = k * (seen - gyro) / 6
        if left >= 2.2 * (white / STANDARD_GRAVITY) ** 2 / seconds:
            factor = 2 ** (round(2 * np.log2(np.sqrt(left * seconds) * STANDARD_GRAVITY / white)) / 2)
            found[factor] = replace(accel, white=factor * white)
        elif seen < quiet * (gyro + force):
            factor = 2 ** (round(2 * np.log2(max(np.sqrt(max(seen - gyro, 0.0) / force), QUIETEST))) / 2)
            found[factor] = replace(
                accel,
                white=factor * accel.white,
                flicker=factor * accel.flicker,
                random_walk=factor * accel.random_walk,
            )
        else:
            found[1.0] = accel
    return list(found.values())


def weigh(
    under: Law, rate: Array, trace: Array | None, added: Array | None = None
) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Log weights, information and estimates: horizontal (e, b, s) and (2, e, b, s), vertical (e, v, s) and (e, v, s).

    Of block means (e, COUNT, 3) and (e, COUNT, 2), the former with more noise in every axis than the law has, of which
    a root is `added`, (e, COUNT, r).
    """
    if added is None:
        added = np.zeros((len(rate), COUNT, 0))
    seen = rate[..., :2] if trace is None else np.concatenate([rate[..., :2], trace], axis=1)
    log_h, info_h, rate_h = _axes(under.horizontal, seen, under, added)
    log_v, info_v, rate_v = _axes(under.vertical, rate[..., 2:], under, added, tilting=TWIST)
    return log_h + under.log_prior[:, None], info_h, rate_h, log_v + under.yaw_log_prior[:, None], info_v, rate_v[0]


def _axes(axis: Axis, seen: Array, under: Law, added: Array, *, tilting: float = 1.0) -> tuple[Array, Array, Array]:
    """Evidence of every base and shape over the axes `seen` (e, d, a): log weight, information, estimate (a, e, b, s).

    Unknowns are eliminated one after the other: the modes of a walk, then the noise F that is `added`, of which
    (I + F F')^-1 = I - F (I + F'F)^-1 F' once whitened, then what is a shape of rank one, and the constant.
    """
    shapes, (e, d, axes), r = under.shapes, seen.shape, added.shape[2]
    white = axis.whitened(np.concatenate([_padded(added, d), seen], axis=2))
    with_known = axis.known @ white  # (e, b, 1 + c + m, r + a)
    own = np.swapaxes(white, 2, 3) @ white  # (e, b, r + a, r + a)
    columns = slice(1, 1 + axis.cross.shape[1])
    # Without a walk, then with each: what is left of the products, (w, e, b, ...).
    scale = np.concatenate([[0.0], shapes.size[shapes.walks] ** 2])
    gain = (scale / (1 + scale * axis.walk_square[..., None])).transpose(2, 0, 1)[:, None]  # (w, 1, b, m)
    walk = with_known[:, :, columns.stop :]
    scaled = gain[..., None] * walk
    left = own - np.swapaxes(walk, 2, 3) @ scaled
    of_one = with_known[:, :, 0] - (axis.walk_cross[:, None] @ scaled)[..., 0, :]
    information = (axis.information - np.sum(gain * axis.walk_cross**2, axis=-1)) + np.zeros((1, e, 1))
    log_det = np.sum(np.log1p(scale[:, None, None] * axis.walk_square), axis=-1)[:, None] + np.zeros((1, e, 1))
    projected, square = of_one[..., r:], np.trace(left[..., r:, r:], axis1=-2, axis2=-1)
    cross, of_columns, squares = axis.cross, with_known[:, :, columns, r:], axis.square
    if r:
        lower = np.linalg.cholesky(left[..., :r, :r] + np.eye(r))
        beside = np.concatenate([of_one[..., :r, None], left[..., :r, r:]], axis=-1)
        solved: Array = np.asarray(np.linalg.solve(lower, beside), dtype=float)
        one, these = solved[..., 0], solved[..., 1:]
        of_shapes = np.swapaxes(with_known[:, :, columns, :r], 2, 3)
        shaped: Array = np.asarray(np.linalg.solve(lower[0], of_shapes), dtype=float)
        information = information - np.sum(one**2, axis=-1)
        projected = projected - (one[..., None, :] @ these)[..., 0, :]
        square = square - np.sum(these**2, axis=(-2, -1))
        log_det = log_det + 2 * np.sum(np.log(np.diagonal(lower, axis1=-2, axis2=-1)), axis=-1)
        cross = cross - (one[0][..., None, :] @ shaped)[..., 0, :]
        of_columns = of_columns - np.swapaxes(shaped, 2, 3) @ these[0]
        squares = squares - np.sum(shaped**2, axis=2)
    # What is no rank-one shape has size 0 here.
    column: Index = np.maximum(shapes.column, 0)
    size = np.where(shapes.column >= 0, shapes.size * np.where(shapes.tilts, tilting, 1.0), 0.0) ** 2
    pivot = 1 + size * squares[..., column]
    gain = size / pivot
    crossed = cross[..., column]
    pulled = gain * crossed
    found = information[0][..., None] - pulled * crossed
    residual = square[0][..., None] - gain * np.sum(of_columns**2, axis=-1)[..., column]
    each = projected[0].transpose(2, 0, 1)[..., None] - pulled * of_columns.transpose(3, 0, 1, 2)[..., column]
    half_log_det = axis.half_log_det[:, None] + 0.5 * (log_det[0][..., None] + np.log(pivot))
    found[..., shapes.walks] = np.moveaxis(information[1:], 0, -1)
    residual[..., shapes.walks] = np.moveaxis(square[1:], 0, -1)
    each[..., shapes.walks] = projected[1:].transpose(3, 1, 2, 0)
    half_log_det[..., shapes.walks] = axis.half_log_det[:, None] + 0.5 * np.moveaxis(log_det[1:], 0, -1)
    estimate = each / found
    residual -= np.sum(each * estimate, axis=0)
    return -axes * (half_log_det + 0.5 * np.log(found)) - 0.5 * residual, found, estimate


def _padded(added: Array, d: int) -> Array:
    """Columns (e, COUNT, r) of the rate as those of rate and trace (e, d, r), of which only the former is noisier."""
    return np.concatenate([added, np.zeros((len(added), d - COUNT, added.shape[2]))], axis=1)
