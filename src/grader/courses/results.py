"""Keeps the results: what counts for each learner at each question, in the transaction of every verdict."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from sqlalchemy.orm import Session

from grader.courses import outbox
from grader.courses.audit import COMMAND_LINE, Action, record
from grader.courses.policy import NO_EXTENSION, Attempt, counted, due_of
from grader.domain.policy import Extension, Policy
from grader.domain.verdict import Status, Verdict
from grader.identity import Identity
from grader.library import Library
from grader.store import answers, extensions, results, submissions
from grader.store.answers import Found, Source
from grader.store.database import Database
from grader.store.results import COUNTED, LearnerAt
from grader.store.rows import insert_waiting
from grader.store.tables import Member, Result, Submission, plain


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
    recount(session, library, LearnerAt.of(submission), New(library, submission, verdict))


@dataclass(frozen=True)
class New:
    """A new submission, with its verdict or waiting for one."""

    library: Library
    submission: Submission
    verdict: Verdict | None

    @cached_property
    def key(self) -> LearnerAt:
        """The result that it counts for."""
        return LearnerAt.of(self.submission)


def count_new(session: Session, new: Sequence[New], found: Mapping[LearnerAt, Found]) -> None:
    """Counts new submissions in the order of handing in; `found` is what was stored before, and is brought up to date.

    The caller holds the learners' locks. Unless the policy takes the average, what counted before and a new attempt
    decide together what counts now: the time does not grow with the number of attempts.
    """
    changed: dict[LearnerAt, Result] = {}
    averages, told = dict[LearnerAt, Library](), list[dict[str, Any]]()
    for one in new:
        here = found[one.key]
        if here.result is not None and policy_of(one.library, one.key.quiz).counts == "average":
            averages[one.key] = one.library
        elif (values := with_new(one, here)) is not None:
            columns, rows = results.change(here.result, one.key, values)
            if columns:
                here.result = here.result or plain(Result, {})
                vars(here.result).update(columns)
                changed[one.key] = here.result
            told += rows
            if values["submission_id"] == one.submission.id:
                here.source = source_of(one.submission, one.verdict)
    answers.put_results(session, list(changed.values()), told)
    keys = {LearnerAt(*(row[name] for name in LearnerAt._fields)) for row in told}
    outbox.note(session, {key for key in keys if found[key].has_destinations})
    if averages:
        insert_waiting(session)
    for key, library in averages.items():
        recount(session, library, key)


def with_new(new: New, found: Found) -> dict[str, Any] | None:
    """The columns of a result after one more submission; None if it changes nothing."""
    before, submission, verdict = found.result, new.submission, new.verdict
    if verdict is None:
        return None if before is None else {name: getattr(before, name) for name in COUNTED} | {"is_final": False}
    if not verdict.status.uses_attempt:
        return None
    sources = [found.source, source_of(submission, verdict)]
    attempts = [attempt_of(source) for source in sources if source is not None]
    policy = policy_of(new.library, submission.quiz)
    values = counting(attempts, policy, found.extension or NO_EXTENSION, {submission.id: verdict.max_points}, before)
    if found.source is None:
        values |= first_answer(verdict.status, verdict.evidence)
    told = [] if before is None else json.loads(before.diagnoses)
    return values | {"diagnoses": listed([*told, verdict.diagnosis])}


def recount(session: Session, library: Library, key: LearnerAt, new: New | None = None) -> None:
    """Counts a result from all attempts; `new` is what has just got a verdict. The caller holds the learner's lock."""
    before, rows = results.find(session, key), results.attempts_of(session, key)
    decided = [row for row in rows if row.outcome is not None]
    if before is None and not decided:
        return
    policy, extension = rules_at(session, library, key)
    worth = {row.id: row.max_points for row in decided}
    values = counting([attempt_of(row) for row in rows], policy, extension, worth, before)
    values |= told_by(session, [row.id for row in decided], before, new)
    if results.put(session, before, key, values):
        outbox.note(session, [key])


def told_by(session: Session, decided: Sequence[str], before: Result | None, new: New | None) -> dict[str, Any]:
    """The columns of the first answer and of the diagnoses; `decided` are the ids of the attempts with a verdict.

    A first verdict adds to what was told before. Where it may have changed, the verdicts of all attempts are read.
    """
    if before is not None and new is not None and new.verdict is not None and new.submission.revision == 1:
        if new.submission.id not in decided:
            return {}
        first = first_answer(new.verdict.status, new.verdict.evidence) if decided[0] == new.submission.id else {}
        return first | {"diagnoses": listed([*json.loads(before.diagnoses), new.verdict.diagnosis])}
    verdicts = submissions.verdicts_of(session, decided)
    oldest = verdicts[decided[0]] if decided else None
    first = first_answer(Status(oldest["status"]), oldest["evidence"]) if oldest else {}
    return first | {"diagnoses": listed([verdict["diagnosis"] for verdict in verdicts.values()])}


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
    with database.write() as session:
        outbox.release(database, session, course, quiz)
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
    outbox.release(database, session, learner.course, quiz, learner.id)
    detail = granted.model_dump(mode="json")
    record(session, by, learner.course, Action.EXTENDED, quiz, member=learner.id, name=learner.name, **detail)


def rules_at(session: Session, library: Library, key: LearnerAt) -> tuple[Policy, Extension]:
    """The policy of a quiz, and the learner's extension of it."""
    policy = policy_of(library, key.quiz)
    if policy.due is None:  # an extension moves dates, and attempts do not matter here
        return policy, NO_EXTENSION
    found = extensions.of_learner(session, key.course, key.learner, [key.quiz])
    return policy, found.get(key.quiz, NO_EXTENSION)


def policy_of(library: Library, quiz: str) -> Policy:
    """The policy of a quiz; the default policy where the quiz is gone."""
    return library.quizzes[quiz].policy if quiz in library.quizzes else Policy()


def source_of(submission: Submission, verdict: Verdict | None) -> Source:
    """A new submission as an attempt."""
    points = None if verdict is None else verdict.points
    return Source(submission.id, submission.attempt, submission.created_at, submission.outcome, points)


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
