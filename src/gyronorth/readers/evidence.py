"""What physics says of numbers whose unit nobody states.

Gravity shows the unit of any accelerometer, Earth rate that of a good gyro, noise that of a poor one within bounds.

Proposals only: whoever reads the file declares them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR
from gyronorth.arrays import mean_of_rows, median, robust_noise
from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY
from gyronorth.frozen import frozen
from gyronorth.readers.options import ACCEL_PROPOSED, ACCEL_UNITS, GYRO_PROPOSED, GYRO_UNITS

#: The norm of a mean that is gravity, or Earth rate, within these shares.
NEAR_GRAVITY, NEAR_EARTH_RATE = 0.1, 0.25
#: Mean rate, in Earth rates, and angle random walk, rad/sqrt(s), of a gyro at rest.
RATES_AT_REST, WALKS = (0.3, 2000.0), (1e-5 * DEG_PER_SQRT_HOUR, 30 * DEG_PER_SQRT_HOUR)
#: Parts into which samples are cut; medians over them ignore a turn in some.
PARTS = 11
#: Units of increments that are proposed, by the unit of their sum over a second.
GYRO_INCREMENTS, ACCEL_INCREMENTS = ("rad/s", "deg/s", "arcsec/s"), ("m/s2", "g")
#: Sample intervals of which an increment may cover one, where a logger keeps one of so many.
KEPT_ONE_OF = (2, 3, 4, 5, 8, 10)
#: Counts in one g that accelerometers have.
COUNTS_PER_G = tuple(float(1 << power) for power in range(8, 16))


@frozen
class Fit:
    """A unit that fits, and what the numbers are in it."""

    unit: str
    increments: bool
    size: float  # of the mean specific force, m/s^2, or the mean rate, rad/s
    certain: bool  # gravity or Earth rate is met
    scale: float | None = None  # units in one count
    interval: float | None = None  # s that an increment covers, where it is not the sample interval

    @property
    def words(self) -> str:
        """The fit for people."""
        a_sample = " a sample (increments)" if self.increments else ""
        return f"{self.unit}{a_sample}"


def accel_fits(values: NDArray[np.float64], rate_hz: float | None) -> list[Fit]:
    """Units in which the norm of the force, from raw values (n, 3), is gravity."""
    size = norm_of_parts(values)
    fits = []
    for increments, names in ((False, ACCEL_PROPOSED), (True, ACCEL_INCREMENTS)):
        if increments and rate_hz is None:
            continue
        for unit in names:
            force = size * ACCEL_UNITS[unit] * (rate_hz if increments and rate_hz else 1.0)
            if abs(force / STANDARD_GRAVITY - 1) < NEAR_GRAVITY:
                fits.append(Fit(unit, increments, force, True))
    if not fits and rate_hz is not None:
        for one_of in KEPT_ONE_OF:
            if abs(size * rate_hz * one_of / STANDARD_GRAVITY - 1) < NEAR_GRAVITY:
                interval = float(f"{1 / (rate_hz * one_of):.4g}")
                fits.append(Fit("m/s2", True, size / interval, True, interval=interval))
    if not fits and is_whole(values):
        for counts in COUNTS_PER_G:
            if abs(size / counts - 1) < NEAR_GRAVITY / 2:
                fits.append(Fit("g", False, size / counts * STANDARD_GRAVITY, True, 1 / counts))
    return fits


def gyro_fits(values: NDArray[np.float64], rate_hz: float | None, *, increments: bool | None = None) -> list[Fit]:
    """Units that raw rates (n, 3) may have, the best first; `increments` where that is known."""
    mean, errors = robust_mean(values)
    norm, error, noise = float(np.linalg.norm(mean)), float(np.linalg.norm(errors)), sample_noise(values)
    fits: list[tuple[float, Fit]] = []
    for each, names in ((False, GYRO_PROPOSED), (True, GYRO_INCREMENTS)):
        if (increments is not None and each != increments) or (each and rate_hz is None):
            continue
        for unit in names:
            factor = GYRO_UNITS[unit] * (rate_hz if each and rate_hz else 1.0)
            size, walk = norm * factor, noise * factor / np.sqrt(rate_hz or 100.0)
            near = abs(size / EARTH_RATE - 1) < NEAR_EARTH_RATE and error * factor < NEAR_EARTH_RATE * EARTH_RATE
            possible = (
                RATES_AT_REST[0] < (size + 3 * error * factor) / EARTH_RATE
                and size / EARTH_RATE < RATES_AT_REST[1]
                and (noise == 0 or WALKS[0] < walk < WALKS[1])
            )
            if near or possible:
                # Of those that are merely possible: not increments, and near to Earth rate.
                distance = abs(np.log(max(size, 1e-300) / EARTH_RATE)) + (20.0 if each and not increments else 0.0)
                fits.append((-1.0 if near else distance, Fit(unit, each, size, near)))
    return [fit for _, fit in sorted(fits, key=lambda scored: scored[0])]


def norm_of_parts(values: NDArray[np.float64]) -> float:
    """Median of the norms of the means of parts: a unit that is turned over and over feels gravity in each."""
    return float(median(np.linalg.norm(_parts(values), axis=1)))


def earth_words(size: float) -> str:
    """A mean rate, rad/s, for people."""
    return f"{size / DEG_PER_HOUR:.4g} deg/h"


def _parts(values: NDArray[np.float64], most: int = PARTS) -> NDArray[np.float64]:
    parts = max(1, min(most, len(values)))
    size = max(1, len(values) // parts)
    return mean_of_rows(values[: parts * size].reshape(parts, size, 3))


def robust_mean(values: NDArray[np.float64], most: int = PARTS) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Median of the means of `most` parts, shape (3,), and its standard error."""
    means = _parts(values, most)
    # 1.253 = sqrt(pi / 2): the standard error of a median over that of a mean, for Gaussian parts.
    error = 1.253 * means.std(axis=0, ddof=1) / np.sqrt(len(means)) if len(means) > 1 else np.full(3, np.inf)
    return median(means, axis=0), error


def sample_noise(values: NDArray[np.float64]) -> float:
    """Standard deviation of the white noise of the middle one of the axes."""
    if len(values) < 2:
        return 0.0
    return float(median(np.array([robust_noise(axis) for axis in values.T])))  # one at a time: of the recording's size


def is_whole(values: NDArray[np.float64]) -> bool:
    """Whether all are whole numbers, as counts are."""
    return bool((values == np.rint(values)).all())
