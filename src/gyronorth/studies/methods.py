"""The methods without a network that the studies compare, on splits of the published reconstruction."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import cos, radians

import numpy as np
from numpy.typing import NDArray

from gyronorth.angles import DEG_PER_HOUR, angle_error
from gyronorth.deviation import PRIORS, fit_classical, fit_deviation, rate_surplus
from gyronorth.earth import EARTH_RATE
from gyronorth.evaluation import Split
from gyronorth.published import LATITUDE, Twin, model_based
from gyronorth.sensor import Sensor, TriadErrors
from gyronorth.studies.source import WINDOW, recordings_of
from gyronorth.uncertainty import cramer_rao_floor

Array = NDArray[np.float64]
#: Heading of the closed form, rad, and surplus to its expected error and the standard deviation of that, rad.
Predictor = Callable[[Array, Array], tuple[Array, Array]]

MODEL_BASED = "model-based"
CLASSICAL = "deviation curve, A + B sin + C cos + D sin 2 + E cos 2"
GP = "deviation curve, Gaussian process on heading"
LEARNED = "learned + deviation"
#: Row of a table -> prior of the deviation; the ablations take one ingredient away each.
DEVIATIONS = {
    GP: "gp on heading",
    "learned + deviation, Gaussian noise": "gaussian noise",
    "learned + deviation, no coupling to the rate": "no coupling",
    "learned + deviation, always a curve": "always a curve",
    LEARNED: "learned",
}
METHODS = (MODEL_BASED, CLASSICAL, *DEVIATIONS)


def north(rate: float) -> float:
    """Heading error, rad, of an east rate error, rad/s, at the published latitude."""
    return rate / (EARTH_RATE * cos(LATITUDE))


def bias_deviation(heading: Array, mean_rate: Array) -> float:
    """Standard deviation of the residual horizontal bias per axis, rad/s, of true headings and mean rates."""
    expected = EARTH_RATE * cos(LATITUDE) * np.stack([np.cos(heading), -np.sin(heading)], axis=1)
    return float((mean_rate[:, :2] - expected).std(axis=0).mean())


def floor(recordings: Twin, duration: float) -> float:
    """Cramer-Rao floor, rad, of the noise and of a bias that cannot be learnt."""
    bias = bias_deviation(recordings.heading_true, recordings.gyro_l.mean(axis=1))
    sensor = Sensor("published", TriadErrors(white=recordings.arw, turn_on_bias=bias))
    return float(cramer_rao_floor(sensor, latitude=LATITUDE, duration=duration))


def judge_split(
    *, train: list[int], validation: list[int], test: list[int], seed: int, data: dict | None = None
) -> dict:
    """Errors and sigmas, deg, of every method on the test recordings: see `judged`."""

    def fitted(heading: Array, surplus: Array, truth: Array) -> dict[str, Predictor]:
        models = {name: fit_deviation(heading, surplus, truth, prior=PRIORS[key]) for name, key in DEVIATIONS.items()}
        corrections: dict[str, Predictor] = {CLASSICAL: lambda at, _: fit_classical(heading, truth, at=at)}
        return corrections | {name: model.predict for name, model in models.items()}

    split = Split(np.array(train, int), np.array(test, int), np.array(validation, int))
    return judged(recordings_of(seed, data), split, fitted)


def judged(twin: Twin, split: Split, fitted: Callable[[Array, Array, Array], Mapping[str, Predictor]]) -> dict:
    """Errors and sigmas, deg, of the closed form and of corrections to it on the tests, whole and in 100 s windows.

    `fitted` learns the corrections, by name, from heading, surplus and true heading of the whole known recordings,
    rad; a window's sigma includes the noise that the whole recording does not have.
    """
    known = split.known
    heading, truth = model_based(twin.gyro_l)[known], twin.heading_true[known]
    surplus = rate_surplus(twin.gyro_l.mean(axis=1), LATITUDE)[known]
    corrections = fitted(heading, surplus, truth)
    spread = float(np.sqrt(np.mean(angle_error(heading, truth) ** 2)))

    def judge(duration: float) -> dict:
        gyro_l, true, recording = twin.windows(duration)
        tested = np.isin(recording, split.test)
        at, at_surplus = model_based(gyro_l[tested]), rate_surplus(gyro_l[tested].mean(axis=1), LATITUDE)
        expected = {MODEL_BASED: (np.zeros(len(at)), np.full(len(at), spread))}
        expected |= {name: correction(at, at_surplus) for name, correction in corrections.items()}
        error = angle_error(at, true[tested])
        extra = north(twin.arw) ** 2 * (1 / duration - 1 / twin.duration)
        return {
            "recording": recording[tested].tolist(),
            "error_deg": {k: rounded(angle_error(error, e)) for k, (e, _) in expected.items()},
            "sigma_deg": {k: rounded(np.sqrt(s**2 + extra)) for k, (_, s) in expected.items()},
        }

    return {"whole": judge(twin.duration), "windows": judge(WINDOW)}


def rounded(angle: Array) -> list[float]:
    """Degrees to 1e-6: the last bits of a sum depend on the processor, and files are compared."""
    return np.round(np.degrees(angle), 6).tolist()


def as_rad(values: list[float]) -> Array:
    """Stored degrees as radians."""
    return np.array([radians(v) for v in values])


def deg_per_hour(rate: float) -> float:
    """A rate for a table."""
    return rate / DEG_PER_HOUR
