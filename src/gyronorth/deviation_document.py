"""The file of a deviation curve, gyronorth.deviation/1: a strict schema, so that no number in it makes up a heading."""

from __future__ import annotations

from math import pi
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from gyronorth.errors import InputError

SCHEMA = "gyronorth.deviation/1"
#: Most recordings, and most members of the ensemble.
MOST_RECORDINGS, MOST_SETTINGS = 2000, 2000
#: Most numbers in the covariances of the whole ensemble, (k, n, n).
MOST_COVARIANCES = 30_000_000
#: Largest file, bytes.
LARGEST = 1 << 26
#: Scatter below this, rad^2, is no measurement: a hundredth of an arcsecond.
SMALLEST_VARIANCE = 1e-16

_Angle = Annotated[float, Field(ge=-100 * pi, le=100 * pi)]
_Variance = Annotated[float, Field(ge=SMALLEST_VARIANCE, le=1e6)]
_Scale = Annotated[float, Field(ge=0, le=1e4)]
_Recordings = Field(min_length=1, max_length=MOST_RECORDINGS)
_Members = Field(min_length=1, max_length=MOST_SETTINGS)
_Setting = tuple[_Scale, _Scale, Annotated[float, Field(gt=1e-6, le=1e4)], _Scale]


class DeviationDocument(BaseModel):
    """A fitted deviation as it stands in the file; angles in rad."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)

    schema_: Annotated[Literal["gyronorth.deviation/1"], Field(alias="schema")]
    heading: Annotated[list[_Angle], _Recordings]
    surplus: Annotated[list[Annotated[float, Field(ge=-1, le=1e6)]], _Recordings]
    error: Annotated[list[Annotated[float, Field(ge=-pi, le=pi)]], _Recordings]
    weight: Annotated[list[Annotated[float, Field(ge=0, le=1 + 1e-6)]], _Members]
    settings: Annotated[list[_Setting], _Members]
    noise_variance: Annotated[list[Annotated[list[_Variance], _Recordings]], _Members]
    noise_future: Annotated[list[_Variance], _Members]
    sigma_elsewhere: Annotated[float, Field(ge=0, le=1e4)]
    unit: str | None = None
    session: str | None = None
    duration: Annotated[float, Field(gt=0, le=1e9)] | None = None
    latitude: Annotated[float, Field(ge=-pi / 2, le=pi / 2)] | None = None
    boresight: tuple[_Angle, _Angle, _Angle] | None = None

    @model_validator(mode="after")
    def _shapes_agree(self) -> DeviationDocument:
        n, k = len(self.heading), len(self.weight)
        lengths = {"surplus": (len(self.surplus), n), "error": (len(self.error), n)}
        lengths |= {name: (len(getattr(self, name)), k) for name in ("settings", "noise_variance", "noise_future")}
        lengths |= {f"noise_variance.{i}": (len(row), n) for i, row in enumerate(self.noise_variance)}
        for name, (found, wanted) in lengths.items():
            if found != wanted:
                raise ValueError(f"{name} has {found} entries; {wanted} are expected")
        if n * n * k > MOST_COVARIANCES:
            raise ValueError(f"{n} recordings and {k} settings are more than are worked with")
        if abs(sum(self.weight) - 1) > 1e-6:
            raise ValueError(f"the weights add up to {sum(self.weight):g}; 1 is expected")
        return self


def parse_deviation(content: bytes, *, where: str) -> dict[str, Any]:
    """The fields of a deviation curve, lists of numbers as arrays.

    Parameters
    ----------
    content : bytes
        The file.
    where : str
        Its name, for messages.

    Raises
    ------
    InputError
        If it is not such a file: a number is missing, out of its bounds or no number, or the shapes do not agree.
    """
    try:
        if len(content) > LARGEST:
            raise ValueError(f"{len(content) >> 20} MiB")
        document = DeviationDocument.model_validate_json(content)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"]) or "its content"
        shown = "" if isinstance(first["input"], dict) else f" (got {str(first['input'])[:60]!r})"
        raise InputError(_refused(where, f"{place}: {first['msg'].removeprefix('Value error, ')}{shown}")) from None
    except ValueError as error:
        raise InputError(_refused(where, f"{type(error).__name__}: {str(error)[:100]}")) from None
    fields = {name: getattr(document, name) for name in DeviationDocument.model_fields if name != "schema_"}
    return {name: np.asarray(value, float) if isinstance(value, list) else value for name, value in fields.items()}


def _refused(where: str, why: str) -> str:
    return (
        f"{where} is not a deviation profile of schema {SCHEMA} ({why}). "
        "Write one with `gyronorth calibrate FOLDER -o PROFILE`."
    )
