"""Write src/gyronorth/schemas/*.json from the types of the documents: python docs/make_schemas.py."""

from __future__ import annotations

import json
from pathlib import Path

from pydantic import TypeAdapter

from gyronorth.alignment.networks.bundle import Bundle
from gyronorth.documents import DOCUMENTS
from gyronorth.sensor.profile_schema import Profile

FOLDER = Path(__file__).parents[1] / "src/gyronorth/schemas"


def schemas() -> dict[str, str]:
    """Text of every schema by its name."""
    made = {name: TypeAdapter(document).json_schema() for name, document in DOCUMENTS.items()}
    made |= {"sensor-1": Profile.model_json_schema(), "bundle-1": Bundle.model_json_schema()}
    return {
        name: json.dumps({"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}, indent=1) + "\n"
        for name, schema in made.items()
    }


if __name__ == "__main__":
    for name, text in schemas().items():
        (FOLDER / f"{name}.json").write_text(text, encoding="utf-8")
