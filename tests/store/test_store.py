"""The store on both databases: transactions, migrations, attempts, revisions, pages."""

import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import Any

import psycopg
import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import MetaData, select, text
from sqlalchemy.exc import IntegrityError

from grader.domain.policy import Progress
from grader.domain.verdict import Status, Verdict
from grader.queue.jobs import QueueBase
from grader.store import contents, courses, line_items, outbox, platforms, policies, regrades, submissions, tickets
from grader.store.engine import database as store_database
from grader.store.engine.database import Database
from grader.store.engine.ids import make_id
from grader.store.events import events_after
from grader.store.reviewing import line_comments
from grader.store.submissions import SubmissionFilter
from grader.store.tables import Base, Member, Submission, VerdictRow
from grader.store.upkeep.installation import hidden_case_secret
from support.databases import BACKENDS, database_url, open_database


@pytest.fixture(params=BACKENDS)
def database(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Database]:
    with open_database(request.param, tmp_path) as database:
        yield database


def an_answer(user: str = "ann", question: str = "q1", course: str = "c") -> Submission:
    return Submission(
        id=make_id(),
        course=course,
        learner=user,
        user=user,
        quiz="quiz",
        question=question,
        answer='"5 ms"',
        content_digest="d",
        attempt=1,
    )


def a_verdict(status: Status = Status.CORRECT, points: float = 1.0) -> Verdict:
    return Verdict(status=status, points=points, max_points=1.0, stdout="a\x00b é", content_digest="d")


def keep(database: Database, verdict: Verdict | None, submission: Submission | None = None) -> Submission:
    submission = submission or an_answer()
    with database.write() as session:
        submissions.add(session, [(submission, verdict)])
    return submission


def test_migrations_make_the_tables_that_the_code_describes(database: Database) -> None:
    with database.engine.connect() as connection:
        context = MigrationContext.configure(connection, opts={"compare_type": True, "compare_server_default": True})
        described = MetaData()
        kept = {contents.ContentFile, contents.ContentManifest, contents.ContentInUse, regrades.RegradeItem}
        new = {outbox.Delivery, outbox.Destination, line_items.LineItem, policies.PolicyChange, tickets.Ticket,
               line_comments.LineComment}  # fmt: skip
        assert {courses.CourseLink, courses.AuditEntry, regrades.Regrade, platforms.PlatformRow, *kept, *new} <= {
            mapper.class_ for mapper in Base.registry.mappers
        }
        for table in (*Base.metadata.sorted_tables, *QueueBase.metadata.sorted_tables):
            table.to_metadata(described)
        assert compare_metadata(context, described) == []


def test_migrating_again_and_at_once_changes_nothing(database: Database) -> None:
    keep(database, None)
    others = [Database(database.engine.url.render_as_string(hide_password=False)) for _ in range(3)]
    with ThreadPoolExecutor(3) as pool:
        list(pool.map(Database.migrate, others))
    for other in others:
        other.close()
    with database.read() as session:
        assert len(submissions.page(session, SubmissionFilter("c"), None, 10)) == 1


def test_a_failed_transaction_keeps_nothing(database: Database) -> None:
    with pytest.raises(ZeroDivisionError), database.write() as session:
        submissions.add(session, [(an_answer(), None)])
        raise ZeroDivisionError
    with database.read() as session:
        assert not submissions.page(session, SubmissionFilter("c"), None, 10)


@pytest.mark.parametrize("hasty", [True, False])
@pytest.mark.parametrize("backend", BACKENDS)
def test_only_a_hasty_commit_does_not_wait_for_the_disk(backend: str, tmp_path: Path, hasty: bool) -> None:
    """On one connection in turn: neither kind may leave its setting to the other."""
    asked, waits = (
        ("PRAGMA synchronous", {False: 2, True: 1})
        if backend == "sqlite"
        else ("SHOW synchronous_commit", {False: "on", True: "off"})
    )
    with database_url(backend, tmp_path, durable=True) as url, closing(Database(url)) as database:
        for kind in (not hasty, hasty, hasty):
            with database.write(hasty=kind) as session:
                assert session.scalar(text(asked)) == waits[kind]


def test_postgresql_compiles_no_plans(database: Database) -> None:
    with database.read() as session:
        assert database.is_sqlite or session.scalar(text("SHOW jit")) == "off"


@pytest.mark.postgres
def test_a_pooled_connection_is_asked_only_after_a_pause_or_news(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with database_url("postgresql", tmp_path) as url:
        database = Database(url)
        ping, asked = database.engine.dialect.do_ping, list[Any]()

        def counted(connection: Any) -> bool:
            asked.append(connection)
            return ping(connection)

        def session_id() -> int:
            with database.read() as session:
                return int(session.scalar(text("SELECT pg_backend_pid()")) or 0)

        monkeypatch.setattr(database.engine.dialect, "do_ping", counted)

        first = session_id()
        asked.clear()
        monkeypatch.setattr(store_database, "IDLE_S", 3600.0)
        assert (session_id(), asked) == (first, [])
        monkeypatch.setattr(store_database, "IDLE_S", 0.0)
        assert (session_id(), len(asked)) == (first, 1)
        monkeypatch.setattr(store_database, "IDLE_S", 3600.0)
        with psycopg.connect(url, autocommit=True) as other:
            other.execute("SELECT pg_terminate_backend(%s, 10000)", (first,))
        assert session_id() != first
        database.close()


def test_an_instant_answer_comes_with_its_verdict(database: Database) -> None:
    kept = keep(database, a_verdict())
    with database.read() as session:
        submission = submissions.get(session, kept.id)
        assert submission is not None
        assert (submission.status, submission.revision, submission.version) == ("graded", 1, 1)
        assert submission.created_at.utcoffset() is not None
        assert submissions.read_verdicts(session, [submission])[kept.id]["stdout"] == "a\x00b é"
        assert [event.name for event in events_after(session, kept.id, 0)] == ["graded"]


def test_verdicts_are_added_never_changed(database: Database) -> None:
    kept = keep(database, a_verdict(Status.NEEDS_REVIEW, 0.0))
    with database.write() as session:
        submission = session.get_one(Submission, kept.id)
        assert submission.status == "needs_review"
        submissions.append_verdict(session, submission, a_verdict(), "review")
    with database.read() as session:
        rows = session.scalars(select(VerdictRow).order_by(VerdictRow.revision)).all()
        assert [(row.revision, row.cause, row.status) for row in rows] == [
            (1, "grading", "needs_review"),
            (2, "review", "correct"),
        ]
        submission = session.get_one(Submission, kept.id)
        assert submission.version == 2
        assert submissions.read_verdicts(session, [submission])[kept.id]["status"] == "correct"


def test_a_revision_cannot_be_given_twice(database: Database) -> None:
    kept = keep(database, a_verdict())
    with pytest.raises(IntegrityError), database.write() as session:
        submission = session.get_one(Submission, kept.id)
        submission.revision = 0
        submissions.append_verdict(session, submission, a_verdict(), "grading")


def test_attempts_count_what_is_queued_but_not_what_could_not_be_read_or_graded(database: Database) -> None:
    for verdict in (None, a_verdict(Status.INVALID_ANSWER), a_verdict(Status.GRADER_FAULT), a_verdict(Status.CRASHED)):
        keep(database, verdict)
    keep(database, a_verdict(), an_answer(user="bob"))
    keep(database, a_verdict(), an_answer(course="other"))
    keep(database, a_verdict(), an_answer(question="q2"))
    with database.read() as session:
        expected = {("quiz", "q1"): Progress(2, 1, solved=False), ("quiz", "q2"): Progress(1, 0, solved=True)}
        assert submissions.compute_progress(session, "c", "ann") == expected
        assert submissions.compute_progress_at(session, "c", "ann", "quiz", "q1") == expected["quiz", "q1"]
        assert submissions.count_pending(session, SubmissionFilter("c", learner="ann")) == 1


def test_pages_go_back_in_time_without_gaps(database: Database) -> None:
    kept = sorted((keep(database, None).id for _ in range(7)), reverse=True)
    seen: list[str] = []
    with database.read() as session:
        while rows := submissions.page(session, SubmissionFilter("c", learner="ann"), seen[-1] if seen else None, 3):
            seen.extend(row.id for row in rows)
    assert seen == kept


def test_answers_are_found_by_the_name_that_their_member_has_now(database: Database) -> None:
    kept = keep(database, None)
    with database.write() as session:
        session.add(Member(id="ann", course="c", name="bea", role="student"))
        session.add(Member(id="other", course="other", name="bea", role="student"))
    with database.read() as session:
        for name, ids in (("bea", [kept.id]), ("ann", []), ("none", [])):
            wanted = SubmissionFilter("c", name)
            assert [row.id for row in submissions.page(session, wanted, None, 3)] == ids
            assert submissions.count_pending(session, wanted) == len(ids)


def test_named_locks_make_writers_wait_for_each_other(database: Database) -> None:
    """Read, then write: without the lock two of them would see the same count."""
    barrier = threading.Barrier(4)

    def one_more(_: int) -> int:
        barrier.wait()
        with database.write() as session:
            database.lock(session, "ann")
            used = submissions.compute_progress_at(session, "c", "ann", "quiz", "q1").used
            submission = an_answer()
            submission.attempt = used + 1
            submissions.add(session, [(submission, None)])
            return submission.attempt

    with ThreadPoolExecutor(4) as pool:
        assert sorted(pool.map(one_more, range(4))) == [1, 2, 3, 4]


def test_a_database_has_one_secret_even_for_processes_that_start_together(database: Database) -> None:
    url = database.engine.url.render_as_string(hide_password=False)
    others = [Database(url) for _ in range(4)]
    with ThreadPoolExecutor(4) as pool:
        hidden_secrets = set(pool.map(hidden_case_secret, others))
    for other in others:
        other.close()
    assert len(hidden_secrets) == 1
    assert len(hidden_secrets.pop()) == 32


def test_ids_sort_by_time_and_differ() -> None:
    ids = [make_id() for _ in range(1000)]
    assert len(set(ids)) == 1000
    assert all(len(each) == 32 for each in ids)
    assert ids == sorted(ids)
