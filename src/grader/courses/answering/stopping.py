"""Stopping one's own script while it waits: it leaves the queue, and uses no attempt.

A script that has begun is graded to its end: it has seen cases, so to stop it for free would be a look for free.
"""

from contextlib import suppress

from sqlalchemy.orm import Session

from grader.courses.answering import results
from grader.courses.people.identity import Identity
from grader.domain.verdict import Status, Verdict
from grader.errors import Conflict, NotFound
from grader.library import Library
from grader.queue import jobs
from grader.store import intake, submissions
from grader.store.engine.database import Database
from grader.store.submissions import STOP
from grader.store.tables import Submission

STOPPED = "You stopped this script before it ran. No attempt was used."
TOO_LATE = "This script does not wait any more: once it runs, it is graded."


def stop(database: Database, library: Library, session: Session, who: Identity, submission_id: str) -> Submission:
    """Takes a waiting script of a learner out of the queue. Raises NotFound, and Conflict where it does not wait."""
    submission = submissions.get(session, submission_id) if submission_id.isalnum() else None
    if submission is None or (submission.course, submission.learner) != (who.course, who.id):
        raise NotFound("There is no such submission.")
    if not jobs.withdraw(session, jobs.GRADE, submission.id):
        raise Conflict(TOO_LATE)
    results.append_verdict(database, library, session, submission, verdict_on(library, submission), cause=STOP)
    intake.forget_key(session, submission.id)
    return submission


def verdict_on(library: Library, submission: Submission) -> Verdict:
    """The verdict on a stopped script: like an answer that cannot be read, it touches nothing."""
    worth = 0.0
    with suppress(NotFound):  # the content has lost the question
        worth = library.question(submission.quiz, submission.question).points
    return Verdict(
        status=Status.INVALID_ANSWER,
        points=0.0,
        max_points=worth,
        diagnosis=STOPPED,
        content_digest=submission.content_digest,
    )
