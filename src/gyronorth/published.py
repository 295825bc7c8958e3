"""The published reconstruction: 60 recordings with the real biases of an SDC500 and simulated noise.

The public notebooks of "Towards Learning-Based Gyrocompassing" (Engelsman and Klein, arXiv
2312.12121; repository ansfl/Learning-Based-MEMS-Gyrocompassing) print, for 60 recordings of
230 s at 32.11 N, the true heading, the heading of the mean rate, the mean rate and its norm,
and for another set the model-based CRMSE against duration. These figures ship with the package.

**The mean rates, and so the biases, are real. The noise is simulated**: white, of a size
that makes the CRMSE grow towards short windows as printed, and bridged, so that the mean over
the whole recording stays the printed one. The set looks selected: 1 error of 60 is below 2 deg,
where a Gaussian of the same size would give 23.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from math import cos, radians

import numpy as np
from numpy.typing import NDArray

from gyronorth.angles import DEG_PER_HOUR, angle_error, cyclic_rmse, wrap_heading
from gyronorth.arrays import Array
from gyronorth.attitude import heading_of_rate
from gyronorth.earth import EARTH_RATE
from gyronorth.errors import InputError
from gyronorth.recording import Note, Recording

#: Latitude of the published recordings, rad: the paper, section IV-A.
LATITUDE = radians(32.11)
#: Length of each published recording, s.
DURATION = 230.0
#: Name of the set: what learns from it carries this as its session.
SESSION = "published"
#: The durations from which the noise is fitted, and the one it is counted from, s.
LONGEST_PRINTED = 240.0


@dataclass(frozen=True)
class Published:
    """What the notebooks print of 60 recordings."""

    heading_true: Array  # (60,) rad
    heading_mean: Array  # (60,) heading of the mean rate, rad
    mean_rate: Array  # (60, 3) levelled mean rate, rad/s


@dataclass(frozen=True)
class NoiseFit:
    """The white noise that explains the growth of the model-based CRMSE towards short durations."""

    arw: float  # angle random walk, rad/sqrt(s)
    duration: Array  # (k,) s
    printed: Array  # (k,) printed CRMSE, rad
    fitted: Array  # (k,) the same from the printed one at the longest duration and the noise, rad


@dataclass(frozen=True)
class Twin:
    """Levelled angular rate of recordings of known heading on one time grid."""

    gyro_l: Array  # (m, n, 3) rad/s
    heading_true: Array  # (m,) rad
    rate_hz: float
    arw: float  # of the noise, rad/sqrt(s)

    @property
    def duration(self) -> float:
        """Length of each recording, s."""
        return self.gyro_l.shape[1] / self.rate_hz

    def windows(self, duration: float) -> tuple[Array, Array, NDArray[np.int64]]:
        """Windows side by side from the start: rates (m, n, 3), true headings (m,), recordings (m,).

        Raises
        ------
        InputError
            If no window of `duration` s fits.
        """
        samples = round(duration * self.rate_hz)
        count = self.gyro_l.shape[1] // samples if samples else 0
        if count == 0:
            raise InputError(f"A window of {duration:g} s came in; 1 sample to {self.duration:g} s fit a recording.")
        parts = self.gyro_l[:, : count * samples].reshape(-1, samples, 3)
        recording = np.repeat(np.arange(len(self.gyro_l)), count)
        return parts, self.heading_true[recording], recording

    def recording(self, index: int) -> Recording:
        """One recording as if read from a file: level, gyro only."""
        return Recording(
            gyro_b=self.gyro_l[index],
            accel_b=None,
            rate_hz=self.rate_hz,
            latitude=LATITUDE,
            heading_true=float(self.heading_true[index]),
            session=SESSION,
            source=f"published reconstruction, recording {index}",
            notes=(Note("simulated_noise", "The biases of this recording are real and its noise is simulated."),),
        )


@cache
def published() -> Published:
    """The printed figures, with the horizontal rate at full precision.

    The components are printed to 0.36 deg/h; the norm (0.01 deg/h) and w_z give the horizontal
    rate, the printed heading (0.1 deg) its direction.
    """
    table = _table("published_recordings.csv")
    heading = np.radians(table["heading_mean_gyro_deg"])
    vertical = np.radians(table["w_z_deg_s"])
    horizontal = np.sqrt((table["w_norm_deg_h"] * DEG_PER_HOUR) ** 2 - vertical**2)
    rate = np.stack([horizontal * np.cos(heading), -horizontal * np.sin(heading), vertical], axis=1)
    return Published(np.radians(table["heading_true_deg"]), heading, rate)


@cache
def fit_noise() -> NoiseFit:
    """Fit the angle random walk to the printed durations by least squares of the CRMSE.

    CRMSE(T)^2 = CRMSE(240 s)^2 + (arw / (Earth rate cos lat))^2 (1/T - 1/240 s): what the
    longest duration shows is bias, what comes on top is white noise.
    """
    from scipy.optimize import least_squares

    table = _table("published_durations.csv")
    duration, printed = table["duration_s"], np.radians(table["model_based_crmse_deg"])
    at_longest = printed[duration == LONGEST_PRINTED][0]

    def crmse(arw: float) -> Array:
        noise = arw / (EARTH_RATE * cos(LATITUDE))
        return np.sqrt(at_longest**2 + noise**2 * (1 / duration - 1 / LONGEST_PRINTED))

    start = radians(0.04) / 60  # near the solution; the problem has one unknown and one minimum
    scale = least_squares(lambda s: crmse(s[0] * start) - printed, [1.0]).x[0]
    return NoiseFit(float(scale * start), duration, printed, crmse(scale * start))


def published_twin(*, rate_hz: float = 3.0, rng: np.random.Generator) -> Twin:
    """The 60 recordings of 230 s: printed mean rate plus bridged white noise.

    The mean of every draw of noise is taken out, so that the noise of a window of T s has the
    variance arw^2 (1/T - 1/230 s) and that of the whole recording none.
    """
    figures, noise = published(), fit_noise()
    shape = (len(figures.heading_true), round(DURATION * rate_hz), 3)
    drawn = rng.standard_normal(shape) * noise.arw * np.sqrt(rate_hz)
    drawn -= drawn.mean(axis=1, keepdims=True)
    return Twin(figures.mean_rate[:, None] + drawn, figures.heading_true, rate_hz, noise.arw)


def model_based(gyro_l: Array) -> Array:
    """Heading of the mean of levelled rates (m, n, 3), rad in [0, 2 pi): atan2(-w_y, w_x)."""
    mean = gyro_l.mean(axis=-2)
    return wrap_heading(heading_of_rate(mean))


def duration_curve(twin: Twin, durations: Array) -> Array:
    """Model-based CRMSE of the reconstruction over windows of each duration, rad."""
    curve = []
    for duration in durations:
        gyro_l, truth, _ = twin.windows(float(duration))
        curve.append(cyclic_rmse(angle_error(model_based(gyro_l), truth)))
    return np.array(curve)


def _table(name: str) -> dict[str, Array]:
    with (files("gyronorth") / "data" / name).open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    return {key: np.array([float(row[key]) for row in rows]) for key in rows[0]}
