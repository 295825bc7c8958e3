"""Heading of a disturbed recording: a network proposes bumps and tones, closed-form evidence decides.

The network (`Propose`) says which samples lie in a bump and on which frequencies tones may be. On
those few frequencies every model of a constant, at most two tones, a settling exponential or a
slow tilt and the sensor's noise is weighed by its exact evidence (`evidence`), first on the grid
of the proposals, then on finer ones where the tones are. Samples that the best model cannot explain
are left out, and samples that it can are taken back: a wrong proposal costs accuracy only if it
misses a tone. The heading is the average over the models.

This is amortised Bayesian inference: the search over all pairs of some 200 frequencies, which
`bayes` does for each recording, was done once, in training.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyronorth.alignment.tones.evidence import TILTS, Columns, Evidence, ToneLaw, columns, law, network_axes
from gyronorth.alignment.tones.search import UNKNOWN_BIAS, white_of
from gyronorth.alignment.tones.side_by_side import Proposing, Search, Weighing, searched
from gyronorth.alignment.tones.unexplained import STILL, BoundedMotion, unexplained
from gyronorth.angles import mean_direction, wrap_heading
from gyronorth.arrays import Array, Mask, median
from gyronorth.attitude import heading_of_rate
from gyronorth.earth import EARTH_RATE
from gyronorth.frozen import frozen
from gyronorth.sensor import TriadErrors

#: From rates in units of noise less their median (n, 3), sample numbers from the middle (n,) and
#: frequencies in cycles a sample (f,): log odds of a bump (n,) and log weights of tones (f,).
Propose = Callable[[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]], tuple[Array, Array]]

#: Frequencies kept of the proposals.
KEPT = 16
#: Squared residual of a sample over three axes, in variances, beyond which it lies in a bump
#: (chi-square with 3 degrees of freedom: 1e-5).
BUMP_CHI2 = 26.0
#: Expected tones at a frequency above which it is divided into so many, at most so many frequencies in all, and rounds
#: of dividing: a strong tone between two frequencies hides a weak one until its own are divided. As many rounds learn
#: the law of what is left unexplained.
FINER, MOST, ROUNDS = ((0.15, 7), (0.01, 3)), 44, 2
#: Expected tones at a frequency below which it is left out of the last round.
NO_TONE = 1e-4
#: The mean squared residual scatters by sqrt(2 / its number): beyond so many of these the law does not hold.
EXCESS_SIGMA = 4.0
#: Share of the samples above which what stands out is no bumps.
MOST_BUMPED = 0.2
#: A unit whose in-run drift is less than its profile says: by what factor, and the log odds of it beforehand.
STEADIER, STEADY = 0.3, np.log(0.1 / 0.9)
#: Models less likely than this are left out of the average.
NEGLIGIBLE = 1e-5
#: Models less likely than the best by this in the logarithm are not looked at: what is known of the constant
#: changes weights by less.
FAR = 30.0
#: Points of the posterior density of the heading.
POINTS = 1024


@frozen
class Amortised:
    """Posterior of the heading of one recording, and what was found."""

    heading: float  # mean, rad in [0, 2 pi)
    sigma: float  # root mean square deviation from it, rad
    low: float  # ends of the shortest 95 % interval, rad from `heading`
    high: float
    rate_l: Array  # (3,) expected constant rate, rad/s
    tones: float  # expected number
    settling: float  # probability that the bias settles
    tilt: float  # probability that the unit tilts slowly
    walk: float  # probability that it walks
    bumps: int  # samples left out
    excess: float  # mean squared residual over the law's variance; beyond the limit its own law is taken
    fits: bool  # whether the law explains the recording


def amortised(
    gyro_l: ArrayLike, propose: Propose, *, rate_hz: float, latitude: float, errors: TriadErrors | None
) -> Amortised:
    """Heading of one level recording that may sway, settle and be bumped.

    Parameters
    ----------
    gyro_l : array_like, shape (n, 3)
        Angular rate in the level frame, rad/s, each sample a mean: 90 to 900, at 3 Hz or less.
    propose : callable
        The network, or anything else that proposes.
    rate_hz : float
        Sample rate, Hz.
    latitude : float
        Geodetic latitude, rad.
    errors : TriadErrors, optional
        Error terms of the gyro. Without them the white noise comes from second differences and the
        turn-on bias is averaged over those that `bayes` tries.
    """
    search = amortising(gyro_l, rate_hz=rate_hz, latitude=latitude, errors=errors)
    return searched([search], _each(propose))[0]


def amortising(gyro_l: ArrayLike, *, rate_hz: float, latitude: float, errors: TriadErrors | None) -> Search[Amortised]:
    """The search of `amortised`, for `searched`."""
    gyro_l = np.asarray(gyro_l, dtype=float)
    biases = UNKNOWN_BIAS if errors is None else (errors.turn_on_bias,)
    if errors is None or errors.white == 0:
        errors = replace(errors or TriadErrors(), white=white_of(gyro_l) / np.sqrt(rate_hz))
    found = yield from exploring(gyro_l, rate_hz=rate_hz, errors=errors)
    excess = left = _excess(found.residual, found.masked)
    law_holds = excess <= _most(found.masked)
    for number in range(0 if law_holds else ROUNDS):
        beyond = found.law.coloured(found.residual)
        noise, motion = unexplained(beyond, found.masked, rate_hz=rate_hz, errors=errors)
        again = yield from exploring(gyro_l, rate_hz=rate_hz, errors=noise, motion=motion)
        less = _excess(again.residual, again.masked)
        if less > (left if number == 0 else _most(again.masked)):
            break
        found, left = again, less
    models, masked = found.models, found.masked
    if left > _most(masked):
        models = yield Weighing(found.law, found.seen, found.lines.log_prior, scale=float(np.sqrt(left)))
    if law_holds and (errors.flicker > 0 or errors.random_walk > 0):
        drift = {"flicker": STEADIER * errors.flicker, "random_walk": STEADIER * errors.random_walk}
        steady = law(len(gyro_l), rate_hz, replace(errors, **drift))
        seen = columns(steady, steady.whitened(gyro_l), masked, found.lines.frequency)
        without = yield Weighing(steady, seen, found.lines.log_prior)
        log_odds = STEADY + 3 * (steady.log_det(masked) - found.law.log_det(masked))
        models = models.beside(without, log_odds)
    fits = bool(law_holds and masked.mean() <= MOST_BUMPED)
    return _conclude(models, latitude, np.array(biases), bumps=int(masked.sum()), excess=excess, fits=fits)


@frozen
class Explored:
    """Where tones and bumps are, and all models there."""

    law: ToneLaw
    lines: Lines
    masked: Mask  # (n,) samples in bumps
    seen: Columns
    models: Evidence
    residual: Array  # (n, 3) whitened, from the likeliest model


def exploring(gyro_l: Array, *, rate_hz: float, errors: TriadErrors, motion: BoundedMotion = STILL) -> Search[Explored]:
    """Frequencies of tones and samples in bumps, from proposals by rounds of evidence; parameters as `amortised`."""
    known = law(len(gyro_l), rate_hz, errors, motion)
    noise = errors.white * np.sqrt(rate_hz)
    scaled = (gyro_l - median(gyro_l, axis=0)) / noise
    odds, weight = yield Proposing(scaled.astype(np.float32), *network_axes(len(gyro_l), rate_hz))
    masked = grown(odds > 0)
    if masked.mean() > 0.5:  # nothing would be left to judge by
        masked = np.zeros_like(masked)
    kept = np.sort(np.argsort(-weight)[:KEPT])
    lines = Lines(known.frequency[kept], known.log_prior[kept], np.ones(KEPT, dtype=np.int64))
    whitened, spacing = known.whitened(gyro_l), known.frequency[1] - known.frequency[0]
    seen = columns(known, whitened, masked, lines.frequency)
    models = yield Weighing(known, seen, lines.log_prior)
    residual = whitened
    for number in range(ROUNDS):
        lines = lines.divided(models.shares(len(lines.frequency)), spacing, last=number == ROUNDS - 1)
        seen = columns(known, whitened, masked, lines.frequency)
        models = yield Weighing(known, seen, lines.log_prior)
        residual = _residual(known, whitened, seen, models)
        bumped = _bumped(residual, masked)
        if (bumped != masked).any():
            masked = bumped
            seen = columns(known, whitened, masked, lines.frequency)
            models = yield Weighing(known, seen, lines.log_prior)
            residual = _residual(known, whitened, seen, models)
    return Explored(known, lines, masked, seen, models, residual)


def _each(propose: Propose) -> Callable[[Sequence[Proposing]], list[tuple[Array, Array]]]:
    """Proposals of one recording after the other."""
    return lambda asked: [propose(one.rate, one.index, one.cycles) for one in asked]


def grown(flags: Mask) -> Mask:
    """The flagged samples and their neighbours, which a bump may touch in part."""
    wide = flags.copy()
    wide[1:] |= flags[:-1]
    wide[:-1] |= flags[1:]
    return wide


@frozen
class Lines:
    """Frequencies on which tones may be."""

    frequency: Array  # (f,) Hz
    log_prior: Array  # (f,) of one tone
    parts: NDArray[np.int64]  # (f,) into how many its cell of the proposals' grid was divided

    def divided(self, share: Array, spacing: float, *, last: bool) -> Lines:
        """Divide those that hold a tone, the likeliest first; leave out those that hold none, if these are the last."""
        order = np.argsort(-share)
        expected, whole = share[order], self.parts[order] == 1
        made = np.ones(len(order), dtype=np.int64)
        for limit, parts in reversed(FINER):
            made[whole & (expected > limit)] = parts
        if last:
            made = made[: max(2, int(np.searchsorted(-expected, -NO_TONE, side="right")))]
        total = len(share)
        if total + int((made - 1).sum()) > MOST:
            for place, parts in enumerate(made.tolist()):
                made[place] = parts if total + parts - 1 <= MOST else 1
                total += int(made[place]) - 1
        number, parts = np.repeat(order[: len(made)], made), np.repeat(made, made)
        within = np.arange(len(number)) - np.repeat(np.cumsum(made) - made, made)
        return Lines(
            self.frequency[number] + ((within + 0.5) / parts - 0.5) * spacing,
            self.log_prior[number] - np.log(parts),
            parts * self.parts[number],
        )


def _bumped(residual: Array, masked: Mask) -> Mask:
    """Samples that the likeliest model cannot explain; as before if they are too many to be bumps."""
    square = np.sum(residual**2, axis=1)
    # 2.366 is the median of chi-square with 3 degrees of freedom.
    bumped = grown(square > BUMP_CHI2 * max(1.0, float(median(square[~masked])) / 2.366))
    return bumped if bumped.mean() <= MOST_BUMPED else masked


def _residual(known: ToneLaw, whitened: Array, seen: Columns, models: Evidence) -> Array:
    """Whitened residual (n, 3) of all samples from the likeliest model, fitted to those that are not masked."""
    slow, which = np.unravel_index(np.argmax(models.log_posterior), models.log_weight.shape)
    f, k = len(seen.frequency), len(known.share)
    tones = [int(t) for t in (models.first[which], models.second[which]) if t >= 0]
    settles: list[int] = [] if slow == 0 else [int(slow) - 1] if slow <= k else list(range(k, known.settling.shape[1]))
    parts = [seen.known[:, [0, *(4 + s for s in settles)]], *(seen.tone[:, [t, t + f]] for t in tones)]
    inside = np.concatenate(parts, axis=1)
    free = np.ones(inside.shape[1])
    free[0] = 0.0
    fitted = np.linalg.solve(inside.T @ inside + np.diag(free), inside.T @ seen.known[:, 1:4])
    whole = known.tones(seen.frequency[tones])[:, _interleaved(len(tones))]
    design = np.concatenate([known.constant[:, None], known.settling[:, settles], whole], axis=1)
    return whitened - design @ fitted


def _excess(residual: Array, masked: Mask) -> float:
    """Mean squared residual of the likeliest model over the variance of its law."""
    return float(np.mean(residual[~masked] ** 2))


def _most(masked: Mask) -> float:
    """The same up to which the law holds."""
    return 1 + EXCESS_SIGMA * float(np.sqrt(2 / (3 * np.count_nonzero(~masked))))


def _interleaved(tones: int) -> list[int]:
    """Cosine and sine of one tone after the other, from all cosines, then all sines."""
    return [part * tones + tone for tone in range(tones) for part in (0, 1)]


def _conclude(models: Evidence, latitude: float, biases: Array, *, bumps: int, excess: float, fits: bool) -> Amortised:
    """Weigh the models by what is known of the constant too, and average their headings, as `bayes` does."""
    from scipy.special import i0e

    north, down = EARTH_RATE * np.cos(latitude), -EARTH_RATE * np.sin(latitude)
    slow, which = np.nonzero(models.log_posterior > models.log_posterior.max() - FAR)
    rate, information = models.rate[:, slow, which], models.information[slow, which]
    variance = 1 / information + biases[:, None] ** 2  # (biases, models)
    size = np.hypot(rate[0], rate[1])
    concentration = size * north / variance
    log_weight = models.log_weight[slow, which] - 1.5 * np.log(information * variance)
    log_weight += np.log(np.asarray(i0e(concentration), dtype=float)) - (
        (size - north) ** 2 + (rate[2] - down) ** 2
    ) / (2 * variance)
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    bias, some = np.nonzero(weight > NEGLIGIBLE)
    weight, concentration = weight[bias, some] / weight[bias, some].sum(), concentration[bias, some]
    slow, which, rate, last = slow[some], which[some], rate[:, some], len(models.log_weight) - 1
    heading, sigma, low, high = posterior(heading_of_rate(rate.T), concentration, weight)
    return Amortised(
        heading=heading,
        sigma=sigma,
        low=low,
        high=high,
        rate_l=rate @ weight,
        tones=float(weight @ (models.first[which] >= 0) + weight @ (models.second[which] >= 0)),
        settling=float(weight @ ((slow > 0) & (slow < last - TILTS))),
        tilt=float(weight @ ((slow >= last - TILTS) & (slow < last))),
        walk=float(weight @ (slow == last)),
        bumps=bumps,
        excess=excess,
        fits=fits,
    )


def posterior(centre: Array, concentration: Array, weight: Array) -> tuple[float, float, float, float]:
    """Mean, rms deviation and shortest 95 % interval, from the mean, of a mixture of von Mises laws, rad.

    The laws are gathered in bins of equal concentration (width 0.1 in the logarithm) and of centre, so that each
    bin of concentration costs one convolution on the circle. `posterior.density` keeps what lies between two points
    of the grid; this one is as `learned` was trained and its figures published.
    """
    from scipy.special import i0e, i1e

    pull = weight * i1e(concentration) / i0e(concentration)
    mean = float(mean_direction(centre, pull))
    off = (centre - mean + np.pi) % (2 * np.pi) - np.pi
    spread = float(np.sqrt(weight @ (off**2 + 1 / np.maximum(concentration, 0.1))))
    # A window that holds the mass, or the whole circle.
    reach = np.pi if spread > np.pi / 12 else 12 * spread
    step = 2 * reach / POINTS
    place = np.clip((off + reach) / step, 0, POINTS - 1).astype(int)
    bins = np.round(10 * np.log(np.maximum(concentration, 1e-3))).astype(int)
    numbers, row = np.unique(bins, return_inverse=True)
    lines = np.bincount(POINTS * row + place, weight, minlength=POINTS * len(numbers)).reshape(-1, POINTS)
    # The kernel is even: one half of it is worked out.
    half = np.exp(np.exp(numbers[:, None] / 10) * (np.cos(step * np.arange(POINTS // 2 + 1)) - 1))
    kernel = np.concatenate([half, half[:, POINTS // 2 - 1 : 0 : -1]], axis=1)
    kernel /= kernel.sum(axis=1, keepdims=True)
    density = np.fft.irfft(np.einsum("bf,bf->f", np.fft.rfft(lines), np.fft.rfft(kernel)), POINTS)
    density = np.maximum(density, 0)
    density /= density.sum()
    grid = (np.arange(POINTS) + 0.5) * step - reach
    middle = float(density @ grid)
    sigma = float(np.sqrt(density @ (grid - middle) ** 2))
    cumulative = np.concatenate([[0.0], np.cumsum(density)])
    ends = np.searchsorted(cumulative, cumulative + 0.95)
    width = np.where(ends <= POINTS, ends - np.arange(POINTS + 1), POINTS + 1)
    start = int(np.argmin(width))
    low, high = start * step - reach - middle, min(start + width[start], POINTS) * step - reach - middle
    return float(wrap_heading(mean + middle)), sigma, float(low), float(high)
