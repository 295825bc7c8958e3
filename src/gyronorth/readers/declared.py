"""What holds for a file: the user's declarations, the file's statements, its format's conventions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.frozen import frozen
from gyronorth.readers.asking import OpenQuestion, ask
from gyronorth.readers.axes import convention, mat_bf, mat_vb
from gyronorth.readers.evidence import Fit, accel_fits, earth_words, gyro_fits, is_whole, norm_of_parts
from gyronorth.readers.joining import accelerometer_beside
from gyronorth.readers.options import ACCEL_UNITS, GYRO_UNITS, ReadOptions, increments_of
from gyronorth.readers.source import FORCES, RATES, TIME, Question, Source
from gyronorth.recording import AxesOrigin, agreed_latitude

#: Largest relative difference between a declared rate and the one that the file states.
RATE_STATED_TOLERANCE = 1e-3

#: Shortest sample interval from which a rate is told, s.
SHORTEST_STEP = 1e-9
#: Mean force, in the unit of the file, above which it is neither m/s2 nor g.
MOST_GRAVITY = 100.0


@frozen
class Declared:
    """Everything that turns the numbers of a file into SI and body axes."""

    rate_hz: float | None  # None: to be taken from the time column
    gyro_unit: str
    accel_unit: str  # "" without an accelerometer
    axes: str  # three letters
    axes_origin: AxesOrigin
    gyro_increments: bool
    accel_increments: bool
    mat_vf: NDArray[np.float64] | None  # file axes to vehicle axes, shape (3, 3); None: the same
    latitude: float | None  # rad
    heading_true: float | None  # rad
    gyro_scale: float = 1.0  # units in one number of the file
    accel_scale: float = 1.0
    increment_interval: float | None = None  # s; None: the sample interval

    @property
    def increments(self) -> bool:
        """Whether any sensor holds increments."""
        return self.gyro_increments or self.accel_increments

    @property
    def units(self) -> str:
        """Units of the file in words: "deg/s, g", with scale factors and increments where there are such."""
        sensors = [(self.gyro_unit, self.gyro_scale, self.gyro_increments)]
        if self.accel_unit:
            sensors.append((self.accel_unit, self.accel_scale, self.accel_increments))
        return ", ".join(
            f"{'' if scale == 1 else f'{scale:.10g} '}{unit}{' as increments' if increments else ''}"
            for unit, scale, increments in sensors
        )

    def scale(self, rate_hz: float) -> NDArray[np.float64]:
        """SI per number of each value column at a sample rate, shape (3,) or (6,)."""
        per_second = rate_hz if self.increment_interval is None else 1 / self.increment_interval
        gyro = GYRO_UNITS[self.gyro_unit] * self.gyro_scale * (per_second if self.gyro_increments else 1.0)
        if not self.accel_unit:
            return np.array([gyro] * 3)
        accel = ACCEL_UNITS[self.accel_unit] * self.accel_scale * (per_second if self.accel_increments else 1.0)
        return np.array([gyro] * 3 + [accel] * 3)

    @property
    def axes_declared(self) -> bool:
        """Whether the user or the file says so, not mere convention."""
        return self.axes_origin in ("stated", "declared")


def resolve(source: Source, options: ReadOptions, path: Path | str | None = None) -> Declared:
    """Put declarations, statements and conventions together; `path` is for the message.

    Raises
    ------
    InputError
        If two of them contradict each other; an `OpenQuestion` about all that is known from none.
    """
    stated, usual, name = source.stated, source.usual, source.name
    if source.decoded:
        options = replace(options, gyro_unit=None, accel_unit=None, gyro_scale=None, accel_scale=None, increments=None)
        if source.usual.rate_hz or (source.clock is not None and source.clock.unit is not None):
            options = replace(options, rate_hz=None)  # the frames have settled it, and told of a conflict
    has_accel = FORCES[0] in source.columns
    gyro_unit = _unit("gyro", options.gyro_unit, stated.gyro_unit, usual.gyro_unit, name)
    accel_unit = _unit("accel", options.accel_unit, stated.accel_unit, usual.accel_unit, name) if has_accel else ""
    if options.increments and source.ours:
        raise InputError(f"{name} was written by gyronorth and holds rates; leave --increments out.")
    increments = increments_of(options.increments) | increments_of(stated.increments)
    increments |= frozenset() if options.increments else increments_of(usual.increments)
    rate_hz, asks_rate = _rate(source, options)
    _check_scales(source, options)
    if gyro_unit is None or accel_unit is None or asks_rate or source.questions:
        raise _open(source, options, path or name, gyro_unit, accel_unit, increments, asks_rate)
    declared_axes = options.axes or stated.axes
    usual_axes = stated.axes_assumed or usual.axes or "frd"
    known = "format" if source.axes_defined and stated.axes_assumed is None else "assumed"
    mat = mat_bf(declared_axes or usual_axes)
    if options.axes and stated.axes and not np.array_equal(mat, mat_bf(stated.axes)):
        raise InputError(
            f"{name} states axes {stated.axes}; {options.axes} is declared. Leave --axes out, or correct it."
        )
    heading_true = stated.heading_true
    if source.truth_follows_axes and not np.array_equal(mat, mat_bf(usual_axes)):
        heading_true = None
    boresight = mat_vb(options.boresight)
    turned = mat if boresight is None else boresight @ mat
    return Declared(
        rate_hz=rate_hz,
        gyro_unit=gyro_unit,
        accel_unit=accel_unit,
        axes=convention(mat),
        axes_origin="stated" if stated.axes else "declared" if options.axes else known,
        gyro_increments="gyro" in increments,
        accel_increments="accel" in increments and has_accel,
        mat_vf=None if np.array_equal(turned, np.eye(3)) else turned,
        latitude=agreed_latitude(options.latitude, source.stated.latitude, source.name),
        heading_true=heading_true,
        gyro_scale=options.gyro_scale or stated.gyro_scale or usual.gyro_scale or 1.0,
        accel_scale=options.accel_scale or stated.accel_scale or usual.accel_scale or 1.0,
        increment_interval=options.increment_interval,
    )


def in_place_of(source: Source, declared: Declared, sensor: str, unit: str, increments: bool) -> tuple[str, ...]:
    """The options by which the numbers of a sensor are read in another unit; none where no option does that.

    A unit that the file states is not declared anew: a scale makes of it the other one.
    """
    gyro = sensor == "gyro"
    was, units, scale = (
        (declared.gyro_unit, GYRO_UNITS, declared.gyro_scale)
        if gyro
        else (declared.accel_unit, ACCEL_UNITS, declared.accel_scale)
    )
    options: tuple[str, ...] = ()
    if increments != (declared.gyro_increments if gyro else declared.accel_increments):
        other = declared.accel_increments if gyro else declared.gyro_increments
        which = {(True, True): "both", (True, False): sensor, (False, True): "accel" if gyro else "gyro"}
        options = ("--increments", which.get((increments, other), "none"))
    stated = source.stated.gyro_unit if gyro else source.stated.accel_unit
    if source.decoded or source.ours or (options and source.stated.increments):
        return ()
    if unit == was:
        return options
    if stated is None:
        return (*options, f"--{sensor}-unit", unit)
    return (*options, f"--{sensor}-scale", f"{scale * units[unit] / units[was]:.10g}")


def forgotten_accelerometer(source: Source, options: ReadOptions, path: Path | str) -> Path | None:
    """The accelerometer's file beside a gyroscope's, where nobody says what to do with it."""
    declared = options.accel_file is not None or any(name in FORCES for name in options.columns or {})
    return None if declared or FORCES[0] in source.columns else accelerometer_beside(Path(path))


def _unit(sensor: str, declared: str | None, stated: str | None, usual: str | None, name: str) -> str | None:
    if declared and stated and declared != stated:
        raise InputError(
            f"{name} states {sensor}_unit {stated}; {declared} is declared. Leave --{sensor}-unit out, or correct it."
        )
    return declared or stated or usual


def _check_scales(source: Source, options: ReadOptions) -> None:
    for scale, value in (("gyro-scale", options.gyro_scale), ("accel-scale", options.accel_scale)):
        if value is not None and source.ours:
            raise InputError(f"{source.name} was written by gyronorth in SI; leave --{scale} out.")


def _open(
    source: Source,
    options: ReadOptions,
    path: Path | str,
    gyro_unit: str | None,
    accel_unit: str | None,
    increments: frozenset[str],
    asks_rate: str,
) -> OpenQuestion:
    """One message for all that is open, with what the first rows say."""
    questions, name = list(source.questions), source.name
    values, rate_hz = _first_values(source, options)
    known = bool(options.increments)
    gyro, accel = (None, None) if values is None else (values[:, :3], values[:, 3:])
    interval: float | None = None
    force = None
    if accel_unit is None:
        fits = [] if accel is None else accel_fits(accel, rate_hz)
        fits = [fit for fit in fits if not known or fit.increments == ("accel" in increments)]
        fits = [fit for fit in fits if "accel" not in increments or fit.increments]
        force = _accel_question(accel, fits, options)
        if fits and fits[0].increments:
            increments, interval = increments | {"accel"}, fits[0].interval
    if gyro_unit is None:
        gyro_increments = "gyro" in increments if known or "gyro" in increments else None
        gyro_rate = rate_hz if interval is None else 1 / interval
        fits = None if gyro is None else gyro_fits(gyro, gyro_rate, increments=gyro_increments)
        counts = gyro is not None and is_whole(gyro) and options.gyro_scale is None
        questions.append(_gyro_question(name, [] if counts else fits, counts=counts))
        if fits and fits[0].increments and not counts:
            increments |= {"gyro"}
    if force is not None:
        nor = "It does not say that of" if gyro_unit is None else f"{name} does not say in which unit"
        are = "either" if gyro_unit is None else "are"
        questions.append(Question(f"{nor} {', '.join(FORCES)} {are}{force.says}", force.options, force.certain))
    stated = increments_of(source.stated.increments) | increments_of(source.usual.increments)
    if increments - stated and not known:
        which = "both" if len(increments) == 2 else next(iter(increments))
        questions.append(Question("", ("--increments", which)))
    if interval is not None and options.increment_interval is None:
        says = f"An increment covers {interval:g} s by gravity, though a row comes every {1 / (rate_hz or 1):g} s."
        questions.append(Question(says, ("--increment-interval", f"{interval:g}")))
    if asks_rate:
        questions.append(Question(asks_rate, ("--rate", "HZ")))
    beside = forgotten_accelerometer(source, options, path)
    if beside is not None:
        questions.append(Question(f"{beside.name} beside it is likely its accelerometer.", ("--accel", str(beside))))
    return ask(path, options, questions)


def _accel_question(values: NDArray[np.float64] | None, fits: list[Fit], options: ReadOptions) -> Question:
    """What gravity says of the unit; the sentence begins elsewhere."""
    if values is None:
        return Question(f". Declare it: --accel-unit {' or '.join(ACCEL_UNITS)}.", ("--accel-unit", "UNIT"))
    if not fits:
        size = norm_of_parts(values)
        says = f"; the norm of the mean is {size:.4g}, which is gravity in no unit that is known here."
        if options.accel_scale is None and (size > MOST_GRAVITY or (is_whole(values) and size > 1)):
            says += f" If these are counts and the unit stands still, one g is {size:.5g} of them."
            return Question(says, ("--accel-unit", "g", "--accel-scale", f"{1 / size:.6g}"), certain=False)
        return Question(says, ("--accel-unit", "m/s2"), certain=False)
    fit = fits[0]
    scale = ("--accel-scale", f"{fit.scale:.10g}") if fit.scale is not None and options.accel_scale is None else ()
    counts = f" at {1 / fit.scale:.0f} counts in one g" if fit.scale is not None else ""
    return Question(f": gravity fits {fit.words}{counts}, {fit.size:.3f} m/s2.", ("--accel-unit", fit.unit, *scale))


def _gyro_question(name: str, fits: list[Fit] | None, *, counts: bool) -> Question:
    lead = f"{name} does not say in which unit {', '.join(RATES)} are"
    choices = f" Declare it: --gyro-unit {' or '.join(GYRO_UNITS)}."
    if fits is None:
        return Question(f"{lead}.{choices}", ("--gyro-unit", "UNIT"))
    if counts:
        says = f"{lead}; they are whole numbers, as counts are: the data sheet says how much one is.{choices}"
        return Question(says, ("--gyro-unit", "deg/s", "--gyro-scale", "DEG_PER_S_IN_ONE_COUNT"))
    if not fits:
        says = f"{lead}; no unit makes of the mean what a gyro at rest shows.{choices}"
        return Question(says, ("--gyro-unit", "deg/s"), certain=False)
    fit = fits[0]
    if fit.certain:
        says = f"{lead}: Earth rate, 15.04 deg/h, fits --gyro-unit {fit.words}, {earth_words(fit.size)}."
        return Question(says, ("--gyro-unit", fit.unit))
    possible = ", ".join(f"{earth_words(each.size)} in {each.words}" for each in fits[:3])
    return Question(f"{lead}; the mean is {possible}.{choices}", ("--gyro-unit", fit.unit), certain=False)


def _first_values(source: Source, options: ReadOptions) -> tuple[NDArray[np.float64] | None, float | None]:
    """Raw values of the first usable rows, and about the sample rate, Hz; None where there are none."""
    block = next((block for block in source.blocks() if len(block.values)), None)
    if block is None:
        return None, None
    rows = block.values[np.isfinite(block.values).all(axis=1)]
    values = rows if source.clock is None else rows[:, 1:]
    rate_hz = options.rate_hz or source.stated.rate_hz or source.usual.rate_hz
    if rate_hz is None and source.clock is not None and source.clock.unit is not None and len(rows) > 1:
        step = np.diff(rows[:, 0])
        step = step[step > 0]
        seconds = float(step.mean()) * source.clock.unit if len(step) else 0.0
        rate_hz = 1 / seconds if SHORTEST_STEP < seconds < np.inf else None
    return (values if len(values) > 1 else None), rate_hz


def _rate(source: Source, options: ReadOptions) -> tuple[float | None, str]:
    """Sample rate, Hz, where it is known, and the question where it is known from nothing."""
    declared, stated = options.rate_hz, source.stated.rate_hz
    if declared and stated and abs(declared / stated - 1) > RATE_STATED_TOLERANCE:
        raise InputError(
            f"{source.name} states a rate of {stated:g} Hz; {declared:g} Hz is declared. --rate declares what the "
            "file holds and never resamples: leave it out, or correct it."
        )
    rate_hz = declared or stated or source.usual.rate_hz
    if rate_hz is None and (source.clock is None or source.clock.unit is None):
        why = "has no time column" if source.clock is None else f"counts samples in {source.clock.name}, not time,"
        also = "" if TIME in source.columns else " or name its time column (seconds): --columns t=NAME"
        return None, f"{source.name} {why} and does not state its rate. Declare it: --rate HZ{also}."
    return rate_hz, ""
