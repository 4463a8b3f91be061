"""Several lessons, dates and withheld feedback on the pages, with content of their own."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from grader.settings import Settings
from web.browsing import service
from web.test_forms import BROWSER, card, fields

CHOICE = {"id": "q", "kind": "mcq", "q": "Which?", "options": ["a", "b"], "answer": 1, "explain": "SECRET"}
QUIZZES: dict[str, dict[str, Any]] = {
    "1.1-open": {},
    "1.1-two": {"attempts": 2},
    "2.1-later": {"opens": "2190-01-01T00:00Z", "due": "2191-01-01T00:00Z"},
    "2.2-withheld": {"feedback": "after_publish", "due": "2190-01-01T18:00Z"},
    "2.3-closed": {"due": "2020-01-01T00:00Z"},
}


@pytest.fixture(scope="module")
def origin(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    content = tmp_path_factory.mktemp("content")
    for folder in ("quizzes", "models", "reference_solutions"):
        (content / folder).mkdir()
    for name, policy in QUIZZES.items():
        quiz = {"id": name, "title": f"Quiz <i>{name}</i>", "policy": policy, "questions": [CHOICE]}
        (content / "quizzes" / f"{name}.json").write_text(json.dumps(quiz))
    with service(Settings(data=tmp_path_factory.mktemp("data"), content=Path(content), workers=0)) as origin:
        yield origin


@pytest.fixture
def browser(origin: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=origin, headers=BROWSER, follow_redirects=True) as browser:
        yield browser


def send(browser: httpx.Client, quiz: str, answer: str) -> httpx.Response:
    lesson = f"/lessons/{quiz.partition('-')[0]}"
    data = fields(card(browser.get(lesson).text, f"{quiz}--q"))
    assert data["back"] == lesson
    return browser.post(f"/quizzes/{quiz}/q", data=data | {"answer": answer})


def test_several_lessons_are_listed_with_points_and_dates(browser: httpx.Client) -> None:
    page = browser.get("/").text
    assert re.findall(r'<a href="/lessons/([\d.]+)">Lesson', page) == ["1.1", "2.1", "2.2", "2.3"]
    assert "Quiz 1.1-open, Quiz 1.1-two" in page
    assert "0 of 2" in page
    assert "Fri 1 Jan, 18:00 UTC" in page


def test_a_quiz_that_has_not_opened_shows_when(browser: httpx.Client) -> None:
    page = browser.get("/lessons/2.1").text
    assert "opens on 2190-01-01" in page
    assert "Which?" not in page


def test_withheld_feedback_is_only_a_receipt(browser: httpx.Client) -> None:
    right, page = (send(browser, "2.2-withheld", answer).text for answer in ("1", "0"))
    mine = card(page, "2.2-withheld--q")
    assert "Received" in mine
    assert "once the results are published" in mine
    assert not re.search("orrect|SECRET", mine)
    assert not re.search("orrect|SECRET", card(right, "2.2-withheld--q"))
    assert "<dd>0 of 1</dd>" in page


def test_when_attempts_are_spent_the_page_says_so_and_shows_the_solution(browser: httpx.Client) -> None:
    first = send(browser, "1.1-two", "0").text
    assert "1 of 2 attempts left" in first
    assert "SECRET" not in first
    mine = card(send(browser, "1.1-two", "0").text, "1.1-two--q")
    assert "SECRET" in mine


def test_a_closed_quiz_takes_nothing_and_says_why(browser: httpx.Client) -> None:
    response = send(browser, "2.3-closed", "1")
    assert response.status_code == 409
    assert "closed on 2020-01-01" in card(response.text, "2.3-closed--q")
