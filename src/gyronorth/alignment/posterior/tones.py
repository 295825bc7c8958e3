"""Tones and bumps: what is fast against a block, taken out of the block means under several explanations.

Given the frequencies of tones and the samples in bumps, a recording at a few Hz is block means plus tones of normal
amplitudes plus noise, so that its likelihood in the block means is normal: `Cleaned` holds its centre and covariance,
and what the explanation as a whole is worth. The search is that of `tones.proposals`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gyronorth.alignment.posterior.blocks import COUNT
from gyronorth.alignment.tones.proposals import exploring
from gyronorth.alignment.tones.search import TONE_RATE, white_of
from gyronorth.alignment.tones.side_by_side import Proposing, Search
from gyronorth.arrays import Array, Mask, median
from gyronorth.sensor import TriadErrors
from gyronorth.sensor.law import NoiseLaw

#: Prior weights of no, one and two tones, and the probability of a bump in 100 s.
TONES, BUMP = (0.66, 0.16, 0.18), 0.1
#: Lines that are looked for beside an accelerometer, and the prior weights of so many, beside `TONES[0]` of none.
LINES, LINED = 4, {1: 0.16, 2: 0.18, 4: 0.1}
#: Steps of their frequencies.
REFINED = 3
#: Rate of a bump, rad/s per axis.
BUMP_RATE = np.radians(0.05)
#: Explanations kept, and the least share of the best that one must have.
KEPT, LEAST = 6, 3e-2
#: Power of a line, and square of a sample, in units of white noise, from which tones or bumps are looked for.
LINE, SAMPLE = 6.0, 20.0
#: Square of a sample off its neighbours, in units of white noise, that lies in a bump, and how many
#: blocks with bumps are tried.
BUMP_SQUARE, BUMPED = 30.0, (1, 2, 4, 8)
#: Fewest samples in which tones are looked for.
FEWEST = 90


@dataclass(frozen=True)
class Cleaned:
    """Block means of one recording under one explanation of its fast part."""

    rate_l: Array  # (COUNT, 3) rad/s
    added: Array  # (COUNT, r) root of their covariance beyond that of white noise, one axis, rad/s
    log_weight: float  # prior and likelihood of the explanation, over that of no tones and bumps
    white: float  # noise density at the rate of the samples, rad/sqrt(s)
    tones: int
    bumped: int  # samples


def shows_tones(fine_l: Array, *, rate_hz: float, errors: TriadErrors) -> bool:
    """Whether one recording (n, 3) may hold a tone or a bump: a line or a sample that stands out of noise and drift."""
    white = white_of(fine_l)
    off = fine_l - median(fine_l, axis=0)
    # Tapered, so that a trend does not leak into the lines.
    taper = np.hanning(len(off))[:, None]
    power = np.sum(np.abs(np.fft.rfft(taper * off, axis=0)[2:]) ** 2, axis=1) / (np.sum(taper**2) * white**2)
    power /= _drift_over_white(len(off), rate_hz, replace(errors, white=white / np.sqrt(rate_hz)))[2:]
    # Of white noise the power is Gamma(3), a sample's square chi-square with 3 degrees of freedom.
    spread = max(white, 1.4826 * float(median(np.abs(off))))
    return bool(power.max() > LINE + 1.3 * np.log(len(power)) or np.sum(off**2, axis=1).max() > SAMPLE * spread**2)


def _drift_over_white(n: int, rate_hz: float, errors: TriadErrors) -> Array:
    """Spectrum of noise and drift over that of white noise at the frequencies of `rfft`; 1 at frequency 0."""
    f = np.fft.rfftfreq(n, 1 / rate_hz)
    drift = NoiseLaw(replace(errors, white=0.0, quantisation=0.0)).spectrum(f[1:], rate_hz).sum(axis=-1)
    return np.concatenate([[1.0], 1 + drift / max(errors.white**2, np.finfo(float).tiny)])


def by_periodogram(
    rate: NDArray[np.float32], _: NDArray[np.float32], cycles: NDArray[np.float32]
) -> tuple[Array, Array]:
    """Proposals without a network: peaks of the periodogram, samples that stand out of their neighbours.

    Parameters and returns are those of `tones.proposals.Propose`.
    """
    n = len(rate)
    off = rate - rate.mean(axis=0)
    beside = _neighbours(off)
    odds = np.sum((off - beside) ** 2, axis=1) - BUMP_SQUARE
    quiet = np.where(odds[:, None] > 0, beside, off)
    phase, tapered = 2 * np.pi * np.outer(cycles, np.arange(n)), quiet * np.hanning(n)[:, None]
    power = np.asarray(np.sum((np.cos(phase) @ tapered) ** 2 + (np.sin(phase) @ tapered) ** 2, axis=1), dtype=float)
    peak = np.r_[True, power[1:] > power[:-1]] & np.r_[power[:-1] >= power[1:], True]
    return odds, np.where(peak, power, 1e-6 * power)


def _neighbours(x: Array) -> Array:
    """Median of each of the samples (n, k) and the six on each side of it; the last one is beside the first."""
    wide = np.concatenate([x[-6:], x, x[:6]])
    return np.asarray(np.partition(np.lib.stride_tricks.sliding_window_view(wide, 13, axis=0), 6, axis=-1)[..., 6])


def periodograms(asked: Sequence[Proposing]) -> list[tuple[Array, Array]]:
    """The same of several recordings, for `searched`."""
    return [by_periodogram(one.rate, one.index, one.cycles) for one in asked]


def bumped_blocks(fine_l: Array) -> list[tuple[int, ...]]:
    """Blocks of one recording (q COUNT, 3) with samples that stand out of their neighbours: the worst, and more.

    None where there are too many: that is motion, of which the accelerometer sees all.
    """
    off = fine_l / white_of(fine_l)
    beside = _neighbours(off)
    square = np.sum((off - beside) ** 2, axis=1)
    # What sways all along is no bump: 2.366 is the median of chi-square with 3 degrees of freedom.
    square = square / max(1.0, float(median(square)) / 2.366)
    wide = np.maximum(square, np.maximum(np.roll(square, 1), np.roll(square, -1)))
    worst = wide.reshape(COUNT, -1).max(axis=1)
    order = [int(block) for block in np.argsort(-worst) if worst[block] > BUMP_SQUARE]
    if len(order) > BUMPED[-1]:
        return []
    return [tuple(sorted(order[:count])) for count in BUMPED if count <= len(order)]


def strongest(fine_l: Array, *, rate_hz: float) -> list[tuple[float, float]]:
    """Frequency, Hz, and rms size, rad/s, of the `LINES` strongest lines of one recording (n, 3).

    Each is the highest peak of what those before it leave; then all are fitted together, so that lines of several axes
    may lie close together.
    """
    n = len(fine_l)
    seen: Array = np.asarray(np.hanning(n)[:, None] * (fine_l - fine_l.mean(axis=0)), dtype=float)
    cycles: Array = np.zeros(0)  # a sample
    wave, size, left = _fitted(seen, cycles)
    for _ in range(LINES):
        power = np.sum(np.abs(np.fft.rfft(left, n=4 * n, axis=0)) ** 2, axis=1)
        cycles = np.append(cycles, (4 + int(np.argmax(power[4:]))) / (4 * n))  # one in the recording or more
        wave, size, left = _fitted(seen, cycles)
    time = 2 * np.pi * (np.arange(n) - (n - 1) / 2)[:, None, None]
    for _ in range(REFINED):
        cosine, sine = wave[:, 1 : LINES + 1, None], wave[:, LINES + 1 :, None]
        slope: Array = np.asarray(time * (cosine * size[LINES + 1 :] - sine * size[1 : LINES + 1]), dtype=float)
        slope = slope.reshape(n, -1) - wave @ _solved(wave, slope.reshape(n, -1))
        step = _solved(np.swapaxes(slope.reshape(n, LINES, 3), 1, 2).reshape(-1, LINES), left.ravel())
        cycles = np.clip(cycles + np.clip(step, -0.5 / n, 0.5 / n), 1 / n, 0.5)
        wave, size, left = _fitted(seen, cycles)
    rms = np.sqrt(np.sum(size[1:].reshape(2, LINES, 3) ** 2, axis=(0, 2)) / 6)
    return [(float(cycles[i]) * rate_hz, float(rms[i])) for i in np.argsort(-rms)]


def _fitted(seen: Array, cycles: Array) -> tuple[Array, Array, Array]:
    """A constant, cosines and sines (n, 1 + 2 k) under the taper, their sizes (1 + 2 k, 3), and what they leave."""
    n = len(seen)
    phase = 2 * np.pi * cycles * (np.arange(n) - (n - 1) / 2)[:, None]
    wave = np.hanning(n)[:, None] * np.concatenate([np.ones((n, 1)), np.cos(phase), np.sin(phase)], axis=1)
    size = _solved(wave, seen)
    return wave, size, np.asarray(seen - wave @ size, dtype=float)


def _solved(columns: Array, seen: Array) -> Array:
    """Least squares of columns that may be next to equal."""
    return np.asarray(np.linalg.lstsq(columns, seen, rcond=1e-6)[0], dtype=float)


def cleaning(fine_l: Array, *, rate_hz: float, errors: TriadErrors) -> Search[list[Cleaned]]:
    """Explanations of one recording (q COUNT, 3), the first that without tones and bumps; a search of `searched`."""
    white = white_of(fine_l) / np.sqrt(rate_hz)
    if len(fine_l) < FEWEST:
        return [replace(tone_fit(fine_l, rate_hz, white, np.zeros(0), None).explained((), 0.0), log_weight=0.0)]
    # In steps of a quarter octave, so that recordings of one unit share the factors of a law.
    louder = 2 ** max(round(4 * np.log2(white / errors.white)) / 4, 0.0) if errors.white > 0 else 1.0
    seeking = replace(errors, white=louder * errors.white or white, quantisation=0.0)
    looked = yield from exploring(fine_l, rate_hz=rate_hz, errors=seeking)
    models, masked, share = looked.models, looked.masked, looked.models.posterior.sum(axis=0)
    bumps = np.count_nonzero(np.diff(masked.astype(int), prepend=0) > 0)
    chance = bumps * float(np.log(BUMP / rate_hz / 100))
    likely = [n for n in np.argsort(-share)[:KEPT] if share[n] >= LEAST * share.max()]
    chosen = [tuple(int(t) for t in (models.first[n], models.second[n]) if t >= 0) for n in likely]
    used = sorted({t for some in chosen for t in some})
    frequencies = looked.lines.frequency[used]
    sides = [(tone_fit(fine_l, rate_hz, white, frequencies, None), 0.0)]
    if bumps:
        sides.append((tone_fit(fine_l, rate_hz, white, frequencies, masked), chance))
    plain = sides[0][0].explained((), float(np.log(TONES[0])))
    found = [plain]
    for some in chosen:
        prior = np.log(TONES[len(some)]) + looked.lines.log_prior[list(some)].sum() + np.log(max(len(some), 1))
        found += [
            one.explained([used.index(t) for t in some], prior + more) for one, more in sides if some or one.bumped
        ]
    if bumps and () not in chosen:
        found.append(sides[1][0].explained((), float(np.log(TONES[0])) + chance))
    base = plain.log_weight - float(np.log(TONES[0]))
    return [replace(one, log_weight=one.log_weight - base) for one in found]


@dataclass(frozen=True)
class ToneFit:
    """A recording and tones of some frequencies, whose samples have so much noise, the mean of each block apart."""

    white: float  # noise density, rad/sqrt(s)
    bumped: int  # samples in bumps
    spread: Array  # (COUNT, b) root of the variance of block means beyond that of white noise, by bumps, rad/s
    rate_l: Array  # (COUNT, 3) block means
    mean: Array  # (COUNT, 2 f) block means of the tones: cosines, then sines
    gram: Array  # (2 f, 2 f) of the tones about their block means, in units of the noise, and of their prior
    cross: Array  # (2 f, 3) of the same with the rates
    log_weight: float  # without tones

    def explained(self, some: Sequence[int], log_prior: float) -> Cleaned:
        """Those of the given numbers fitted and taken out, whose normal amplitudes leave the block means uncertain."""
        number = [*some, *(t + len(self.gram) // 2 for t in some)]
        factor = np.linalg.cholesky(self.gram[number][:, number])
        root: Array = np.asarray(np.linalg.inv(factor), dtype=float)
        left, mean = root @ self.cross[number], self.mean[:, number] @ root.T
        added = np.concatenate([mean, self.spread], axis=1)
        log_weight = self.log_weight - 3 * float(np.sum(np.log(np.diag(factor)))) + 0.5 * float(np.sum(left**2))
        return Cleaned(self.rate_l - mean @ left, added, log_prior + log_weight, self.white, len(some), self.bumped)


def tone_fit(fine_l: Array, rate_hz: float, white: float, frequencies: Array, masked: Mask | None) -> ToneFit:
    """The level rate (n, 3), rad/s, and tones of the given frequencies, Hz; a sample of a bump is uncertain."""
    n, size = len(fine_l), len(fine_l) // COUNT
    bumped = (np.zeros(n, dtype=bool) if masked is None else masked).reshape(COUNT, size)
    variance = white**2 * rate_hz + BUMP_RATE**2 * bumped
    phase = 2 * np.pi * (np.arange(n)[:, None] + 0.5) / rate_hz * frequencies
    # Rates are means over a sample: a tone is damped by its sinc.
    damped = TONE_RATE / np.sqrt(2) * np.tile(np.sinc(frequencies / rate_hz), 2)
    columns = np.concatenate([fine_l, np.concatenate([np.cos(phase), np.sin(phase)], axis=1) * damped], axis=1)
    blocks, weight = columns.reshape(COUNT, size, -1), 1 / variance[:, None]
    information = weight.sum(axis=2)
    mean = weight @ blocks / information[:, None]
    off = ((blocks - mean) * np.sqrt(weight).reshape(COUNT, size, 1)).reshape(n, -1)
    product, mean = off[:, 3:].T @ off, mean[:, 0]
    log_det = float(np.sum(np.log(variance)) + np.sum(np.log(information)))
    return ToneFit(
        white=white,
        bumped=int(bumped.sum()),
        spread=np.diag(np.sqrt(np.maximum(1 / information[:, 0] - white**2 * rate_hz / size, 0.0)))[
            :, bumped.any(axis=1)
        ],
        rate_l=mean[:, :3],
        mean=mean[:, 3:],
        gram=np.eye(len(product)) + product[:, 3:],
        cross=product[:, :3],
        log_weight=-1.5 * log_det - 0.5 * float(np.sum(off[:, :3] ** 2)),
    )
