"""A term played through: what everybody handed in, graded again in a dozen lines of Python, is what the service says.

A dozen learners answer five quizzes: one is late for all but a few, one is closed for all but a few, one has a
wrong key that is found and mended, one gets a new question while it is open, and one has answers that a person grades.
At the end the gradebook is exported, the data is restored from a backup, and the gradebook is the same to the byte.
"""

import csv
import io
import json
import random
import time
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import httpx
import pytest

from grader.courses.people.tokens import create_token
from grader.settings import Settings
from support.databases import BACKENDS, database_url
from support.sites import Site, open_site, write_content

pytestmark = [pytest.mark.slow, pytest.mark.postgres]

API = "/api/v1"
LEARNERS = [f"learner{number:03}" for number in range(12)]
EXTENDED = LEARNERS[::6]
ESSAYISTS = LEARNERS[::4]
NEWCOMERS = LEARNERS[::3]
NOW = datetime.now(UTC)
HOUR = timedelta(hours=1)
PER_DAY = 0.75

POLICIES: dict[str, dict[str, Any]] = {
    "plain": {},
    "late": {"due": (NOW - HOUR).isoformat(), "late": {"per_day": PER_DAY, "until": (NOW + 48 * HOUR).isoformat()}},
    "closed": {"opens": (NOW - 48 * HOUR).isoformat(), "due": (NOW - HOUR).isoformat()},
    "mended": {"counts": "latest"},
    "growing": {"attempts": 3},
}
WRONG_KEY, RIGHT_KEY = 0, 2


def quiz(name: str, key: int) -> dict[str, Any]:
    """A choice and a number, and an essay where a person grades."""
    questions: list[dict[str, Any]] = [
        {"id": "choice", "kind": "mcq", "q": "Which?", "options": ["a", "b", "c"], "answer": key, "explain": "So."},
        {"id": "number", "kind": "numeric", "q": "How long?", "answer": 5, "tol": 0.1, "unit": "ms", "points": 2},
    ]
    if name == "plain":
        questions.append({"id": "essay", "kind": "open", "q": "Why?", "reference": "Since.", "points": 4})
    return {"id": name, "title": name.capitalize(), "policy": POLICIES[name], "questions": questions}


def write(content: Path, document: dict[str, Any]) -> None:
    """Writes one quiz into the content folder."""
    (content / "quizzes" / f"{document['id']}.json").write_text(json.dumps(document))


@dataclass
class Term:
    """The service, its clients, and what everybody handed in, in order."""

    site: Site
    content: Path
    teacher: httpx.Client
    everyone: httpx.Client
    tokens: dict[str, dict[str, str]]
    answers: dict[tuple[str, str, str], list[Any]] = field(default_factory=lambda: defaultdict(list))

    def all_hand_in(self, learners: list[str], quiz_id: str, question: str, draw: random.Random) -> list[int]:
        """Each learner hands in one or two answers; the statuses of the first ones."""
        planned = [(name, [answer(question, draw) for _ in range(draw.choice((1, 1, 2)))]) for name in learners]
        with ThreadPoolExecutor(8) as pool:
            return list(pool.map(lambda one: self.hand_in(one[0], quiz_id, question, one[1]), planned))

    def hand_in(self, name: str, quiz_id: str, question: str, answers: list[Any]) -> int:
        statuses = []
        for one in answers:
            body = {"quiz": quiz_id, "question": question, "answer": one}
            statuses.append(self.everyone.post(f"{API}/submissions", json=body, headers=self.tokens[name]).status_code)
            if statuses[-1] == 201:
                self.answers[name, quiz_id, question].append(one)
        return statuses[0]

    def change(self, document: dict[str, Any]) -> None:
        """The author changes a quiz while the service runs."""
        write(self.content, document)
        assert self.teacher.post(f"{API}/content:reload").status_code == 200

    def gradebook(self) -> str:
        response = self.teacher.get(f"{API}/gradebook.csv")
        assert response.status_code == 200
        return response.text

    def regrade(self, *, dry_run: bool) -> dict[str, Any]:
        """A regrade of the mended quiz, when it has ended."""
        body = {"quiz": "mended", "scope": "all", "dry_run": dry_run}
        made = self.teacher.post(f"{API}/regrades", json=body)
        assert made.status_code == 202, made.text
        deadline = time.monotonic() + 120
        while (state := self.teacher.get(made.headers["location"]).json())["status"] not in ("done", "failed"):
            assert time.monotonic() < deadline, state
            time.sleep(0.05)
        assert state["status"] == "done"
        return dict(state)


def answer(question: str, draw: random.Random) -> Any:
    if question == "choice":
        return draw.randrange(3)
    return draw.choice(("5 ms", "0.005 s", "4.95 ms", "6 ms", "5 s"))


def points(question: str, given: Any, key: int) -> float:
    if question == "number":
        return 2.0 * (given in ("5 ms", "0.005 s", "4.95 ms"))
    return float(given == key)


def expected(term: Term, name: str, quiz_id: str, question: str, key: int) -> float | None:
    """What counts, from the answers alone; None where the learner handed in nothing."""
    given = term.answers.get((name, quiz_id, question))
    if not given:
        return None
    multiplier = PER_DAY if quiz_id == "late" and name not in EXTENDED else 1.0
    graded = [multiplier * points(question, one, key) for one in given]
    return graded[-1] if quiz_id == "mended" else max(graded)


def check(term: Term, mended_key: int, essays: dict[str, float]) -> None:
    """Compares every cell of the gradebook with `expected`."""
    by_user = {row["user"]: row for row in csv.DictReader(io.StringIO(term.gradebook()))}
    assert sorted(by_user) == LEARNERS
    columns = [(quiz_id, question) for quiz_id in POLICIES for question in ("choice", "number")]
    for name in LEARNERS:
        wanted = {
            f"{quiz_id}/{question}": expected(term, name, quiz_id, question, mended_key if quiz_id == "mended" else 1)
            for quiz_id, question in [*columns, ("growing", "later")]
        }
        wanted["plain/essay"] = essays.get(name)
        cells = {column: by_user[name].get(column, "") for column in wanted}
        assert {column: float(cell) if cell else None for column, cell in cells.items()} == wanted


@pytest.fixture(params=BACKENDS)
def term(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Term]:
    content = write_content(tmp_path / "content")
    (content / "quizzes" / "small.json").unlink()
    for name in POLICIES:
        write(content, quiz(name, WRONG_KEY if name == "mended" else 1))
    with ExitStack() as stack:
        url = stack.enter_context(database_url(request.param, tmp_path))
        site = stack.enter_context(open_site(Settings(content=content, database_url=url, workers=1)))
        with site.app.state.services.database.write() as session:
            tokens = {name: create_token(session, name, "student", None) for name in LEARNERS}
        headers = {name: {"Authorization": f"Bearer {token}"} for name, token in tokens.items()}
        yield Term(site, content, site.client("tina", "instructor"), site.anonymous(), headers)


def test_a_term(term: Term) -> None:
    draw = random.Random(3)
    for quiz_id in ("late", "closed"):
        for name in EXTENDED:
            body = {"user": name, "due": (NOW + 24 * HOUR).isoformat()}
            assert term.teacher.put(f"{API}/quizzes/{quiz_id}/extensions", json=body).status_code == 200
    for quiz_id in POLICIES:
        for question in ("choice", "number"):
            statuses = term.all_hand_in(LEARNERS, quiz_id, question, draw)
            in_time = [name in EXTENDED or quiz_id != "closed" for name in LEARNERS]
            assert [status == 201 for status in statuses] == in_time
    check(term, WRONG_KEY, {})

    document = quiz("growing", 1)
    document["questions"].append({"id": "later", "kind": "mcq", "q": "And?", "options": ["a", "b"], "answer": 1})
    term.change(document)
    with ThreadPoolExecutor(8) as pool:
        later = [(name, "growing", "later", [draw.randrange(2)]) for name in NEWCOMERS]
        assert set(pool.map(lambda one: term.hand_in(*one), later)) == {201}
    check(term, WRONG_KEY, {})

    term.change(quiz("mended", RIGHT_KEY))
    before = term.gradebook()
    term.regrade(dry_run=True)
    assert term.gradebook() == before
    term.regrade(dry_run=False)
    check(term, RIGHT_KEY, {})
    after = term.gradebook()
    assert after != before
    term.regrade(dry_run=False)
    assert term.gradebook() == after

    for name in ESSAYISTS:
        assert term.hand_in(name, "plain", "essay", ["Since the pole leaves the unit circle."]) == 201
    check(term, RIGHT_KEY, review_all(term, draw))


def review_all(term: Term, draw: random.Random) -> dict[str, float]:
    """The teacher grades what waits until nothing does: what each learner got."""
    owners = {}
    for name in ESSAYISTS:
        own = term.teacher.get(f"{API}/submissions", params={"quiz": "plain", "question": "essay", "user": name})
        owners[own.json()["items"][0]["id"]] = name
    given = {}
    while (claimed := term.teacher.post(f"{API}/reviews:claim", json={})).status_code == 200:
        worth = draw.randrange(9) / 2
        one = claimed.json()["id"]
        decided = term.teacher.put(
            f"{API}/submissions/{one}/review", json={"points": worth}, headers={"If-Match": claimed.headers["etag"]}
        )
        assert decided.status_code == 200, decided.text
        given[owners[one]] = worth
    assert claimed.status_code == 404
    assert sorted(given) == ESSAYISTS
    return given
