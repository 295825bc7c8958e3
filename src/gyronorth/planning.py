"""Expected heading sigma of a sensor at a latitude, against time, and when waiting no longer helps."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyronorth.alignment.gates import WIDEST_HALF_WIDTH
from gyronorth.alignment.turned.bound import turned_sigma
from gyronorth.arrays import Array
from gyronorth.errors import InputError
from gyronorth.given import checked_latitude, finite, number, numbers
from gyronorth.sensor import Sensor, read_sensor
from gyronorth.uncertainty import heading_sigma_parts, von_mises

Method = Literal["mean", "inertial"]

#: Times that are considered at all, s: one second to one day.
SHORTEST, LONGEST = 1.0, 86400.0
#: Times that may be asked for, s: thirty years.
LONGEST_PLAN = 1e9
#: Waiting is useless once sigma is this near its least value.
NEAR_ENOUGH = 1.05
#: Most turns that a plan goes through.
MOST_TURNS = 20
#: Latitudes of the table, deg.
LATITUDES_DEG = np.arange(0.0, 81.0, 10.0)

_STEPS = np.array([1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8])


@dataclass(frozen=True)
class Plan:
    """Expected heading sigma of one still pose against its duration."""

    sensor: Sensor
    latitude: float  # rad
    method: Method
    duration: Array  # (k,) s
    parts: dict[str, Array]  # noise, drift, turn_on_bias, levelling: (k,) rad, to first order
    sigma: Array  # (k,) rad, what `heading` is expected to claim
    half_width: Array  # (k,) half of the 95 % interval, rad
    least_sigma: float  # least first-order sigma within a day, rad
    useful_duration: float | None  # s; waiting longer is useless. None: it helps for more than half a day
    shortest_duration: float | None  # s, from which a heading is told from its reverse. None: never within a day
    latitudes: Array  # (l,) rad
    sigma_by_latitude: Array  # (l, k) rad

    def to_json(self) -> dict[str, Any]:
        """The object that `gyronorth plan --json` prints; a figure that does not exist is None."""
        return {
            "schema": "gyronorth.plan/1",
            "sensor": self.sensor.name,
            "latitude_deg": float(np.degrees(self.latitude)),
            "method": self.method,
            "useful_duration_s": self.useful_duration,
            "shortest_duration_s": self.shortest_duration,
            "least_sigma_deg": float(np.degrees(self.least_sigma)),
            "duration_s": self.duration.tolist(),
            "sigma_deg": np.degrees(self.sigma).tolist(),
            "half_width95_deg": np.degrees(self.half_width).tolist(),
            "sigma_parts_deg": {name: np.degrees(part).tolist() for name, part in self.parts.items()},
            "latitudes_deg": np.degrees(self.latitudes).round(9).tolist(),
            "sigma_by_latitude_deg": np.degrees(self.sigma_by_latitude).tolist(),
        }


def plan(
    sensor: str | os.PathLike[str] | Sensor,
    *,
    latitude: float,
    durations: ArrayLike | None = None,
    method: Method = "mean",
) -> Plan:
    """Expected heading sigma of a still pose against time, with its parts, and how long to wait.

    Parameters
    ----------
    sensor : str, path or Sensor
        Name of a built-in profile, a profile file, or the sensor itself.
    latitude : float
        Geodetic latitude, rad.
    durations : array_like, shape (k,), optional
        Durations, s. Default: ten in a decade from 10 s to one day.
    method : {"mean", "inertial"}
        Plain averaging, or inertial-frame alignment.

    Returns
    -------
    Plan

    Raises
    ------
    InputError
        If the sensor is not known, or latitude or durations make no sense.

    Notes
    -----
    The parts are those of `uncertainty.heading_sigma_parts`; their root sum square is the first-order
    sigma s(T). `sigma` and `half_width` are those of the von Mises law of concentration 1 / s^2,
    as in `heading`: they end at pi / sqrt(3) and pi where nothing is known.

    *Waiting is useless* after the least T with s(T) <= 1.05 min s(T'), both within one second to
    one day: noise falls as 1 / sqrt(T), the turn-on bias does not fall, and drift may grow. Where
    that T is above half a day, as for a sensor of white noise alone, time still helps and
    `useful_duration` is None. A heading can be told from its reverse from the least T at which
    the half-width is at most 90 deg.

    The in-run bias of the model is stationary: it averages out beyond its longest time constant,
    1000 s unless the profile says otherwise. A plan of hours leans on that.
    """
    sensor = read_sensor(sensor)
    latitude = checked_latitude(latitude)
    if not isinstance(method, str) or method not in ("mean", "inertial"):
        raise InputError(f"method is {method!r:.80}; mean or inertial is expected.")
    duration = _default_durations() if durations is None else np.atleast_1d(numbers("durations", durations, "(k,)"))
    if duration.ndim != 1 or len(duration) == 0 or not (np.isfinite(duration) & (duration > 0)).all():
        raise InputError(f"durations is {durations!r:.80}; a list of positive times in s is expected.")
    if duration.max() > LONGEST_PLAN:
        raise InputError(f"durations has {duration.max():g} s; at most {LONGEST_PLAN:g} s are expected.")

    parts = heading_sigma_parts(sensor, latitude=latitude, duration=duration, method=method)
    sigma, half_width = von_mises(1 / _square(parts))

    time = np.geomspace(SHORTEST, LONGEST, 2000)
    square = _square(heading_sigma_parts(sensor, latitude=latitude, duration=time, method=method))
    useful = float(time[np.argmax(square <= NEAR_ENOUGH**2 * square.min())])
    told = von_mises(1 / square)[1] <= WIDEST_HALF_WIDTH

    latitudes = np.radians(LATITUDES_DEG)
    by_latitude = heading_sigma_parts(sensor, latitude=latitudes[:, None], duration=duration, method=method)
    return Plan(
        sensor=sensor,
        latitude=latitude,
        method=method,
        duration=duration,
        parts=parts,
        sigma=sigma,
        half_width=half_width,
        least_sigma=float(np.sqrt(square.min())),
        useful_duration=useful if useful <= LONGEST / 2 else None,
        shortest_duration=float(time[np.argmax(told)]) if told.any() else None,
        latitudes=latitudes,
        sigma_by_latitude=von_mises(1 / _square(by_latitude))[0],
    )


@dataclass(frozen=True)
class TurnPlan:
    """Expected heading sigma of poses and turns that share one time of standing still."""

    sensor: Sensor
    latitude: float  # rad
    still_duration: float  # s, shared evenly by the poses
    turn_duration: float  # s, of each turn
    turns: NDArray[np.int64]  # (k,) number of turns, from 0
    angle: Array  # (a,) of each turn, rad
    sigma: Array  # (k, a) rad, the Cramer-Rao bound of the sensor's noise law

    def to_json(self) -> list[dict[str, Any]]:
        """What `gyronorth plan --turns --json` adds under "turns", one object for a number and angle."""
        return [
            {
                "turns": int(number),
                "angle_deg": float(np.degrees(angle)),
                "still_duration_s": self.still_duration,
                "turn_duration_s": self.turn_duration,
                "sigma_deg": float(np.degrees(self.sigma[row, column])),
            }
            for row, number in enumerate(self.turns)
            for column, angle in enumerate(self.angle)
        ]


def plan_turns(
    sensor: str | os.PathLike[str] | Sensor,
    *,
    latitude: float,
    turns: int,
    still_duration: float = 100.0,
    turn_duration: float = 10.0,
) -> TurnPlan:
    """How much each further turn helps: sigma after 0 to `turns` turns of 180 and of 90 deg.

    Parameters
    ----------
    sensor, latitude
        As in `plan`.
    turns : int
        Largest number of turns.
    still_duration : float
        Time of standing still in all, s.
    turn_duration : float
        Time of one turn, s.

    Returns
    -------
    TurnPlan

    Raises
    ------
    InputError
        If the number of turns is not 1 to `MOST_TURNS`.
    """
    latitude = checked_latitude(latitude)
    if number("turns", turns) not in range(1, MOST_TURNS + 1):
        raise InputError(f"{turns} turns were asked for; 1 to {MOST_TURNS} are expected.")
    still_duration = finite("still_duration", still_duration, "s", positive=True)
    turn_duration = finite("turn_duration", turn_duration, "s", positive=True)
    if max(still_duration, turn_duration) > LONGEST_PLAN:
        raise InputError(f"A plan of more than {LONGEST_PLAN:g} s was asked for; less is expected.")
    sensor, angles = read_sensor(sensor), np.array([np.pi, np.pi / 2])
    counts = np.arange(int(turns) + 1)
    sigma = [
        [
            turned_sigma(
                sensor,
                latitude=latitude,
                turns=(float(angle),) * int(count),
                still_duration=still_duration,
                turn_duration=turn_duration,
            )
            for angle in angles
        ]
        for count in counts
    ]
    return TurnPlan(sensor, latitude, still_duration, turn_duration, counts, angles, np.array(sigma))


def _square(parts: dict[str, Array]) -> Array:
    """Square of the first-order sigma; a perfect sensor is given 1e-12 rad, below any that exists."""
    return np.sum([part**2 for part in parts.values()], axis=0) + 1e-24


def _default_durations() -> Array:
    times = np.concatenate([_STEPS * 10**power for power in range(1, 5)])
    return np.append(times[times < LONGEST], LONGEST)
