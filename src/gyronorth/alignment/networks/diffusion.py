"""The diffusion denoiser without its network: noise schedule, normalisation, samplers.

Plain NumPy, for training and for exported bundles alike: the network enters as a function
`predict(x, t) -> noise` with x of shape (n, samples, 3), float32, and t the step, 1..T.
Equation labels are those of arXiv 2507.21245, "Diffusion Denoiser-Aided Gyrocompassing".
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Predict = Callable[[NDArray[np.float32], int], NDArray[np.float32]]

#: Steps of a schedule; the paper has 1000.
MOST_STEPS = 100_000
#: Seeds lie below this, and mean and deviation of a data set, rad/s, no further from zero than that.
SEEDS, LARGEST_RATE = 1 << 63, 1e9
#: Unit of data that are not normalised, rad/s: the recordings of the paper are in deg/s.
RAW_UNIT = np.pi / 180


@dataclass(frozen=True)
class Schedule:
    """The linear noise schedule (eq:16); arrays are indexed by the step t = 0..T, t = 0 being clean."""

    steps: int = 1000  # T
    beta_min: float = 1e-4
    beta_max: float = 5e-4

    def __post_init__(self) -> None:
        if not 1 <= self.steps <= MOST_STEPS:
            raise ValueError(f"steps is {self.steps}; 1 to {MOST_STEPS} steps are expected.")
        if not 0 < self.beta_min <= self.beta_max < 1:
            raise ValueError(
                f"beta_min, beta_max are {self.beta_min}, {self.beta_max}; 0 < min <= max < 1 is expected."
            )

    @cached_property
    def beta(self) -> NDArray[np.float64]:
        """Variance added at each step, shape (T + 1,): beta_T is beta_max, beta_1 a step above beta_min (eq:16)."""
        beta = self.beta_min + np.arange(self.steps + 1) * (self.beta_max - self.beta_min) / self.steps
        beta[0] = 0.0
        return beta

    @cached_property
    def alpha_bar(self) -> NDArray[np.float64]:
        """Cumulative product of alpha_t = 1 - beta_t, shape (T + 1,), 1 at t = 0 (eq:13, eq:14)."""
        return np.cumprod(1 - self.beta, dtype=np.float64)

    @cached_property
    def noise_ratio(self) -> NDArray[np.float64]:
        """Noise over signal gain at each step, sqrt(1 - abar) / sqrt(abar), shape (T + 1,) (eq:17)."""
        return np.asarray(np.sqrt(1 / self.alpha_bar - 1), dtype=float)

    def matched_step(self, noise: NDArray[np.float64]) -> NDArray[np.int64]:
        """The step, 0..T, whose noise ratio is nearest to white noise of standard deviation `noise`, shape (n,)."""
        edges = (self.noise_ratio[1:] + self.noise_ratio[:-1]) / 2
        return np.searchsorted(edges, noise)


@dataclass(frozen=True)
class Sampler:
    """How the reverse process is run: from where, to where, in how many jumps, with noise or without."""

    kind: Literal["chain", "ddim"] = "chain"  # eq:18, or the deterministic DDIM step (arXiv 2010.02502, eq. 12)
    t_back: int = 950  # last step reached (III-B)
    start: Literal["last", "matched"] = "last"  # from T as in the paper, or where the recording's noise level is
    jumps: int | None = None  # network evaluations; None: one per step
    noise: bool = True  # the sampling noise of eq:18; ddim has none
    seed: int = 0  # of the sampling noise

    def __post_init__(self) -> None:
        if not 0 <= self.seed < SEEDS:
            raise ValueError(f"seed is {self.seed}; 0 to {SEEDS - 1} is expected.")
        if not 0 <= self.t_back < MOST_STEPS:
            raise ValueError(f"t_back is {self.t_back}; a step from 0 to {MOST_STEPS - 1} is expected.")
        if self.jumps is not None and not 1 <= self.jumps <= MOST_STEPS:
            raise ValueError(f"jumps is {self.jumps}; 1 to {MOST_STEPS} are expected.")

    def table(self, schedule: Schedule, start: int) -> list[Jump]:
        """The jumps from step `start` down to t_back; empty if there is nothing to do."""
        if start <= self.t_back:
            return []
        count = min(self.jumps or schedule.steps, start - self.t_back)
        ends = np.round(np.linspace(start, self.t_back, count + 1)).astype(int)
        jump = _chain_jump if self.kind == "chain" else _ddim_jump
        return [jump(schedule, int(a), int(b)) for a, b in pairwise(ends)]


@dataclass(frozen=True)
class Jump:
    """x -> gain x - weight predict(x, step) + sigma z, with z white and of unit variance."""

    step: int
    gain: float
    weight: float
    sigma: float


def _chain_jump(schedule: Schedule, start: int, stop: int) -> Jump:
    """Steps `start` .. `stop` + 1 of eq:18 with the noise prediction held: exact for a single step.

    sigma_t of eq:18 is the variance beta_t; the step from t = 1 to 0 adds no noise.
    """
    gain, weight, variance = 1.0, 0.0, 0.0
    for t in range(start, stop, -1):
        scale = 1 / np.sqrt(1 - schedule.beta[t])
        gain *= scale
        weight = scale * (weight + schedule.beta[t] / np.sqrt(1 - schedule.alpha_bar[t]))
        variance = scale**2 * variance + (schedule.beta[t] if t > 1 else 0.0)
    return Jump(start, float(gain), float(weight), float(np.sqrt(variance)))


def _ddim_jump(schedule: Schedule, start: int, stop: int) -> Jump:
    """The deterministic DDIM step (Song et al., arXiv 2010.02502, eq. 12 with sigma = 0)."""
    before, after = schedule.alpha_bar[start], schedule.alpha_bar[stop]
    gain = np.sqrt(after / before)
    return Jump(start, float(gain), float(gain * np.sqrt(1 - before) - np.sqrt(1 - after)), 0.0)


@dataclass(frozen=True)
class Normalisation:
    """What the data are brought to zero mean and unit deviation over (III-C).

    `sample`: the three channels of one time sample; `sequence`: all values of one sequence;
    `channel`: one channel of one sequence; `dataset`: `mean` and `std` recorded in training;
    `none`: raw data in deg/s. A zero deviation counts as one.
    """

    kind: Literal["sample", "sequence", "channel", "dataset", "none"] = "sequence"
    mean: float = 0.0  # rad/s, of the data set; used by `dataset` only
    std: float = 1.0  # rad/s

    def __post_init__(self) -> None:
        if not (abs(self.mean) <= LARGEST_RATE and 0 <= self.std <= LARGEST_RATE):
            raise ValueError(
                f"mean, std are {self.mean}, {self.std}; at most {LARGEST_RATE:g} rad/s are expected, std not negative."
            )

    def moments(self, gyro: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mean and deviation, rad/s, that broadcast against gyro (n, samples, 3)."""
        if self.kind in ("dataset", "none"):
            mean, std = (self.mean, self.std) if self.kind == "dataset" else (0.0, RAW_UNIT)
            return np.full((1, 1, 1), mean), np.full((1, 1, 1), std)
        axis = {"sample": (2,), "sequence": (1, 2), "channel": (1,)}[self.kind]
        mean, std = gyro.mean(axis, keepdims=True), gyro.std(axis, keepdims=True)
        # A constant channel keeps the rounding error of its own mean: that is zero too.
        return mean, np.where(std > 1e-12 * np.abs(mean), std, 1.0)

    def recorded(self, gyro: NDArray[np.float64]) -> Normalisation:
        """The same with mean and deviation of the data set gyro (n, samples, 3), rad/s, recorded."""
        return Normalisation(self.kind, float(gyro.mean()), float(gyro.std()))


def check_steps(sampler: Sampler, schedule: Schedule) -> None:
    """Raise `ValueError` where the last step that a sampler reaches lies outside of the schedule."""
    if sampler.t_back >= schedule.steps:
        raise ValueError(f"sampler.t_back is {sampler.t_back}; below schedule.steps = {schedule.steps} is expected")


def white_noise(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Deviation of the white noise of x (n, samples, 3), shape (n,): from first differences, blind to drift.

    A root mean square and no median (`arrays.robust_noise`): the step at which a bundle starts, and its domain, were
    found with this one, and are trained for it.
    """
    return np.asarray(np.sqrt(np.mean(np.diff(x, axis=1) ** 2, axis=(1, 2)) / 2), dtype=float)


def reverse(
    predict: Predict, x: NDArray[np.float64], jumps: Iterable[Jump], noise: Callable[[], NDArray[np.float64]] | None
) -> NDArray[np.float64]:
    """Run the jumps on x (n, samples, 3); `noise()` gives a unit white draw of the same shape, None leaves it out."""
    for jump in jumps:
        x = jump.gain * x - jump.weight * predict(x.astype(np.float32), jump.step)
        if noise is not None and jump.sigma > 0:
            x = x + jump.sigma * noise()
    return x


def denoise(
    predict: Predict, gyro: NDArray[np.float64], *, schedule: Schedule, sampler: Sampler, normalisation: Normalisation
) -> NDArray[np.float64]:
    """Denoised angular rate: normalise, reverse process, de-normalise (III-C).

    Parameters
    ----------
    gyro : ndarray, shape (n, samples, 3)
        Angular rate, rad/s.

    Returns
    -------
    ndarray, shape (n, samples, 3)
        rad/s, on the scale of the input.

    Notes
    -----
    `start="last"` takes the recording for x_T as it is, as the paper does. `start="matched"` finds the
    step s whose noise ratio is the recording's, takes sqrt(abar_s) x for x_s, and divides the
    result by sqrt(abar) of t_back; a recording that is cleaner than t_back is left alone.

    The sampling noise of a recording is drawn from (seed, checksum of the recording): it is
    reproducible, differs between recordings, and does not depend on what else is in the batch.
    """
    mean, std = normalisation.moments(gyro)
    x = (gyro - mean) / std
    noise = _sampling_noise(gyro, sampler.seed) if sampler.noise and sampler.kind == "chain" else None
    if sampler.start == "last":
        out = reverse(predict, x, sampler.table(schedule, schedule.steps), noise)
        return out * std + mean
    steps = schedule.matched_step(white_noise(x))
    out = x.copy()
    for step in np.unique(steps[steps > sampler.t_back]):
        rows = steps == step
        draw = _sampling_noise(gyro[rows], sampler.seed) if noise is not None else None
        scaled = reverse(predict, np.sqrt(schedule.alpha_bar[step]) * x[rows], sampler.table(schedule, int(step)), draw)
        out[rows] = scaled / np.sqrt(schedule.alpha_bar[sampler.t_back])
    return out * std + mean


def _sampling_noise(gyro: NDArray[np.float64], seed: int) -> Callable[[], NDArray[np.float64]]:
    # Rounded to 1e-9 rad/s (0.2 deg/h on one sample): rounding errors upstream do not change the draw.
    rounded = np.asarray(np.round(gyro * 1e9), dtype=np.int64)
    keys = [zlib.crc32(np.ascontiguousarray(one).tobytes()) for one in rounded]
    generators = [np.random.default_rng([seed, key]) for key in keys]
    shape = gyro.shape[1:]
    return lambda: np.stack([generator.standard_normal(shape) for generator in generators])
