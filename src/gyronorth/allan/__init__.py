"""Allan deviation with confidence; the error terms of a sensor identified from a record at rest."""

from __future__ import annotations

from gyronorth.allan.at_rest import axes_in_files
from gyronorth.allan.characterisation import (
    Characterisation,
    TriadReport,
    characterise,
    identified_sensor,
)
from gyronorth.allan.deviation import AllanDeviation, allan_deviation
from gyronorth.allan.identification import Identification, Identified, identify

__all__ = [
    "AllanDeviation",
    "Characterisation",
    "Identification",
    "Identified",
    "TriadReport",
    "allan_deviation",
    "axes_in_files",
    "characterise",
    "identified_sensor",
    "identify",
]


def __dir__() -> list[str]:
    return sorted(__all__)
