"""The OpenAPI document describes every route with every refusal, and shows an example of every response."""

import json
import re
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


OPERATIONS = """
quizzes: list_quizzes show_quiz reload_content download_kit
submissions: create_submission list_submissions show_films show_submission stop_submission validate_answer follow_events
    create_submission_on_behalf show_submission_on_behalf show_quiz_on_behalf
labs: run_lab
devices: begin_device get_device_token
reviews: list_reviews list_disagreements claim_review prolong_claim release_claim recompute_reviews show_review
    put_review withdraw_review put_second_mark list_comments save_comment change_comment delete_comment
    list_line_comments write_line_comment delete_line_comment
dates: list_extensions put_extension publish_feedback withhold_feedback recount_results show_policy put_policy
regrades: create_regrade list_regrades show_regrade cancel_regrade
results: list_results export_gradebook show_statistics
people: list_members change_member remove_member list_invitations create_invitations revoke_invitation list_tokens
    create_token revoke_token show_course rotate_course_link close_course_link list_audit_entries import_roster
    export_roster export_oneroster show_caller
courses: list_courses make_course
platforms: list_platforms add_platform approve_platform remove_platform make_registration_link list_contexts
    link_context unlink_context pull_roster
webhooks: list_webhooks create_webhook show_webhook delete_webhook rotate_webhook_secret enable_webhook replay_webhook
    list_deliveries replay_delivery
health: show_health show_readiness show_metrics
"""
"""The ids by tag. Generated clients name their functions by them: add new ones, and change none."""


def test_operations_have_short_ids_that_stay_and_one_tag_each(document: dict[str, Any]) -> None:
    by_tag: dict[str, list[str]] = {}
    for _, _, operation in openapi.operations(document):
        [tag] = operation["tags"]
        by_tag.setdefault(tag, []).append(operation["operationId"])
    pinned = {
        words[0].removesuffix(":"): words[1:]
        for words in (block.split() for block in re.split(r"\n(?! )", OPERATIONS.strip()))
    }
    assert {tag: sorted(ids) for tag, ids in by_tag.items()} == {tag: sorted(ids) for tag, ids in pinned.items()}, (
        "write the id of a new route beside its tag into OPERATIONS of this file"
    )
    ids = [one for some in by_tag.values() for one in some]
    assert len(set(ids)) == len(ids)
    assert [tag["name"] for tag in document["tags"]] == [*pinned]
    assert all(tag["description"] for tag in document["tags"])


@pytest.mark.parametrize(("origin", "url"), [(None, "/"), ("https://grader.example.org", "https://grader.example.org")])
def test_the_document_names_its_server(origin: str | None, url: str) -> None:
    app = FastAPI(title="test", version="0")
    routes.include_in(app)
    openapi.install(app, origin)
    assert app.openapi()["servers"] == [{"url": url}]
