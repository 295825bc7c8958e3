"""JSON Schema of every document that a command prints or a file holds.

Generated from the types: `python docs/make_schemas.py`.
"""

from __future__ import annotations

import json
from importlib import resources
from typing import Any

from gyronorth.errors import InputError


def schema_names() -> tuple[str, ...]:
    """Names of the schemas, sorted: "heading-1" for `gyronorth.heading/1`."""
    files = (entry.name for entry in resources.files(__name__).iterdir())
    return tuple(sorted(name.removesuffix(".json") for name in files if name.endswith(".json")))


def read_schema(name: str) -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a name of `schema_names`.

    Raises
    ------
    InputError
        If there is none.
    """
    if name not in schema_names():
        raise InputError(f"There is no schema {name!r}; one of {', '.join(schema_names())} is expected.")
    return json.loads((resources.files(__name__) / f"{name}.json").read_text(encoding="utf-8"))
