"""From a recording, or a batch, to headings with sigma and verdict: joins the rooms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from gyronorth.arrays import Array
from gyronorth.choice import TRAINED, bundle_of, deviated, find
from gyronorth.conclusion import Found, as_batch, estimate_of
from gyronorth.conditioning import decimated
from gyronorth.deviation import DeviationModel
from gyronorth.errors import InputError
from gyronorth.estimate import Convergence, HeadingBatch, HeadingEstimate
from gyronorth.recording import Recording
from gyronorth.sensor import Sensor, read_sensor
from gyronorth.solution import (
    Data,
    disturbance,
    mean_alignment,
    prefers_inertial,
    saturation_gates,
    solve_inertial,
    solve_mean,
    unknown,
)
from gyronorth.specialists import BAYES_LONGEST, BAYES_RATE, BAYES_SHORTEST, bayes_fits
from gyronorth.validity import length_gate

#: Methods that `heading` offers.
METHODS = ("auto", "mean", "inertial", "turned", "bayes", *TRAINED)
#: Latitudes given and stored may differ by this, rad, before it is a mistake.
LATITUDE_CONFLICT = np.radians(0.1)
#: Recordings of a batch are worked in groups of about this many samples, to bound memory.
GROUP_SAMPLES = 1_500_000


def heading(
    recording: Recording,
    *,
    latitude: float | None = None,
    sensor: Sensor | str | None = None,
    method: str = "auto",
    model: str | Path | None = None,
    attitude: tuple[float, float] | None = None,
    turn_angles: Sequence[float] | None = None,
    deviation: DeviationModel | None = None,
) -> HeadingEstimate:
    """Heading of a recording from the Earth rate it senses, with sigma and verdict.

    Parameters
    ----------
    recording : Recording
        Angular rate and, if there is one, specific force.
    latitude : float, optional
        Geodetic latitude, rad; taken from the recording when left out.
    sensor : Sensor or str, optional
        Profile: a `Sensor`, a shipped name or a file. Without one the bias scale is inferred
        from what can be seen, and `bias_unknown` warns.
    method : str
        One of `METHODS`. "auto" takes "turned" if the recording holds two or more poses; else
        "learned" ("bayes", where that cannot explain it or is not installed) if the bias settles
        or walks; else, if it is disturbed, of these, "inertial" and "mean" the one whose own sigma
        is smallest; else "mean".
    model : str or Path, optional
        Bundle for "learned", "paper" and "baseline"; without one, that which ships with the package.
    attitude : tuple of float, optional
        Known roll and pitch, rad, in place of levelling by the accelerometer.
    turn_angles : sequence of float, optional
        Angles of the turns between poses, rad, clockwise from above, as an index table gives
        them; without them the gyro measures them.
    deviation : DeviationModel, optional
        Deviation curve, applied to the closed form where `deviation.covers(recording.session)`.

    Returns
    -------
    HeadingEstimate

    Raises
    ------
    InputError
        If the latitude is missing, out of range or contradicts the recording, the method is
        unknown or cannot work on this recording; or the heading would be valid but for a note
        of the reader that wants a declaration (`Note.blocking`).
    """
    data = Data(
        recording.gyro_b,
        recording.accel_b,
        recording.rate_hz,
        _latitude(latitude, recording),
        None if sensor is None else read_sensor(sensor),
        attitude,
    )
    _check_method(method, data, model)
    if turn_angles is not None and method not in ("auto", "turned"):
        raise InputError(f"Turn angles belong to method turned, or auto; method {method} was given. Leave them out.")
    short = length_gate(data.gyro_b.shape[-2], data.duration, ())
    if short.failed:
        found = Found("mean", replace(unknown(mean_alignment(data)), gates=[short]), "too short for any other")
    else:
        found = find(method, data, model, turn_angles, session=recording.session)
    if deviation is not None:
        found = deviated(found, data, deviation, session=recording.session)
    estimate = estimate_of(recording, data, found)
    for note in recording.notes:
        if note.blocking and estimate.valid:
            raise InputError(note.message)
    return estimate


def heading_batch(
    gyro_b: ArrayLike,
    accel_b: ArrayLike | None = None,
    *,
    rate_hz: float,
    latitude: float,
    sensor: Sensor | str | None = None,
    method: str = "mean",
    model: str | Path | None = None,
) -> HeadingBatch:
    """Headings of many recordings of one length at once.

    Parameters
    ----------
    gyro_b, accel_b : array_like, shape (recordings, samples, 3)
        Angular rate, rad/s, and specific force, m/s^2; without the latter the unit is taken
        as level.
    rate_hz : float
        Sample rate, Hz.
    latitude : float
        rad.
    sensor : Sensor or str, optional
        As in `heading`.
    method : str
        As in `heading`; "auto" takes every recording for one pose and chooses of "mean" and
        "inertial".
    model : str or Path, optional
        As in `heading`.

    Returns
    -------
    HeadingBatch

    Raises
    ------
    InputError
        If a value is not finite, there are no samples, the rate is not positive or the
        latitude out of range, the method is unknown or needs an accelerometer.
    """
    gyro = np.asarray(gyro_b, dtype=float)
    accel = None if accel_b is None else np.asarray(accel_b, dtype=float)
    if gyro.ndim != 3 or gyro.shape[-1] != 3 or (accel is not None and accel.shape != gyro.shape):
        raise ValueError(
            f"gyro_b has shape {gyro.shape}, accel_b {None if accel is None else accel.shape}; "
            "(recordings, samples, 3) is expected of both."
        )
    _check_batch({"gyro_b": gyro} if accel is None else {"gyro_b": gyro, "accel_b": accel}, rate_hz)
    _check_latitude(latitude)
    profile = None if sensor is None else read_sensor(sensor)
    group = max(1, GROUP_SAMPLES // gyro.shape[1])
    pieces = []
    for start in range(0, len(gyro), group):
        part = slice(start, start + group)
        data = Data(gyro[part], None if accel is None else accel[part], rate_hz, latitude, profile)
        _check_method(method, data, model)
        if method in ("auto", "mean", "inertial"):
            pieces.append(_batch(method, data))
        else:
            pieces += [_one_of_batch(method, data, model, index) for index in range(len(data.gyro_b))]
    return HeadingBatch(*(np.concatenate([getattr(piece, name) for piece in pieces]) for name in vars(pieces[0])))


def convergence(
    recording: Recording,
    *,
    latitude: float | None = None,
    sensor: Sensor | str | None = None,
    method: str = "mean",
    model: str | Path | None = None,
    attitude: tuple[float, float] | None = None,
    points: int = 60,
) -> Convergence:
    """Heading and interval against the time used, from the start of the recording.

    Parameters
    ----------
    recording, latitude, sensor, method, model, attitude
        As in `heading`.
    points : int
        Number of times, evenly spaced in the logarithm from 5 s, or a twentieth, to the end.
    """
    slow = decimated(recording, min(10.0, recording.rate_hz))
    times = np.geomspace(min(5.0, slow.duration / 20), slow.duration, points)
    counts = np.unique(np.maximum(2, np.round(times * slow.rate_hz).astype(int)))
    runs = [
        heading(
            replace(slow.window(0.0, count / slow.rate_hz), gaps=(), notes=()),
            latitude=latitude,
            sensor=sensor,
            method=method,
            model=model,
            attitude=attitude,
        )
        for count in counts
    ]
    angle = np.array([np.nan if run.heading is None else run.heading for run in runs])
    low, high = (np.array([run.interval95[side] for run in runs]) for side in (0, 1))
    return Convergence(
        time=counts / slow.rate_hz,
        heading=angle,
        half_width=np.where(high - low >= 2 * np.pi, np.pi, ((high - low) % (2 * np.pi)) / 2),
        valid=np.array([run.valid for run in runs]),
    )


def _check_method(method: str, data: Data, model: str | Path | None) -> None:
    if method not in METHODS:
        raise InputError(f"Method {method!r} is not known; one of {', '.join(METHODS)} is expected.")
    if model is not None and method not in TRAINED:
        raise InputError(f"A bundle was given, but method {method} runs none; {' and '.join(TRAINED)} do.")
    if method == "inertial" and data.accel_b is None:
        raise InputError(
            "Method 'inertial' traces gravity and needs specific force; the recording has angular rate only. "
            "Use --method mean."
        )
    if method == "bayes" and not bayes_fits(data):
        raise InputError(
            f"Method 'bayes' works on {BAYES_SHORTEST:g} to {BAYES_LONGEST:g} s at {BAYES_RATE:g} Hz or more; the "
            f"recording has {data.duration:g} s at {data.rate_hz:g} Hz. Cut it with --window, or use --method mean."
        )


def _check_latitude(latitude: float) -> None:
    if not abs(latitude) <= np.pi / 2:
        raise InputError(
            f"The latitude is {latitude:g} rad, {np.degrees(latitude):g} deg; a value in [-90, 90] deg, given in rad, "
            "is expected."
        )


def _check_batch(arrays: dict[str, Array], rate_hz: float) -> None:
    if not 0 < rate_hz < np.inf:
        raise InputError(f"The rate is {rate_hz:g} Hz; a positive number is expected.")
    for name, array in arrays.items():
        if array.size == 0:
            raise InputError(f"{name} has shape {array.shape}; at least one recording with samples is expected.")
        if not np.isfinite(array).all():
            run, sample, axis = np.argwhere(~np.isfinite(array))[0]
            raise InputError(
                f"{name}[{run}, {sample}, {axis}] is {array[run, sample, axis]}; finite numbers are expected. "
                "Leave that recording out, or repair it."
            )


def _latitude(given: float | None, recording: Recording) -> float:
    stored = recording.latitude
    if given is None and stored is None:
        raise InputError(
            "The latitude is not known: neither given nor in the file. Pass --latitude DEG (north positive); "
            "Earth rate cannot be read without it."
        )
    if given is not None:
        _check_latitude(given)
    if given is not None and stored is not None and abs(given - stored) > LATITUDE_CONFLICT:
        raise InputError(
            f"Latitude {np.degrees(given):.4f} deg was given, but {recording.source or 'the recording'} says "
            f"{np.degrees(stored):.4f} deg; they differ by more than 0.1 deg. Correct one of them."
        )
    return float(stored if given is None else given)  # type: ignore[arg-type]


def _one_of_batch(method: str, data: Data, model: str | Path | None, index: int) -> HeadingBatch:
    one = replace(data, gyro_b=data.gyro_b[index], accel_b=None if data.accel_b is None else data.accel_b[index])
    if method == "learned" and bundle_of(method, model).deviation is not None:
        raise InputError(
            "The bundle corrects recordings of one session, and a batch says none. Use `heading` with each recording."
        )
    found = find(method, one, model, None)
    single = as_batch(found.solution, saturation_gates(one), np.asarray(method))
    return HeadingBatch(*(np.asarray(value)[None] for value in vars(single).values()))


def _batch(method: str, data: Data) -> HeadingBatch:
    found = mean_alignment(data)
    shape = found.heading.shape
    short = length_gate(data.gyro_b.shape[-2], data.duration, shape)
    names = np.full(shape, "mean", dtype="<U16")
    if short.failed.any():
        return as_batch(unknown(found), [short], names)
    moved = disturbance(data, found)
    mean = solve_mean(data, found, moved)
    extra = saturation_gates(data)
    result = as_batch(mean, extra, names)
    asked = np.full(shape, method == "inertial" or (method == "auto" and data.sensor is None)) | moved.detected
    if method == "mean" or data.accel_b is None or not asked.any():
        return result
    # Only what may take the other method pays for it.
    some = replace(data, gyro_b=data.gyro_b[asked], accel_b=data.accel_b[asked])
    found = mean_alignment(some)
    moved = disturbance(some, found)
    traced = solve_inertial(some, moved)
    take = np.ones(asked.sum(), bool)
    if method == "auto":
        take = prefers_inertial(some, moved, solve_mean(some, found, moved), traced)
    other = as_batch(traced, saturation_gates(some), np.full(asked.sum(), "inertial", dtype="<U16"))
    rows = np.flatnonzero(asked)[take]
    for name, values in vars(other).items():
        getattr(result, name)[rows] = values[take]
    return result
