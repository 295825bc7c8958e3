"""The JSON schema of sensor profiles: what a file may hold, and the messages about what is wrong with one.

Only files of users are checked against it: those of the package are by the tests, and a heading need not load pydantic.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model, model_validator

from gyronorth.errors import InputError
from gyronorth.sensor.profiles import SCHEMA
from gyronorth.sensor.terms import FLICKER, TERMS, WHITE, Term, TermUnit

_NonNegative = Annotated[float, Field(ge=0, le=1e9)]
_Positive = Annotated[float, Field(gt=0, le=1e9)]
_Definition = Literal["coefficient", "allan_minimum"]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True, defer_build=True)


class _Triad(_Strict):
    bias_instability_definition: _Definition | None = None  # what the data sheet means by bias instability
    bias_instability_longest_s: Annotated[float, Field(ge=0.1, le=1e9)] = 1000.0  # longest time constant of its law
    scale_factor_ppm: _NonNegative = 0.0
    misalignment_mrad: _NonNegative = 0.0  # each axis towards each other axis


def _with_terms(unit_of: Callable[[Term], TermUnit]) -> type[_Triad]:
    """A triad with one figure for each stochastic term."""
    figures: dict[str, Any] = {unit_of(term).key: (_NonNegative, 0.0) for term in TERMS}
    return create_model("_Terms", __base__=_Triad, **figures)


class GyroProfile(_with_terms(lambda term: term.gyro)):
    """The gyro part of a profile."""

    turn_on_bias_deg_h: _NonNegative = 0.0  # 1 sigma from power-up to power-up
    g_sensitivity_deg_h_g: _NonNegative = 0.0  # each axis of the gyro for each axis of specific force
    range_deg_s: _Positive | None = None

    @model_validator(mode="after")
    def _definition_is_given(self) -> GyroProfile:
        _require_definition(_figure(self, FLICKER.gyro), self.bias_instability_definition)
        return self


class AccelProfile(_with_terms(lambda term: term.accel)):
    """The accelerometer part of a profile; velocity random walk in one of its two usual units."""

    velocity_random_walk_ug_sqrt_hz: _NonNegative = 0.0
    turn_on_bias_mg: _NonNegative = 0.0
    range_g: _Positive | None = None

    @model_validator(mode="after")
    def _is_unambiguous(self) -> AccelProfile:
        _require_definition(_figure(self, FLICKER.accel), self.bias_instability_definition)
        if _figure(self, WHITE.accel) and self.velocity_random_walk_ug_sqrt_hz:
            raise ValueError("velocity random walk is given twice; give it in m/s/sqrt(h) or in ug/sqrt(Hz)")
        return self


class Profile(_Strict):
    """A sensor profile as it stands in the file."""

    schema_: Annotated[Literal["gyronorth.sensor/1"], Field(alias="schema")]
    name: Annotated[str, Field(min_length=1, max_length=100)]
    source: str = ""  # citation, and what could not be verified
    upper_bounds: Annotated[
        tuple[str, ...], Field(strict=False)
    ] = ()  # figures that a recording only bounds, such as gyro.bias_instability_deg_h
    gyro: GyroProfile
    accel: AccelProfile = Field(default_factory=AccelProfile)

    @model_validator(mode="after")
    def _bounds_are_figures(self) -> Profile:
        triads = (("gyro", GyroProfile.model_fields), ("accel", AccelProfile.model_fields))
        figures = [f"{name}.{key}" for name, fields in triads for key in fields]
        for name in self.upper_bounds:
            if name not in figures:
                near = difflib.get_close_matches(name, figures, n=1)
                hint = f"; did you mean {near[0]}?" if near else ""
                raise ValueError(f"upper_bounds names {name}, which is no figure of the profile{hint}")
        return self


def check(content: dict[str, Any], *, where: str) -> None:
    """Refuse what is no sensor profile.

    Raises
    ------
    InputError
        Naming `where`, the field, its value and what was expected.
    """
    try:
        Profile.model_validate(content)
    except ValidationError as error:
        raise InputError(_explain(error, where)) from error


def _figure(triad: BaseModel, unit: TermUnit) -> float:
    return float(getattr(triad, unit.key))


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
