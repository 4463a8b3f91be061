"""Keeps the results: what counts for each learner at each question, in the transaction of every verdict."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from sqlalchemy.orm import Session

from grader.courses.people.audit import COMMAND_LINE, Action, record
from grader.courses.people.identity import Identity
from grader.courses.rules.policy import NO_EXTENSION, Attempt, count_points, policy_in_force
from grader.courses.sending import outbox
from grader.domain.policy import LATE_UNTIL, Extension, Policy
from grader.domain.verdict import POINT_DIGITS, Status, Verdict
from grader.errors import Unprocessable
from grader.library import Library
from grader.store import extensions, policies, results, submissions
from grader.store.engine.bulk import TableRows, insert_rows
from grader.store.engine.database import Database
from grader.store.intake import QuestionState, SourceAttempt
from grader.store.outbox import SCORES
from grader.store.results import COUNTED, Columns, LearnerAt
from grader.store.tables import Member, Result, Submission, now


def append_verdict(
    database: Database, library: Library, session: Session, submission: Submission, verdict: Verdict, *, cause: str,
    reviewer: str | None = None
) -> None:  # fmt: skip
    """Adds a verdict as the submission's newest revision, and counts the learner's result again. What a reviewer wrote
    or took back goes to learning platforms, also where the points stay as they were."""
    database.lock_learner(session, submission.course, submission.learner)
    submissions.append_verdict(session, submission, verdict, cause, reviewer)
    session.flush()
    place = LearnerAt.from_submission(submission)
    is_revised = recount(session, library, place, NewSubmission(library, submission, verdict, place))
    if cause in (submissions.REVIEW, submissions.WITHDRAWN) and not is_revised:
        outbox.note(session, [place], kind=SCORES)


@dataclass(frozen=True)
class NewSubmission:
    """A new submission, with its verdict or waiting for one."""

    library: Library
    submission: Submission
    verdict: Verdict | None
    place: LearnerAt
    """The result that it counts for."""


@dataclass
class NewResults:
    """What new submissions come to: results that have `changed`, those of them with a new revision, and the places
    whose policy takes the average of all attempts."""

    changed: dict[LearnerAt, Columns] = field(default_factory=dict)
    revised: list[Columns] = field(default_factory=list)
    averages: dict[LearnerAt, Library] = field(default_factory=dict)


def store_new(
    session: Session, new: Sequence[NewSubmission], states: Mapping[LearnerAt, QuestionState], clock: datetime,
    *more: TableRows,
) -> None:  # fmt: skip
    """Stores new submissions, what counts after them, and `more` rows that refer to them. `states` are those before,
    and are brought up to date. The caller holds the learners' locks."""
    rows = submissions.settle([(submission.submission, submission.verdict) for submission in new], clock)
    counts = count_new(new, states)
    changed = results.build_rows(list(counts.changed.values()), counts.revised, clock)
    insert_rows(session, *rows, *more, *changed, replace=Result)
    places = {LearnerAt(*(after[name] for name in LearnerAt._fields)) for after in counts.revised}
    if delivered := {place for place in places if states[place].has_destinations}:
        outbox.note(session, delivered)
    for place, library in counts.averages.items():
        recount(session, library, place)


def count_new(new: Sequence[NewSubmission], states: Mapping[LearnerAt, QuestionState]) -> NewResults:
    """Counts new submissions in the order of handing in. Unless the policy takes the average, what counted before and a
    new attempt decide together what counts now: the time does not grow with the number of attempts."""
    counts = NewResults()
    for submission in new:
        place, state = submission.place, states[submission.place]
        before = state.result
        if before is not None and find_policy(submission.library, place.quiz, state.changes).counts == "average":
            counts.averages[place] = submission.library
        elif (values := count_one_more(submission, state)) is not None:
            state.result = after = results.change(before, submission.place, values)
            if after is not before:
                counts.changed[place] = after
            if before is None or after["revision"] != before["revision"]:
                counts.revised.append(after)
            if values["submission_id"] == submission.submission.id:
                state.source = make_source(submission.submission, submission.verdict)
    return counts


def count_one_more(new: NewSubmission, state: QuestionState) -> dict[str, Any] | None:
    """The columns of a result after one more submission; None if it changes nothing."""
    before, submission, verdict = state.result, new.submission, new.verdict
    if verdict is None:
        return None if before is None else {name: before[name] for name in COUNTED} | {"is_final": False}
    if not verdict.status.uses_attempt:
        return None
    sources = [state.source, make_source(submission, verdict)]
    attempts = [make_attempt(source) for source in sources if source is not None]
    policy = find_policy(new.library, submission.quiz, state.changes)
    worth = {submission.id: verdict.max_points}
    values = count_attempts(attempts, policy, state.extension or NO_EXTENSION, worth, before)
    if state.source is None:
        values |= describe_first_answer(verdict.status, verdict.evidence)
    return values | {"diagnoses": add_diagnosis("[]" if before is None else before["diagnoses"], verdict.diagnosis)}


def recount(session: Session, library: Library, key: LearnerAt, new: NewSubmission | None = None) -> bool:
    """Counts a result from all attempts; `new` is what has just got a verdict. Returns whether what counts has changed.
    The caller holds the learner's lock."""
    before, rows = results.read_columns(session, key), results.list_attempts(session, key)
    decided = [row for row in rows if row.outcome is not None]
    if before is None and not decided:
        return False
    policy, extension = read_rules(session, library, key)
    worth = {row.id: row.max_points for row in decided}
    values = count_attempts([make_attempt(row) for row in rows], policy, extension, worth, before)
    values |= describe_answers(session, [row.id for row in decided], before, new)
    after = results.change(before, key, values)
    is_revised = before is None or after["revision"] != before["revision"]
    results.save(session, [after] if after is not before else [], [after] if is_revised else [], now())
    if is_revised:
        outbox.note(session, [key])
    return is_revised


def describe_answers(
    session: Session, decided: Sequence[str], before: Columns | None, new: NewSubmission | None
) -> dict[str, Any]:
    """The columns of the first answer and of the diagnoses; `decided` are the ids of the attempts with a verdict. A
    first verdict adds to what was told before. Where it may have changed, the verdicts of all attempts are read."""
    if before is not None and new is not None and new.verdict is not None and new.submission.revision == 1:
        if new.submission.id not in decided:
            return {}
        is_first = decided[0] == new.submission.id
        first = describe_first_answer(new.verdict.status, new.verdict.evidence) if is_first else {}
        return first | {"diagnoses": add_diagnosis(before["diagnoses"], new.verdict.diagnosis)}
    verdicts = submissions.read_verdicts_by_id(session, decided)
    oldest = verdicts[decided[0]] if decided else None
    first = describe_first_answer(Status(oldest["status"]), oldest["evidence"]) if oldest else {}
    return first | {"diagnoses": dump_diagnoses([verdict["diagnosis"] for verdict in verdicts.values()])}


def predict_points(
    session: Session, library: Library, key: LearnerAt, verdicts: Mapping[str, tuple[Status, float]]
) -> float | None:
    """The points that would count if submissions had these statuses and points; None if nothing would count yet."""
    attempts = {row.id: make_attempt(row) for row in results.list_attempts(session, key)}
    for submission in submissions.get_several(session, list(verdicts)):
        status, points = verdicts[submission.id]
        attempts[submission.id] = Attempt(
            submission.id, submission.attempt, submission.created_at, status, points, status.uses_attempt
        )
    now_counted = count_points([attempts[attempt] for attempt in sorted(attempts)], *read_rules(session, library, key))
    return now_counted.points if now_counted.sources or results.find(session, key) else None


def recount_quiz(database: Database, library: Library, course: str, quiz: str) -> int:
    """Counts every result of a quiz again, after its policy has changed, one learner at a time. Returns how many. First
    answers that are taken meanwhile, perhaps still by the policy before, are counted again as well."""
    done = set[LearnerAt]()
    while keys := [key for key in list_results(database, course, quiz) if key not in done]:
        for key in keys:
            with database.write() as session:
                database.lock_learner(session, course, key.learner)
                recount(session, library, key)
        done.update(keys)
    with database.write() as session:
        outbox.release(database, session, course, quiz)
    return len(done)


def list_results(database: Database, course: str, quiz: str) -> Sequence[LearnerAt]:
    """Every learner at a question of a quiz who has a result."""
    with database.read() as session:
        return results.list_keys(session, course, quiz)


def grant(
    database: Database, library: Library, session: Session, learner: Member, quiz: str, *, granted: Extension,
    by: Identity | None
) -> None:  # fmt: skip
    """Gives a learner an extension of a quiz, and counts the learner's results in it again. `by` is None for the
    command line. Raises NotFound if the course has no such quiz, and Unprocessable if late answers would end before it
    is due."""
    library.quiz(quiz)
    if granted.due is not None and granted.until is not None and granted.until < granted.due:
        raise Unprocessable(f"late: {LATE_UNTIL}")
    database.lock_learner(session, learner.course, learner.id)
    extensions.put(session, (learner.course, quiz, learner.id), granted, COMMAND_LINE if by is None else by.user)
    session.flush()
    for learner_at in results.list_keys(session, learner.course, quiz, learner.id):
        recount(session, library, learner_at)
    outbox.release(database, session, learner.course, quiz, learner.id)
    detail = granted.model_dump(mode="json")
    record(session, by, learner.course, Action.EXTENDED, quiz, member=learner.id, name=learner.name, **detail)


def read_rules(session: Session, library: Library, key: LearnerAt) -> tuple[Policy, Extension]:
    """The policy of a quiz that is in force, and the learner's extension of it."""
    policy = find_policy(library, key.quiz, policies.read_of_quiz(session, key.course, key.quiz))
    if policy.due is None:  # an extension moves dates, and attempts do not matter here
        return policy, NO_EXTENSION
    theirs = extensions.list_of_learner(session, key.course, key.learner, [key.quiz])
    return policy, theirs.get(key.quiz, NO_EXTENSION)


def find_policy(library: Library, quiz: str, changes: str | None) -> Policy:
    """The policy of a quiz with the changes of the course; where the quiz is gone, they are all that is left of it."""
    default = library.quizzes[quiz].default_policy if quiz in library.quizzes else Policy()
    return policy_in_force(default, changes)


def make_source(submission: Submission, verdict: Verdict | None) -> SourceAttempt:
    """A new submission as an attempt."""
    points = None if verdict is None else verdict.points
    return SourceAttempt(submission.id, submission.attempt, submission.created_at, submission.outcome, points)


def make_attempt(row: Any) -> Attempt:
    """A stored attempt."""
    status = None if row.outcome is None else Status(row.outcome)
    return Attempt(row.id, row.attempt, row.created_at, status, row.points or 0.0)


def count_attempts(
    attempts: Sequence[Attempt],
    policy: Policy,
    extension: Extension,
    worth: Mapping[str, float],
    before: Columns | None,
) -> dict[str, Any]:
    """What counts, as columns of a result; `worth` are the maximal points by submission where they have changed."""
    total = count_points(attempts, policy, extension)
    source = total.sources[-1] if total.sources else None
    if source is None:
        assert before is not None
        counts: dict[str, Any] = {"submission_id": before["submission_id"], "attempt": None}
    else:
        counts = {"submission_id": source.id, "attempt": source.number}
    return counts | {
        "points": total.points,
        "max_points": find_maximum(total.sources, worth)
        or worth.get(counts["submission_id"])
        or (before["max_points"] if before is not None else 0.0),
        "is_late": total.is_late,
        "is_final": total.is_final,
    }


def find_maximum(sources: Sequence[Attempt], worth: Mapping[str, float]) -> float | None:
    """What an average over attempts is out of, where the question had other points at some of them: the average of
    theirs, as that of the newest could be less than the points. None where they agree."""
    maxima = [worth[source.id] for source in sources if source.id in worth]
    if len(maxima) < len(sources) or len({*maxima}) < 2:
        return None
    return round(math.fsum(maxima) / len(maxima), POINT_DIGITS)


def describe_first_answer(status: Status, evidence: Mapping[str, Any]) -> dict[str, Any]:
    """The columns of the first attempt: its status, and the option or the number that was given, or several of them."""
    option, value = evidence.get("option"), evidence.get("value")
    several = {name: values for name, values in (("option", option), ("value", value)) if isinstance(values, list)}
    return {
        "first_status": status.value,
        "first_option": None if "option" in several else option,
        "first_value": None if "value" in several else value,
        "first_several": json.dumps(several) if several else None,
    }


def add_diagnosis(before: str, diagnosis: str | None) -> str:
    """The JSON list of diagnoses with one more, if there is one."""
    return dump_diagnoses([*json.loads(before), diagnosis]) if diagnosis else before


def dump_diagnoses(diagnoses: Sequence[str | None]) -> str:
    """Diagnoses, each once, as the JSON list that a result keeps."""
    return json.dumps(sorted({diagnosis for diagnosis in diagnoses if diagnosis}))
