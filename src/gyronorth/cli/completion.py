"""What the shell offers when Tab is pressed behind an option: names from the lists that the program itself uses."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import permutations
from pathlib import Path


def offered(names: Callable[[], Iterable[str]]) -> Callable[[str], list[str]]:
    """A completer that offers the names that begin as what is typed; they are looked up when Tab is pressed."""
    return lambda incomplete: [name for name in names() if name.startswith(incomplete)]


def sensor(incomplete: str) -> list[str]:
    """Built-in profiles, and JSON files and folders of the place that is typed."""
    from gyronorth.sensor import profiles

    found = [name for name in profiles.names() if name.startswith(incomplete.lower())]
    place = Path(incomplete) if incomplete.endswith("/") else Path(incomplete).parent
    if place.is_dir():
        paths = (f"{path}/" if path.is_dir() else str(path) for path in sorted(place.iterdir()))
        found += [path for path in paths if path.startswith(incomplete) and path.endswith((".json", "/"))]
    return found


@offered
def method() -> Iterable[str]:
    """Methods, those of other packages too."""
    from gyronorth.alignment import registry

    return registry.METHODS


@offered
def gyro_unit() -> Iterable[str]:
    """Units of angular rate."""
    from gyronorth.readers.options import GYRO_UNITS

    return GYRO_UNITS


@offered
def accel_unit() -> Iterable[str]:
    """Units of specific force."""
    from gyronorth.readers.options import ACCEL_UNITS

    return ACCEL_UNITS


@offered
def time_unit() -> Iterable[str]:
    """Units of a time column."""
    from gyronorth.readers.options import TIME_UNITS

    return TIME_UNITS


@offered
def preset() -> Iterable[str]:
    """Shipped presets."""
    from gyronorth.readers import presets

    return (preset.name for preset in presets.shipped())


@offered
def imu() -> Iterable[str]:
    """IMU types of NovAtel."""
    from gyronorth.frames.protocols.novatel import IMU_TYPES

    return (imu.name for imu in IMU_TYPES)


@offered
def axes() -> Iterable[str]:
    """The 24 right-handed ones by their letters."""
    from gyronorth.errors import InputError
    from gyronorth.readers.axes import mat_bf

    found = []
    for letters in map("".join, permutations("frdblu", 3)):
        try:
            mat_bf(letters)
        except InputError:
            continue
        found.append(letters)
    return found


@offered
def protocol() -> Iterable[str]:
    """Protocols of frames."""
    from gyronorth.frames.catalogue import NAMES

    return NAMES


@offered
def disturbance() -> Iterable[str]:
    """Kinds that `simulate` draws."""
    from gyronorth.catalogue import DISTURBANCE_KINDS

    return (kind.name for kind in DISTURBANCE_KINDS)


@offered
def benchmark() -> Iterable[str]:
    """Benchmarks."""
    from gyronorth.studies.benchmark import STUDIES

    return dict.fromkeys(study.benchmark for study in STUDIES)


@offered
def study() -> Iterable[str]:
    """Studies of all benchmarks."""
    from gyronorth.studies.benchmark import STUDIES

    return dict.fromkeys(study.name for study in STUDIES)
