"""Sensor profiles: the JSON schema in data-sheet units, its conversion to SI, and the built-in files.

A profile is an object with `schema`, `name`, `source`, `gyro` and `accel`. Every figure carries its
unit in its name; each is one standard deviation of one axis; what is left out is zero (a left-out
range is unlimited). Data sheets give bias instability either as the minimum of the Allan deviation
or as the coefficient B of IEEE Std 952, which is that minimum / 0.664:
`bias_instability_definition` says which, and reading converts to B.
"""

from __future__ import annotations

import difflib
import json
import math
from importlib import resources
from importlib.resources.abc import Traversable
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from gyronorth.angles import DEG_PER_HOUR
from gyronorth.earth import STANDARD_GRAVITY
from gyronorth.errors import InputError
from gyronorth.sensor.law import MILLI_G, TERMS

SCHEMA = "gyronorth.sensor/1"
#: Allan minimum of flicker noise over its coefficient B, sqrt(2 ln 2 / pi): IEEE Std 952-1997, annex C.
ALLAN_MINIMUM = math.sqrt(2 * math.log(2) / math.pi)

_DEG = math.pi / 180
_NonNegative = Annotated[float, Field(ge=0, le=1e9)]
_Positive = Annotated[float, Field(gt=0, le=1e9)]
_Definition = Literal["coefficient", "allan_minimum"]

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


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True, defer_build=True)


class _Triad(_Strict):
    bias_instability_definition: _Definition | None = None  # what the data sheet means by bias instability
    bias_instability_longest_s: Annotated[float, Field(ge=0.1, le=1e9)] = 1000.0  # longest time constant of its law
    scale_factor_ppm: _NonNegative = 0.0
    misalignment_mrad: _NonNegative = 0.0  # each axis towards each other axis


class GyroProfile(_Triad):
    """The gyro part of a profile."""

    angle_random_walk_deg_sqrt_h: _NonNegative = 0.0
    bias_instability_deg_h: _NonNegative = 0.0
    rate_random_walk_deg_h_sqrt_h: _NonNegative = 0.0
    turn_on_bias_deg_h: _NonNegative = 0.0  # 1 sigma from power-up to power-up
    g_sensitivity_deg_h_g: _NonNegative = 0.0  # each axis of the gyro for each axis of specific force
    quantisation_arcsec: _NonNegative = 0.0  # step of the integrated output
    range_deg_s: _Positive | None = None

    @model_validator(mode="after")
    def _definition_is_given(self) -> GyroProfile:
        _require_definition(self.bias_instability_deg_h, self.bias_instability_definition)
        return self


class AccelProfile(_Triad):
    """The accelerometer part of a profile; velocity random walk in one of its two usual units."""

    velocity_random_walk_m_s_sqrt_h: _NonNegative = 0.0
    velocity_random_walk_ug_sqrt_hz: _NonNegative = 0.0
    bias_instability_mg: _NonNegative = 0.0
    acceleration_random_walk_mg_sqrt_h: _NonNegative = 0.0
    turn_on_bias_mg: _NonNegative = 0.0
    quantisation_m_s: _NonNegative = 0.0
    range_g: _Positive | None = None

    @model_validator(mode="after")
    def _is_unambiguous(self) -> AccelProfile:
        _require_definition(self.bias_instability_mg, self.bias_instability_definition)
        if self.velocity_random_walk_m_s_sqrt_h and self.velocity_random_walk_ug_sqrt_hz:
            raise ValueError("velocity random walk is given twice; give it in m/s/sqrt(h) or in ug/sqrt(Hz)")
        return self


class Profile(_Strict):
    """A sensor profile as it stands in the file."""

    schema_: Annotated[Literal["gyronorth.sensor/1"], Field(alias="schema")]
    name: Annotated[str, Field(min_length=1, max_length=100)]
    source: str = ""  # citation, and what could not be verified
    gyro: GyroProfile
    accel: AccelProfile = Field(default_factory=AccelProfile)


def _builtin() -> Traversable:
    return resources.files("gyronorth.sensor") / "builtin"


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
    try:
        profile = Profile.model_validate(content)
    except ValidationError as error:
        raise InputError(_explain(error, where)) from error
    gyro, accel = (_to_si(profile.gyro, _GYRO_UNITS), _to_si(profile.accel, _ACCEL_UNITS))
    if profile.accel.velocity_random_walk_ug_sqrt_hz:
        accel["white"] = profile.accel.velocity_random_walk_ug_sqrt_hz * _NOISE_DENSITY[1]
    sensitivity = profile.gyro.g_sensitivity_deg_h_g * _G_SENSITIVITY[1]
    return {"name": profile.name, "source": profile.source, "gyro": gyro, "accel": accel, "g_sensitivity": sensitivity}


def compose(values: dict[str, Any]) -> str:
    """JSON text of a profile in SI, the inverse of `parse` (bias instability as coefficient)."""
    gyro, accel = _from_si(values["gyro"], _GYRO_UNITS), _from_si(values["accel"], _ACCEL_UNITS)
    gyro[_G_SENSITIVITY[0]] = values["g_sensitivity"] / _G_SENSITIVITY[1]
    content = {"schema": SCHEMA, "name": values["name"], "source": values["source"], "gyro": gyro, "accel": accel}
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _to_si(triad: _Triad, units: dict[str, tuple[str, float]]) -> dict[str, float]:
    given = triad.model_dump()
    values = {field: given[key] * unit for field, (key, unit) in units.items() if given[key] is not None}
    if triad.bias_instability_definition == "allan_minimum":
        values["flicker"] /= ALLAN_MINIMUM
    return values


def _from_si(values: dict[str, float], units: dict[str, tuple[str, float]]) -> dict[str, Any]:
    given: dict[str, Any] = {key: values[field] / unit for field, (key, unit) in units.items()}
    if math.isinf(values["saturation"]):
        del given[units["saturation"][0]]
    return {"bias_instability_definition": "coefficient"} | given


def _require_definition(bias_instability: float, definition: str | None) -> None:
    if bias_instability > 0 and definition is None:
        raise ValueError(
            "bias_instability_definition is missing; say 'allan_minimum' if the data sheet gives the minimum of the "
            "Allan deviation (the usual case), or 'coefficient' if it gives that minimum / 0.664"
        )


def _explain(error: ValidationError, where: str) -> str:
    problems = [_explain_one(problem) for problem in error.errors(include_url=False)]
    more = f" And {len(problems) - 3} more." if len(problems) > 3 else ""
    return f"{where} is not a sensor profile ({SCHEMA}): " + "; ".join(problems[:3]) + "." + more


def _explain_one(problem: Any) -> str:
    path = ".".join(str(part) for part in problem["loc"])
    value, kind = problem["input"], problem["type"]
    if kind == "missing":
        return f"{path} is missing"
    if kind == "extra_forbidden":
        model = {"gyro": GyroProfile, "accel": AccelProfile}.get(str(problem["loc"][0]), Profile)
        known = [info.alias or key for key, info in model.model_fields.items()]
        near = difflib.get_close_matches(str(problem["loc"][-1]), known, n=1)
        return f"{path} is not a known field" + (f" (did you mean {near[0]}?)" if near else f"; known are {known}")
    shown = "" if isinstance(value, dict) else f" is {value!r:.60}"
    expected = problem["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    return f"{path}{shown}: {expected if kind == 'value_error' else expected + ' is expected'}"
