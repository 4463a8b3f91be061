"""The list of attempts on the page of an exercise: none is lost, however many there are."""

import json
import re
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta

import httpx
import pytest

from grader.domain.verdict import Status, Verdict
from grader.settings import Settings
from grader.store import submissions
from grader.store.engine.ids import first_id
from support.sites import Site, open_site

QUIZ, QUESTION = "1.3-exercises", "rk4-step"
PAGE = f"/quizzes/{QUIZ}/{QUESTION}"
THEN = datetime(2026, 9, 1, 12, tzinfo=UTC)
HANDED_IN, BEST = 130, 3


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    with open_site(Settings(data=tmp_path_factory.mktemp("data"), workers=0)) as site:
        yield site


def attempt_often(site: Site, often: int) -> httpx.Client:
    """A new learner after so many attempts, of which the third was the best."""
    learner = site.anonymous({"Accept": "text/html", "Sec-Fetch-Site": "same-origin", "Origin": site.origin})
    learner.post("/session")
    first = learner.post("/api/v1/submissions", json={"quiz": QUIZ, "question": QUESTION, "answer": {"source": "x"}})
    with site.app.state.services.database.write() as session:
        own = submissions.get(session, first.json()["id"])
        assert own is not None
        for number in range(1, often + 1):
            moment = THEN + timedelta(minutes=number)
            row = submissions.make(
                id=first_id(moment)[:12] + own.id[12:], course=own.course, learner=own.learner, user=own.user,
                quiz=QUIZ, question=QUESTION, answer=json.dumps({"source": f"number = {number}\n"}), seed=1,
                content_digest="d", attempt=number,
            )  # fmt: skip
            verdict = Verdict(status=Status.PARTIAL, points=2 if number == BEST else 1, max_points=4)
            submissions.add(session, [(row, verdict)], moment)
        own.created_at, own.attempt = THEN + timedelta(days=1), often + 1
    return learner


def read_numbers(page: str) -> list[int]:
    """The numbers of the attempts that are listed."""
    return [int(number) for number in re.findall(r'class="chip".*?<span>attempt (\d+)', page)]


def test_all_attempts_are_listed_counted_and_compared(site: Site) -> None:
    learner = attempt_often(site, 17)
    page = learner.get(PAGE).text
    assert read_numbers(page) == [*range(18, 0, -1)]
    assert "<summary>15 earlier</summary>" in page
    oldest = re.findall(rf'href="{PAGE}\?attempt=(\w+)#attempts"', page)[-1]
    shown = learner.get(f"{PAGE}?attempt={oldest}").text
    assert "<span>number = 1</span>" in shown
    assert "<details open><summary>15 earlier</summary>" in shown
    compared = learner.get(f"{PAGE}/attempts?left={oldest}").text
    assert "number = 1<" in compared
    assert len(re.findall(r"<option value=.{32}", compared)) == 2 * 18


def test_the_best_attempt_is_named_and_listed_however_many_follow(site: Site) -> None:
    page = attempt_often(site, HANDED_IN).get(PAGE).text
    assert f"Attempt {BEST} was better, 2 points in place of 1" in page
    assert read_numbers(page) == [*range(HANDED_IN + 1, HANDED_IN - 102, -1), BEST]
    assert f"<summary>{HANDED_IN - 2} earlier</summary>" in page
    assert f"{HANDED_IN - 103} more are not listed" in page
