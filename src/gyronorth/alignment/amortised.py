"""Heading of a disturbed recording: a network proposes bumps and tones, closed-form evidence decides.

The network (`Propose`) says which samples lie in a bump and on which frequencies tones may be. On
those few frequencies every model of a constant, at most two tones, a settling exponential and the
sensor's noise is weighed by its exact evidence (`evidence`), first on the grid of the
proposals, then on finer ones where the tones are. Samples that the best model cannot explain
are left out, and samples that it can are taken back: a wrong proposal costs accuracy only if it
misses a tone. The heading is the average over the models.

This is amortised Bayesian inference: the search over all pairs of some 200 frequencies, which
`bayes` does for each recording, was done once, in training.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyronorth.alignment.evidence import Columns, Evidence, Law, columns, evidence, law
from gyronorth.angles import wrap_heading
from gyronorth.earth import EARTH_RATE
from gyronorth.sensor import TriadErrors

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: From rates in units of noise less their median (n, 3), sample numbers from the middle (n,) and
#: frequencies in cycles a sample (f,): log odds of a bump (n,) and log weights of tones (f,).
Propose = Callable[[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]], tuple[Array, Array]]

#: Frequencies kept of the proposals.
KEPT = 28
#: Squared residual of a sample over three axes, in variances, beyond which it lies in a bump
#: (chi-square with 3 degrees of freedom: 1e-5); rounds of comparing the mask with the fit.
BUMP_CHI2, ROUNDS = 26.0, 3
#: Expected tones at a frequency above which it is divided into so many, at most so many in all.
FINER, MOST = ((0.15, 7), (0.01, 3), (1e-4, 1)), 44
#: Models less likely than this are left out of the average.
NEGLIGIBLE = 1e-5
#: Points of the posterior density of the heading.
POINTS = 1024


@dataclass(frozen=True)
class Amortised:
    """Posterior of the heading of one recording, and what was found."""

    heading: float  # mean, rad in [0, 2 pi)
    sigma: float  # root mean square deviation from it, rad
    low: float  # ends of the shortest 95 % interval, rad from `heading`
    high: float
    rate_l: Array  # (3,) expected constant rate, rad/s
    tones: float  # expected number
    settling: float  # probability
    bumps: int  # samples left out
    excess: float  # mean squared residual over the law's variance
    surprise: tuple[float, float]  # sums of squares of the settling and tone coefficients, in prior deviations


def amortised(
    gyro_l: Array, propose: Propose, *, rate_hz: float, latitude: float, errors: TriadErrors
) -> Amortised:
    """Heading of one level recording (n, 3), rad/s."""
    known = law(len(gyro_l), rate_hz, errors)
    noise = errors.white * np.sqrt(rate_hz)
    scaled = (gyro_l - np.median(gyro_l, axis=0)) / noise
    index = np.arange(len(gyro_l)) - (len(gyro_l) - 1) / 2
    odds, weight = propose(
        scaled.astype(np.float32), index.astype(np.float32), (known.frequency / rate_hz).astype(np.float32)
    )
    masked = grown(odds > 0)
    kept = np.sort(np.argsort(-weight)[:KEPT])
    for _ in range(ROUNDS):
        seen = columns(known, gyro_l, masked, known.frequency[kept])
        models = evidence(known, seen, known.log_prior[kept])
        square = np.sum(_fit(known, gyro_l, seen, models).residual ** 2, axis=1)
        again = grown(square > BUMP_CHI2 * max(1.0, float(np.median(square[~masked])) / 2.366))
        if (again == masked).all():
            break
        masked = again
    frequency, log_prior = _finer(known, kept, models.shares(len(kept)))
    seen = columns(known, gyro_l, masked, frequency)
    models = evidence(known, seen, log_prior)
    fit = _fit(known, gyro_l, seen, models)
    free = 3 * int((~masked).sum())
    excess = float(np.sum(fit.residual[~masked] ** 2)) / free
    # The squares scatter by sqrt(2 / free): beyond 4 of these the law does not hold.
    if excess > 1 + 4 * np.sqrt(2 / free):
        models = evidence(known, seen, log_prior, scale=float(np.sqrt(excess)))
    return _conclude(models, latitude, errors.turn_on_bias, int(masked.sum()), excess, (fit.settling, fit.tones))


def grown(flags: Mask) -> Mask:
    """The flagged samples and their neighbours, which a bump may touch in part; none if that were half of all."""
    wide = flags.copy()
    wide[1:] |= flags[:-1]
    wide[:-1] |= flags[1:]
    return wide if wide.mean() < 0.5 else np.zeros_like(flags)


def _finer(known: Law, kept: NDArray[np.int64], share: Array) -> tuple[Array, Array]:
    """Frequencies, Hz, and their log priors: the kept ones divided where tones are."""
    spacing = known.frequency[1] - known.frequency[0]
    frequency, log_prior, total = [], [], 0
    for number in np.argsort(-share):
        parts = next((parts for limit, parts in FINER if share[number] > limit), 0)
        if parts == 0 or total + parts > MOST:
            break
        offset = ((np.arange(parts) + 0.5) / parts - 0.5) * spacing
        frequency.append(known.frequency[kept[number]] + offset)
        log_prior.append(np.full(parts, known.log_prior[kept[number]] - np.log(parts)))
        total += parts
    if not frequency:  # no tone anywhere: any frequency will do
        return known.frequency[kept[:2]], known.log_prior[kept[:2]]
    return np.concatenate(frequency), np.concatenate(log_prior)


@dataclass(frozen=True)
class _Fit:
    residual: Array  # (n, 3) whitened, of all samples, masked ones too
    settling: float  # squares of the coefficients in units of their prior deviation
    tones: float


def _fit(known: Law, gyro_l: Array, seen: Columns, models: Evidence) -> _Fit:
    """The likeliest model, fitted to the samples that are not masked."""
    settling, which = np.unravel_index(np.argmax(models.posterior), models.log_weight.shape)
    f = len(seen.frequency)
    tones = [t for t in (models.first[which], models.second[which]) if t >= 0]
    settles = [3 + settling] if settling else []
    inside = np.concatenate([seen.known[:, [0, *settles]], *(seen.tone[:, [t, t + f]] for t in tones)], axis=1)
    free = np.ones(inside.shape[1])
    free[0] = 0.0
    fitted = np.linalg.solve(inside.T @ inside + np.diag(free), inside.T @ seen.known[:, 1:4])
    whole = [known.constant[:, None]] + ([known.settling[:, [settling - 1]]] if settling else [])
    design = np.concatenate([*whole, known.tones(seen.frequency[tones])[:, _interleaved(len(tones))]], axis=1)
    square = np.sum(fitted**2, axis=1)
    first = 1 + len(settles)
    return _Fit(known.whitened(gyro_l) - design @ fitted, float(square[1:first].sum()), float(square[first:].sum()))


def _interleaved(tones: int) -> list[int]:
    """Cosine and sine of one tone after the other, from all cosines, then all sines."""
    return [part * tones + tone for tone in range(tones) for part in (0, 1)]


def _conclude(
    models: Evidence, latitude: float, bias: float, bumps: int, excess: float, surprise: tuple[float, float]
) -> Amortised:
    """Weigh the models by what is known of the constant too and average their headings (as `bayes` does)."""
    from scipy.special import i0e

    north, down = EARTH_RATE * np.cos(latitude), -EARTH_RATE * np.sin(latitude)
    log_weight = models.log_weight - 1.5 * np.log(models.information)
    settling, which = np.nonzero(log_weight > log_weight.max() - 30)  # the constant changes weights by less
    rate = models.rate[:, settling, which]
    variance = 1 / models.information[settling, which] + bias**2
    size = np.hypot(rate[0], rate[1])
    concentration = size * north / variance
    log_weight = models.log_weight[settling, which] - 1.5 * np.log(models.information[settling, which] * variance)
    log_weight += np.log(i0e(concentration)) - ((size - north) ** 2 + (rate[2] - down) ** 2) / (2 * variance)
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    some = weight > NEGLIGIBLE
    weight, concentration, rate = weight[some] / weight[some].sum(), concentration[some], rate[:, some]
    heading, sigma, low, high = posterior(np.arctan2(-rate[1], rate[0]), concentration, weight)
    return Amortised(
        heading=heading,
        sigma=sigma,
        low=low,
        high=high,
        rate_l=rate @ weight,
        tones=float(weight @ ((models.first >= 0) + (models.second >= 0.0))[which[some]]),
        settling=float(weight @ (settling[some] > 0)),
        bumps=bumps,
        excess=excess,
        surprise=surprise,
    )


def posterior(centre: Array, concentration: Array, weight: Array) -> tuple[float, float, float, float]:
    """Mean, rms deviation and shortest 95 % interval, from the mean, of a mixture of von Mises laws, rad.

    The laws are gathered in bins of equal concentration (width 0.1 in the logarithm) and of centre, so that each
    bin of concentration costs one convolution on the circle.
    """
    from scipy.special import i0e, i1e

    step = 2 * np.pi / POINTS
    pull = weight * i1e(concentration) / i0e(concentration)
    mean = float(np.arctan2(pull @ np.sin(centre), pull @ np.cos(centre)))
    off = (centre - mean + np.pi) % (2 * np.pi) - np.pi
    spread = float(np.sqrt(weight @ (off**2 + 1 / np.maximum(concentration, 0.1))))
    # A window of the circle that holds the mass; a mixture wider than a quarter turn takes the whole circle.
    reach = np.pi if spread > np.pi / 12 else 12 * spread
    step = 2 * reach / POINTS
    place = np.clip((off + reach) / step, 0, POINTS - 1).astype(int)
    bins = np.round(10 * np.log(np.maximum(concentration, 1e-3))).astype(int)
    angle = (np.arange(POINTS) - POINTS // 2) * step
    density = np.zeros(POINTS)
    for number in np.unique(bins):
        here = bins == number
        lines = np.bincount(place[here], weight[here], minlength=POINTS)
        kernel = np.exp(np.exp(number / 10) * (np.cos(angle) - 1))
        density += np.fft.irfft(np.fft.rfft(lines) * np.fft.rfft(np.fft.ifftshift(kernel / kernel.sum())), POINTS)
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
