"""Recordings of a unit on the rotating Earth from a sensor model, with truth.

measured = (1 + scale + misalignment) true + g-sensitivity x specific force + `sensor_errors`,
limited to the range, then quantised. One run is one power-up: turn-on bias, scale factor,
misalignment and g-sensitivity are drawn anew for each.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gyronorth.angles import wrap_heading
from gyronorth.arrays import Array
from gyronorth.errors import InputError
from gyronorth.given import checked_latitude, finite, numbers, of_kind
from gyronorth.recording import Recording
from gyronorth.sensor import Sensor, TriadErrors, read_sensor
from gyronorth.sensor.drawing import sensor_errors
from gyronorth.sensor.law import NoiseLaw
from gyronorth.simulation.motion import DISTURBANCES, Motion, true_motion

__all__ = ["DISTURBANCES", "Motion", "sensor_errors", "simulate", "simulate_batch"]

# Values of one triad that are worked on at once: 32 MB, so that temporaries stay small beside the result.
_CHUNK = 4_000_000
#: Angles beyond this, rad, are no angles.
LARGEST_ANGLE = 1e9
#: Samples that are simulated, at most: 24 GB of angular rate.
MOST_SAMPLES = 10**9


def simulate(
    sensor: Sensor | str,
    *,
    latitude: float,
    heading: float,
    duration: float,
    rate_hz: float,
    rng: np.random.Generator,
    roll: float = 0.0,
    pitch: float = 0.0,
    motion: Motion | None = None,
    accel: bool = True,
) -> Recording:
    """A recording of one power-up, with its true heading.

    Parameters
    ----------
    sensor : Sensor or str
        Sensor model, name of a built-in profile, or profile file.
    latitude : float
        Geodetic latitude, rad; negative in the southern hemisphere.
    heading : float
        Heading of the body x axis at the start, rad, clockwise from true north.
    duration, rate_hz : float
        Length, s, and sample rate, Hz.
    rng : numpy.random.Generator
        Source of randomness.
    roll, pitch : float
        Attitude of the undisturbed unit, rad.
    motion : Motion, optional
        Turns about the vertical and disturbance; standing still by default.
    accel : bool
        Whether the recording has specific force.

    Returns
    -------
    Recording
        With `latitude`, `heading_true` (at the end, undisturbed) and a `session` of its own.

    Raises
    ------
    InputError
        If an argument is out of range or a turn outlasts the recording.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> recording = simulate("sdc500", latitude=0.56, heading=1.0, duration=10, rate_hz=100, rng=rng)
    >>> recording.gyro_b.shape, recording.heading_true
    ((1000, 3), 1.0)
    """
    sensor, motion = read_sensor(sensor), Motion() if motion is None else motion
    latitude, heading = checked_latitude(latitude), finite("heading", heading, "rad")
    roll, pitch = finite("roll", roll, "rad"), finite("pitch", pitch, "rad")
    gyro_b, accel_b = simulate_batch(
        sensor,
        runs=1,
        latitude=latitude,
        heading=heading,
        duration=duration,
        rate_hz=rate_hz,
        rng=rng,
        roll=roll,
        pitch=pitch,
        motion=motion,
        accel=accel,
    )
    return Recording(
        gyro_b=gyro_b[0],
        accel_b=None if accel_b is None else accel_b[0],
        rate_hz=rate_hz,
        latitude=latitude,
        heading_true=float(wrap_heading(heading + motion.total_angle)),
        session=f"simulated-{rng.integers(2**32):08x}",
        source=f"simulated {sensor.name}",
    )


def simulate_batch(
    sensor: Sensor | str,
    *,
    runs: int,
    latitude: ArrayLike,
    heading: ArrayLike,
    duration: float,
    rate_hz: float,
    rng: np.random.Generator,
    roll: ArrayLike = 0.0,
    pitch: ArrayLike = 0.0,
    motion: Motion | None = None,
    accel: bool = True,
) -> tuple[Array, Array | None]:
    """Many independent power-ups at once, for Monte Carlo studies.

    Parameters are those of `simulate`; `latitude`, `heading`, `roll` and `pitch` may also have one
    value per run, shape (runs,). Temporaries are bounded, the result is not: 24 bytes per sample
    and triad. Parallel work takes one `rng.spawn` child per batch.

    Returns
    -------
    gyro_b : ndarray, shape (runs, samples, 3)
        Mean angular rate over each sample's interval, rad/s.
    accel_b : ndarray, shape (runs, samples, 3), or None
        Mean specific force, m/s^2; None if `accel` is false.
    """
    sensor, motion = read_sensor(sensor), Motion() if motion is None else motion
    of_kind("motion", motion, Motion, "a Motion")
    of_kind("rng", rng, np.random.Generator, "a generator, as of numpy.random.default_rng(SEED),")
    of_kind("accel", accel, bool | np.bool_, "true or false")
    duration = finite("duration", duration, "s", positive=True)
    rate_hz = finite("rate_hz", rate_hz, "Hz", positive=True)
    pose = _pose(runs, latitude=latitude, roll=roll, pitch=pitch, heading=heading)
    samples = _samples(runs, duration, rate_hz, motion)
    gyro_b = np.empty((runs, samples, 3))
    accel_b = np.empty((runs, samples, 3)) if accel else None
    rows = max(1, _CHUNK // (3 * samples))
    for first in range(0, runs, rows):
        part = slice(first, first + rows)
        truth = true_motion(motion, pose[:, part], samples, rate_hz, rng=rng)
        shape = (pose[:, part].shape[1], samples)
        sensitivity = sensor.g_sensitivity * rng.standard_normal((shape[0], 3, 3))
        bias = truth.accel_b @ np.swapaxes(sensitivity, -1, -2) if sensor.g_sensitivity else np.zeros((1, 1, 3))
        gyro_b[part] = _measure(sensor.gyro, truth.gyro_b, bias, shape, rate_hz, rng=rng)
        if accel_b is not None:
            accel_b[part] = _measure(sensor.accel, truth.accel_b, np.zeros((1, 1, 3)), shape, rate_hz, rng=rng)
    return gyro_b, accel_b


def _pose(runs: int, **angles: ArrayLike) -> Array:
    """The angles of each run, rad, shape (4, runs)."""
    if not isinstance(runs, int | np.integer) or runs < 1:
        raise InputError(f"runs is {runs!r:.80}; a whole number of at least 1 is expected.")
    pose: list[Array] = []
    for name, given in angles.items():
        angle = numbers(name, given, "(runs,)")
        if angle.shape not in ((), (runs,)):
            raise InputError(f"{name} has shape {angle.shape}; one angle, or one for each of {runs} runs, is expected.")
        if not (abs(angle) <= LARGEST_ANGLE).all():
            raise InputError(f"{name} is {angle!r:.80}; finite angles in rad are expected.")
        if name in ("latitude", "pitch") and not (abs(angle) <= np.pi / 2).all():
            raise InputError(f"{name} is {np.degrees(np.max(abs(angle))):g} deg; -90 to 90 deg is expected.")
        pose.append(np.broadcast_to(angle, (runs,)))
    return np.stack(pose)


def _samples(runs: int, duration: float, rate_hz: float, motion: Motion) -> int:
    """Number of samples of a run."""
    count = duration * rate_hz
    if not 0.5 < count * runs <= MOST_SAMPLES:
        raise InputError(
            f"{duration:g} s at {rate_hz:g} Hz, {runs} times, are {count * runs:.0f} samples; 1 to {MOST_SAMPLES:g} "
            "are expected. Make it shorter, or the rate lower."
        )
    end = max((start + length for start, length, _ in motion.turns), default=0.0)
    if end > duration + 1e-9:
        raise InputError(f"The last turn ends at {end:g} s, after the recording of {duration:g} s. Make it longer.")
    return round(count)


def _measure(
    errors: TriadErrors, true: Array, bias: Array, shape: tuple[int, int], rate_hz: float, *, rng: np.random.Generator
) -> Array:
    """What the triad gives for the `true` signal plus a known `bias`, (runs, samples, 3) each or broadcast."""
    runs = shape[0]
    matrix = errors.misalignment * rng.standard_normal((runs, 3, 3))
    axis = np.arange(3)
    matrix[:, axis, axis] = 1 + errors.scale_factor * rng.standard_normal((runs, 3))
    signal = true @ np.swapaxes(matrix, -1, -2) + bias
    constant = errors.turn_on_bias * rng.standard_normal((runs, 3))
    if signal.shape[1] == 1:  # standing still
        out = NoiseLaw(errors).draw(shape, rate_hz, constant=constant + signal[:, 0], rng=rng)
    else:
        out = NoiseLaw(errors).draw(shape, rate_hz, constant=constant, rng=rng)
        out += signal
    if errors.saturation < np.inf:
        np.clip(out, -errors.saturation, errors.saturation, out=out)
    if errors.quantisation > 0:
        _quantise(out, errors.quantisation * rate_hz, rng=rng)
    return out


def _quantise(signal: Array, step: float, *, rng: np.random.Generator) -> None:
    """Quantise the integrated signal, in place: what one sample loses the next one gives, so the mean is kept.

    The residue before the first sample is uniform, as it is in a unit that has been running.
    """
    total = np.cumsum(signal, axis=1)
    total /= step
    total += rng.random((len(signal), 1, 3))
    np.floor(total, out=total)
    signal[:, 1:] = np.diff(total, axis=1)
    signal[:, 0] = total[:, 0]
    signal *= step


def __dir__() -> list[str]:
    return sorted(__all__)
