"""The OpenAPI document: what FastAPI knows of the routes, with what holds for all of them, and with the examples."""

from collections.abc import Iterator
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI

from grader.api.admission import PREFIX
from grader.api.examples import EXAMPLES, PROBLEMS
from grader.api.problems import MEDIA_TYPE, SCHEMA, documented, problem_body

PROBLEM = {"$ref": "#/components/schemas/Problem"}

ANY_ROUTE = (401, 403, 429, 503)
"""What AdmissionMiddleware may answer to any request under /api/v1, and what any of them may come to."""

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
            app.openapi_schema = completed(derive())
        return app.openapi_schema

    app.openapi = describe  # type: ignore[method-assign]


def completed(document: dict[str, Any]) -> dict[str, Any]:
    """The document of FastAPI, changed in place: with every refusal, and an example for every response."""
    document["components"]["schemas"]["Problem"] = SCHEMA
    for method, path, operation in operations(document):
        responses = operation["responses"]
        if path.startswith(PREFIX):
            more = ANY_ROUTE + (WITH_BODY if "requestBody" in operation else ())
            responses |= {str(status): one for status, one in documented(*more).items() if str(status) not in responses}
        if method == "GET" and path not in UNTAGGED:
            responses["304"] = {"description": "Not modified: If-None-Match named the ETag"}
        examples = EXAMPLES.get(f"{method} {path.removeprefix(PREFIX)}", {})
        for status, response in responses.items():
            complete(status, response, examples)
    return document


def operations(document: dict[str, Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Method, path and description of every operation."""
    for path, item in document["paths"].items():
        for method, operation in item.items():
            yield method.upper(), path, operation


def complete(status: str, response: dict[str, Any], examples: dict[int, Any]) -> None:
    """Adds the example to a response, and what all problems have in common."""
    if status >= "400":
        example = problem_body(int(status), request_id="0d6c3f0b1a2e4d5f8091a2b3c4d5e6f7", **PROBLEMS[int(status)])
        response["description"] = HTTPStatus(int(status)).phrase
        response["content"] = {MEDIA_TYPE: {"schema": PROBLEM, "example": example | examples.get(int(status), {})}}
        if name := HEADERS_OF.get(status):
            response["headers"] = {name: HEADERS[name]}
    elif int(status) in examples:
        for media in response["content"].values():
            media["example"] = examples[int(status)]
