"""Sensor profiles: the JSON schema in data-sheet units, its conversion to SI, and the built-in files.

A profile is an object with `schema`, `name`, `source`, `gyro` and `accel`. Every figure carries its
unit in its name; each is one standard deviation of one axis; what is left out is zero (a left-out
range is unlimited). Data sheets give bias instability either as the minimum of the Allan deviation
or as the coefficient B of IEEE Std 952, which is that minimum / 0.664:
`bias_instability_definition` says which, and reading converts to B.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, cast

from gyronorth.angles import DEG_PER_HOUR
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.errors import InputError
from gyronorth.sensor.terms import MILLI_G, TERMS

SCHEMA = "gyronorth.sensor/1"
#: Allan minimum of flicker noise over its coefficient B, sqrt(2 ln 2 / pi): IEEE Std 952-1997, annex C.
ALLAN_MINIMUM = math.sqrt(2 * math.log(2) / math.pi)

_DEG = math.pi / 180

# Field of TriadErrors: (key in the file, one unit of the file in SI); those of the stochastic terms are the law's.
_GYRO_UNITS = {term.field: (term.gyro.key, term.gyro.one) for term in TERMS} | {
    "flicker_longest": ("bias_instability_longest_s", 1.0),
    "turn_on_bias": ("turn_on_bias_deg_h", DEG_PER_HOUR),
    "scale_factor": ("scale_factor_ppm", 1e-6),
    "misalignment": ("misalignment_mrad", 1e-3),
    "saturation": ("range_deg_s", _DEG),
}
_ACCEL_UNITS = {term.field: (term.accel.key, term.accel.one) for term in TERMS} | {
    "flicker_longest": ("bias_instability_longest_s", 1.0),
    "turn_on_bias": ("turn_on_bias_mg", MILLI_G),
    "scale_factor": ("scale_factor_ppm", 1e-6),
    "misalignment": ("misalignment_mrad", 1e-3),
    "saturation": ("range_g", STANDARD_GRAVITY),
}
_G_SENSITIVITY = ("g_sensitivity_deg_h_g", DEG_PER_HOUR / STANDARD_GRAVITY)
_NOISE_DENSITY = ("velocity_random_walk_ug_sqrt_hz", 1e-6 * STANDARD_GRAVITY)


def _builtin() -> Path:
    return Path(__file__).with_name("builtin")


def names() -> tuple[str, ...]:
    """Names of the built-in profiles, sorted."""
    files = (entry.name for entry in _builtin().iterdir())
    return tuple(sorted(name.removesuffix(".json") for name in files if name.endswith(".json")))


def builtin_text(name: str) -> str:
    """Text of a built-in profile."""
    return (_builtin() / f"{name}.json").read_text(encoding="utf-8")


def parse(text: str, *, where: str) -> dict[str, Any]:
    """The profile in `text` in SI: `name`, `source`, `gyro`, `accel` (fields of TriadErrors) and `g_sensitivity`.

    Raises
    ------
    InputError
        Naming `where`, the field, its value and what was expected.
    """
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:  # ValueError: not JSON, or a number of thousands of digits
        raise InputError(f"{where} is not valid JSON: {error}. A sensor profile ({SCHEMA}) is expected.") from error
    if not isinstance(content, dict):
        raise InputError(f"{where} holds {content!r:.40}; a JSON object, a sensor profile ({SCHEMA}), is expected.")
    from gyronorth.sensor import profile_schema

    found = cast("dict[str, Any]", content)
    profile_schema.check(found, where=where)
    return _in_si(found)


def builtin(name: str) -> dict[str, Any]:
    """A built-in profile as `parse` returns it; that each is one the tests see."""
    return _in_si(json.loads(builtin_text(name)))


def compose(values: dict[str, Any]) -> str:
    """JSON text of a profile in SI, the inverse of `parse` (bias instability as coefficient)."""
    gyro, accel = _from_si(values["gyro"], _GYRO_UNITS), _from_si(values["accel"], _ACCEL_UNITS)
    gyro[_G_SENSITIVITY[0]] = values["g_sensitivity"] / _G_SENSITIVITY[1]
    content = {"schema": SCHEMA, "name": values["name"], "source": values["source"], "gyro": gyro, "accel": accel}
    if values["bounds"]:
        content["upper_bounds"] = list(values["bounds"])
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _in_si(content: dict[str, Any]) -> dict[str, Any]:
    """A profile that is one, in SI."""
    gyro, accel = content["gyro"], content.get("accel", {})
    values: dict[str, Any] = {"name": content["name"], "source": content.get("source", "")}
    values["bounds"] = tuple(content.get("upper_bounds", ()))
    values["gyro"], values["accel"] = _to_si(gyro, _GYRO_UNITS), _to_si(accel, _ACCEL_UNITS)
    if accel.get(_NOISE_DENSITY[0]):
        values["accel"]["white"] = accel[_NOISE_DENSITY[0]] * _NOISE_DENSITY[1]
    values["g_sensitivity"] = gyro.get(_G_SENSITIVITY[0], 0.0) * _G_SENSITIVITY[1]
    return values


def _to_si(triad: dict[str, Any], units: dict[str, tuple[str, float]]) -> dict[str, float]:
    """Fields of `TriadErrors` that are given: what is left out is there as here."""
    values = {field: triad[key] * unit for field, (key, unit) in units.items() if triad.get(key) is not None}
    if triad.get("bias_instability_definition") == "allan_minimum" and "flicker" in values:
        values["flicker"] /= ALLAN_MINIMUM
    return values


def _from_si(values: dict[str, float], units: dict[str, tuple[str, float]]) -> dict[str, Any]:
    given: dict[str, Any] = {key: values[field] / unit for field, (key, unit) in units.items()}
    if math.isinf(values["saturation"]):
        del given[units["saturation"][0]]
    return {"bias_instability_definition": "coefficient"} | given
