"""Allan deviation with confidence; the error terms of a sensor identified from a record at rest."""

from gyronorth.allan.characterisation import Characterisation as Characterisation
from gyronorth.allan.characterisation import TriadReport as TriadReport
from gyronorth.allan.characterisation import characterise as characterise
from gyronorth.allan.characterisation import identified_sensor as identified_sensor
from gyronorth.allan.deviation import AllanDeviation as AllanDeviation
from gyronorth.allan.deviation import allan_deviation as allan_deviation
from gyronorth.allan.identification import Identification as Identification
from gyronorth.allan.identification import Identified as Identified
from gyronorth.allan.identification import identify as identify
