"""Does what was declared fit what was measured? Units and axes against Earth rate and gravity.

A body at rest senses Earth rate plus its gyro bias, and gravity. Good gyros (bias below Earth
rate) therefore show their unit: the right one gives a norm near 15.04 deg/h. Poor ones do
not, and are let through: the validity limits of the heading deal with them. Gravity shows
the unit of any accelerometer, and which axis is vertical.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gyronorth.angles import DEG_PER_HOUR, DEG_PER_SQRT_HOUR
from gyronorth.arrays import mean_of_rows
from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY
from gyronorth.errors import InputError
from gyronorth.readers.axes import about_vertical, convention, mat_bf
from gyronorth.readers.declared import Declared
from gyronorth.readers.evidence import KEPT_ONE_OF, NEAR_GRAVITY, norm_of_parts, robust_mean, sample_noise
from gyronorth.readers.options import ACCEL_PROPOSED, ACCEL_UNITS, GYRO_PROPOSED, GYRO_UNITS
from gyronorth.recording import Note

#: A mean rate within this fraction of Earth rate tells that a unit is right.
NEAR_EARTH_RATE = 0.25
#: A mean rate beyond this factor above or below Earth rate tells that it may be wrong.
FAR_FROM_EARTH_RATE = 8.0
#: Mean rates (in Earth rates) and angle random walks (rad/sqrt(s)) that no gyro at rest shows.
COMMON_RATES = ("rad/s", "deg/s", "deg/h")
IMPLAUSIBLE_LOW, IMPLAUSIBLE_HIGH = 0.1, 2000.0
IMPLAUSIBLE_ARW = 30 * DEG_PER_SQRT_HOUR
#: The same for the unit proposed in place of an implausible one.
PROPOSED_LOW, PROPOSED_HIGH = 0.3, 1000.0
PROPOSED_ARW_LOW, PROPOSED_ARW_HIGH = 1e-5 * DEG_PER_SQRT_HOUR, 10 * DEG_PER_SQRT_HOUR
#: Mean specific force of a body at rest, in g: wide for poor accelerometers and moving vehicles.
FORCE_LOW, FORCE_HIGH = 0.7, 1.4
#: The same for the unit proposed in place of an implausible one.
PROPOSED_FORCE_LOW, PROPOSED_FORCE_HIGH = 0.9, 1.1
#: Share of gravity along body down below which the axes are suspect: a tilt of 60 deg.
SUSPECT_DOWN_SHARE = 0.5
#: Mean rates of parts that differ by more than so many standard deviations of a single sample are motion.
MOVING = 5.0
#: Parts in a row without motion that are worth a window.
STILL_PARTS = 3
#: Parts into which a recording is cut; the median of their means ignores a drive or a turn in some of them.
PARTS = 21


class Misfit(InputError):
    """A declaration that cannot be right, and the first of those that fit in its place, or the options that cure it."""

    def __init__(
        self, text: str, sensor: str = "", unit: str = "", increments: bool = False, options: tuple[str, ...] = ()
    ) -> None:
        super().__init__(text)
        self.sensor, self.unit, self.increments, self.options = sensor, unit, increments, options


def check_units(samples: NDArray[np.float64], declared: Declared, *, rate_hz: float, name: str) -> None:
    """Compare mean and noise with Earth rate and gravity under the declared and the other units.

    Parameters
    ----------
    samples : ndarray, shape (n, 3) or (n, 6)
        Angular rate, rad/s, and specific force, m/s^2, by the declared units.

    Raises
    ------
    Misfit
        If the declared unit is implausible; it names the one that is not.
    """
    gyro, gyro_error = robust_mean(samples[:, :3], PARTS)
    moves = _moves(samples[:, :3])
    force = vertical = None
    if samples.shape[1] == 6:
        force, _ = robust_mean(samples[:, 3:], PARTS)
        norm = float(np.linalg.norm(gyro)) / EARTH_RATE
        _check_force(norm_of_parts(samples[:, 3:]), norm, declared, rate_hz=rate_hz, name=name)
        vertical = float(gyro @ force / np.linalg.norm(force))
    norm, noise = float(np.linalg.norm(gyro)) / EARTH_RATE, sample_noise(samples[:, :3]) / np.sqrt(rate_hz)
    uncertain = float(np.linalg.norm(gyro_error)) / EARTH_RATE
    implausible = norm > IMPLAUSIBLE_HIGH or noise > IMPLAUSIBLE_ARW or (norm + 3 * uncertain < IMPLAUSIBLE_LOW)
    if moves is not None:
        if implausible:
            raise InputError(_moving(samples[:, :3], moves, declared, rate_hz=rate_hz, name=name))
        return  # the mean of a unit that moves shows no unit
    likely: list[tuple[str, bool]] = []
    possible: list[tuple[str, bool]] = []
    for unit, increments, factor in _others(GYRO_UNITS, declared.gyro_unit, declared.gyro_increments, rate_hz):
        if force is not None and increments != declared.gyro_increments:
            continue  # gravity has told already whether these are increments
        certain = uncertain * factor < NEAR_EARTH_RATE
        near = abs(norm * factor - 1) < NEAR_EARTH_RATE and certain
        if near and vertical is not None and declared.latitude is not None:
            near = abs(vertical * factor / EARTH_RATE - np.sin(declared.latitude)) < NEAR_EARTH_RATE
        far = not 1 / FAR_FROM_EARTH_RATE < norm < FAR_FROM_EARTH_RATE
        if near and far and (implausible or unit in COMMON_RATES):
            likely.append((unit, increments))
        elif PROPOSED_LOW < norm * factor < PROPOSED_HIGH and (
            noise == 0 or PROPOSED_ARW_LOW < noise * factor < PROPOSED_ARW_HIGH
        ):
            possible.append((unit, increments))
    proposed = likely or (possible if implausible else [])
    if proposed:
        fits = " or ".join(_words("gyro", *each, declared) for each in proposed)
        raise Misfit(
            f"{name}: the mean angular rate is {norm * EARTH_RATE / DEG_PER_HOUR:.4g} deg/h and its angle random walk "
            f"{noise / DEG_PER_SQRT_HOUR:.2g} deg/sqrt(h) if "
            f"{_words('gyro', declared.gyro_unit, declared.gyro_increments)} is right; a gyro at rest shows "
            f"Earth rate, 15.04 deg/h, and its bias. {fits} fits. "
            "(If the declaration is right, the bias hides Earth rate and no heading can be had.)",
            "gyro",
            *proposed[0],
        )


def check_flags(flagged: NDArray[np.int64], samples: int, *, name: str) -> tuple[Note, ...]:
    """What the unit itself says of its samples; each is a reason.

    `flagged` (2,) counts the samples, as `FLAGS`.
    """
    ranged, faulty = (int(count) for count in flagged)
    notes: list[Note] = []
    if ranged:
        message = (
            f"{name} marks {ranged} of {samples} samples as at the end of the range: a clipped signal has another "
            "mean. Take a larger range, or leave the shock out (--window)."
        )
        notes.append(Note("saturated", message, float(ranged), 0.0))
    if faulty:
        message = (
            f"{name} marks {faulty} of {samples} samples as not to be trusted: the unit is starting up, or reports an "
            "error. Leave that part out (--window; live: Start), and see the unit's manual if it stays."
        )
        notes.append(Note("sensor_fault", message, float(faulty), 0.0))
    return tuple(notes)


def _moves(gyro: NDArray[np.float64]) -> float | None:
    """By how much the mean rates of parts differ, in the unit of `gyro`, if far more than any noise lets them."""
    parts = min(PARTS, len(gyro))
    means = mean_of_rows(gyro[: parts * (len(gyro) // parts)].reshape(parts, -1, 3))
    spread = float(np.ptp(means, axis=0).max())
    scatter = sample_noise(gyro)
    return spread if parts == PARTS and scatter > 0 and spread > MOVING * scatter else None


def _moving(gyro: NDArray[np.float64], spread: float, declared: Declared, *, rate_hz: float, name: str) -> str:
    """What to do about a unit that moves; the window named is one whose rates have been looked at."""
    size = len(gyro) // PARTS
    means = gyro[: PARTS * size].reshape(PARTS, size, 3)
    halves = np.array([means[:, : size // 2].mean(axis=1), means[:, size // 2 :].mean(axis=1)])
    scatter = sample_noise(gyro)
    still = (np.abs(halves[0] - halves[1]).max(axis=1) < 8 * scatter / np.sqrt(size / 2)) & (
        np.linalg.norm(halves.mean(axis=0), axis=1) < IMPLAUSIBLE_HIGH * EARTH_RATE
    )
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]])))
    begins, ends = edges[::2], edges[1::2]
    if len(begins) and (ends - begins).max() >= STILL_PARTS:
        longest = int(np.argmax(ends - begins))
        first, last = begins[longest] * size / rate_hz, ends[longest] * size / rate_hz
        cure = f"Take a still part: from {first:.4g} to {last:.4g} s of what was read it stands (--window START:END)."
    else:
        cure = "No part of what was read stands still: take a still part of another place (--window START:END), or "
        cure += "record the unit at rest."
    return (
        f"{name}: the unit moves: its mean rate differs by {np.degrees(spread):.4g} deg/s between parts if "
        f"{_words('gyro', declared.gyro_unit, declared.gyro_increments)} is right. {cure}"
    )


def check_axes(samples: NDArray[np.float64], declared: Declared, *, name: str) -> tuple[Note, ...]:
    """Which axis gravity lies along, against the axes: no note, one `axes_suspect`, or one `axes_assumed`.

    `samples`, shape (n, 3) or (n, 6), are in file axes. A sensor that lies upside down looks the same
    as one with z up, and the heading of its x axis comes out the same; but right-forward-up
    taken for forward-right-down would be a right angle off. So the note is blocking where
    nobody declared the axes.
    """
    if samples.shape[1] != 6:
        return _assumed(declared, name)
    force_file, _ = robust_mean(samples[:, 3:], PARTS)
    if np.linalg.norm(force_file) < 0.5 * norm_of_parts(samples[:, 3:]):
        return _assumed(declared, name)  # it was turned over: no axis is the vertical one
    down = -float((mat_bf(declared.axes) @ force_file)[2] / np.linalg.norm(force_file))
    if down >= SUSPECT_DOWN_SHARE:
        return _assumed(declared, name)
    vertical = int(np.argmax(np.abs(force_file)))
    message = (
        f"The mean specific force of {name} is ({', '.join(f'{value:+.2f}' for value in force_file)}) m/s^2 in file "
        f"axes: its {'xyz'[vertical]} axis points {'up' if force_file[vertical] > 0 else 'down'}, which does not fit "
        f"axes {declared.axes}. Most likely the file has other axes: {_vertical_conventions(force_file)}. "
    )
    if declared.axes_declared:
        message += "With those the heading is another one; it is right if the sensor is really mounted that way round."
    else:
        message += (
            f"Declare them: --axes with one of these, or --axes {declared.axes} if the sensor is really mounted that "
            "way round. (If the file holds gravity instead of specific force, as phones of Apple do: --accel-scale -1.)"
        )
    return (Note("axes_suspect", message, value=down, limit=SUSPECT_DOWN_SHARE, blocking=not declared.axes_declared),)


def _assumed(declared: Declared, name: str) -> tuple[Note, ...]:
    """The warning that the axes are not stated; none where the format defines them."""
    if declared.axes_origin != "assumed":
        return ()
    message = (
        f"The axes of {name} are not stated: {declared.axes} is assumed. Gravity does not show which of them points "
        "forward, so the heading may be off by 90, 180 or 270 deg. Declare it: --axes "
        f"{' or '.join(letters for letters, _ in about_vertical(declared.axes))}, or {declared.axes} if that is right."
    )
    return (Note("axes_assumed", message),)


def _vertical_conventions(force_file: NDArray[np.float64]) -> str:
    """The usual conventions, as --axes wants them, whose down is where gravity points."""
    axis = int(np.argmax(np.abs(force_file)))
    up = force_file[axis] > 0
    if axis == 2:
        return "flu (forward-left-up) or rfu (right-forward-up)" if up else "frd (forward-right-down)"
    # Body down is the file axis that points down; forward is one of the two others, either way round.
    down = f"{'-' if up else '+'}{'xyz'[axis]}"
    found = []
    for forward in (index for index in range(3) if index != axis):
        for sign in "+-":
            right = 3 - axis - forward
            for right_sign in "+-":
                text = f"{sign}{'xyz'[forward]}{right_sign}{'xyz'[right]}{down}"
                try:
                    found.append(f"{text} ({convention(mat_bf(text))})")
                except InputError:  # the left-handed one of the pair
                    continue
    return " or ".join(found)


def _check_force(size: float, norm: float, declared: Declared, *, rate_hz: float, name: str) -> None:
    """Mean specific force, m/s^2, against gravity; `norm` is the mean rate in Earth rates."""
    share = size / STANDARD_GRAVITY
    if FORCE_LOW <= share <= FORCE_HIGH:
        return
    proposed = [
        (unit, increments)
        for unit, increments, factor in _others(ACCEL_UNITS, declared.accel_unit, declared.accel_increments, rate_hz)
        if PROPOSED_FORCE_LOW <= share * factor <= PROPOSED_FORCE_HIGH
    ]
    parts = [number for number in KEPT_ONE_OF if abs(share * number - 1) < NEAR_GRAVITY]
    if not proposed and parts:
        interval = 1 / (parts[0] * rate_hz) if declared.increment_interval is None else None
        cure, options = f"That is gravity over {parts[0]}", ()
        if declared.increments and interval is not None:
            cure += (
                f": each increment covers {1e3 * interval:.4g} ms, but one is logged every {1e3 / rate_hz:.4g} ms. "
                f"--increment-interval {interval:.6g} fits."
            )
            options = ("--increment-interval", f"{interval:.6g}")
        else:
            cure += (
                f": increments of a sensor {parts[0]} times as fast, or a driver with the wrong rate, are likely. "
                f"--accel-scale {parts[0]} makes it gravity; the rates are probably wrong by as much (--gyro-scale)."
            )
            scales = ("--accel-scale", f"{parts[0] * declared.accel_scale:.10g}")
            if abs(norm * parts[0] - 1) < NEAR_EARTH_RATE:
                options = (*scales, "--gyro-scale", f"{parts[0] * declared.gyro_scale:.10g}")
            elif abs(norm - 1) < NEAR_EARTH_RATE:
                options = scales
        raise Misfit(_weighs(size, declared, name) + cure, options=options)
    if proposed:
        fits = " or ".join(_words("accel", *each, declared) for each in proposed)
        raise Misfit(f"{_weighs(size, declared, name)}{fits} fits.", "accel", *proposed[0])
    raise InputError(
        _weighs(size, declared, name) + "No other unit fits: has gravity been taken out, or is the accelerometer off? "
        "Without it, leave the f columns out (--columns f_x=-,f_y=-,f_z=-) and give --roll and --pitch."
    )


def _weighs(size: float, declared: Declared, name: str) -> str:
    return (
        f"{name}: the mean specific force is {size:.4g} m/s^2 if "
        f"{_words('accel', declared.accel_unit, declared.accel_increments)} is right; at rest it is gravity, "
        f"{STANDARD_GRAVITY:.2f} m/s^2 ({FORCE_LOW:g} to {FORCE_HIGH:g} times that is accepted). "
    )


def _others(units: dict[str, float], unit: str, increments: bool, rate_hz: float) -> Iterator[tuple[str, bool, float]]:
    """Other readings of the same numbers: unit, whether increments, and the factor on the values."""
    for other_increments in (increments, not increments):
        per_second = {(False, False): 1.0, (True, True): 1.0, (False, True): rate_hz, (True, False): 1 / rate_hz}
        for other in (unit for unit in (*GYRO_PROPOSED, *ACCEL_PROPOSED) if unit in units):
            scale = units[other]
            if (other, other_increments) != (unit, increments):
                yield other, other_increments, scale / units[unit] * per_second[increments, other_increments]


def _words(sensor: str, unit: str, increments: bool, declared: Declared | None = None) -> str:
    """A reading as the command line declares it; with `declared`, only what would have to change."""
    words = f"--{sensor}-unit {unit}"
    if declared is None:
        return f"{words} --increments" if increments else words
    if unit == (declared.gyro_unit if sensor == "gyro" else declared.accel_unit):
        words = ""
    if increments != (declared.gyro_increments if sensor == "gyro" else declared.accel_increments):
        words += " --increments" if increments else " without --increments"
    return words.strip()
