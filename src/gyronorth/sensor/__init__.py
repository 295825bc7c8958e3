"""Inertial sensors: their error terms, profiles in data-sheet units, and the noise law.

`model` holds the error terms, `profiles` the JSON files, `law` what the stochastic terms do.
"""

from gyronorth.sensor.model import (
    FLICKER_SHORTEST,
    FLICKER_SPACING,
    Sensor,
    TriadErrors,
    flicker_components,
    read_sensor,
    sensor_names,
    write_sensor,
)

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
