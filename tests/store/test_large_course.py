"""With 100,000 submissions no list, gradebook or statistics walks them all; and old keys and events are pruned."""

import json
import time
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path

import httpx
import pytest
from sqlalchemy import func, select

from databases import BACKENDS, database_url
from grader.settings import Settings
from grader.store import submissions
from grader.store.database import Database
from grader.store.pruning import prune
from grader.store.tables import Event, IdempotencyKey, Submission
from seeding import Course, seed
from sites import Site, open_site, write_content

LISTS = (
    "/submissions",
    "/submissions?user=nobody",
    "/submissions?user=user7",
    "/submissions?question=none",
    "/submissions?quiz=large&question=none",
    "/submissions?user=nobody&quiz=large",
    "/submissions?learner=nobody",
    "/reviews",
    "/reviews?user=nobody",
    "/members",
    "/quizzes/large/statistics",
    "/gradebook.csv?quiz=large",
)
TIMES_OF_NOTHING = 6
"""What a request may cost, beside one that reads nothing: on a quiet machine they take 10 to 50 ms, and that one 5."""


@pytest.fixture(scope="module", params=BACKENDS)
def large(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("large")
    content = write_content(folder / "content")
    questions = [{"kind": "mcq", "q": f"Which {n}?", "options": ["a", "b", "c"], "answer": 1} for n in range(8)]
    (content / "quizzes" / "large.json").write_text(json.dumps({"id": "large", "title": "L", "questions": questions}))
    with (
        database_url(request.param, folder) as url,
        open_site(Settings(content=content, data=folder / "data", database_url=url, workers=0)) as site,
    ):
        seed(site.app.state.context.database, Course())
        yield site


def cost_s(client: httpx.Client, path: str) -> float:
    """The least time of five requests [s], after one that fills the caches."""
    times = []
    for _ in range(6):
        begin = time.perf_counter()
        assert client.get(f"/api/v1{path}").status_code == 200, path
        times.append(time.perf_counter() - begin)
    return min(times[1:])


@pytest.mark.cost
@pytest.mark.parametrize("path", LISTS)
def test_no_list_grows_with_the_course(large: Site, path: str) -> None:
    teacher = large.client("tina", "instructor", Course().name)
    nothing = cost_s(teacher, "/audit")
    assert cost_s(teacher, path) < TIMES_OF_NOTHING * nothing + 0.05


@pytest.fixture(params=BACKENDS)
def small(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Database]:
    with database_url(request.param, tmp_path) as url:
        database = Database(url)
        database.migrate()
        seed(database, Course(learners=30, questions=2, submissions=1200))
        yield database
        database.close()


def counts(database: Database) -> tuple[int, int]:
    with database.read() as session:
        keys = session.scalar(select(func.count()).select_from(IdempotencyKey))
        events = session.scalar(select(func.count()).select_from(Event))
        return keys or 0, events or 0


def test_old_keys_and_superseded_events_are_deleted_and_the_last_event_stays(small: Database) -> None:
    with small.write() as session:
        waiting = session.scalars(select(Submission).limit(3)).all()
        for number, submission in enumerate(waiting):
            submission.status = "running" if number == 0 else "graded"
            session.add(Event(submission_id=submission.id, number=2, name=submission.status))
    assert counts(small) == (1200, 1203)
    assert prune(small, timedelta(days=365_000 // 10)) == 0
    assert prune(small, timedelta(days=30)) == 1202
    assert counts(small) == (0, 1201)
    with small.read() as session:
        left = [[one.number for one in submissions.events_after(session, one.id, 0)] for one in waiting]
    assert left == [[1, 2], [2], [2]]
    assert prune(small, timedelta(days=30)) == 0
