"""Six-axis sensor error generation beside python-ins, allantools and numpy + scipy.

The same error terms, float64 and length for all: white noise and a first-order bias on each of six
axes, 1e6 samples at 100 Hz. python-ins and allantools know the random-walk bias, so ours has it
there; `lfilter` recipes know the Gauss-Markov bias (here 100 s), so ours has it there.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.signal import lfilter

from benchmarks.comparison import Comparison
from gyronorth.sensor import Sensor, TriadErrors, read_sensor
from gyronorth.sensor.drawing import draw
from gyronorth.sensor.terms import ProcessLaw
from gyronorth.simulation import sensor_errors, simulate_batch

SAMPLES = 1_000_000
RATE_HZ = 100.0
#: White noise, random walk and turn-on bias of gyro and accelerometer, SI.
TRIADS = (
    TriadErrors(white=6e-6, random_walk=1e-8, turn_on_bias=5e-6),
    TriadErrors(white=1e-3, random_walk=1e-6, turn_on_bias=5e-3),
)
TIME_CONSTANT = 100.0
MARKOV_SIGMA = 5e-6


def comparisons() -> Iterable[Comparison]:
    """The comparisons of this module."""
    yield _random_walk()
    yield _recording()
    yield _gauss_markov()
    yield _profile()


def _random_walk() -> Comparison:
    rng = np.random.default_rng(1)
    return Comparison(
        title="Errors of six axes: white noise + random-walk bias + turn-on bias, 1e6 samples",
        ours="gyronorth",
        candidates={
            "gyronorth": lambda: [sensor_errors(errors, (1, SAMPLES), RATE_HZ, rng=rng) for errors in TRIADS],
            "python-ins": _pyins(),
            "allantools": _allantools(),
            "numpy": lambda: [_numpy_random_walk(errors, rng) for errors in TRIADS],
        },
        targets={"python-ins": 3.0},
    )


def _recording() -> Comparison:
    rng = np.random.default_rng(1)
    sensor = Sensor("benchmark", *TRIADS)
    settings = {"runs": 1, "latitude": 0.56, "heading": 1.0, "duration": SAMPLES / RATE_HZ, "rate_hz": RATE_HZ}
    return Comparison(
        title="The same added to true rate and specific force through a misalignment matrix (a whole recording)",
        ours="gyronorth",
        candidates={
            "gyronorth": lambda: simulate_batch(sensor, rng=rng, **settings),
            "python-ins": _pyins(),
        },
        targets={"python-ins": 3.0},
    )


def _gauss_markov() -> Comparison:
    rng = np.random.default_rng(1)
    return Comparison(
        title="Errors of six axes: white noise + Gauss-Markov bias (100 s), 1e6 samples",
        ours="gyronorth",
        candidates={
            "gyronorth": lambda: [_markov_errors(errors.white, rng) for errors in TRIADS],
            "numpy + scipy lfilter": lambda: [_lfilter_errors(errors.white, rng) for errors in TRIADS],
        },
    )


def _profile() -> Comparison:
    rng = np.random.default_rng(1)
    sensor = read_sensor("sdc500")
    triads = (sensor.gyro, sensor.accel)
    return Comparison(
        title="Errors of six axes of the profile sdc500 (white noise, turn-on bias, flicker of nine processes)",
        ours="gyronorth",
        candidates={"gyronorth": lambda: [sensor_errors(errors, (1, SAMPLES), RATE_HZ, rng=rng) for errors in triads]},
    )


def _pyins():
    import pandas as pd
    from pyins import inertial_sensor
    from pyins.util import ACCEL_COLS, GYRO_COLS

    imu = pd.DataFrame(
        np.tile([5e-5, -3e-5, -4e-5, 0.0, 0.0, -9.8], (SAMPLES, 1)),
        index=np.arange(SAMPLES) / RATE_HZ,
        columns=GYRO_COLS + ACCEL_COLS,
    )

    def generate():
        gyro, accel = (
            inertial_sensor.Parameters(bias=[e.turn_on_bias] * 3, noise=e.white, bias_walk=e.random_walk, rng=number)
            for number, e in enumerate(TRIADS)
        )
        return inertial_sensor.apply_imu_parameters(imu, "rate", gyro, accel)

    return generate


def _allantools():
    from allantools import noise as allantools_noise

    def generate():
        out = np.empty((SAMPLES, 6))
        for axis in range(6):
            errors = TRIADS[axis // 3]
            white = allantools_noise.white(SAMPLES, b0=errors.white**2, fs=RATE_HZ)
            walk = allantools_noise.brown(SAMPLES, b_minus2=errors.random_walk**2, fs=RATE_HZ)
            out[:, axis] = white + walk + errors.turn_on_bias
        return out

    return generate


def _numpy_random_walk(errors: TriadErrors, rng: np.random.Generator):
    walk = np.cumsum(errors.random_walk / np.sqrt(RATE_HZ) * rng.standard_normal((SAMPLES, 3)), axis=0)
    white = errors.white * np.sqrt(RATE_HZ) * rng.standard_normal((SAMPLES, 3))
    return white + walk + errors.turn_on_bias * rng.standard_normal(3)


def _lfilter_errors(white: float, rng: np.random.Generator):
    keep = np.exp(-1 / (RATE_HZ * TIME_CONSTANT))
    drive = MARKOV_SIGMA * np.sqrt(1 - keep**2) * rng.standard_normal((SAMPLES, 3))
    drive[0] = MARKOV_SIGMA * rng.standard_normal(3)
    bias = lfilter([1.0], [1.0, -keep], drive, axis=0)
    return bias + white * np.sqrt(RATE_HZ) * rng.standard_normal((SAMPLES, 3))


def _markov_errors(white: float, rng: np.random.Generator):
    law = ProcessLaw(white, processes=((MARKOV_SIGMA**2, TIME_CONSTANT),))
    return draw(law, (1, SAMPLES), RATE_HZ, constant=np.zeros((1, 3)), rng=rng)
