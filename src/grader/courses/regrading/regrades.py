"""Regrades: which submissions, who started and cancelled them, and the difference that they make for each learner."""

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import groupby, takewhile
from typing import Any, Literal

from sqlalchemy.orm import Session

from grader.courses.answering.results import make_attempt
from grader.courses.people.audit import Action, record
from grader.courses.people.identity import Identity
from grader.courses.rules.policy import NO_EXTENSION, count_points, policy_in_force
from grader.domain.policy import Extension, Policy
from grader.domain.verdict import Status
from grader.errors import Conflict, NotFound
from grader.library import Library
from grader.questions import Quiz
from grader.queue import jobs
from grader.store import extensions, policies, regrades
from grader.store.engine.database import Database
from grader.store.engine.ids import make_id
from grader.store.regrades import CANCELLED, DONE, LANES, QUEUED, UNFINISHED, WAITING, Regrade, RegradeItem
from grader.store.tables import now

UNFINISHED_MAX = 10
"""Regrades of one course that may be queued or running."""

IDS_MAX = 1000
"""Submissions that one regrade may name one by one."""

Scope = Literal["latest", "best", "all"]
SCOPES: tuple[Scope, ...] = ("latest", "best", "all")


@dataclass(frozen=True)
class RegradeRequest:
    """Which submissions to regrade: of a question or of all questions of a quiz. `scope` takes each learner's latest
    attempt at a question, the best one, or everything that was handed in; or else these submissions. What ended as a
    fault of ours uses no attempt: the first two take the newest of these that no attempt has followed."""

    quiz: str
    question: str | None
    scope: Scope | tuple[str, ...]
    dry_run: bool


def create(database: Database, library: Library, who: Identity, wanted: RegradeRequest) -> Regrade:
    """Queues a regrade by the content as it is now. Raises NotFound, and Conflict while it has to wait for another."""
    quiz = library.quiz(wanted.quiz)
    if wanted.question is not None:
        library.question(quiz.id, wanted.question)
    questions = [question.id for question in quiz.questions if wanted.question in (None, question.id)]
    with database.read() as session:
        chosen = choose(session, who.course, quiz, questions, wanted.scope)
    regrade = Regrade(
        id=make_id(), course=who.course, quiz=quiz.id, question=wanted.question,
        scope=json.dumps(wanted.scope if isinstance(wanted.scope, str) else {"submission_ids": wanted.scope}),
        dry_run=wanted.dry_run, content_digest=library.digest(quiz.id), status=QUEUED if chosen else DONE,
        created_by=who.user, finished_at=None if chosen else now(),
    )  # fmt: skip
    with database.write() as session:
        database.lock(session, f"regrades\n{who.course}")
        refuse_more(session, regrade)
        regrades.add(session, regrade, chosen)
        for lane in sorted({item["place"] % LANES for item in chosen}):
            jobs.put(session, jobs.REGRADE, f"{regrade.id}:{lane}", share=regrade.id)
        details: dict[str, Any] = {"quiz": quiz.id, "question": wanted.question, "dry_run": wanted.dry_run}
        record(session, who, who.course, Action.REGRADED, regrade.id, **details, submissions=len(chosen))
    return regrade


def restore_wanted(tried: Regrade) -> RegradeRequest:
    """Says what a dry run has tried, to be applied."""
    scope: Any = json.loads(tried.scope)
    chosen = tuple(scope["submission_ids"]) if isinstance(scope, dict) else scope
    return RegradeRequest(tried.quiz, tried.question, chosen, dry_run=False)


def refuse_more(session: Session, regrade: Regrade) -> None:
    """Raises Conflict while the course has too many unfinished regrades, or one that changes the same quiz."""
    running = regrades.list_unfinished(session, regrade.course)
    if len(running) >= UNFINISHED_MAX:
        raise Conflict(f"{UNFINISHED_MAX} regrades are in progress: wait for one, or cancel one.")
    if any(not (other.dry_run or regrade.dry_run) and other.quiz == regrade.quiz for other in running):
        raise Conflict(f"A regrade of {regrade.quiz!r} is in progress: wait for it, or cancel it.")


def cancel(session: Session, who: Identity, regrade_id: str) -> Regrade:
    """Ends a regrade; the verdicts that it has appended stay. Raises NotFound, and Conflict if it is over."""
    get(session, regrade_id, who.course)
    regrade = regrades.lock(session, regrade_id)
    if regrade.status in UNFINISHED:
        regrades.finish(session, regrade, CANCELLED)
        record(session, who, who.course, Action.REGRADE_CANCELLED, regrade.id)
    elif regrade.status != CANCELLED:
        raise Conflict(f"This regrade is over: {regrade.status}.")
    return regrade


def get(session: Session, regrade_id: str, course: str) -> Regrade:
    """Returns the regrade. Raises NotFound."""
    regrade = regrades.find(session, regrade_id, course) if regrade_id.isalnum() else None
    if regrade is None:
        raise NotFound("There is no such regrade.")
    return regrade


def choose(
    session: Session, course: str, quiz: Quiz, questions: list[str], scope: Scope | tuple[str, ...]
) -> list[dict[str, Any]]:
    """Returns the submissions of a scope as columns of items. Raises NotFound if one that is named is not there."""
    rows = regrades.list_candidates(session, course, quiz.id, questions, None if isinstance(scope, str) else scope)
    extended = {
        row.learner: extensions.read_extension(row) for row, _ in extensions.list_of_quiz(session, course, quiz.id)
    }
    by_learner = [list(theirs) for _, theirs in groupby(rows, key=lambda row: (row.learner, row.question))]
    policy = policy_in_force(quiz.default_policy, policies.read_of_quiz(session, course, quiz.id))
    chosen = [select_rows(theirs, scope, policy, extended.get(theirs[0].learner)) for theirs in by_learner]
    items = [
        {"place": place, "submission_id": row.id, "learner": row.learner, "question": row.question}
        for place, theirs in enumerate(filter(None, chosen), 1)
        for row in theirs
    ]
    if not isinstance(scope, str) and (missing := {*scope} - {item["submission_id"] for item in items}):
        raise NotFound(f"There is no such submission here: {min(missing)}.")
    return [item | {"number": number} for number, item in enumerate(items, 1)]


def select_rows(
    rows: list[Any], scope: Scope | tuple[str, ...], policy: Policy, extension: Extension | None
) -> list[Any]:
    """Says which of a learner's submissions at a question are in the scope; the best one with late multipliers. What we
    failed to grade is in every scope where no attempt has followed: it may become the latest one, or the best."""
    if scope not in ("latest", "best"):
        return rows
    used = [row for row in rows if row.uses_attempt]
    newer = takewhile(lambda row: not row.uses_attempt, reversed(rows))
    failed = [row for row in newer if row.outcome == Status.GRADER_FAULT][:1]
    if scope == "latest":
        return used[-1:] + failed
    best = policy.model_copy(update={"counts": "best"})
    sources = count_points([make_attempt(row) for row in used], best, extension or NO_EXTENSION).sources
    return [row for row in used if row.id in {source.id for source in sources}] + failed


def describe_regrade(regrade: Regrade, counts: Mapping[str, int]) -> dict[str, Any]:
    """Returns a regrade as plain JSON; `counts` are its items by outcome."""
    names = (
        "id", "quiz", "question", "dry_run", "status", "reason", "content_digest", "created_by", "created_at",
        "finished_at",
    )  # fmt: skip
    total = sum(counts.values())
    done = {outcome: count for outcome, count in sorted(counts.items()) if outcome != WAITING}
    return {name: getattr(regrade, name) for name in names} | {
        "scope": json.loads(regrade.scope),
        "progress": {"total": total, "done": sum(done.values()), "outcomes": done},
    }


def compare_points(
    rows: Iterable[tuple[RegradeItem, str | None]], *, is_over: bool = False
) -> Iterator[dict[str, Any]]:
    """Says what the regrade comes to for each learner at a question, as plain JSON; `rows` in the order of their
    numbers. `before` and `after` are the points that count, by the policy and the learner's extension; None where
    nothing does, or where it is not known yet. One that `is_over` came to what its last submission left."""
    for place, several in groupby(rows, key=lambda row: row[0].place):
        theirs = list(several)
        items = [item for item, _ in theirs]
        done = [item for item in items if item.outcome != WAITING]
        is_done = len(done) == len(items) or (is_over and bool(done))
        before, after = items[0].counted_before, done[-1].counted_after if is_done else None
        yield {
            "place": place,
            "learner": items[0].learner,
            "user": theirs[0][1],
            "question": items[0].question,
            "before": before,
            "after": after,
            "difference": (after or 0.0) - (before or 0.0) if is_done else None,
            "submissions": [
                {
                    "submission_id": item.submission_id,
                    "outcome": item.outcome,
                    "old": view_points(item.old_status, item.old_points),
                    "new": view_points(item.new_status, item.new_points),
                }
                for item in items
            ],
        }


def view_points(status: str | None, points: float | None) -> dict[str, Any] | None:
    """Returns a verdict in short."""
    return None if status is None else {"status": status, "points": points}


def read_page(session: Session, regrade: Regrade, after: int, limit: int, *, changed: bool) -> list[dict[str, Any]]:
    """The differences of at most `limit` learners after a place; with `changed` those alone whose verdicts differ."""
    rows = regrades.list_learners(session, regrade.id, after, limit, "changed" if changed else None)
    return list(compare_points(rows, is_over=regrade.status not in UNFINISHED))
