"""The inertial sensor model: error terms of gyro and accelerometer in SI units.

Error terms of one triad
------------------------
measured = (1 + scale + misalignment) true + turn_on_bias + in-run bias + rate random walk
           + white noise (+ g-sensitivity x specific force, gyro), then quantised.

*In-run bias* is flicker noise with the two-sided spectrum B^2 / (2 pi f) of IEEE Std
952-1997, annex C, so that its Allan deviation is flat at sqrt(2 ln 2 / pi) B = 0.664 B.
**B, the bias instability of this package, is that coefficient: the Allan minimum / 0.664.**
It is realised as a sum of stationary first-order Gauss-Markov processes with time constants
half a decade apart, from `flicker_longest` down to about `FLICKER_SHORTEST`
(`flicker_components`), each drawn from its stationary law at the first sample.

With the default longest time constant of 1000 s the Allan deviation stands within 2 % of
0.664 B for averaging times of 2 to 150 s and within 5 % for 0.8 to 400 s; the standard
deviation of the in-run bias at any one instant is 1.82 B, that of its mean over 100 s 1.10 B
and over 230 s 0.98 B. The turn-on bias is a separate constant: what a data sheet or a test
over one duration calls bias is the root sum square of both.
"""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError, did_you_mean
from gyronorth.files import write_text

#: Shortest time constant of the in-run bias, s: below it white noise hides flicker.
FLICKER_SHORTEST = 0.1
#: Spacing of the time constants in the natural logarithm: half a decade. Its ripple on 1/f is
#: 2 / cosh(pi^2 / spacing) = 0.08 % far from the ends (`flicker_components`).
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
            if not value >= 0 or (value == np.inf and name != "saturation"):
                raise ValueError(f"{name} is {value}; a finite number of at least 0 is expected.")
        if self.flicker_longest < FLICKER_SHORTEST:
            raise ValueError(f"flicker_longest is {self.flicker_longest} s; at least {FLICKER_SHORTEST} s is expected.")


@dataclass(frozen=True)
class Sensor:
    """An inertial sensor: its profile of errors and where the figures come from."""

    name: str
    gyro: TriadErrors
    accel: TriadErrors = field(default_factory=TriadErrors)
    g_sensitivity: float = 0.0  # gyro bias per specific force, (rad/s) / (m/s^2)
    source: str = ""  # citation
    bounds: tuple[str, ...] = ()  # figures that are upper bounds, as `triad.key` of the profile's file


def flicker_components(errors: TriadErrors) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Variances (k,), u^2, and time constants (k,), s, of the Gauss-Markov sum that is the in-run bias.

    Notes
    -----
    A sum over time constants spaced by d in ln(tau), each of variance v = B^2 d / pi, has the
    two-sided spectrum sum of 2 v tau / (1 + (2 pi f tau)^2), which goes to B^2 / (2 pi f) as the
    spacing falls. By Poisson summation the ripple left by a spacing d is 2 / cosh(pi^2 / d) of it:
    0.08 % for half a decade. The finite ends take away
    (2 / pi) (arctan(2 pi f tau_1 exp(-d/2)) + arccot(2 pi f tau_k exp(d/2))): the spectrum stays
    within 2 % of 1/f from 0.003 to 0.087 Hz for time constants of 0.1 to 1000 s, and turns flat
    below 1 / (2 pi tau_k), to 1/f^2 above 1 / (2 pi tau_1).
    """
    if errors.flicker == 0:
        return np.zeros(0), np.zeros(0)
    count = round(np.log(errors.flicker_longest / FLICKER_SHORTEST) / FLICKER_SPACING) + 1
    steps = np.arange(count, dtype=float)[::-1]
    tau = np.asarray(errors.flicker_longest * np.exp(-FLICKER_SPACING * steps), dtype=float)
    return np.full_like(tau, errors.flicker**2 * FLICKER_SPACING / np.pi), tau


def sensor_names() -> tuple[str, ...]:
    """Names of the built-in sensor profiles, sorted."""
    from gyronorth.sensor import profiles

    return profiles.names()


def read_sensor(name_or_file: str | os.PathLike[str] | Sensor) -> Sensor:
    """A sensor from the name of a built-in profile or from a JSON profile file.

    Parameters
    ----------
    name_or_file : str, path or Sensor
        Built-in name (`sensor_names`), any case; or a file, in the schema of `gyronorth.sensor.profiles`.
        A Sensor is returned as it is.

    Raises
    ------
    InputError
        If there is no such name or file, or the file is not a valid profile.
    """
    if isinstance(name_or_file, Sensor):
        return name_or_file
    from gyronorth.sensor import profiles

    path, name = Path(name_or_file), str(name_or_file).lower()
    if name in profiles.names():
        values = profiles.builtin(name)
    elif os.path.isfile(path):
        values = profiles.parse(_read_text(path), where=str(path))
    else:
        raise InputError(
            f"There is no sensor {str(name_or_file)!r}: neither a built-in profile ({', '.join(profiles.names())}) "
            f"nor a file.{did_you_mean(name, profiles.names())} Give one of those names, or the path of a JSON profile."
        )
    gyro, accel = TriadErrors(**values.pop("gyro")), TriadErrors(**values.pop("accel"))
    return Sensor(gyro=gyro, accel=accel, **values)


def write_sensor(sensor: Sensor, path: str | os.PathLike[str]) -> None:
    """Write a JSON profile that `read_sensor` reads back to the same sensor (within 1e-12).

    Raises
    ------
    InputError
        If the sensor is none that a profile may describe (a negative or absurd figure, no name),
        or the file cannot be written.
    """
    from gyronorth.sensor import profiles

    target = Path(path)
    text = profiles.compose(dataclasses.asdict(sensor))
    profiles.parse(text, where=f"The sensor to be written to {target}")
    write_text(target, text)


def _read_text(path: Path) -> str:
    try:
        if path.stat().st_size > 1_000_000:
            raise InputError(f"{path} has {path.stat().st_size} bytes; a sensor profile is a JSON file of a few kB.")
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8 text ({error}). A JSON sensor profile is expected.") from error
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from error
