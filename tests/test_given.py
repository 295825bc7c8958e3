"""What a Python caller gives is a number or an array of real numbers, or one message says what it is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from still import LATITUDE, still

import gyronorth
from gyronorth import InputError
from gyronorth.errors import number

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
