"""The JSON Schema files are those of the types, and every output is valid against its own."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import gyronorth as gn
from gyronorth.allan import characterise
from gyronorth.calibration import calibrate
from gyronorth.documents import DOCUMENTS
from gyronorth.errors import InputError
from gyronorth.live.status import Status
from gyronorth.planning import plan
from gyronorth.readers import describe
from gyronorth.schemas import read_schema, schema_names
from gyronorth.sensor.profiles import builtin_text, names

ROOT = Path(__file__).parents[1]
LATITUDE = np.radians(32.11)


def recorded(*, heading=1.0, seed=0, duration=70.0, **more):
    rng = np.random.default_rng(seed)
    return gn.simulate("isa100c", latitude=LATITUDE, heading=heading, duration=duration, rate_hz=10, rng=rng, **more)


def output(name):
    """An output of each kind."""
    if name == "heading-1":
        return gn.heading(recorded(), sensor="isa100c").to_json(posterior=True)
    if name == "plan-1":
        return plan("sdc500", latitude=LATITUDE).to_json()
    if name == "allan-1":
        return characterise(recorded()).to_json()
    if name == "info-1":
        return describe(ROOT / "examples/data/demo.npz").to_json()
    if name == "live-1":
        return Status("waiting", "serial:/dev/ttyUSB0").to_json()
    assert name == "calibration-1"
    return calibrate([replace(recorded(heading=h, seed=h), session="one") for h in range(7)]).to_json()


def test_the_files_are_those_of_the_types(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    import make_schemas

    made = make_schemas.schemas()
    assert tuple(sorted(made)) == schema_names()
    for name, text in made.items():
        assert json.loads(text) == read_schema(name), f"run python docs/make_schemas.py: {name} has changed"
    sys.modules.pop("make_schemas")


@pytest.mark.slow
@pytest.mark.parametrize("name", DOCUMENTS)
def test_an_output_is_valid_and_has_no_other_field(name):
    document = json.loads(json.dumps(output(name), allow_nan=False))
    schema = read_schema(name)
    jsonschema.validate(document, schema)
    assert list(document) == list(schema["properties"])


def test_a_refused_heading_is_valid_too():
    document = gn.heading(recorded().window(0.0, 1.0)).to_json()
    jsonschema.validate(json.loads(json.dumps(document, allow_nan=False)), read_schema("heading-1"))


def test_a_document_that_breaks_the_contract_is_not_valid():
    document = output("heading-1") | {"sigma_deg": "large"}
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(document, read_schema("heading-1"))


@pytest.mark.parametrize("name", names())
def test_built_in_profiles_are_valid(name):
    jsonschema.validate(json.loads(builtin_text(name)), read_schema("sensor-1"))


def test_an_unknown_schema_is_told():
    with pytest.raises(InputError, match="heading-1"):
        read_schema("heading-7")
