"""Inertial sensors: their error terms, profiles in data-sheet units, and the noise law.

`terms` holds the error terms, `law` what they do together, `model` the sensor, `profiles` its JSON files.
"""

from gyronorth.sensor.model import Sensor, read_sensor, sensor_names, write_sensor
from gyronorth.sensor.terms import FLICKER_SHORTEST, FLICKER_SPACING, TriadErrors, flicker_components

__all__ = [
    "FLICKER_SHORTEST",
    "FLICKER_SPACING",
    "Sensor",
    "TriadErrors",
    "flicker_components",
    "read_sensor",
    "sensor_names",
    "write_sensor",
]


def __dir__() -> list[str]:
    return sorted(__all__)
