"""The JSON schema of a quiz file, for editors: of the installed kinds, made from what validates the file."""

from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from grader.domain.lab import UnknownLab
from grader.exercises import load_kinds
from grader.labs import lab_kinds
from grader.questions import Quiz, installed_kinds

DRAFT = "https://json-schema.org/draft/2020-12/schema"

REMARKS: dict[str, Any] = {"^x-": {}}
"""Keys that authors may write anywhere, for themselves."""


def build_quiz_schema() -> dict[str, Any]:
    """Returns the schema: draft 2020-12, with the parameters of every installed kind of exercise."""
    parameters = {name: kind.parameters for name, kind in load_kinds().items()}
    models: list[type[BaseModel]] = [Quiz, *dict.fromkeys(parameters.values())]
    refs, document = models_json_schema([(model, "validation") for model in models], title="Quiz")
    parts: dict[str, Any] = document["$defs"]

    def find(model: type) -> dict[str, Any]:
        schema: dict[str, Any] = parts[refs[model, "validation"]["$ref"].rpartition("/")[2]]
        return schema

    for kind in installed_kinds().values():  # a question without an id gets one by its place
        question = parts[kind.question.__name__]
        question["required"] = [key for key in question["required"] if key != "id"]
        if kind.is_script:
            question["properties"]["check"] = {
                "required": ["kind"],
                "discriminator": {"propertyName": "kind"},
                "oneOf": [refs[model, "validation"] for model in parameters.values()],
            }
    for name, model in parameters.items():
        find(model)["properties"]["kind"] = {"const": name}
    unknown = parts[UnknownLab.__name__]
    unknown["properties"]["kind"], unknown["required"] = {"type": "string", "not": {"enum": [*lab_kinds()]}}, ["kind"]
    find(Quiz)["properties"]["$schema"] = {"type": "string", "description": "Where this schema is, for editors."}
    for part in find_objects(document):
        if "additionalProperties" in part:
            part["patternProperties"] = REMARKS
        if "propertyNames" in part:
            part["propertyNames"] = {"anyOf": [{"pattern": "^x-"}, part["propertyNames"]]}
    return {"$schema": DRAFT, **refs[Quiz, "validation"], **document}


def find_objects(schema: Any) -> Iterator[dict[str, Any]]:
    """Yields every part of a schema that describes an object."""
    parts = schema.values() if isinstance(schema, dict) else schema if isinstance(schema, list) else ()
    if isinstance(schema, dict) and schema.get("type") == "object":
        yield schema
    for part in parts:
        yield from find_objects(part)
