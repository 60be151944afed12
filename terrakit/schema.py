"""JSON Schema of operators and recipes, for editors, panels and documentation."""

from __future__ import annotations

from typing import Any

from pydantic_core import to_jsonable_python

from terrakit.operators import Generator, Operator
from terrakit.recipe import MOST_STEPS, Header
from terrakit.registry import Registry, default_registry
from terrakit.sources import MOST_LINKS

CHAINED = ("generator", "filter", "erosion", "texture")
"""Kinds of operator that may stand in a chain."""
STEPS = ("filter", "erosion", "texture")
"""Kinds of operator that may stand in the steps of a loop, if they keep the grid."""
DIALECT = "https://json-schema.org/draft/2020-12/schema"


def operator_schema(operator: type[Operator]) -> dict[str, Any]:
    """Return the schema of an operator's parameters, with what else it declares.

    Bounds of maskable parameters are ``minimum`` and its siblings beside ``anyOf``: JSON Schema
    applies them to numbers only. The keys ``x-...`` carry kind, layers, presets and papers.
    """
    schema = _tidied(operator.model_json_schema())
    schema["title"] = operator.name
    schema["description"] = operator.summary()
    return (
        schema
        | {
            "x-kind": operator.kind,
            "x-surfaces": [surface.__name__ for surface in operator.surfaces],
            "x-reads": list(operator.reads),
            "x-uses": list(operator.uses),
            "x-writes": list(operator.writes),
            "x-presets": to_jsonable_python(operator.presets),
            "x-cites": list(operator.cites),
            "x-parity": operator.parity,
            "x-locality": operator.locality,
        }
        | ({"x-portrait": operator.portrait} if issubclass(operator, Generator) else {})
    )


def recipe_schema(registry: Registry | None = None) -> dict[str, Any]:
    """Return the schema of a recipe file: the header, and one alternative an operator."""
    registry = registry or default_registry()
    definitions: dict[str, Any] = {}
    alternatives: list[dict[str, str]] = []
    chained: list[dict[str, str]] = []
    steps: list[dict[str, str]] = []
    for operator in registry.operators():
        step = _step_schema(operator)
        definitions |= step.pop("$defs", {})
        definitions[f"step_{operator.name}"] = step
        alternatives.append({"$ref": f"#/$defs/step_{operator.name}"})
        if operator.kind in CHAINED:
            chained.append({"$ref": f"#/$defs/step_{operator.name}"})
        if operator.kind in STEPS and not getattr(operator, "changes_grid", False):
            steps.append({"$ref": f"#/$defs/step_{operator.name}"})
    definitions["Chain"] = _nested_schema("Chain", "A terrain made on the spot.", chained)
    definitions["Steps"] = _nested_schema("Steps", "What is done to the terrain.", steps)
    header = _tidied(Header.model_json_schema())
    return {
        "$schema": DIALECT,
        "title": "terrakit recipe",
        "type": "object",
        "properties": header["properties"]
        | {
            "step": {
                "description": "What is done, in order; the first makes or reads a terrain.",
                "type": "array",
                "minItems": 1,
                "maxItems": MOST_STEPS,
                "items": {"oneOf": alternatives},
            }
        },
        "required": ["step"],
        "additionalProperties": False,
        "$defs": definitions | header.get("$defs", {}),
    }


def _nested_schema(title: str, meaning: str, steps: list[dict[str, str]]) -> dict[str, Any]:
    """Return the schema of nested operators: one of these steps, without a name, or a list."""
    unwanted = [{"required": [key]} for key in ("name", "input")]
    link = {"type": "object", "oneOf": steps, "not": {"anyOf": unwanted}}
    links = {"type": "array", "minItems": 1, "maxItems": MOST_LINKS, "items": link}
    return {"title": title, "description": meaning, "anyOf": [link, links]}


def _step_schema(operator: type[Operator]) -> dict[str, Any]:
    schema = operator_schema(operator)
    properties: dict[str, Any] = {
        "use": {"const": operator.name, "description": "The operator."},
        "name": {"type": "string", "pattern": r"^[^.]+$", "description": "What to call the step."},
    }
    required = ["use"]
    if operator.kind != "importer":
        properties["input"] = {
            "type": "string",
            "description": "The step to work on; by default the one before. "
            "A generator is made on its grid.",
        }
    if operator.presets:
        properties["preset"] = {
            "enum": sorted(operator.presets),
            "description": "A named set of parameters, under those given here.",
        }
    if operator.kind in ("importer", "exporter"):
        properties["file"] = {"type": "string", "description": "Path inside the recipe's folder."}
    if operator.kind == "importer":
        required.append("file")
    schema["properties"] = properties | schema.get("properties", {})
    schema["required"] = [*required, *schema.get("required", [])]
    return schema


def _tidied(schema: dict[str, Any]) -> dict[str, Any]:
    """Return a schema without the alternative ``null``, which TOML cannot say."""
    tidy = dict(schema)
    tidy["properties"] = {
        name: _without_null(part) for name, part in schema.get("properties", {}).items()
    }
    if "$defs" in schema:
        tidy["$defs"] = {
            name: _tidied(part) if "properties" in part else part
            for name, part in schema["$defs"].items()
        }
    return tidy


def _without_null(part: dict[str, Any]) -> dict[str, Any]:
    alternatives = [a for a in part.get("anyOf", []) if a != {"type": "null"}]
    if len(alternatives) == len(part.get("anyOf", [])):
        return part
    kept = {key: value for key, value in part.items() if key != "anyOf"}
    if kept.get("default", 0) is None:
        del kept["default"]
    return kept | (alternatives[0] if len(alternatives) == 1 else {"anyOf": alternatives})
