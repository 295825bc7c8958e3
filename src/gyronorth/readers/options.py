"""What the user declares about a file that the file does not say."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gyronorth.angles import DEG_PER_HOUR
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.errors import InputError, did_you_mean, one_line
from gyronorth.given import checked_latitude, checked_path, number, numbers, of_kind
from gyronorth.readers.axes import mat_bf
from gyronorth.readers.source import FORCES, NAMES, RATES, TIME
from gyronorth.recording import FASTEST_RATE_HZ, SLOWEST_RATE_HZ

#: rad/s in one unit of angular rate.
GYRO_UNITS = {
    "rad/s": 1.0,
    "deg/s": float(np.radians(1.0)),
    "deg/h": DEG_PER_HOUR,
    "mdeg/s": float(np.radians(1e-3)),
    "mrad/s": 1e-3,
    "arcsec/s": DEG_PER_HOUR,  # 3600 arcsec are a degree and 3600 s an hour
    "urad/s": 1e-6,
    "deg/min": float(np.radians(1.0 / 60)),
    "rpm": float(np.radians(6.0)),
}
#: m/s^2 in one unit of specific force.
ACCEL_UNITS = {
    "m/s2": 1.0,
    "g": STANDARD_GRAVITY,
    "mg": 1e-3 * STANDARD_GRAVITY,
    "ug": 1e-6 * STANDARD_GRAVITY,
    "cm/s2": 0.01,
    "mm/s2": 1e-3,
    "ft/s2": 0.3048,
}
#: Units proposed for numbers without one, the likeliest first; the others are rare, or the same by another name.
GYRO_PROPOSED = ("rad/s", "deg/s", "deg/h", "mdeg/s")
ACCEL_PROPOSED = ("m/s2", "g", "mg")
#: s in one unit of time.
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
#: Above this no count has units: beyond what any sensor scales by, far below where numbers end.
LARGEST_SCALE = 1e30
#: Which sensors hold increments.
INCREMENTS = ("gyro", "accel", "both", "none")
#: Names by which a column is known without a declaration; time in seconds has several.
OUR_TITLES = {TIME: (TIME, "time", "Time", "TIME")} | {name: (name,) for name in (*RATES, *FORCES)}
#: Columns that a message lists.
LISTED = 24
#: In place of a column's name: the file has it, and it is to be left alone.
IGNORED = "-"


@dataclass(frozen=True)
class ReadOptions:
    """Declarations about a file; None where the file itself is to tell.

    Raises
    ------
    InputError
        If a declaration is not one of the choices, or out of its range.
    """

    rate_hz: float | None = None  # sample rate, Hz; declares, never resamples
    axes: str | None = None  # frd, flu, rfu, ... or a signed permutation such as +y+x-z
    boresight: tuple[float, float, float] = (0.0, 0.0, 0.0)  # roll, pitch, yaw of the sensor in the vehicle, rad
    gyro_unit: str | None = None  # of GYRO_UNITS
    accel_unit: str | None = None  # of ACCEL_UNITS
    gyro_scale: float | None = None  # gyro_unit in one count of the file
    accel_scale: float | None = None  # accel_unit in one count of the file
    #: angle and velocity per sample, not per second: True and "both", "gyro", "accel", "none"; None: as the file says
    increments: bool | str | None = None
    increment_interval: float | None = None  # s that an increment covers; by default the sample interval
    time_unit: str | None = None  # of TIME_UNITS, of a column of times
    columns: Mapping[str, str | int] | None = None  # our name -> name or number (from 0) in the file, "-" to ignore it
    variable: str | None = None  # name of the array in a .mat file, of a dataset or group in HDF5
    topic: str | None = None  # name of the topic in a bag of ROS or an MCAP file
    latitude: float | None = None  # geodetic latitude, rad
    drop_bad_rows: bool = False  # leave out rows that cannot be used, and count them
    protocol: str | None = None  # of a capture of frames; by default it is recognised by its checksums
    imu: str | None = None  # of NovAtel RAWIMU and RAWIMUS: the type of the IMU, as STIM300
    accel_range_g: float | None = None  # of STIM datagrams: 5, 10, 30 or 80 g
    format: str | None = None  # name of the format; by default from suffix and content
    window: tuple[float, float] | None = None  # only [start, end) of the file, s from its first sample
    preset: str | None = None  # name or file of a preset, which declares what is not declared here
    accel_file: str | Path | None = None  # of the accelerometer, where the file holds the gyro alone
    accel_topic: str | None = None  # of the accelerometer, in a bag of ROS or an MCAP file
    needed: tuple[str, ...] = RATES  # columns without which it is no recording; FORCES for an accelerometer's file

    def __post_init__(self) -> None:
        self._check_kinds()
        _among("gyro_unit", self.gyro_unit, GYRO_UNITS)
        _among("accel_unit", self.accel_unit, ACCEL_UNITS)
        _among("time_unit", self.time_unit, TIME_UNITS)
        self._check_scales()
        if self.axes is not None:
            mat_bf(self.axes)
        if self.rate_hz is not None and not SLOWEST_RATE_HZ <= self.rate_hz <= FASTEST_RATE_HZ:
            raise InputError(
                f"The declared rate is {self.rate_hz:g} Hz; {SLOWEST_RATE_HZ:g} to {FASTEST_RATE_HZ:g} Hz is expected."
            )
        boresight = numbers("The boresight", self.boresight, "(3,)")
        if boresight.shape != (3,) or not (abs(boresight) <= 2 * np.pi).all():
            raise InputError(
                f"The boresight is {self.boresight!r:.80} rad; three angles roll, pitch, yaw of a turn at most are "
                "expected."
            )
        if self.window is not None and numbers("The window", self.window, "(2,)").shape != (2,):
            raise InputError(f"The window is {self.window!r:.80}; start and end in s are expected.")
        if self.window is not None and not 0 <= self.window[0] < self.window[1] < np.inf:
            raise InputError(
                f"The window is {self.window[0]:g}:{self.window[1]:g} s; START:END with 0 <= START < END is expected."
            )
        for name in self.columns or {}:
            if name not in NAMES:
                raise InputError(f"columns names {name!r}; the columns of a recording are {', '.join(NAMES)}.")

    def _check_kinds(self) -> None:
        """Numbers as such, and everything else of its type."""
        for name in ("rate_hz", "gyro_scale", "accel_scale", "increment_interval", "accel_range_g"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, number(name, getattr(self, name)))
        if self.latitude is not None:
            object.__setattr__(self, "latitude", checked_latitude(self.latitude))
        for name in ("axes", "variable", "topic", "protocol", "imu", "format", "accel_topic"):
            if getattr(self, name) is not None:
                of_kind(name, getattr(self, name), str, "a text")
        for name in ("preset", "accel_file"):
            if getattr(self, name) is not None:
                checked_path(name, getattr(self, name))
        of_kind("needed", self.needed, tuple, "a tuple of names")
        of_kind("drop_bad_rows", self.drop_bad_rows, bool | np.bool_, "true or false")
        of_kind(
            "columns", {} if self.columns is None else self.columns, Mapping, "a mapping of our names to the file's"
        )
        if tuple(self.needed) not in (RATES, FORCES):
            raise InputError(f"needed is {self.needed!r:.80}; {RATES} or {FORCES} is expected.")

    def _check_scales(self) -> None:
        """Counts and increments."""
        if not isinstance(self.increments, bool):
            _among("increments", self.increments, INCREMENTS)
        if self.increments == "none":
            object.__setattr__(self, "increments", False)
        for name, value in (
            ("gyro_scale", self.gyro_scale),
            ("accel_scale", self.accel_scale),
            ("increment_interval", self.increment_interval),
        ):
            if value is not None and not 0 < abs(value) < LARGEST_SCALE:
                told = f"{value:g}" if abs(value) < LARGEST_SCALE else f"above {LARGEST_SCALE:g}"
                raise InputError(f"{name} is {told}; a number other than 0 is expected.")
        if self.increment_interval is not None and not (self.increments and self.increment_interval > 0):
            raise InputError(
                f"increment_interval is {self.increment_interval:g} s; it goes with --increments, and is positive."
            )


def increments_of(increments: bool | str | None) -> frozenset[str]:
    """The sensors that hold increments: of "gyro" and "accel"."""
    both = frozenset(("gyro", "accel"))
    return both if increments in (True, "both") else frozenset((str(increments),)) if increments else frozenset()


def parse_columns(text: str) -> dict[str, str]:
    """The map of `--columns`: "t=time,w_x=gx,..." -> {"t": "time", "w_x": "gx", ...}.

    A name in the file may hold commas and equal signs: an entry begins at one of our
    names followed by "=".
    """
    starts = list(re.finditer(rf"(?:^|,)\s*({'|'.join(NAMES)})\s*=", text))
    if not starts or text[: starts[0].start()].strip():
        raise InputError(f"columns is {text!r}; our name = name in the file is expected, as in t=time,w_x=gx,w_y=gy.")
    ends = [match.start() for match in starts[1:]] + [len(text)]
    columns: dict[str, str] = {}
    for match, end in zip(starts, ends, strict=True):
        name, value = match[1], text[match.end() : end].strip()
        if name in columns or not value:
            raise InputError(f"columns is {text!r}; {name} needs one name or number in the file.")
        columns[name] = value
    return columns


def choose_columns(
    header: list[str] | int,
    columns: Mapping[str, str | int] | None,
    aliases: Mapping[str, tuple[str, ...]],
    name: str,
    *,
    needed: tuple[str, ...] = RATES,
) -> dict[str, int]:
    """Positions of our columns in a file.

    Parameters
    ----------
    header : list of str or int
        Names in the file, or how many columns there are when they have no names.
    columns : mapping or None
        What the user declared: our name -> name in the file, or position from 0, or "-".
    aliases : mapping
        Our name -> names that the format uses for it, in order of preference.
    name : str
        File name, for messages.
    needed : tuple of str, optional
        Columns without which it is no recording.

    Returns
    -------
    dict
        Our name -> position from 0. Three rates and three forces, or none of those that are not `needed`; t or not.
    """
    titles = header if isinstance(header, list) else []
    width = len(header) if isinstance(header, list) else header
    declared = dict(columns or {})
    found: dict[str, int] = {}
    for ours in NAMES:
        if ours in declared:
            if str(declared[ours]) != IGNORED:
                found[ours] = _position(ours, declared[ours], titles, width, name)
            continue
        present = [alias for alias in aliases.get(ours, ()) if alias in titles]
        if len(present) > 1 and ours in (*RATES, *FORCES):
            raise InputError(
                f"{name} has {' and '.join(present)}, and each of them may be {ours}: which one is meant? Say so: "
                f"--columns {ours}={present[0]}, and likewise for the other axes."
            )
        for alias in aliases.get(ours, ()):
            if titles.count(alias) > 1:
                raise InputError(f"The header of {name} has {titles.count(alias)} columns {alias}; which one is meant?")
            if alias in titles:
                found[ours] = titles.index(alias)
                break
    for triple in (RATES, FORCES):
        missing = [ours for ours in triple if ours not in found]
        if missing and (triple == needed or len(missing) < 3):
            has = f"its columns are {_listed(titles)}" if titles else f"it has {width} columns without names"
            raise InputError(
                f"{name} has no column {', '.join(missing)}: {has}. Say which ones hold them, as in "
                f"--columns {','.join(f'{ours}=NAME' for ours in missing)} (a number counts columns from 0)."
            )
    positions = list(found.values())
    for ours, position in found.items():
        if positions.count(position) > 1:
            raise InputError(f"columns gives column {position} of {name} to {ours} and to another of our names.")
    return found


def _position(ours: str, wanted: str | int, titles: list[str], width: int, name: str) -> int:
    if isinstance(wanted, str) and wanted in titles:
        if titles.count(wanted) > 1:
            raise InputError(
                f"The header of {name} has {titles.count(wanted)} columns {wanted}; which one is meant? Give "
                "its number."
            )
        return titles.index(wanted)
    if re.fullmatch(r"[0-9]{1,6}", str(wanted)) and int(wanted) < width:
        return int(wanted)
    has = f"its columns are {_listed(titles)}" if titles else f"its columns are numbered 0 to {width - 1}"
    raise InputError(f"columns says {ours}={wanted}, but {name} has no such column: {has}.")


def _listed(titles: list[str]) -> str:
    """Names for a message, the first ones of many, none longer than a line."""
    shown = [one_line(title if len(title) <= 60 else title[:57] + "...") for title in titles[:LISTED]]
    return ", ".join(shown) + (f" and {len(titles) - LISTED} more" if len(titles) > LISTED else "")


def _among(name: str, value: Any, choices: Iterable[str]) -> None:
    if value is None:
        return
    if not isinstance(value, str) or value not in choices:
        raise InputError(
            f"{name} is {value!r:.80}; one of {', '.join(choices)} is expected.{did_you_mean(str(value), choices)}"
        )
