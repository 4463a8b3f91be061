"""Writes the reference of the HTTP API, from the document that a server gives at /openapi.json."""

import json
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any


def read_document() -> dict[str, Any]:
    """Returns the OpenAPI document of this version. No server is started."""
    from grader.service.app import create_app
    from grader.settings import Settings

    with TemporaryDirectory() as folder:
        app = create_app(Settings(data=Path(folder), workers=0))
        document: dict[str, Any] = app.openapi()
        app.state.services.database.close()
    return document


def write_page(document: dict[str, Any]) -> str:
    """Returns the page in Markdown: every route with its parameters, body and responses, and every schema."""
    begin = (
        f"# HTTP reference\n\nVersion {document['info']['version']}. [rest.md](../rest.md) explains how to use it; "
        "a server gives this document at `/openapi.json`.\n"
    )
    parts = [begin]
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            parts.append("\n".join(describe_operation(method, path, operation)))
    parts.append("# Schemas\n")
    schemas = document.get("components", {}).get("schemas", {})
    parts += ["\n".join(describe_schema(name, schema)) for name, schema in sorted(schemas.items())]
    return "\n".join(parts)


def describe_operation(method: str, path: str, operation: dict[str, Any]) -> Iterator[str]:
    """Yields the lines on one route."""
    yield f"## {method.upper()} {path}\n"
    yield f"{operation.get('description') or operation.get('summary', '')}\n"
    if parameters := operation.get("parameters"):
        yield "| parameter | in | type | |\n|---|---|---|---|"
        for parameter in parameters:
            needed = "required. " if parameter.get("required") else ""
            name, place, kind = parameter["name"], parameter["in"], name_type(parameter["schema"])
            yield f"| `{name}` | {place} | {kind} | {needed}{cell(parameter)} |"
        yield ""
    for kind, content in operation.get("requestBody", {}).get("content", {}).items():
        yield f"Body, `{kind}`: {name_type(content.get('schema', {}))}\n"
        yield from show_examples(content)
    for status, response in operation["responses"].items():
        yield f"**{status}** {response.get('description', '')}\n"
        for content in response.get("content", {}).values():
            if schema := content.get("schema"):
                yield f"{name_type(schema)}\n"
            if status.startswith("2"):
                yield from show_examples(content)


def show_examples(content: dict[str, Any]) -> Iterator[str]:
    """Yields the first example of a body, as JSON."""
    examples = [content["example"]] if "example" in content else [
        one["value"] for one in content.get("examples", {}).values() if "value" in one
    ]  # fmt: skip
    for example in examples[:1]:
        if isinstance(example, dict | list):
            yield f"```json\n{json.dumps(example, indent=2, ensure_ascii=False)}\n```\n"
        else:
            yield f"```text\n{example}\n```\n"


def describe_schema(name: str, schema: dict[str, Any]) -> Iterator[str]:
    """Yields the lines on one schema."""
    yield f"(schema-{name.lower()})=\n## {name}\n"
    yield f"{schema.get('description', '')}\n"
    if properties := schema.get("properties"):
        required = schema.get("required", ())
        yield "| key | type | |\n|---|---|---|"
        for key, one in properties.items():
            yield f"| `{key}` | {name_type(one)} | {'required. ' if key in required else ''}{cell(one)} |"
        yield ""


def name_type(schema: dict[str, Any]) -> str:
    """Returns what a schema admits in a word or two, with a link to a named one."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return f"[{name}](#schema-{name.lower()})"
    for several in ("anyOf", "oneOf", "allOf"):
        if several in schema:
            return " or ".join(dict.fromkeys(map(name_type, schema[several])))
    if "enum" in schema:
        return ", ".join(f"`{value}`" for value in schema["enum"])
    if "const" in schema:
        return f"`{schema['const']}`"
    if schema.get("type") == "array":
        return f"list of {name_type(schema.get('items', {}))}"
    return str(schema.get("format") or schema.get("type") or "any")


def cell(schema: dict[str, Any]) -> str:
    """Returns a description in one line of a table."""
    return " ".join(str(schema.get("description", "")).split()).replace("|", "\\|")
