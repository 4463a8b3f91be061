"""A learner's work as pages show it: read once for a page, and redacted by the policy."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy.orm import Session

from grader.courses.standing import Standing, progress_at, shown_verdict, standing_of
from grader.domain.policy import Policy
from grader.domain.quiz import QuestionPart, Quiz
from grader.domain.verdict import Status
from grader.identity import Identity
from grader.library import Library
from grader.store import results, submissions
from grader.store.submissions import SubmissionFilter
from grader.store.tables import Result, Submission
from grader.web.words import NOT_ANSWERED, QUEUED, RUNNING, Told, told_of

ATTEMPTS_MAX = 12
"""Attempts that a page lists, the newest ones."""


@dataclass(frozen=True)
class Given:
    """One answer of a learner with as much of its verdict as they may see."""

    id: str
    attempt: int
    at: datetime
    answer: Any
    state: str
    verdict: dict[str, Any] | None
    withheld: str | None

    @property
    def told(self) -> Told:
        """Its state in words."""
        if self.verdict is None:
            return RUNNING if self.state == submissions.RUNNING else QUEUED
        return told_of(self.verdict["status"], withheld=self.withheld is not None)

    @property
    def is_decided(self) -> bool:
        """Whether points can be shown."""
        return self.verdict is not None and self.verdict["status"] != Status.NEEDS_REVIEW

    @property
    def text(self) -> str:
        """The answer as it was typed: a script's source, a text, or an option's index."""
        answer = self.answer
        return str(answer.get("source", "")) if isinstance(answer, dict) else "" if answer is None else str(answer)


@dataclass(frozen=True)
class Place:
    """Where a learner stands at one question."""

    given: Given | None
    points: float | None
    of: float
    notice: str
    may_answer: bool
    lab_is_open: bool
    due: datetime | None

    @property
    def told(self) -> Told:
        """The state of the question in words."""
        return NOT_ANSWERED if self.given is None else self.given.told


@dataclass(frozen=True)
class Work:
    """A learner's work: places by (quiz, question)."""

    standing: Standing
    places: Mapping[tuple[str, str], Place]

    def points(self, quiz: Quiz) -> tuple[float, float]:
        """The points so far, and how many there are."""
        places = [self.places[quiz.id, question.id] for question in quiz.questions]
        return sum(place.points or 0.0 for place in places), sum(place.of for place in places)


def work_of(session: Session, library: Library, who: Identity, quizzes: Sequence[Quiz]) -> Work:
    """The newest answer and the result at every question of some quizzes."""
    standing = standing_of(session, library, who)
    named = {quiz.id for quiz in quizzes}
    rows = [row for row in submissions.newest(session, who.course, who.id) if row.quiz in named]
    verdicts = submissions.verdicts(session, rows)
    newest = {(row.quiz, row.question): given_of(standing, row, verdicts.get(row.id)) for row in rows}
    found = results.everywhere(session, who.course, who.id)
    places = {}
    for quiz in quizzes:
        for question in quiz.questions:
            at = (quiz.id, question.id)
            places[at] = place_of(standing, quiz, question, newest.get(at), found.get(at))
    return Work(standing, places)


def place_of(
    standing: Standing, quiz: Quiz, question: QuestionPart, given: Given | None, result: Result | None
) -> Place:
    """Where a learner stands at one question, by the policy."""
    progress = progress_at(standing, quiz, question, result)
    decision = standing.decision(quiz.id, question.id)
    counts = progress["result"]
    return Place(
        given,
        None if counts is None else counts["points"],
        question.points,
        progress["notice"],
        decision.may_answer,
        given is not None and decision.why_no_lab is None,
        decision.due,
    )


def attempts_of(session: Session, standing: Standing, who: Identity, quiz: str, question: str) -> list[Given]:
    """A learner's answers to one question, newest first; unreadable ones are left out."""
    wanted = SubmissionFilter(who.course, quiz=quiz, question=question, learner=who.id)
    rows = submissions.page(session, wanted, None, ATTEMPTS_MAX)
    verdicts = submissions.verdicts(session, rows)
    found = [given_of(standing, row, verdicts.get(row.id)) for row in rows]
    return [one for one in found if one.verdict is None or one.verdict["status"] != Status.INVALID_ANSWER]


def given_of(standing: Standing, row: Submission, verdict: Any | None) -> Given:
    """A stored answer as the learner may see it now."""
    decision = standing.decision(row.quiz, row.question)
    settled = verdict if row.status in submissions.AT_REST else None
    answer = json.loads(row.answer) if row.answer else None
    shown = shown_verdict(settled, decision)
    return Given(row.id, row.attempt, row.created_at, answer, row.status, shown, decision.withheld)


def given_in_full(row: Submission, verdict: Any | None) -> Given:
    """A stored answer as an instructor sees it, with the verdict as reviewers may see it."""
    answer = json.loads(row.answer) if row.answer else None
    settled = verdict if row.status in submissions.AT_REST else None
    return Given(row.id, row.attempt, row.created_at, answer, row.status, settled, None)


def counting(policy: Policy) -> str:
    """Which attempts count, in two words."""
    return {"best": "best attempt", "latest": "latest attempt", "average": "average"}[policy.counts]
