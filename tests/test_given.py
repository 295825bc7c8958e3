"""What a Python caller gives is a number or an array of real numbers, or one message says what it is."""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal
from typing import Any

import numpy as np
import pytest
from still import LATITUDE, still

import gyronorth
from gyronorth import InputError
from gyronorth.deviation import fit_deviation
from gyronorth.given import number

GYRO, ACCEL = still(120)
MASKED = np.ma.MaskedArray(GYRO, mask=np.arange(len(GYRO))[:, None] == 5 * np.ones(3))
#: Arrays of one shape that are no angular rates.
NOT_REAL = {
    "masked": (MASKED, "masked values"),
    "complex": (GYRO + 1e-5j, "real ones"),
    "bool": (GYRO > 0, "real ones"),
    "texts": (GYRO.astype(str), "real ones"),
    "times": (np.zeros(GYRO.shape, "M8[s]"), "real ones"),
    "objects": (np.full(GYRO.shape, object()), "real ones"),
    "overflow": (np.where(np.arange(len(GYRO))[:, None] == 3, 1e300, GYRO), "1e\\+09"),
    "fields": (np.zeros(len(GYRO), [("x", "f8"), ("y", "f8"), ("z", "f8")]), "expected"),
}
NO_NUMBERS = ["1", True, 1j, [1.0], np.ones(2), 10**400, np.True_]


def of_one(**changed: Any) -> Any:
    given = {"rate_hz": 1.0, "latitude": LATITUDE, "method": "mean", **changed}
    return gyronorth.heading(given.pop("gyro", GYRO), accel_b=given.pop("accel", ACCEL), **given)


def of_batch(**changed: Any) -> Any:
    given = {"rate_hz": 1.0, "latitude": LATITUDE, **changed}
    gyro, accel = given.pop("gyro", GYRO), given.pop("accel", ACCEL)
    return gyronorth.heading_batch(gyro[None], accel[None], **given)


@pytest.mark.parametrize("use", [of_one, of_batch])
@pytest.mark.parametrize("name", ["gyro", "accel"])
@pytest.mark.parametrize("what", NOT_REAL)
def test_arrays_that_hold_no_real_numbers_are_refused(use, name, what):
    value, message = NOT_REAL[what]
    with pytest.raises(InputError, match=message):
        use(**{name: value})


@pytest.mark.parametrize("kind", ["f4", ">f8", "g", "O"])
def test_real_numbers_of_any_type_give_the_heading(kind):
    expected = of_one()
    assert of_one(gyro=GYRO.astype(kind)).heading_deg == pytest.approx(expected.heading_deg, abs=1e-3)
    assert of_one(gyro=np.ma.MaskedArray(GYRO, mask=False)).heading == expected.heading


@pytest.mark.parametrize("value", NO_NUMBERS, ids=repr)
@pytest.mark.parametrize("name", ["rate_hz", "latitude", "require_sigma", "roll", "turn angle", "sigma of the turn"])
def test_what_is_no_number_is_refused(name, value):
    given: dict[str, dict[str, Any]] = {
        "roll": {"attitude": (value, 0.0) if np.ndim(value) == 0 else [value]},
        "turn angle": {"turn_angles": [value], "method": "turned"},
        "sigma of the turn": {"turn_angles": [1.0], "turn_angle_sigma": value, "method": "turned"},
        "require_sigma": {"require_sigma": value},
    }
    with pytest.raises(InputError, match="expected"):
        of_one(**given.get(name, {name: value}))
    if name in ("rate_hz", "latitude"):
        with pytest.raises(InputError, match="a number is expected"):
            of_batch(**{name: value})
        with pytest.raises(InputError, match="a number is expected"):
            gyronorth.StreamingHeading(**{"rate_hz": 1.0, "latitude": LATITUDE, name: value}, accelerometer=True)


@pytest.mark.parametrize("value", [5, b"x", True, [], {"a": 1}], ids=repr)
@pytest.mark.parametrize("name", ["sensor", "model", "deviation", "method"])
def test_objects_of_another_type_are_refused(name, value):
    with pytest.raises(InputError, match="expected"):
        of_one(**{name: value} | ({"method": "baseline"} if name == "model" else {}))


def test_specific_force_of_nothing_warns_of_no_division():
    assert not of_one(accel=np.zeros_like(ACCEL)).valid  # warnings are errors here


def test_a_number_is_any_real_one():
    assert [number("x", one) for one in (3, np.float32(0.5), np.array(2), np.int8(1))] == [3.0, 0.5, 2.0, 1.0]


@pytest.mark.parametrize("value", [5, "ab", [None]], ids=repr)
def test_turn_angles_are_numbers(value):
    with pytest.raises(InputError, match="expected"):
        of_one(turn_angles=value)


RECORDING = gyronorth.Recording(GYRO, ACCEL, 1.0, latitude=LATITUDE)
TRUTH = np.linspace(0.0, 6.0, 8)
#: Public function -> its arguments that make sense; of these, the numbers are spoilt.
USES: dict[str, tuple[Callable[..., Any], dict[str, Any], tuple[str, ...]]] = {
    "simulate": (
        gyronorth.simulate,
        {"sensor": "stim300", "latitude": 0.5, "heading": 0.0, "duration": 5.0, "rate_hz": 1.0,
         "rng": np.random.default_rng(1), "roll": 0.0, "pitch": 0.0},
        ("latitude", "heading", "duration", "rate_hz", "roll", "pitch"),
    ),
    "Motion": (lambda angle: gyronorth.Motion(turns=((0.0, 1.0, angle),)), {"angle": 1.0}, ("angle",)),
    "plan": (
        lambda time, **more: gyronorth.plan("stim300", durations=[time, 9.0], **more),
        {"latitude": 0.5, "time": 5.0},
        ("latitude", "time"),
    ),
    "plan_turns": (
        gyronorth.plan_turns,
        {"sensor": "stim300", "latitude": 0.5, "turns": 1, "still_duration": 9.0, "turn_duration": 2.0},
        ("latitude", "turns", "still_duration", "turn_duration"),
    ),
    "calibrate": (gyronorth.calibrate, {"recordings": [RECORDING] * 7, "latitude": LATITUDE}, ()),
    "fit_deviation": (
        lambda first, **more: fit_deviation([first, *TRUTH[1:]], TRUTH / 100, TRUTH + np.sin(TRUTH) / 9, **more),
        {"first": 0.0, "latitude": 0.5, "duration": 9.0},
        ("first", "latitude", "duration"),
    ),
    "allan_deviation": (
        lambda tau, **more: gyronorth.allan_deviation(GYRO[:, 0], taus=[tau, 3.0], **more),
        {"rate_hz": 1.0, "tau": 2.0},
        ("rate_hz", "tau"),
    ),
    "convergence": (gyronorth.convergence, {"recording": RECORDING, "points": 3}, ("points",)),
    "ReadOptions": (
        gyronorth.ReadOptions,
        {"rate_hz": 1.0, "latitude": 0.5, "gyro_scale": 1.0, "accel_scale": 1.0, "accel_range_g": 10.0,
         "increments": True, "increment_interval": 0.1},
        ("rate_hz", "latitude", "gyro_scale", "accel_scale", "accel_range_g", "increment_interval"),
    ),
    "heading_many": (
        lambda step, **more: list(gyronorth.heading_many([], windows=(9.0, step), **more)),
        {"step": 1.0, "latitude": 0.5},
        ("step", "latitude"),
    ),
}  # fmt: skip
SPOILT = [*NO_NUMBERS, float("nan"), float("inf"), Decimal(1), np.ma.masked, np.timedelta64(1, "s"), None, {}, object()]


@pytest.mark.slow
@pytest.mark.parametrize("name", USES)
def test_every_number_of_every_public_function_is_checked(name):
    use, given, numbers = USES[name]
    if name != "calibrate":  # one recording seven times
        use(**given)
    for argument in numbers:
        for value in SPOILT:
            if value is None and name in ("ReadOptions", "fit_deviation", "heading_many") and argument != "first":
                continue
            if argument == "accel_range_g" and isinstance(value, float):
                continue
            with pytest.raises(InputError, match=r"expected|allows"):
                use(**given | {argument: value})


@pytest.mark.parametrize("value", [5, "ab", True, [None], np.ones(2), object()], ids=lambda value: type(value).__name__)
@pytest.mark.parametrize(
    ("name", "argument"),
    [("simulate", "rng"), ("simulate", "motion"), ("calibrate", "recordings"), ("convergence", "recording"),
     ("fit_deviation", "prior"), ("ReadOptions", "columns"), ("ReadOptions", "window"), ("ReadOptions", "needed")],
)  # fmt: skip
def test_an_object_of_another_kind_is_refused(name, argument, value):
    use, given, _ = USES[name]
    with pytest.raises(InputError, match="expected"):
        use(**given | {argument: value})


@pytest.mark.parametrize("use", [gyronorth.read, gyronorth.read_deviation, gyronorth.read_sensor])
@pytest.mark.parametrize("value", [5, None, b"x", ["x"], "a\0b"], ids=repr)
def test_a_path_is_a_text_or_a_path(use, value):
    with pytest.raises(InputError, match=r"expected|no sensor"):
        use(value)
    with pytest.raises(InputError, match="expected"):
        gyronorth.write(RECORDING, value)


def test_masked_values_in_lists_are_refused():
    with pytest.raises(InputError, match="3 masked values"):
        gyronorth.heading_batch([MASKED[:60], MASKED[60:]], rate_hz=1.0, latitude=LATITUDE)
    with pytest.raises(InputError, match="3 masked values"):
        of_one(gyro=list(MASKED))
