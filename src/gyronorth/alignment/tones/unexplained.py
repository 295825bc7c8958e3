"""What neither tones, settling nor the sensor's noise explain: broadband noise, and motion whose angle stays bounded.

The residual of the likeliest model is the sensor's noise, white noise of any size and the rate of an
Ornstein-Uhlenbeck angle. The three that its periodogram shows most likely (Whittle, J. R. Stat. Soc. B 15, 1953,
125-139) take the place of the sensor's noise. Motion of a bounded angle has next to no rate near frequency 0, where
the Earth rate is: a residual many times the noise leaves a heading all the same.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gyronorth.arrays import Array, Mask
from gyronorth.frozen import frozen
from gyronorth.sensor import TriadErrors
from gyronorth.sensor.law import NoiseLaw

#: Frequencies from 0, in steps of 1 / duration, that the fitted constant and slow change leave nothing of.
FITTED = 3
#: Angles tried, rad: more of them than one in 1.5 tells apart; and white noise over the sensor's.
ANGLES, WHITES = np.geomspace(1e-8, 1e-2, 35), np.geomspace(1.0, 1e3, 18)
#: Correlation times tried, from a sample to this share of the duration.
TIMES, LONGEST = 8, 0.25


@frozen
class BoundedMotion:
    """An Ornstein-Uhlenbeck angle of each axis."""

    angle: float = 0.0  # rad, root mean square
    time: float = 1.0  # correlation time, s

    def covariance(self, samples: int, rate_hz: float) -> Array:
        """Covariance (n, n) of the mean rates of samples: differences of the angle at their ends."""
        lag = np.arange(samples + 1)
        angle = (self.angle * rate_hz) ** 2 * np.exp(-np.abs(lag[:, None] - lag) / (rate_hz * self.time))
        return np.diff(np.diff(angle, axis=0), axis=1)

    def spectrum(self, f: Array, rate_hz: float) -> Array:
        """Two-sided spectrum of the same at frequencies `f`, Hz, (rad/s)^2/Hz."""
        phase = 2 * np.pi * f / rate_hz
        kept = np.exp(-1 / (rate_hz * self.time))
        angle = self.angle**2 / rate_hz * (1 - kept**2) / (1 - 2 * kept * np.cos(phase) + kept**2)
        return 2 * (1 - np.cos(phase)) * rate_hz**2 * angle


#: A platform that does not move.
STILL = BoundedMotion()


def unexplained(
    residual: Array, masked: Mask, *, rate_hz: float, errors: TriadErrors
) -> tuple[TriadErrors, BoundedMotion]:
    """Noise and motion that a residual (n, 3), rad/s, shows beyond the law of `errors`; masked samples do not count."""
    n = len(residual)
    used = np.where(masked[:, None], 0.0, residual)
    power = np.sum(np.abs(np.fft.rfft(used, axis=0)) ** 2, axis=1)[FITTED:] / (rate_hz * np.count_nonzero(~masked))
    f = np.asarray(np.fft.rfftfreq(n, 1 / rate_hz)[FITTED:], dtype=float)
    drift = NoiseLaw(replace(errors, white=0.0)).spectrum(f, rate_hz).sum(axis=-1)
    white = (errors.white * WHITES[:, None]) ** 2
    best, found = np.inf, (errors, STILL)
    for time in np.geomspace(1 / rate_hz, LONGEST * n / rate_hz, TIMES):
        moved = BoundedMotion(1.0, float(time)).spectrum(f, rate_hz)
        level = drift + white[:, None] + np.r_[0.0, ANGLES**2][None, :, None] * moved  # (whites, angles, f)
        cost = np.sum(3 * np.log(level) + power / level, axis=-1)
        row, column = np.unravel_index(np.argmin(cost), cost.shape)
        if cost[row, column] < best:
            best = float(cost[row, column])
            angle = float(np.r_[0.0, ANGLES][column])
            found = (replace(errors, white=errors.white * float(WHITES[row])), BoundedMotion(angle, float(time)))
    return found
