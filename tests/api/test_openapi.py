"""The OpenAPI document describes every route with every refusal, and shows an example of every response."""

import json
from collections.abc import Iterator
from typing import Any

import jsonschema_rs
import pytest
from fastapi import FastAPI

from grader.api import openapi, routes
from grader.gate.admission import PREFIX

CURE = "call it in tests/api/test_examples.py, then `make examples`"


@pytest.fixture(scope="module")
def document() -> dict[str, Any]:
    app = FastAPI(title="test", version="0")
    routes.include_in(app)
    openapi.install(app)
    return app.openapi()


def responses(document: dict[str, Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Route as the examples name it, status and description of every response."""
    for method, path, operation in openapi.operations(document):
        for status, response in operation["responses"].items():
            yield f"{method} {path.removeprefix(PREFIX)}", status, response


def faults(document: dict[str, Any]) -> Iterator[str]:
    """What is missing or wrong, as a sentence that says what to write."""
    for key, status, response in responses(document):
        for media in response.get("content", {}).values():
            if "example" not in media:
                yield f"{key} has no example of {status}: {CURE}"
                continue
            schema = media.get("schema") or media.get("itemSchema")
            if not schema:
                yield f"{key} describes no schema of {status}: give the route a response_model, or refusals(more=)"
                continue
            validator = jsonschema_rs.validator_for({**schema, "components": document["components"]})
            for error in validator.iter_errors(media["example"]):
                where = "/".join(map(str, error.instance_path))
                yield f"{key}: the example of {status} does not fit its schema at {where}: {error.message}; {CURE}"


@pytest.mark.slow
def test_every_response_has_an_example_that_fits_its_schema(document: dict[str, Any]) -> None:
    assert not (found := "\n".join(faults(document))), found


@pytest.mark.slow
def test_a_route_without_an_example_is_found() -> None:
    app = FastAPI(title="test", version="0")
    routes.include_in(app)

    @app.get("/api/v1/new", responses={404: {"description": ""}})
    def new() -> dict[str, int]:
        return {}

    openapi.install(app)
    assert list(faults(app.openapi())) == [f"GET /new has no example of 200: {CURE}"]


def test_every_example_belongs_to_a_documented_response(document: dict[str, Any]) -> None:
    described = {(key, status) for key, status, _ in responses(document)}
    recorded = json.loads(openapi.EXAMPLES.read_text(encoding="utf-8"))["responses"]
    assert {(key, status) for key, by_status in recorded.items() for status in by_status} <= described


@pytest.mark.slow
def test_an_example_that_does_not_fit_is_found(document: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    media = document["paths"]["/api/v1/members"]["get"]["responses"]["200"]["content"]["application/json"]
    monkeypatch.setitem(media, "example", {"items": [{"id": 3}], "next_cursor": None})
    assert any("GET /members: the example of 200 does not fit" in fault for fault in faults(document))


def test_every_refusal_is_a_problem(document: dict[str, Any]) -> None:
    for key, status, response in responses(document):
        if status >= "400":
            assert list(response["content"]) == ["application/problem+json"], key


def test_every_route_of_the_api_may_refuse_and_be_away(document: dict[str, Any]) -> None:
    for method, path, operation in openapi.operations(document):
        statuses = operation["responses"].keys()
        if path.startswith(PREFIX):
            assert {"401", "403", "429", "503"} <= statuses, path
            assert method != "GET" or "304" in statuses, path
            assert "requestBody" not in operation or {"413", "422"} <= statuses, path
