"""Several lessons, dates and withheld feedback on the pages, with content of their own."""

import json
import re
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy import select
from sqlalchemy.orm import Session

from grader.domain.verdict import Status, Verdict
from grader.service.accounts import in_database
from grader.settings import Settings
from grader.store import submissions
from grader.store.submissions import VerdictMark
from grader.store.tables import Submission
from grader.web.verdict.work import describe_regrade
from support.servers import PLAIN
from web.browsing import service
from web.test_forms import BROWSER, card, fields

CHOICE = {"id": "q", "kind": "mcq", "q": "Which?", "options": ["a", "b", "c"], "answer": 1, "explain": "SECRET"}
LESSON = {"title": "Steps &amp; stages", "summary": "What splits <code>mj_step</code> in two."}
QUIZZES: dict[str, dict[str, Any]] = {
    "1.1-open": {},
    "1.1-two": {"attempts": 2},
    "2.1-later": {"opens": "2190-01-01T00:00Z", "due": "2191-01-01T00:00Z"},
    "2.2-withheld": {"feedback": "after_publish", "due": "2190-01-01T18:00Z"},
    "2.3-closed": {"due": "2020-01-01T00:00Z"},
}


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Settings:
    content = tmp_path_factory.mktemp("content")
    for folder in ("quizzes", "models", "reference_solutions"):
        (content / folder).mkdir()
    for name, policy in QUIZZES.items():
        head = {"lesson": LESSON} if name == "1.1-two" else {}
        quiz = {"id": name, "title": f"Quiz <i>{name}</i>", "policy": policy, "questions": [CHOICE], **head}
        (content / "quizzes" / f"{name}.json").write_text(json.dumps(quiz))
    return Settings(data=tmp_path_factory.mktemp("data"), content=Path(content), workers=0)


@pytest.fixture(scope="module")
def origin(settings: Settings) -> Iterator[str]:
    with service(settings) as origin:
        yield origin


@pytest.fixture
def browser(origin: str) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=origin, headers=BROWSER, follow_redirects=True, verify=PLAIN) as browser:
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
    assert "Fri 1 Jan 2190, 18:00 UTC" in page
    assert '<dt>opens</dt><dd><time class="nowrap" datetime="2190-01-01T' in page


def test_a_lesson_says_what_it_is_about_and_what_to_do_first(browser: httpx.Client) -> None:
    page = browser.get("/lessons/1.1").text
    assert "<h1>Lesson 1.1: Steps &amp; stages</h1>" in page
    assert "<code>mj_step</code> in two" in page
    first = re.compile(r'<p class="meta" id="first">(.*?)</p>')
    assert first.findall(page) == ['Begin here: <a href="#1.1-open--q">Quiz 1.1-open, question 1</a>']
    assert first.findall(send(browser, "1.1-open", "0").text) == [
        'Next: <a href="#1.1-two--q">Quiz 1.1-two, question 1</a>'
    ]
    assert first.findall(browser.get("/lessons/2.3").text) == ["Every question is answered or closed."]  # it is closed


def test_a_quiz_that_has_not_opened_shows_when(browser: httpx.Client) -> None:
    page = browser.get("/lessons/2.1").text
    assert re.search(">This quiz opens on <time[^>]*>1 Jan 2190, ", page)
    assert "Which?" not in page


def test_withheld_feedback_is_only_a_receipt(browser: httpx.Client) -> None:
    right, page = (send(browser, "2.2-withheld", answer).text for answer in ("1", "0"))
    mine = card(page, "2.2-withheld--q")
    assert "Received" in mine
    assert "once the results are published" in mine
    assert not re.search("orrect|SECRET", mine)
    assert not re.search("orrect|SECRET", card(right, "2.2-withheld--q"))
    assert "<dd>not shown yet, of 1</dd>" in page


def test_when_attempts_are_spent_the_page_says_so_and_shows_the_solution(browser: httpx.Client) -> None:
    first = send(browser, "1.1-two", "0").text
    assert "1 of 2 attempts left" in first
    assert "SECRET" not in first
    again = card(send(browser, "1.1-two", "0").text, "1.1-two--q")
    assert "This is what you sent last time." in again
    assert "1 of 2 attempts left" in again
    mine = card(send(browser, "1.1-two", "2").text, "1.1-two--q")
    assert "SECRET" in mine


def test_a_closed_quiz_takes_nothing_and_says_why(browser: httpx.Client) -> None:
    response = send(browser, "2.3-closed", "1")
    assert response.status_code == 409
    assert re.search("closed on <time[^>]*>1 Jan 2020, ", card(response.text, "2.3-closed--q"))


def grade_again(settings: Settings, quiz: str) -> None:
    """Replaces the verdict on the newest answer to a quiz, as a regrade does."""

    def change(session: Session) -> None:
        newest = select(Submission).where(Submission.quiz == quiz).order_by(Submission.id.desc()).limit(1)
        verdict = Verdict(status=Status.CORRECT, points=1.0, max_points=1.0)
        submissions.append_verdict(session, session.scalars(newest).one(), verdict, "regrade")

    in_database(settings, change)


def test_a_learner_reads_that_an_answer_was_graded_again(browser: httpx.Client, settings: Settings) -> None:
    assert "Graded again" not in send(browser, "1.1-open", "0").text
    grade_again(settings, "1.1-open")
    shown = card(browser.get("/lessons/1.1").text, "1.1-open--q")
    match = re.search(r"Graded again on <time[^>]*>([^<]*)</time>([^<]*)", shown)
    assert match is not None
    assert (match[1] + match[2]).endswith("UTC, after a change of the question or its key: 1 of 1 now, 0 of 1 before.")


def test_a_learner_reads_what_a_regrade_made_of_earlier_attempts(browser: httpx.Client, settings: Settings) -> None:
    for option in ("1", "0"):
        send(browser, "1.1-open", option)

    def change(session: Session) -> None:
        newest = select(Submission).where(Submission.quiz == "1.1-open").order_by(Submission.id.desc()).limit(2)
        for row in session.scalars(newest).all():
            submissions.append_verdict(
                session, row, Verdict(status=Status.INCORRECT, points=0.0, max_points=1.0), "regrade"
            )

    in_database(settings, change)
    shown = re.sub(r"<[^>]*>", "", card(browser.get("/lessons/1.1").text, "1.1-open--q"))
    assert "its key: this attempt keeps 0 of 1. Attempt 1: 0 of 1 now, 1 of 1 before." in shown


def test_a_withheld_verdict_does_not_tell_that_it_was_changed(browser: httpx.Client, settings: Settings) -> None:
    send(browser, "2.2-withheld", "0")
    grade_again(settings, "2.2-withheld")
    assert "Graded again" not in browser.get("/lessons/2.2").text


@pytest.mark.parametrize(
    ("before", "after", "ends"),
    [
        (
            ("grading", "incorrect", 0, 1),
            ("review", "partial", 0.5, 1),
            "UTC: 0.5 of 1 now, 0 of 1 before.",
        ),
        (
            ("review", "partial", 0.5, 1),
            ("rubric", "partial", 0.5, 1),
            "change of the rubric: this attempt keeps 0.5 of 1.",
        ),
        (("grading", "correct", 1, 1), ("regrade", "correct", 2, 2), "its key: 2 of 2 now, 1 of 1 before."),
        (("grading", "correct", 1, 1), ("regrade", "needs_review", 0, 1), "will decide; before, it had 1 of 1."),
        (("grading", "correct", 3, 3), ("regrade", "needs_review", 0, 5), "will decide; before, it had 3 of 3."),
        (("review", "correct", 1, 1), ("withdrawn", "needs_review", 0, 1), "will decide; before, it had 1 of 1."),
        (("grading", "needs_review", 0, 1), ("review", "correct", 1, 1), ""),
    ],
)
def test_what_changed_is_one_sentence(
    before: tuple[str, str, float, float], after: tuple[str, str, float, float], ends: str
) -> None:
    at = datetime(2026, 11, 22, 6, 5, tzinfo=UTC)
    sentence = describe_regrade(VerdictMark(*before, at), VerdictMark(*after, at))
    assert sentence.endswith(ends)
    assert (sentence == "") == (ends == "")
    assert not sentence or "on 22 Nov 2026, 06:05 UTC" in sentence
