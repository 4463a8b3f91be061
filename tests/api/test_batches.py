"""Answers that are stored together: each is decided on and answered as if it had come alone."""

import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx
import pytest
from sqlalchemy import func, select
from sqlalchemy.orm import Session

from grader.courses.answering import intake
from grader.service.accounts import revoke_tokens
from grader.store.engine import ids
from grader.store.tables import Event, IdempotencyKey, Result, ResultRevision, Submission, VerdictRow
from support.sites import Site

pytestmark = pytest.mark.slow

SUBMISSIONS = "/api/v1/submissions"


def hand_in(client: httpx.Client, question: str = "q1", answer: Any = 1, **headers: str) -> httpx.Response:
    return client.post(SUBMISSIONS, json={"quiz": "small", "question": question, "answer": answer}, headers=headers)


def counts(site: Site) -> dict[str, int]:
    """Rows of the site's course by table."""
    with site.app.state.services.database.read() as session:
        theirs = select(Submission.id).where(Submission.course == site.course)
        tables = {
            "submissions": select(func.count()).select_from(theirs.subquery()),
            "verdicts": select(func.count()).where(VerdictRow.submission_id.in_(theirs)),
            "events": select(func.count()).where(Event.submission_id.in_(theirs)),
            "results": select(func.count()).where(Result.course == site.course),
            "feed": select(func.count()).where(ResultRevision.course == site.course),
            "keys": select(func.count()).where(IdempotencyKey.course == site.course),
        }
        return {name: session.scalar(query) or 0 for name, query in tables.items()}


@pytest.fixture
def one_batch(either_site: Site, monkeypatch: pytest.MonkeyPatch) -> threading.Event:
    """Holds the writer back until the event is set, so that all answers before it wait for one transaction."""
    go = threading.Event()
    writer = either_site.app.state.services.writer
    store = writer._store

    def held(session: Session, answers: Sequence[Any]) -> Any:
        go.wait(30)
        return store(session, answers)

    monkeypatch.setattr(writer, "_store", held)
    return go


def together(go: threading.Event, clients: list[httpx.Client], *args: Any, **headers: str) -> list[httpx.Response]:
    """The responses of clients that hand in the same at once, in one batch but for the first."""
    with ThreadPoolExecutor(len(clients)) as pool:
        waiting = [pool.submit(hand_in, client, *args, **headers) for client in clients]
        time.sleep(0.5)
        go.set()
        return [one.result() for one in waiting]


@pytest.mark.slow
def test_answers_of_many_learners_leave_every_row_once(either_site: Site, one_batch: threading.Event) -> None:
    clients = [either_site.client(f"user{number}") for number in range(8)]
    made = together(one_batch, clients, "q1", 1, **{"Idempotency-Key": "k"})
    assert [one.status_code for one in made] == [201] * 8
    assert len({one.json()["id"] for one in made}) == 8
    assert counts(either_site) == {
        "submissions": 8, "verdicts": 8, "events": 8, "results": 8, "feed": 8, "keys": 8,
    }  # fmt: skip
    for client, one in zip(clients, made, strict=True):
        assert client.get(one.headers["location"]).json() == one.json()


def test_a_result_that_an_answer_does_not_change_is_not_written(either_site: Site) -> None:
    ann, changes = either_site.client("ann"), []
    for option in (0, 0, 1, 0):  # wrong, the same again, right, and what does not count any more
        hand_in(ann, "q1", option)
        with either_site.app.state.services.database.read() as session:
            changes.append(session.scalar(select(Result.changes).where(Result.course == either_site.course)))
    assert changes == [1, 1, 2, 2]
    assert counts(either_site)["feed"] == 2


def test_attempts_of_one_learner_in_one_batch_are_numbered_and_limited(
    either_site: Site, one_batch: threading.Event
) -> None:
    ann = either_site.client("ann")
    made = together(one_batch, [ann] * 5, "q2", "6 ms")
    assert sorted(one.status_code for one in made) == [201, 201, 409, 409, 409]
    taken = sorted((one.json()["id"], one.json()["attempt"]) for one in made if one.status_code == 201)
    assert [attempt for _, attempt in taken] == [1, 2], "ids in the order of attempts"
    assert counts(either_site)["results"] == 1


def test_attempts_stay_in_order_where_the_clock_is_set_back(either_site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    ann, real = either_site.client("ann"), ids.now_ns
    made = [hand_in(ann, "q1", 0).json()["id"]]
    monkeypatch.setattr(ids, "now_ns", lambda: real() - 3_600_000_000_000)
    made += [hand_in(ann, "q1", option).json()["id"] for option in (0, 1)]
    assert made == sorted(made)
    shown = ann.get(SUBMISSIONS).json()["items"]
    assert [one["attempt"] for one in shown] == [3, 2, 1], "newest first"


def test_a_repeated_key_in_one_batch_makes_one_submission(either_site: Site, one_batch: threading.Event) -> None:
    ann = either_site.client("ann")
    made = together(one_batch, [ann] * 5, "q1", 2, **{"Idempotency-Key": "k"})
    assert {one.status_code for one in made} == {201}
    assert len({one.json()["id"] for one in made}) == 1
    assert counts(either_site)["submissions"] == 1


def test_an_answer_that_cannot_be_stored_fails_alone(
    either_site: Site, one_batch: threading.Event, monkeypatch: pytest.MonkeyPatch
) -> None:
    made_of = intake.make_submission

    def poisoned(answer: intake.NewAnswer, submission_id: str, attempt: int) -> Submission:
        made = made_of(answer, submission_id, attempt)
        if answer.who.user == "eve":
            vars(made)["quiz"] = None  # the database refuses the row, and with it the batch
        return made

    monkeypatch.setattr(intake, "make_submission", poisoned)
    clients = [either_site.client(name) for name in ("ann", "eve", "bob", "cat")]
    made = together(one_batch, clients)
    assert [one.status_code for one in made] == [201, 500, 201, 201]
    assert counts(either_site)["submissions"] == counts(either_site)["verdicts"] == 3


def test_a_revoked_token_ends_at_once_and_before_any_other_error(either_site: Site) -> None:
    ann = either_site.client("ann")
    assert hand_in(ann).status_code == 201
    revoke_tokens(either_site.settings, "ann", either_site.course)  # as another process does it
    assert hand_in(ann).status_code == 401
    assert ann.post(SUBMISSIONS, content=b"{").status_code == 401
    assert hand_in(ann, "q9").status_code == 401
    assert counts(either_site)["submissions"] == 1


def test_a_long_answer_is_taken_as_a_short_one(either_site: Site) -> None:
    made = hand_in(either_site.client("ann"), "q4", "why " * 3000)
    assert (made.status_code, made.json()["status"]) == (201, "needs_review")


@pytest.mark.parametrize("content_type", ["text/plain", "application/x-www-form-urlencoded", ""])
def test_a_body_that_is_not_sent_as_json_is_refused(site: Site, content_type: str) -> None:
    body = b'{"quiz": "small", "question": "q1", "answer": 1}'
    refused = site.client("ann").post(SUBMISSIONS, content=body, headers={"Content-Type": content_type})
    assert refused.status_code == 422
