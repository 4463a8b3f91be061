"""The OpenAPI document: what FastAPI knows of the routes, with what holds for all of them, and with the examples."""

import json
from collections.abc import Iterator, Mapping
from http import HTTPStatus
from pathlib import Path
from typing import Any

from fastapi import FastAPI

from grader.gate.admission import PREFIX
from grader.gate.problems import MEDIA_TYPE, SCHEMA, problem_body, refusals

EXAMPLES = Path(__file__).with_name("examples.json")
"""What a server answered, by route below /api/v1 and status, and problems by status: `make examples` records them."""

PROBLEM = {"$ref": "#/components/schemas/Problem"}

ANY_ROUTE = (401, 403, 429, 503)
"""What the gate may answer to any request under /api/v1, and what any of them may come to."""

WITH_BODY = (413, 422)

HEADERS = {
    "Retry-After": {"description": "When to try again [s].", "schema": {"type": "integer"}},
    "WWW-Authenticate": {"description": "How to sign in.", "schema": {"type": "string"}},
}
HEADERS_OF = {"401": "WWW-Authenticate", "429": "Retry-After", "503": "Retry-After"}

UNTAGGED = ("/healthz", "/readyz", "/metrics")


def install(app: FastAPI) -> None:
    """Makes the app describe itself completely."""
    derive = app.openapi

    def describe() -> dict[str, Any]:
        if app.openapi_schema is None:
            app.openapi_schema = complete_document(derive())
        return app.openapi_schema

    app.openapi = describe  # type: ignore[method-assign]


def complete_document(document: dict[str, Any]) -> dict[str, Any]:
    """The document of FastAPI, changed in place: with every refusal, and an example for every response."""
    document["components"]["schemas"]["Problem"] = SCHEMA
    recorded = json.loads(EXAMPLES.read_text(encoding="utf-8"))
    for method, path, operation in operations(document):
        responses = operation["responses"]
        if path.startswith(PREFIX):
            more = ANY_ROUTE + (WITH_BODY if "requestBody" in operation else ())
            responses |= {str(status): one for status, one in refusals(*more).items() if str(status) not in responses}
        if method == "GET" and path not in UNTAGGED:
            responses["304"] = {"description": "Not modified: If-None-Match named the ETag"}
        examples = recorded["responses"].get(f"{method} {path.removeprefix(PREFIX)}", {})
        for status, response in responses.items():
            complete_response(status, response, examples, recorded["problems"])
    return document


def operations(document: dict[str, Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Method, path and description of every operation."""
    for path, item in document["paths"].items():
        for method, operation in item.items():
            yield method.upper(), path, operation


def complete_response(
    status: str, response: dict[str, Any], examples: Mapping[str, Any], problems: Mapping[str, Mapping[str, Any]]
) -> None:
    """Adds the example to a response, and what all problems have in common; `examples` are those of the route."""
    if status >= "400":
        members = examples.get(status) or problems[status]
        example = problem_body(int(status), request_id="0d6c3f0b1a2e4d5f8091a2b3c4d5e6f7", **members)
        response["description"] = HTTPStatus(int(status)).phrase
        response["content"] = {MEDIA_TYPE: {"schema": PROBLEM, "example": example}}
        if name := HEADERS_OF.get(status):
            response["headers"] = {name: HEADERS[name]}
    elif status in examples:
        for media in response["content"].values():
            media["example"] = examples[status]
