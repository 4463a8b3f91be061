"""One line of the log for every request, with an id that its response and its problem bear; never what is secret."""

import json
from typing import Any

import httpx
import pytest
from pydantic import BaseModel, ValidationError
from sqlalchemy import text

from grader.logs import exception_text, is_json
from support.sites import Site

API = "/api/v1"
ANSWER = "my own secret words"


def lines(capsys: pytest.CaptureFixture[str]) -> list[dict[str, Any]]:
    return [json.loads(line) for line in capsys.readouterr().err.splitlines()]


def test_a_request_is_one_line_with_what_is_needed_to_find_it(
    site: Site, ann: httpx.Client, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    response = ann.get(f"{API}/submissions/abc?token=secret")
    (line,) = lines(capsys)
    assert line.pop("ms") > 0
    assert line.pop("timestamp").endswith("Z")
    assert len(line.pop("user")) == 32
    assert line == {
        "event": "request", "level": "info", "method": "GET", "route": f"{API}/submissions/{{submission_id}}",
        "status": 404, "request_id": response.headers["x-request-id"],
    }  # fmt: skip


@pytest.mark.parametrize("given", ["0af7651916cd43dd8448eb211c80319c", "edge-7.2026_11", "b" * 64])
def test_a_well_formed_request_id_is_taken_over(nobody: httpx.Client, given: str) -> None:
    response = nobody.get(f"{API}/quizzes", headers={"X-Request-ID": given})
    assert response.status_code == 401
    assert response.headers["x-request-id"] == response.json()["request_id"] == given


@pytest.mark.parametrize("given", ["short", "a" * 65, "with blank inside", "-leading", "ünïcödé-id-12345", '"},{"x":1'])
def test_another_request_id_is_replaced(nobody: httpx.Client, given: str) -> None:
    response = nobody.get("/healthz", headers={b"X-Request-ID": given.encode()})
    assert len(response.headers["x-request-id"]) == 32


def test_secrets_and_answers_are_not_logged(
    site: Site, ann: httpx.Client, nobody: httpx.Client, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    secret = ann.headers["Authorization"].split("_")[2]
    capsys.readouterr()
    ann.post(f"{API}/submissions", json={"quiz": "small", "question": "q4", "answer": ANSWER})
    nobody.get("/signin?code=gri_1_secretcode")
    nobody.post("/signin", content="code=gri_1_secretcode")
    nobody.get(f"{API}/quizzes", headers={"Authorization": "Bearer grt_1_secretcode", "Cookie": "grader_session=grs"})

    def broken(*_: object, **_named: object) -> None:
        raise RuntimeError("broken")

    monkeypatch.setattr("grader.courses.answering.results.insert_rows", broken)
    ann.post(f"{API}/submissions", json={"quiz": "small", "question": "q4", "answer": ANSWER})
    told = capsys.readouterr().err
    assert "RuntimeError: broken" in told
    for word in (secret, "secret words", "secretcode", "grs"):
        assert word not in told
    assert len(told.splitlines()) == 6


def test_a_failing_statement_is_logged_without_its_values(
    site: Site, ann: httpx.Client, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(session: Any, *_: object, **_named: object) -> None:
        session.execute(text("INSERT INTO nowhere VALUES (:answer)"), {"answer": ANSWER})

    monkeypatch.setattr("grader.courses.answering.results.insert_rows", broken)
    response = ann.post(f"{API}/submissions", json={"quiz": "small", "question": "q4", "answer": "x"})
    told = capsys.readouterr().err
    assert response.status_code == 500
    assert "nowhere" in told
    assert "secret words" not in told


class Strict(BaseModel):
    number: int


def test_errors_that_quote_their_input_are_named_by_their_type() -> None:
    try:
        Strict.model_validate({"number": ANSWER})
    except ValidationError as error:
        told = exception_text((type(error), error, error.__traceback__))
    assert "ValidationError" in told
    assert "secret" not in told


def test_an_error_that_is_its_own_cause_is_told_once() -> None:
    error = ValueError("its own")
    error.__cause__ = error
    assert exception_text((ValueError, error, None)) == "ValueError: its own"


def test_the_format_is_what_the_setting_says_and_json_beside_a_terminal() -> None:
    assert is_json("json")
    assert not is_json("text")
    assert is_json("auto")  # under pytest stderr is no terminal
