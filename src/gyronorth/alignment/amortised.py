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
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyronorth.alignment.bayes import UNKNOWN_BIAS, white_of
from gyronorth.alignment.evidence import Columns, Evidence, Law, columns, evidence, law, network_axes
from gyronorth.angles import wrap_heading
from gyronorth.earth import EARTH_RATE
from gyronorth.sensor import TriadErrors

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: From rates in units of noise less their median (n, 3), sample numbers from the middle (n,) and
#: frequencies in cycles a sample (f,): log odds of a bump (n,) and log weights of tones (f,).
Propose = Callable[[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]], tuple[Array, Array]]

#: Frequencies kept of the proposals.
KEPT = 16
#: Squared residual of a sample over three axes, in variances, beyond which it lies in a bump
#: (chi-square with 3 degrees of freedom: 1e-5); rounds of comparing the mask with the fit.
BUMP_CHI2, ROUNDS = 26.0, 3
#: Expected tones at a frequency above which it is divided into so many, at most so many in all.
FINER, MOST = ((0.15, 7), (0.01, 3), (1e-4, 1)), 44
#: The mean squared residual scatters by sqrt(2 / its number): beyond so many of these the law does not hold.
EXCESS_SIGMA = 4.0
#: Share of the samples left out above which the law does not hold either: these are not bumps.
MOST_BUMPED = 0.2
#: Models less likely than this are left out of the average.
NEGLIGIBLE = 1e-5
#: Models less likely than the best by this in the logarithm are not looked at: what is known of the constant
#: changes weights by less.
FAR = 30.0
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
    settling: float  # probability that the bias settles
    walk: float  # probability that it walks
    bumps: int  # samples left out
    excess: float  # mean squared residual over the law's variance; above `fits`' limit sigma was scaled up by its root
    fits: bool  # whether the law explains the recording


def amortised(
    gyro_l: ArrayLike, propose: Propose, *, rate_hz: float, latitude: float, errors: TriadErrors | None
) -> Amortised:
    """Heading of one level recording that may sway, settle and be bumped.

    Parameters
    ----------
    gyro_l : array_like, shape (n, 3)
        Angular rate in the level frame, rad/s, at about 3 Hz (each sample a mean); 30-300 s.
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
    gyro_l = np.asarray(gyro_l, dtype=float)
    biases = UNKNOWN_BIAS if errors is None else (errors.turn_on_bias,)
    if errors is None or errors.white == 0:
        errors = replace(errors or TriadErrors(), white=white_of(gyro_l) / np.sqrt(rate_hz))
    known = law(len(gyro_l), rate_hz, errors)
    noise = errors.white * np.sqrt(rate_hz)
    scaled = (gyro_l - np.median(gyro_l, axis=0)) / noise
    odds, weight = propose(scaled.astype(np.float32), *network_axes(len(gyro_l), rate_hz))
    masked = grown(odds > 0)
    kept = np.sort(np.argsort(-weight)[:KEPT])
    for _ in range(ROUNDS):
        seen = columns(known, gyro_l, masked, known.frequency[kept])
        models = evidence(known, seen, known.log_prior[kept])
        square = np.sum(_residual(known, gyro_l, seen, models) ** 2, axis=1)
        again = grown(square > BUMP_CHI2 * max(1.0, float(np.median(square[~masked])) / 2.366))
        if (again == masked).all():
            break
        masked = again
    frequency, log_prior = _finer(known, kept, models.shares(len(kept)))
    seen = columns(known, gyro_l, masked, frequency)
    models = evidence(known, seen, log_prior)
    free = 3 * int((~masked).sum())
    excess = float(np.sum(_residual(known, gyro_l, seen, models)[~masked] ** 2)) / free
    law_holds = excess <= 1 + EXCESS_SIGMA * np.sqrt(2 / free)
    if not law_holds:
        models = evidence(known, seen, log_prior, scale=float(np.sqrt(excess)))
    fits = bool(law_holds and masked.mean() <= MOST_BUMPED)
    return _conclude(models, latitude, np.array(biases), bumps=int(masked.sum()), excess=excess, fits=fits)


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


def _residual(known: Law, gyro_l: Array, seen: Columns, models: Evidence) -> Array:
    """Whitened residual (n, 3) of all samples from the likeliest model, fitted to those that are not masked."""
    slow, which = np.unravel_index(np.argmax(models.posterior), models.log_weight.shape)
    f, k = len(seen.frequency), len(known.share)
    tones = [t for t in (models.first[which], models.second[which]) if t >= 0]
    settles = [] if slow == 0 else [slow - 1] if slow <= k else list(range(k, known.settling.shape[1]))
    parts = [seen.known[:, [0, *(4 + s for s in settles)]], *(seen.tone[:, [t, t + f]] for t in tones)]
    inside = np.concatenate(parts, axis=1)
    free = np.ones(inside.shape[1])
    free[0] = 0.0
    fitted = np.linalg.solve(inside.T @ inside + np.diag(free), inside.T @ seen.known[:, 1:4])
    whole = known.tones(seen.frequency[tones])[:, _interleaved(len(tones))]
    design = np.concatenate([known.constant[:, None], known.settling[:, settles], whole], axis=1)
    return known.whitened(gyro_l) - design @ fitted


def _interleaved(tones: int) -> list[int]:
    """Cosine and sine of one tone after the other, from all cosines, then all sines."""
    return [part * tones + tone for tone in range(tones) for part in (0, 1)]


def _conclude(models: Evidence, latitude: float, biases: Array, *, bumps: int, excess: float, fits: bool) -> Amortised:
    """Weigh the models by what is known of the constant too, and average their headings, as `bayes` does."""
    from scipy.special import i0e

    north, down = EARTH_RATE * np.cos(latitude), -EARTH_RATE * np.sin(latitude)
    log_weight = models.log_weight - 1.5 * np.log(models.information)
    slow, which = np.nonzero(log_weight > log_weight.max() - FAR)
    rate, information = models.rate[:, slow, which], models.information[slow, which]
    variance = 1 / information + biases[:, None] ** 2  # (biases, models)
    size = np.hypot(rate[0], rate[1])
    concentration = size * north / variance
    log_weight = models.log_weight[slow, which] - 1.5 * np.log(information * variance)
    log_weight += np.log(i0e(concentration)) - ((size - north) ** 2 + (rate[2] - down) ** 2) / (2 * variance)
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    bias, some = np.nonzero(weight > NEGLIGIBLE)
    weight, concentration = weight[bias, some] / weight[bias, some].sum(), concentration[bias, some]
    slow, which, rate, last = slow[some], which[some], rate[:, some], len(models.log_weight) - 1
    heading, sigma, low, high = posterior(np.arctan2(-rate[1], rate[0]), concentration, weight)
    return Amortised(
        heading=heading,
        sigma=sigma,
        low=low,
        high=high,
        rate_l=rate @ weight,
        tones=float(weight @ ((models.first[which] >= 0) + (models.second[which] >= 0.0))),
        settling=float(weight @ ((slow > 0) & (slow < last))),
        walk=float(weight @ (slow == last)),
        bumps=bumps,
        excess=excess,
        fits=fits,
    )


def posterior(centre: Array, concentration: Array, weight: Array) -> tuple[float, float, float, float]:
    """Mean, rms deviation and shortest 95 % interval, from the mean, of a mixture of von Mises laws, rad.

    The laws are gathered in bins of equal concentration (width 0.1 in the logarithm) and of centre, so that each
    bin of concentration costs one convolution on the circle.
    """
    from scipy.special import i0e, i1e

    pull = weight * i1e(concentration) / i0e(concentration)
    mean = float(np.arctan2(pull @ np.sin(centre), pull @ np.cos(centre)))
    off = (centre - mean + np.pi) % (2 * np.pi) - np.pi
    spread = float(np.sqrt(weight @ (off**2 + 1 / np.maximum(concentration, 0.1))))
    # A window that holds the mass, or the whole circle.
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
