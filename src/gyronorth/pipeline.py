"""From a recording, or a batch, to headings with sigma and verdict."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyronorth.alignment import registry, verdict
from gyronorth.alignment.problem import Problem
from gyronorth.alignment.registry import Options
from gyronorth.arrays import Array
from gyronorth.catalogue import REASONS
from gyronorth.conditioning import decimated
from gyronorth.errors import InputError
from gyronorth.estimate import Convergence, HeadingBatch, HeadingEstimate
from gyronorth.given import checked_latitude, checked_path, finite, number, numbers, of_kind
from gyronorth.recording import LARGEST_SAMPLE, Recording
from gyronorth.sensor import Sensor, read_sensor

if TYPE_CHECKING:
    from gyronorth.deviation import DeviationModel

#: Methods that `heading` offers.
METHODS = tuple(registry.METHODS)
#: Recordings of a batch are worked in groups of about this many samples, to bound memory.
GROUP_SAMPLES = 1_500_000
#: Times of `convergence`, at most.
MOST_POINTS = 10_000


def heading(
    recording: Recording | str | os.PathLike[str] | ArrayLike | Sequence[Recording],
    *,
    rate_hz: float | None = None,
    accel_b: ArrayLike | None = None,
    latitude: float | None = None,
    sensor: Sensor | str | None = None,
    method: str = "auto",
    model: str | Path | None = None,
    attitude: tuple[float, float] | None = None,
    turn_angles: Sequence[float] | None = None,
    turn_angle_sigma: float | None = None,
    deviation: DeviationModel | None = None,
    require_sigma: float | None = None,
) -> HeadingEstimate:
    """Heading of a recording from the Earth rate it senses, with sigma and verdict.

    Parameters
    ----------
    recording : Recording, path, array_like of shape (n, 3), or list of Recording
        Angular rate and, if there is one, specific force: a recording, a file that `read` opens with nothing
        declared, or the angular rate in the body frame, rad/s. A list: each one still pose of the same power-up, in
        order of time, with the `turn_angles` between them; the heading is that of the last.
    rate_hz : float, optional
        Sample rate of an array, Hz.
    accel_b : array_like, shape (n, 3), optional
        Specific force beside an array, m/s^2.
    latitude : float, optional
        Geodetic latitude, rad; taken from the recording when left out.
    sensor : Sensor or str, optional
        Profile: a `Sensor`, a shipped name or a file. Without one the bias scale is inferred
        from what can be seen, and `bias_unknown` warns.
    method : str
        One of `METHODS`. "auto" takes "turned" if the recording holds two or more poses, else "posterior"
        ("mean" where a deviation curve is given).
    model : str or Path, optional
        Bundle for "learned", "paper" and "baseline"; without one, that which ships with the package.
    attitude : tuple of float, optional
        Known roll and pitch, rad, in place of levelling by the accelerometer.
    turn_angles : sequence of float, optional
        Angles of the turns between poses, rad, clockwise from above, as an index table gives
        them; without them the gyro measures them.
    turn_angle_sigma : float, optional
        Standard deviation of one of them, rad; without it, from what the gyro measures of the turns.
    deviation : DeviationModel, optional
        Deviation curve, applied to the closed form where `deviation.covers(recording.session)`.
    require_sigma : float, optional
        Largest sigma, rad, with which the heading is of use; above it `sigma_required` refuses it.

    Returns
    -------
    HeadingEstimate

    Raises
    ------
    InputError
        If the latitude is missing, out of range or contradicts the recording, the method is
        unknown or cannot work on this recording. Also if a valid heading depends on a
        declaration that is missing, such as the axes (`Finding.blocking`).
    """
    poses, options = _poses_of(recording), _options(model, turn_angles, deviation, turn_angle_sigma)
    if poses is None:
        recording, segments = _as_recording(recording, rate_hz, accel_b), None  # type: ignore[arg-type]
    else:
        from gyronorth.alignment.turned.joined import one_recording

        recording, segments = one_recording(poses, options.turn_angles)
    problem = Problem(
        recording.gyro_b,
        recording.accel_b,
        recording.rate_hz,
        recording.latitude_given(latitude),
        None if sensor is None else read_sensor(sensor),
        attitude,
        recording.session,
        segments,
    )
    result = registry.solve(method, problem, options)
    marked = tuple(note for note in recording.notes if note.code in REASONS)
    notes = tuple(note for note in recording.notes if note not in marked)
    found = verdict.estimate(problem, result, notes=notes, start_time_utc=recording.start_time_utc)
    found = _with_other_headings(replace(found, reasons=(*found.reasons, *marked)), recording.axes)
    for note in recording.notes:
        if note.blocking and found.valid:
            raise InputError(note.message)
    return found.required(require_sigma)


def _with_other_headings(found: HeadingEstimate, axes: str) -> HeadingEstimate:
    """The warning that axes are assumed, with the headings that the others would give."""
    if found.heading is None or not any(warning.code == "axes_assumed" for warning in found.warnings):
        return found
    from gyronorth.readers.axes import about_vertical

    others = ", ".join(
        f"{np.degrees((found.heading + added) % (2 * np.pi)):.2f} deg with --axes {letters}"
        for letters, added in about_vertical(axes)
    )
    warnings = [
        replace(warning, message=f"{warning.message} The heading would be {others}.")
        if warning.code == "axes_assumed"
        else warning
        for warning in found.warnings
    ]
    return replace(found, warnings=tuple(warnings))


def heading_batch(
    gyro_b: ArrayLike | Iterator[ArrayLike],
    accel_b: ArrayLike | Iterator[ArrayLike] | None = None,
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
    gyro_b, accel_b : array_like, shape (recordings, samples, 3), or iterator of these
        Angular rate, rad/s, and specific force, m/s^2; without the latter the unit is taken
        as level. Of any kind of real number, and larger than the memory where they are a `numpy.memmap`, a dataset of
        h5py or zarr, or an iterator of parts: some recordings are worked at a time, and no more of them is read.
    rate_hz : float
        Sample rate, Hz.
    latitude : float
        rad.
    sensor : Sensor or str, optional
        As in `heading`.
    method : str
        As in `heading`, and with the same answers.
    model : str or Path, optional
        As in `heading`.

    Returns
    -------
    HeadingBatch

    Raises
    ------
    InputError
        If a value is not finite, there are no samples, the rate is not positive or the
        latitude out of range, the method is unknown or needs an accelerometer; one of the two is an iterator and the
        other is not, or ends before it.
    """
    known: dict[str, Any] = {"rate_hz": rate_hz, "latitude": latitude, "method": method, "model": model}
    known["sensor"] = None if sensor is None else read_sensor(sensor)
    pieces: list[HeadingBatch] = []
    for gyro, accel in _parts_of(gyro_b, accel_b):
        pieces += _batches(gyro, accel, **known)
    if not pieces:
        raise InputError("gyro_b holds no recordings; at least one is expected.")
    return HeadingBatch(*(np.concatenate([getattr(piece, name) for piece in pieces]) for name in vars(pieces[0])))


def _parts_of(gyro_b: Any, accel_b: Any) -> Iterator[tuple[Any, Any]]:
    """Arrays of recordings, one after the other, of which parts can be had without the whole."""
    if isinstance(gyro_b, Iterator) != isinstance(accel_b, Iterator) and accel_b is not None:
        raise InputError("One of gyro_b and accel_b is an iterator of parts; both are expected to be, part for part.")
    parts: Iterable[tuple[Any, Any]] = [(gyro_b, accel_b)]
    if isinstance(gyro_b, Iterator):
        each = cast("Iterator[Any]", gyro_b)
        parts = ((part, None) for part in each) if accel_b is None else zip_longest(each, accel_b, fillvalue=())
    for gyro, accel in parts:
        yield _sliceable("gyro_b", gyro), None if accel is None else _sliceable("accel_b", accel)


def _sliceable(name: str, array: Any) -> Any:
    """An array, or what is read in slices like one, as a dataset of h5py."""
    if all(hasattr(array, each) for each in ("ndim", "shape", "size", "dtype")):
        return array
    return numbers(name, array, "(recordings, samples, 3)")


def _batches(
    gyro: NDArray[Any],
    accel: NDArray[Any] | None,
    *,
    rate_hz: float,
    latitude: float,
    sensor: Sensor | None,
    method: str,
    model: str | Path | None,
) -> list[HeadingBatch]:
    """Headings of the recordings of one array, some at a time."""
    if gyro.ndim != 3 or gyro.shape[-1] != 3 or (accel is not None and accel.shape != gyro.shape):
        raise InputError(
            f"gyro_b has shape {gyro.shape}, accel_b {None if accel is None else accel.shape}; "
            "(recordings, samples, 3) is expected of both."
        )
    rate_hz = finite("rate_hz", rate_hz, "Hz", positive=True)
    for name, array in (("gyro_b", gyro), ("accel_b", accel)):
        if array is not None and array.size == 0:
            raise InputError(f"{name} has shape {array.shape}; at least one recording with samples is expected.")
    latitude = checked_latitude(latitude)
    options = _options(model, None, None)
    _check_session(method, options)
    group = max(1, GROUP_SAMPLES // gyro.shape[1])
    pieces: list[HeadingBatch] = []
    for start in range(0, len(gyro), group):
        rate = _finite("gyro_b", gyro, start, group)
        force = None if accel is None else _finite("accel_b", accel, start, group)
        problem = Problem(rate, force, rate_hz, latitude, sensor)
        pieces.append(verdict.batch(problem, registry.solve_batch(method, problem, options)))
    return pieces


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
    recording : Recording
        One pose, of any length.
    latitude, sensor, method, model, attitude : optional
        As in `heading`.
    points : int
        Number of times, evenly spaced in the logarithm from 5 s, or a twentieth, to the end.
    """
    of_kind("recording", recording, Recording, "a Recording")
    points = round(finite("points", points, "times", positive=True))
    if points > MOST_POINTS:
        raise InputError(f"points is {points}; at most {MOST_POINTS} are expected.")
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


def _poses_of(source: object) -> list[Recording] | None:
    """The recordings of a list of them; None where the source is one recording."""
    given: list[object] = list(source) if isinstance(source, list | tuple) else []  # type: ignore[arg-type]
    found = [one for one in given if isinstance(one, Recording)]
    if found and len(found) < len(given):
        raise InputError("Poses of several recordings are a list of nothing but recordings; read each file first.")
    return found or None


def _as_recording(
    source: Recording | str | os.PathLike[str] | ArrayLike, rate_hz: float | None, accel_b: ArrayLike | None
) -> Recording:
    """What `heading` was given, as a recording."""
    given = isinstance(source, Recording | str | os.PathLike)
    if given and (rate_hz is not None or accel_b is not None):
        raise InputError(
            "rate_hz and accel_b belong to an array of rates; a recording or a file brings its own. Leave them out."
        )
    if isinstance(source, Recording):
        return source
    if isinstance(source, str | os.PathLike):
        from gyronorth.readers import read

        return read(os.fspath(source))
    if rate_hz is None:
        raise InputError("An array of rates came without rate_hz; give the sample rate in Hz.")
    return Recording(source, accel_b, rate_hz)  # type: ignore[arg-type]  # it checks and converts


def _options(
    model: Any,
    turn_angles: Any,
    deviation: DeviationModel | None,
    turn_angle_sigma: float | None = None,
) -> Options:
    if turn_angles is not None and (not hasattr(turn_angles, "__iter__") or getattr(turn_angles, "ndim", 1) == 0):
        raise InputError(f"turn_angles is {turn_angles!r:.80}; a sequence of angles in rad is expected.")
    angles = None if turn_angles is None else tuple(number("A turn angle", angle) for angle in turn_angles)
    if turn_angle_sigma is not None:
        turn_angle_sigma = number("The sigma of the turn angles", turn_angle_sigma)
    bundle = None if model is None else checked_path("model", model)
    if deviation is not None and not hasattr(deviation, "covers"):
        raise InputError(f"deviation is {deviation!r:.80}; a curve is expected, as `read_deviation` gives it.")
    return Options(bundle, angles, turn_angle_sigma, deviation)


def _check_session(method: str, options: Options) -> None:
    """A bundle's deviation curve holds for one session, and a batch names none."""
    if options.bundle is None or not registry.METHODS.info(method).takes_bundle:
        return
    from gyronorth.alignment.networks.bundle import read_bundle

    if read_bundle(options.bundle).deviation is not None:
        raise InputError(
            "The bundle corrects recordings of one session, and a batch says none. Use `heading` with each recording."
        )


def _finite(name: str, array: NDArray[Any], start: int, count: int) -> Array:
    """Some recordings of a batch as doubles."""
    part = numbers(name, array[start : start + count], "(recordings, samples, 3)")
    if not (abs(part) <= LARGEST_SAMPLE).all():  # nor is NaN
        run, sample, axis = np.argwhere(~(abs(part) <= LARGEST_SAMPLE))[0]
        raise InputError(
            f"{name}[{start + run}, {sample}, {axis}] is {part[run, sample, axis]}; finite numbers up to "
            f"{LARGEST_SAMPLE:g} rad/s or m/s^2 are expected. Leave that recording out, or repair it."
        )
    return part
