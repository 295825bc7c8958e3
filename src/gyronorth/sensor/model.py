"""An inertial sensor: two triads with their error terms (`gyronorth.sensor.terms`), read and written as a profile."""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass, field
from pathlib import Path

from gyronorth.errors import InputError, did_you_mean
from gyronorth.files import write_text
from gyronorth.given import checked_path, of_kind
from gyronorth.sensor.terms import TriadErrors


@dataclass(frozen=True)
class Sensor:
    """An inertial sensor: its profile of errors and where the figures come from."""

    name: str
    gyro: TriadErrors
    accel: TriadErrors = field(default_factory=TriadErrors)
    g_sensitivity: float = 0.0  # gyro bias per specific force, (rad/s) / (m/s^2)
    source: str = ""  # citation
    bounds: tuple[str, ...] = ()  # figures that are upper bounds, as `triad.key` of the profile's file


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
    of_kind("The sensor", name_or_file, (str, os.PathLike), "a name, the path of a profile or a Sensor")
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

    of_kind("sensor", sensor, Sensor, "a Sensor")
    target = checked_path("path", path)
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
