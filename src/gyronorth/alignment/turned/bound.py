"""What a plan of poses and turns is worth before anyone turns: the bound of its heading."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gyronorth.alignment.turned.model import (
    SPIN,
    State,
    attitudes,
    heading_gradient,
    linearise,
    posterior,
    prior,
    regular,
)
from gyronorth.alignment.turned.segments import BLOCK_ANGLE, TurnedBlocks, blocks_per_stretch
from gyronorth.attitude import mat_bn, mean_rotation, rotation
from gyronorth.earth import earth_rate_n
from gyronorth.sensor import Sensor
from gyronorth.sensor.law import NoiseLaw


def turned_sigma(
    sensor: Sensor,
    *,
    latitude: float,
    turns: tuple[float, ...],
    still_duration: float = 100.0,
    turn_duration: float = 10.0,
    accel: bool = True,
    bias_known: bool = True,
) -> float:
    """Cramer-Rao bound of the heading at the end, rad, for a plan of poses and turns of a level unit.

    Parameters
    ----------
    sensor : Sensor
        Its error model.
    latitude : float
        rad.
    turns : tuple of float
        Angle of each turn, rad, clockwise positive: one more pose than turns; () is one pose.
    still_duration : float
        Time of standing still, s, shared evenly by the poses.
    turn_duration : float
        Time of one turn, s.
    accel : bool
        With an accelerometer; without it the poses are level within `LEVEL_SIGMA`.
    bias_known : bool
        Whether the turn-on bias is that of the profile; else it is anything.

    Returns
    -------
    float
        Root mean square over eight headings.
    """
    variances: list[float] = []
    for heading in np.arange(8) * np.pi / 4:
        blocks, state = _ideal(sensor, turns, heading, still_duration, turn_duration, latitude, accel)
        linear = linearise(blocks, state, sensor, latitude=latitude)
        law = NoiseLaw(sensor.gyro)
        noise = linear.covariance(law.mean_covariance(blocks.first, blocks.last, rate_hz=blocks.rate_hz))
        known = prior(sensor, spins=0, bias_known=bias_known)
        gradient = heading_gradient(state.end)
        covariance = posterior(linear, regular(noise), known)[0][:3, :3]
        variances.append(float(gradient @ covariance @ gradient))
    return float(np.sqrt(np.mean(variances)))


def _ideal(
    sensor: Sensor, turns: tuple[float, ...], heading: float, still: float, turning: float, latitude: float, accel: bool
) -> tuple[TurnedBlocks, State]:
    """Blocks and state of a level unit that turns at a constant rate about the vertical, at 100 Hz."""
    rate_hz, per_stretch = 100.0, blocks_per_stretch(len(turns) + 1, sensor.gyro)
    first, spent = [0], 0.0
    stretch, yaw = list[int](), list[float]()
    for number in range(len(turns) + 1):
        edges = np.linspace(0, still / (len(turns) + 1), per_stretch + 1)[1:] + spent
        first += [round(float(edge)) for edge in edges * rate_hz]
        stretch += [number] * per_stretch
        yaw += [0.0] * per_stretch
        spent += still / (len(turns) + 1)
        if number < len(turns):
            parts = max(1, int(np.ceil(abs(turns[number]) / BLOCK_ANGLE)))
            ends = (np.arange(parts, dtype=float) + 1) * turning / parts * rate_hz + spent * rate_hz
            first += [round(float(end)) for end in ends]
            stretch += [-1] * parts
            yaw += [turns[number] / parts] * parts
            spent += turning
    yaw_vector = np.outer(yaw, [0.0, 0.0, 1.0])
    edges = np.array(first)
    seconds = np.diff(edges) / rate_hz
    mean_b = mean_rotation(yaw_vector)
    state = State(mat_bn(0.0, 0.0, heading).T, np.zeros(SPIN))
    n = len(seconds)
    zeros = np.zeros((n, 3))
    blank = TurnedBlocks(
        edges[:-1], edges[1:], np.array(stretch), np.full(n, -1), zeros, zeros if accel else None,
        rotation(yaw_vector), mean_b, rate_hz, np.zeros(n), np.zeros(n),
    )  # fmt: skip
    attitude = attitudes(blank, state, latitude=latitude)
    earth_b = np.swapaxes(attitude @ mean_b, -1, -2) @ earth_rate_n(latitude)
    turn_b = rotation(yaw_vector + np.where(blank.still, 0.0, seconds)[:, None] * earth_b)
    gyro_b = earth_b + yaw_vector / seconds[:, None]
    return replace(blank, gyro_b=gyro_b, turn_b=turn_b), state
