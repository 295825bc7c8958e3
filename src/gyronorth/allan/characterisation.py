"""A recording at rest in, the Allan deviations and the profile of its sensor out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import PurePath
from typing import Any

import numpy as np

from gyronorth.allan.at_rest import AtRest, at_rest
from gyronorth.allan.deviation import AllanDeviation, allan_variance, check_samples, default_multiples, with_bounds
from gyronorth.allan.identification import (
    Identification,
    check_varies,
    fitted_multiples,
    identify_variance,
)
from gyronorth.angles import DEG_PER_HOUR
from gyronorth.arrays import Array
from gyronorth.attitude import level, mat_lb
from gyronorth.earth import EARTH_RATE, normal_gravity
from gyronorth.errors import InputError
from gyronorth.recording import Recording, chosen_latitude
from gyronorth.sensor import Sensor, TriadErrors
from gyronorth.sensor.terms import MILLI_G, TERMS

#: Student's 97.5 % points for 1 and 2 degrees of freedom over the normal law's.
STUDENT1, STUDENT2 = 12.7062 / 1.959964, 4.302653 / 1.959964
#: Half the range of normal gravity from the equator to a pole, m/s^2.
GRAVITY_HALF_RANGE = 0.026


@dataclass(frozen=True)
class TriadReport:
    """Allan deviation and error terms of the three axes of a gyro or an accelerometer."""

    deviation: AllanDeviation  # of shape (k, 3)
    axes: tuple[Identification, Identification, Identification]
    triad: Identification  # the three axes as one


@dataclass(frozen=True)
class Characterisation:
    """Allan deviation, error terms and profile of a recording at rest."""

    gyro: TriadReport
    accel: TriadReport | None  # None: gyro only, or an accelerometer that does not vary
    sensor: Sensor  # profile for `write_sensor`
    notes: tuple[str, ...]  # what the profile assumes, bounds or lacks
    source: str  # file name
    duration: float  # s
    rate_hz: float  # Hz

    def to_json(self) -> dict[str, Any]:
        """The object that `gyronorth allan --json` prints, in the units of sensor profiles."""
        return {
            "schema": "gyronorth.allan/1",
            "source": self.source,
            "duration_s": self.duration,
            "rate_hz": self.rate_hz,
            "gyro": _triad_json(self.gyro, "deg_h", DEG_PER_HOUR),
            "accel": None if self.accel is None else _triad_json(self.accel, "mg", MILLI_G),
            "turn_on_bias_deg_h": self.sensor.gyro.turn_on_bias / DEG_PER_HOUR,
            "notes": list(self.notes),
        }


def characterise(
    recording: Recording | AtRest,
    *,
    latitude: float | None = None,
    base: Sensor | None = None,
    name: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> Characterisation:
    """Allan deviation, identified error terms and sensor profile of a recording at rest.

    Parameters
    ----------
    recording : Recording or AtRest
        One still pose without gaps: 60 s at least, an hour or more for a useful profile. A long one
        comes from `axes_in_files`: then one axis at a time is in memory.
    latitude : float, optional
        Geodetic latitude, rad; default: that of the recording. It sharpens the turn-on bias.
    base : Sensor, optional
        Profile that supplies what Allan deviation cannot see: turn-on biases, scale factor,
        misalignment, g-sensitivity, range, longest time constant of the in-run bias.
    name : str, optional
        Name of the profile; default: that of the file.
    progress : callable, optional
        Called with the share of the axes that are done, in (0, 1].

    Returns
    -------
    Characterisation

    Raises
    ------
    InputError
        If the recording is too short, has gaps, or does not vary.

    Notes
    -----
    A term of the profile is the value of the triad where it is identified, else its upper bound,
    and never below the lower end of any axis: an axis that is worse than the others counts.
    Quantisation that is not identified is 0: below the shortest averaging time it is part of N.

    *Turn-on bias* without a base. One recording shows the bias of one session: with the latitude,
    b_N = |horizontal mean rate| - Omega cos(lat) and b_D = vertical mean rate + Omega sin(lat),
    two independent draws to first order, s^2 = (b_N^2 + b_D^2) / 2. The bias along east, which
    cannot be seen and is what turns the heading, is s times a Student t of 2 degrees of freedom. The profile
    therefore says 2.20 s, with which a 95 % interval of the heading holds 95 %. Without latitude
    one draw is left, |mean rate| - Omega, and the factor is 6.48; so it is for the accelerometer,
    of which | |mean specific force| - g | is seen. In-run bias of the same recording is in these
    figures too: they err to the large side.
    """
    if isinstance(recording, Recording):
        recording = at_rest(recording)
    if recording.gaps:
        raise InputError(_gap_message(recording))
    if latitude is not None or recording.latitude is not None:
        latitude = chosen_latitude(latitude, recording.latitude, recording.source)
    axes = 3 if recording.accel is None else 6
    measured = []
    for axis in range(axes):
        triad = recording.gyro if axis < 3 else recording.accel
        assert triad is not None
        measured.append(_measured(triad(axis % 3), recording.rate_hz))
        if progress is not None:
            progress((axis + 1) / axes)
    rate_b, force_b = (np.array([axis.mean for axis in part]) for part in (measured[:3], measured[3:]))
    check_varies(np.array([axis.spread for axis in measured[:3]]), rate_b)
    gyro = _report(measured[:3], recording, 1000.0 if base is None else base.gyro.flicker_longest)
    notes = _remarks("gyro", gyro)
    accel = None
    if recording.accel is not None and all(axis.spread for axis in measured[3:]):
        accel = _report(measured[3:], recording, 1000.0 if base is None else base.accel.flicker_longest)
        notes += _remarks("accelerometer", accel)
    name = name or PurePath(recording.source).stem or "identified"
    sensor = Sensor(name, TriadErrors(), TriadErrors()) if base is None else base
    sensor = replace(
        sensor,
        name=name,
        gyro=replace(sensor.gyro, **_figures(gyro)),
        accel=sensor.accel if accel is None else replace(sensor.accel, **_figures(accel)),
        bounds=(*_bounds("gyro", gyro), *(() if accel is None else _bounds("accel", accel))),
    )
    if base is None:
        sensor, remarks = with_turn_on_bias(sensor, rate_b, force_b if len(force_b) else None, latitude)
    else:
        remarks = [f"Turn-on bias and all that Allan deviation cannot see are those of {base.name}."]
    if accel is None and base is None:
        missing = "There is no accelerometer" if recording.accel is None else "The accelerometer does not vary"
        remarks.append(f"{missing}: its noise is 0 in the profile.")
    notes += remarks
    file = recording.source or "a recording"
    source = f"Allan deviation of {file}, {recording.duration:g} s at {recording.rate_hz:g} Hz."
    return Characterisation(
        gyro=gyro,
        accel=accel,
        sensor=replace(sensor, source=" ".join([source, *notes])),
        notes=tuple(notes),
        source=recording.source,
        duration=recording.duration,
        rate_hz=recording.rate_hz,
    )


def identified_sensor(
    recording: Recording, *, latitude: float | None = None, base: Sensor | None = None, name: str | None = None
) -> Sensor:
    """The profile of `characterise` alone."""
    return characterise(recording, latitude=latitude, base=base, name=name).sensor


@dataclass(frozen=True)
class _Axis:
    """What is needed of one axis."""

    mean: float
    spread: float  # largest less smallest value
    variance: dict[float, float]  # Allan variance at each averaging time, in samples


def _measured(x: Array, rate_hz: float) -> _Axis:
    x = check_samples(x, rate_hz)
    m = np.union1d(fitted_multiples(len(x), rate_hz), default_multiples(len(x)))
    return _Axis(float(x.mean()), float(np.ptp(x)), dict(zip(m.tolist(), allan_variance(x, m).tolist(), strict=True)))


def _report(measured: list[_Axis], recording: AtRest, flicker_longest: float) -> TriadReport:
    n, rate_hz = recording.samples, recording.rate_hz

    def variances(m: Array) -> Array:
        return np.array([[axis.variance[multiple] for axis in measured] for multiple in m.tolist()])

    fitted, shown = variances(fitted_multiples(n, rate_hz)), default_multiples(n)
    how = {"n": n, "rate_hz": rate_hz, "flicker_longest": flicker_longest}
    axes = tuple(identify_variance(column, axes=1, **how) for column in fitted.T)
    triad = identify_variance(fitted.mean(axis=1), axes=3, **how)
    return TriadReport(with_bounds(shown, variances(shown), n=n, rate_hz=rate_hz), (axes[0], axes[1], axes[2]), triad)


def _figures(report: TriadReport) -> dict[str, float]:
    figures = {}
    for term in TERMS:
        triad, lows = report.triad.terms[term.name], [axis.terms[term.name].low for axis in report.axes]
        if triad.status == "identified":
            figures[term.field] = max(triad.value, *lows)
        else:
            figures[term.field] = 0.0 if term.bounded_integral else max(triad.high, *lows)
    return figures


def _bounds(triad: str, report: TriadReport) -> tuple[str, ...]:
    """Figures of the profile that the curve only bounds, as they are called in its file."""
    return tuple(
        f"{triad}.{(term.gyro if triad == 'gyro' else term.accel).key}"
        for term in TERMS
        if report.triad.terms[term.name].status != "identified" and not term.bounded_integral
    )


def _remarks(what: str, report: TriadReport) -> list[str]:
    triad, remarks = report.triad, []
    if triad.misfit > 0:
        remarks.append(
            f"The {what}'s Allan deviation does not follow the model: it is allowed {100 * triad.misfit:.0f} % of "
            "scatter. Sway, vibration or a change of temperature is likely; record on a still base."
        )
    if triad.tau[0] > 1.5 * report.deviation.tau[0]:
        remarks.append(
            f"The {what} is fitted from {triad.tau[0]:.3g} s on: shorter averaging times do not follow the model "
            "(filter, vibration or sway)."
        )
    for term in (term for term in TERMS if not term.bounded_integral):
        words = (term.gyro if what == "gyro" else term.accel).words.removesuffix(" B")
        subject, status = f"The {what}'s {words}", triad.terms[term.name].status
        if status == "upper bound":
            remarks.append(f"{subject} is an upper bound.")
        elif status == "not identified":
            remarks.append(f"{subject} is not identified; the most that the curve allows stands for it.")
    return remarks


def with_turn_on_bias(
    sensor: Sensor, rate_b: Array, force_b: Array | None, latitude: float | None
) -> tuple[Sensor, list[str]]:
    """The sensor with turn-on biases inferred from the mean rate and specific force; see `characterise`."""
    if latitude is None:
        gyro_bias = STUDENT1 * abs(float(np.linalg.norm(rate_b)) - EARTH_RATE)
        seen = f"the size of the mean rate ({STUDENT1:.2f} times its error; with a latitude the figure would be better)"
    else:
        roll, pitch = (0.0, 0.0) if force_b is None else level(force_b)
        x, y, z = mat_lb(roll, pitch) @ rate_b
        north = float(np.hypot(x, y)) - EARTH_RATE * np.cos(latitude)
        down = float(z) + EARTH_RATE * np.sin(latitude)
        gyro_bias = STUDENT2 * float(np.sqrt((north**2 + down**2) / 2))
        seen = f"the mean rate against Earth rate at {np.degrees(latitude):.4g} deg ({STUDENT2:.2f} times its error)"
    remarks = [
        f"The gyro's turn-on bias, {gyro_bias / DEG_PER_HOUR:.3g} deg/h, is inferred from {seen}; recordings of "
        "several power-ups would tell it."
    ]
    accel = sensor.accel
    if force_b is not None:
        gravity = float(normal_gravity(np.pi / 4 if latitude is None else latitude))
        error = abs(float(np.linalg.norm(force_b)) - gravity)
        accel_bias = STUDENT1 * (error if latitude is not None else max(error, GRAVITY_HALF_RANGE))
        accel = replace(accel, turn_on_bias=accel_bias)
        remarks.append(
            f"The accelerometer's turn-on bias, {accel_bias / MILLI_G:.3g} mg, is inferred from the size of the mean "
            f"specific force ({STUDENT1:.2f} times its error)."
        )
    return replace(sensor, gyro=replace(sensor.gyro, turn_on_bias=gyro_bias), accel=accel), remarks


def _gap_message(recording: AtRest) -> str:
    """What is wrong with the gaps, and the longest window without one."""
    starts = [gap.start for gap in recording.gaps]
    ends = [gap.start + gap.samples / recording.rate_hz for gap in recording.gaps]
    pieces = list(zip([0.0, *ends], [*starts, recording.duration], strict=True))
    start, end = max(pieces, key=lambda piece: piece[1] - piece[0])
    missing = sum(gap.samples for gap in recording.gaps)
    return (
        f"{recording.source or 'The recording'} has {len(recording.gaps)} gap(s), {missing} samples in all; bridged "
        "samples would make the noise look smaller. The Allan deviation needs an unbroken record: use a window "
        f"without a gap; the longest is {np.ceil(start * 1000) / 1000:g}:{np.floor(end * 1000) / 1000:g} s."
    )


def _triad_json(report: TriadReport, unit: str, one: float) -> dict[str, Any]:
    deviation = report.deviation
    return {
        "tau_s": deviation.tau.tolist(),
        f"deviation_{unit}": (deviation.deviation / one).tolist(),
        f"low_{unit}": (deviation.low / one).tolist(),
        f"high_{unit}": (deviation.high / one).tolist(),
        "axes": [_identification_json(axis, unit) for axis in report.axes],
        "triad": _identification_json(report.triad, unit),
    }


def _identification_json(identification: Identification, unit: str) -> dict[str, Any]:
    terms = {}
    for term in TERMS:
        form = term.gyro if unit == "deg_h" else term.accel
        found = identification.terms[term.name]
        terms[form.key] = {
            "value": found.value / form.one if found.status == "identified" else None,
            "low": found.low / form.one,
            "high": found.high / form.one,
            "status": found.status,
        }
    return terms | {"fitted_from_s": float(identification.tau[0]), "misfit": identification.misfit}
