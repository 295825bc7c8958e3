"""The inertial sensor model: error terms of gyro and accelerometer in SI units.

Error terms of one triad
------------------------
measured = (1 + scale + misalignment) true + turn_on_bias + in-run bias + rate random walk
           + white noise (+ g-sensitivity x specific force, gyro), then quantised.

*In-run bias* is flicker noise with the two-sided spectrum B^2 / (2 pi f) of IEEE Std
952-1997, annex C, so that its Allan deviation is flat at sqrt(2 ln 2 / pi) B = 0.664 B.
**B, the bias instability of this package, is that coefficient: the Allan minimum / 0.664.**
It is realised as a sum of stationary first-order Gauss-Markov processes with time constants
spaced evenly in the logarithm between `FLICKER_SHORTEST` and `flicker_longest`
(`flicker_components`), each drawn from its stationary law at the first sample.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

#: Shortest time constant of the in-run bias, s: below it white noise hides flicker.
FLICKER_SHORTEST = 0.1
#: Spacing of the time constants in the natural logarithm: half a decade keeps the spectrum
#: within 2 % of 1/f between the ends.
FLICKER_SPACING = float(np.log(10) / 2)


@dataclass(frozen=True)
class TriadErrors:
    """Error terms of three orthogonal axes, each one standard deviation, SI.

    The unit u is rad/s for a gyro and m/s^2 for an accelerometer.
    """

    white: float = 0.0  # angle (velocity) random walk N, u sqrt(s)
    flicker: float = 0.0  # bias instability B = Allan minimum / 0.664, u
    flicker_longest: float = 1000.0  # longest time constant of the in-run bias, s
    random_walk: float = 0.0  # rate (acceleration) random walk K, u / sqrt(s)
    turn_on_bias: float = 0.0  # constant over a power-up session, u
    scale_factor: float = 0.0  # relative
    misalignment: float = 0.0  # rad, each off-diagonal term
    quantisation: float = 0.0  # step of the integrated output, u s
    saturation: float = np.inf  # full range, u

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not value >= 0:
                raise ValueError(f"{name} is {value}; a non-negative number is expected.")


@dataclass(frozen=True)
class Sensor:
    """An inertial sensor: its profile of errors and where the figures come from."""

    name: str
    gyro: TriadErrors
    accel: TriadErrors = field(default_factory=TriadErrors)
    g_sensitivity: float = 0.0  # gyro bias per specific force, (rad/s) / (m/s^2)
    source: str = ""  # citation


def flicker_components(errors: TriadErrors) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Variances (k,), u^2, and time constants (k,), s, of the Gauss-Markov sum that is the in-run bias.

    A sum over time constants spaced by d in ln(tau), each of variance B^2 d / pi, has the
    spectrum sum of 2 v tau / (1 + (2 pi f tau)^2) -> B^2 / (2 pi f) between the ends.
    """
    if errors.flicker == 0:
        return np.zeros(0), np.zeros(0)
    count = max(1, round(np.log(errors.flicker_longest / FLICKER_SHORTEST) / FLICKER_SPACING) + 1)
    tau = np.geomspace(FLICKER_SHORTEST, errors.flicker_longest, count) if count > 1 else np.array([errors.flicker_longest])
    spacing = np.log(tau[1] / tau[0]) if count > 1 else FLICKER_SPACING
    return np.full(count, errors.flicker**2 * spacing / np.pi), tau
