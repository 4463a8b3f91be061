"""The OpenAPI document: what FastAPI knows of the routes, with what holds for all of them, and with the examples."""

import json
import re
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

TAGS = {
    "quizzes": "What can be answered, and when.",
    "submissions": "Answers and their verdicts: a learner's own, or handed in by a service.",
    "labs": "The authors' simulations.",
    "devices": "Tokens for programs on a learner's own machine.",
    "reviews": "Answers that a person decides on.",
    "dates": "Extensions, the publication of feedback, and counting again after a change of the policy.",
    "regrades": "Grading again by changed content.",
    "results": "What counts: the feed, the gradebook, statistics.",
    "people": "Members, invitations, tokens, rosters, and the audit log.",
    "courses": "The courses that an instructor teaches.",
    "platforms": "Learning platforms, connected by LTI 1.3.",
    "webhooks": "Messages about changed results, and deliveries that failed.",
    "health": "For monitoring.",
}
"""What the routes are about, in the order of a reader who begins."""

WITHOUT_ETAG = ("/healthz", "/readyz", "/metrics")


def install(app: FastAPI, origin: str | None = None) -> None:
    """Makes the app describe itself completely. `origin` is where it is reached, if that is known; else the document
    says that it is the server that the document comes from."""
    derive = app.openapi

    def describe() -> dict[str, Any]:
        if app.openapi_schema is None:
            app.openapi_schema = complete_document(derive(), origin or "/")
        return app.openapi_schema

    app.openapi = describe  # type: ignore[method-assign]


def complete_document(document: dict[str, Any], server: str) -> dict[str, Any]:
    """The document of FastAPI, changed in place: with the server, what the tags mean, every refusal, and an example for
    every response. The id of an operation is the name of its function."""
    document["servers"] = [{"url": server}]
    document["tags"] = [{"name": name, "description": text} for name, text in TAGS.items()]
    document["components"]["schemas"]["Problem"] = SCHEMA
    recorded = json.loads(EXAMPLES.read_text(encoding="utf-8"))
    for method, path, operation in operations(document):
        operation["operationId"] = operation["operationId"].removesuffix(mangle(path, method))
        responses = operation["responses"]
        if path.startswith(PREFIX):
            more = ANY_ROUTE + (WITH_BODY if "requestBody" in operation else ())
            responses |= {
                str(status): response for status, response in refusals(*more).items() if str(status) not in responses
            }
        if method == "GET" and path not in WITHOUT_ETAG:
            responses["304"] = {"description": "Not modified: If-None-Match named the ETag"}
        examples = recorded["responses"].get(f"{method} {path.removeprefix(PREFIX)}", {})
        for status, response in responses.items():
            complete_response(status, response, examples, recorded["problems"])
    return document


def mangle(path: str, method: str) -> str:
    """Returns what FastAPI appends to the name of a function to make the id of its operation."""
    return re.sub(r"\W", "_", path) + f"_{method.lower()}"


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
