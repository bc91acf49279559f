"""JSON schemas of what is written: `validate(name, value)`; `python schemas.py NAME "DESCRIPTION" FILE...` makes one.

A schema is made from files that runs wrote. Objects whose keys are data (effects, estimators, packages) get one schema
for all of their values.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import jsonschema

FOLDER = Path(__file__).parents[2] / "docs" / "reference" / "schemas"
KEYED_BY_DATA = frozenset(
    ("budget", "build", "causes", "errors", "estimators", "parameters", "quantities", "versions", "wheels")
)
"""Keys whose objects have names of things as keys."""


def validate(name: str, value: Any) -> None:
    """Raise jsonschema.ValidationError where a written value is not as its schema says."""
    jsonschema.validate(value, json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8")))


def seed(value: Any) -> dict[str, Any]:
    """The part of a schema that holds for any keys, of a value."""
    if isinstance(value, list):
        return {"type": "array", "items": seed(value[0])} if value and seed(value[0]) else {}
    if not isinstance(value, dict):
        return {}
    told = {
        key: {"type": "object", "patternProperties": {"": {}}} if key in KEYED_BY_DATA else seed(below)
        for key, below in value.items()
        if (key in KEYED_BY_DATA and isinstance(below, dict)) or seed(below)
    }
    return {"type": "object", "properties": told} if told else {}


def loosened(schema: Any) -> Any:
    """A schema in which no key below the top is required, numbers may be whole, and any value null."""
    if isinstance(schema, list):
        return [loosened(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    kept = {
        key: loosened(part) for key, part in schema.items() if key != "required" or isinstance(part, dict)
    }
    if isinstance(kept.get("type"), str) and kept["type"] != "null":
        kept["type"] = ["null", "number" if kept["type"] == "integer" else kept["type"]]
    if kept.get("type") == "null":  # no run had a value: anything may come
        del kept["type"]
    return kept


def main(name: str, description: str, files: list[str]) -> None:
    from genson import SchemaBuilder

    values = [json.loads(Path(file).read_text(encoding="utf-8")) for file in files]
    builder = SchemaBuilder()
    for value in values:
        if seed(value):
            builder.add_schema(seed(value))
        builder.add_object(value)
    FOLDER.mkdir(exist_ok=True)
    schema = loosened(builder.to_schema()) | {"type": "object"}
    head = {"$schema": schema.pop("$schema"), "title": name, "description": description}
    head["required"] = sorted(set.intersection(*map(set, values)))
    (FOLDER / f"{name}.json").write_text(json.dumps(head | schema, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3:])
