"""Keeps the results: what counts for each learner at each question, in the transaction of every verdict."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy.orm import Session

from grader.courses.audit import COMMAND_LINE, Action, record
from grader.courses.policy import NO_EXTENSION, Attempt, counted, due_of
from grader.domain.policy import Extension, Policy
from grader.domain.verdict import Status, Verdict
from grader.errors import NotFound
from grader.identity import Identity
from grader.library import Library
from grader.store import extensions, results, submissions
from grader.store.database import Database
from grader.store.results import LearnerAt
from grader.store.tables import Member, Result, Submission


def append_verdict(
    database: Database,
    library: Library,
    session: Session,
    submission: Submission,
    verdict: Verdict,
    *,
    cause: str,
    reviewer: str | None = None,
) -> None:
    """Adds a verdict as the submission's newest revision, and counts the learner's result again."""
    database.lock_learner(session, submission.course, submission.learner)
    submissions.append_verdict(session, submission, verdict, cause, reviewer)
    session.flush()
    recount(session, library, LearnerAt.of(submission))


def count_new(session: Session, library: Library, submission: Submission, verdict: Verdict | None) -> None:
    """Counts a new submission, with its verdict or waiting for one. The caller holds the learner's lock.

    Unless the policy takes the average, what counted before and a new attempt with a verdict decide together what
    counts now: the time does not grow with the number of attempts.
    """
    key = LearnerAt.of(submission)
    if verdict is None:
        recount(session, library, key)
        return
    if not verdict.status.uses_attempt:
        return
    policy, extension = rules_at(session, library, key)
    before = results.find(session, key)
    if before is not None and policy.counts == "average":
        recount(session, library, key)
        return
    attempts = [Attempt(submission.id, submission.attempt, submission.created_at, verdict.status, verdict.points)]
    source = results.attempt(session, before.submission_id) if before is not None else None
    if source is not None:
        attempts.insert(0, attempt_of(source))
    values = counting(attempts, policy, extension, {submission.id: verdict.max_points}, before)
    if before is None:
        values |= first_answer(verdict.status, verdict.evidence)
    told = [] if before is None else json.loads(before.diagnoses)
    results.put(session, before, key, values | {"diagnoses": listed([*told, verdict.diagnosis])})


def recount(session: Session, library: Library, key: LearnerAt) -> None:
    """Counts a result from all attempts. The caller holds the learner's lock."""
    before, rows = results.find(session, key), results.attempts_of(session, key)
    decided = [row for row in rows if row.outcome is not None]
    if before is None and not decided:
        return
    policy, extension = rules_at(session, library, key)
    worth = {row.id: row.max_points for row in decided}
    values = counting([attempt_of(row) for row in rows], policy, extension, worth, before)
    bodies = [json.loads(row.body) for row in decided]
    if bodies:
        values |= first_answer(Status(decided[0].outcome), bodies[0]["evidence"])
    results.put(session, before, key, values | {"diagnoses": listed([body["diagnosis"] for body in bodies])})


def would_count(
    session: Session, library: Library, key: LearnerAt, verdicts: Mapping[str, tuple[Status, float]]
) -> float | None:
    """The points that would count if submissions had these statuses and points; None if nothing would count yet."""
    attempts = {row.id: attempt_of(row) for row in results.attempts_of(session, key)}
    for one in submissions.several(session, list(verdicts)):
        status, points = verdicts[one.id]
        attempts[one.id] = Attempt(one.id, one.attempt, one.created_at, status, points, status.uses_attempt)
    found = counted([attempts[one] for one in sorted(attempts)], *rules_at(session, library, key))
    return found.points if found.sources or results.find(session, key) else None


def recount_quiz(database: Database, library: Library, course: str, quiz: str) -> int:
    """Counts every result of a quiz again, after its policy has changed, one learner at a time. Returns how many."""
    with database.read() as session:
        keys = results.keys(session, course, quiz)
    for key in keys:
        with database.write() as session:
            database.lock_learner(session, course, key.learner)
            recount(session, library, key)
    return len(keys)


def grant(
    database: Database,
    library: Library,
    session: Session,
    learner: Member,
    quiz: str,
    *,
    granted: Extension,
    by: Identity | None,
) -> None:
    """Gives a learner an extension of a quiz, and counts the learner's results in it again.

    `by` is None for the command line. Raises NotFound if the course has no such quiz.
    """
    library.quiz(quiz)
    database.lock_learner(session, learner.course, learner.id)
    extensions.put(session, (learner.course, quiz, learner.id), granted, COMMAND_LINE if by is None else by.user)
    session.flush()
    for learner_at in results.keys(session, learner.course, quiz, learner.id):
        recount(session, library, learner_at)
    detail = granted.model_dump(mode="json")
    record(session, by, learner.course, Action.EXTENDED, quiz, member=learner.id, name=learner.name, **detail)


def rules_at(session: Session, library: Library, key: LearnerAt) -> tuple[Policy, Extension]:
    """The policy of a quiz, and the learner's extension of it; the default policy where the quiz is gone."""
    try:
        policy = library.quiz(key.quiz).policy
    except NotFound:
        return Policy(), NO_EXTENSION
    if policy.due is None:  # an extension moves dates, and attempts do not matter here
        return policy, NO_EXTENSION
    found = extensions.of_learner(session, key.course, key.learner, [key.quiz])
    return policy, found.get(key.quiz, NO_EXTENSION)


def attempt_of(row: Any) -> Attempt:
    """A stored attempt."""
    status = None if row.outcome is None else Status(row.outcome)
    return Attempt(row.id, row.attempt, row.created_at, status, row.points or 0.0)


def counting(
    attempts: Sequence[Attempt],
    policy: Policy,
    extension: Extension,
    worth: Mapping[str, float],
    before: Result | None,
) -> dict[str, Any]:
    """What counts, as columns of a result; `worth` are the maximal points by submission where they have changed."""
    found = counted(attempts, policy, extension)
    due = due_of(policy, extension)
    source = found.sources[-1] if found.sources else None
    if source is None:
        assert before is not None
        counts: dict[str, Any] = {"submission_id": before.submission_id, "attempt": None}
    else:
        counts = {"submission_id": source.id, "attempt": source.number}
    return counts | {
        "points": found.points,
        "max_points": worth.get(counts["submission_id"]) or (before.max_points if before is not None else 0.0),
        "is_late": due is not None and any(one.at > due for one in found.sources),
        "is_final": found.is_final,
    }


def first_answer(status: Status, evidence: Mapping[str, Any]) -> dict[str, Any]:
    """The columns of the first attempt: its status, and the option or the number that was given."""
    return {
        "first_status": status.value,
        "first_option": evidence.get("option"),
        "first_value": evidence.get("value"),
    }


def listed(diagnoses: Sequence[str | None]) -> str:
    """Diagnoses, each once, as the JSON list that a result keeps."""
    return json.dumps(sorted({one for one in diagnoses if one}))
