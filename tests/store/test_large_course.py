"""With 100,000 submissions no list, gradebook or statistics walks them all; and old keys and events are pruned."""

import json
import time
from collections.abc import Callable, Iterator
from datetime import timedelta
from pathlib import Path

import httpx
import pytest
from sqlalchemy import func, select, update

from databases import BACKENDS, database_url, open_database
from grader.accounts import in_database
from grader.courses.sign_in import create_sign_in_code
from grader.identity import Role
from grader.settings import Settings
from grader.store import submissions
from grader.store.database import Database
from grader.store.pruning import prune
from grader.store.tables import Event, IdempotencyKey, Result, Submission
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
    "/roster.csv",
    "/quizzes/large/statistics",
    "/gradebook.csv?quiz=large",
)
PAGES = (
    "/instructor",
    "/instructor/stuck",
    "/instructor/review",
    "/instructor/people",
    "/instructor/extensions?quiz=large",
    "/instructor/statistics?quiz=large",
    "/instructor/gradebook?quiz=large",
    "/instructor/gradebook?quiz=large&start=4900",
    "/instructor/gradebook?quiz=large&by=points",
    "/instructor/gradebook?quiz=large&by=answered&down=true",
    "/instructor/gradebook?quiz=large&show=waiting",
    f"/instructor/learners/{Course().learner(7)}",
)

AFTER_A_CHANGE = (
    "/api/v1/quizzes/large/statistics",
    "/api/v1/gradebook.csv?quiz=large",
    "/instructor/statistics?quiz=large",
    "/instructor/gradebook?quiz=large",
)
"""What is kept while nothing changes; after a change, only what has changed is read again."""

NOTHING = "/api/v1/audit"
TIMES_OF_NOTHING = 15
"""What a request may cost, beside one that reads nothing: that one takes 3 ms of CPU time. Measured: at most 7.5, on
SQLite, where the export of the roster reads all 5,000 members."""
TIMES_AFTER_A_CHANGE = 16
"""The same for what has to be made again. Measured: 7 to 10, on SQLite, where statistics read a question's results."""


@pytest.fixture(scope="module", params=BACKENDS)
def large(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    folder = tmp_path_factory.mktemp("large")
    content = write_content(folder / "content")
    questions = [{"kind": "mcq", "q": f"Which {n}?", "options": ["a", "b", "c"], "answer": 1} for n in range(8)]
    policy = {"due": "2026-01-01T00:00:00Z"}  # with a date there are extensions to give
    quiz = {"id": "large", "title": "L", "policy": policy, "questions": questions}
    (content / "quizzes" / "large.json").write_text(json.dumps(quiz))
    with (
        database_url(request.param, folder) as url,
        open_site(Settings(content=content, data=folder / "data", database_url=url, workers=0)) as site,
    ):
        seed(site.app.state.context.database, Course())
        yield site


@pytest.fixture(scope="module")
def teacher(large: Site) -> httpx.Client:
    """An instructor, by token for the API and by session for the pages."""
    client = large.client("tina", "instructor", Course().name)
    code = in_database(
        large.settings, lambda session: create_sign_in_code(session, "tina", Role.INSTRUCTOR, Course().name)
    )
    client.headers["Sec-Fetch-Site"] = "same-origin"
    assert client.post("/signin", data={"code": code}).status_code == 303
    return client


def in_nothings(client: httpx.Client, path: str, before: Callable[[], object] = dict) -> float:
    """What a request costs, in requests that read nothing: least CPU times of ten of each, in turns.

    One of each comes first and fills the caches; `before` is called before each.
    """
    times: dict[str, list[float]] = {path: [], NOTHING: []}
    for _ in range(11):
        for one, so_far in times.items():
            before()
            begin = time.process_time()
            assert client.get(one).status_code == 200, one
            so_far.append(time.process_time() - begin)
    return min(times[path][1:]) / min(times[NOTHING][1:])


@pytest.mark.cost
@pytest.mark.parametrize("path", [*(f"/api/v1{path}" for path in LISTS), *PAGES])
def test_no_list_grows_with_the_course(teacher: httpx.Client, path: str) -> None:
    assert in_nothings(teacher, path) < TIMES_OF_NOTHING


@pytest.mark.cost
@pytest.mark.parametrize("path", AFTER_A_CHANGE)
def test_one_changed_result_costs_as_little(large: Site, teacher: httpx.Client, path: str) -> None:
    def change() -> None:
        with large.app.state.context.database.write() as session:
            of = (Result.course == Course().name, Result.learner == Course().learner(7), Result.question == "q3")
            session.execute(update(Result).where(*of).values(points=1 - Result.points, changes=Result.changes + 1))

    assert in_nothings(teacher, path, change) < TIMES_AFTER_A_CHANGE


@pytest.fixture(params=BACKENDS)
def small(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Database]:
    with open_database(request.param, tmp_path) as database:
        seed(database, Course(learners=30, questions=2, submissions=1200))
        yield database


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
