"""A learner's work as pages show it: read once for a page, and redacted by the policy."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any, NamedTuple

from sqlalchemy.orm import Session

from grader.courses.answering.access import LearnerAccess, describe_progress_at, read_access
from grader.courses.answering.stopping import STOPPED, STOPPED_RUNNING
from grader.courses.people.identity import Identity
from grader.courses.rules.policy import (
    NO_EXTENSION,
    Visibility,
    format_moment,
    late_multiplier,
    redact_json,
)
from grader.courses.rules.progress import ComparedAttempt, describe_progress
from grader.domain.policy import Policy
from grader.domain.verdict import POINT_DIGITS, Status
from grader.library import Library
from grader.questions import Question, Quiz, describe_file
from grader.store import results, submissions
from grader.store.reviewing import line_comments
from grader.store.reviewing.line_comments import CommentedAttempt
from grader.store.submissions import AttemptMark, SubmissionFilter, VerdictMark
from grader.store.tables import Result, Submission
from grader.web.text.numbers import write_points
from grader.web.text.statuses import HALTED, NOT_ANSWERED, QUEUED, RUNNING, STATUSES, Badge, describe_status

ReadAnswer = Callable[[Submission], Any]
"""Returns a stored answer as it is shown beside its question now."""

ATTEMPTS_MAX = 12
"""Attempts that a page reads with answers and whole verdicts, the newest ones; of older ones it reads a line."""

AGAIN = {
    "regrade": "Graded again on {when}, after a change of the question or its key",
    "review": "Graded again by an instructor on {when}",
    "withdrawn": "An instructor took a mark back on {when}",
    "rubric": "Graded again on {when}, after a change of the rubric",
}
"""What is said of a verdict that replaced another, by its cause."""


class Comment(NamedTuple):
    """What an instructor wrote to a line of the script; `line` is None for all of it."""

    id: str
    line: int | None
    text: str
    name: str
    at: datetime


@dataclass(frozen=True)
class GivenAnswer:
    """One answer of a learner with as much of its verdict as they may see."""

    id: str
    attempt: int
    at: datetime
    answer: Any
    state: str
    verdict: dict[str, Any] | None
    withheld: str | None
    again: str = ""
    """Says when and why it was graded again, and what changed; empty if it was not, or must not be told."""
    progress: str = ""
    """How it compares with earlier attempts; empty where there is nothing to say."""
    comments: Sequence[Comment] = ()
    """Comments on lines of the script, in the order of the lines."""
    multiplier: float = 1.0
    """What its points are multiplied by, below 1 after the due date."""
    is_whole: bool = True
    """Whether `answer` and `verdict` were read; of others the verdict has status and points alone."""

    @property
    def counted(self) -> float:
        """What its points count as."""
        points = 0.0 if self.verdict is None else float(self.verdict.get("points") or 0.0)
        return round(points * self.multiplier, POINT_DIGITS)

    @property
    def badge(self) -> Badge:
        """Its state in words."""
        if self.verdict is None:
            return RUNNING if self.state == submissions.RUNNING else QUEUED
        if self.verdict.get("diagnosis") in (STOPPED, STOPPED_RUNNING):
            return HALTED
        return describe_status(self.verdict["status"], withheld=self.withheld is not None)

    @property
    def is_decided(self) -> bool:
        """Whether points can be shown."""
        return self.verdict is not None and self.verdict["status"] != Status.NEEDS_REVIEW

    @property
    def is_script(self) -> bool:
        """Whether the answer is a script."""
        return isinstance(self.answer, dict) and "source" in self.answer

    @property
    def file(self) -> str:
        """The size and digest of a file that was handed in; empty for other answers."""
        is_file = isinstance(self.answer, dict) and "file" in self.answer
        return describe_file(str(self.answer["file"])) if is_file else ""

    @property
    def comment_count(self) -> str:
        """How many comments there are, in words; empty where there are none."""
        count = len(self.comments)
        return f"{count} comment{'' if count == 1 else 's'}" if count else ""

    @property
    def commented(self) -> list[tuple[Comment, str]]:
        """Each comment with the text of its line."""
        lines = ["", *self.text.splitlines()]
        return [
            (comment, lines[comment.line] if comment.line and comment.line < len(lines) else "")
            for comment in self.comments
        ]

    @property
    def text(self) -> str:
        """The answer as it was typed: a script's source, a text, or an option's index."""
        answer = self.answer
        return str(answer.get("source", "")) if isinstance(answer, dict) else "" if answer is None else str(answer)


@dataclass(frozen=True)
class QuestionPlace:
    """What a learner has reached at one question."""

    given: GivenAnswer | None
    points: float | None
    of: float
    """What the points that count are out of, also where the question has other points by now; else its points now."""
    notice: str
    dates: str
    may_answer: bool
    lab_is_open: bool
    due: datetime | None
    attempts_left: int | None
    is_final: bool = True
    """Whether neither a verdict nor a person can still change what counts."""
    commented: Sequence[CommentedAttempt] = ()
    """The attempts before the newest that instructors commented on, the newest first."""

    @property
    def badge(self) -> Badge:
        """The state of the newest answer in words."""
        return NOT_ANSWERED if self.given is None else self.given.badge

    @property
    def needs_review(self) -> bool:
        """Whether a person has to decide: no points yet are no lost points."""
        return self.badge is STATUSES[Status.NEEDS_REVIEW]

    @property
    def earlier_waits(self) -> bool:
        """Whether the newest answer is decided, and an earlier one is not."""
        return not self.is_final and self.given is not None and self.given.is_decided

    @property
    def earlier_counts(self) -> bool:
        """Whether an earlier answer has more points than the newest."""
        if self.points is None or self.given is None or self.given.verdict is None or not self.given.is_decided:
            return False
        return self.points > self.given.counted

    @property
    def counting_badge(self) -> Badge:
        """The state of what counts in words."""
        if not self.earlier_counts:
            return self.badge
        return STATUSES[Status.CORRECT if self.points == self.of else Status.PARTIAL]


@dataclass(frozen=True)
class Work:
    """A learner's work: places by (quiz, question)."""

    access: LearnerAccess
    places: Mapping[tuple[str, str], QuestionPlace]
    read: ReadAnswer

    def points(self, quiz: Quiz) -> tuple[float, float]:
        """Returns the points so far, and how many there are."""
        places = [self.places[quiz.id, question.id] for question in quiz.questions]
        return sum(place.points or 0.0 for place in places), sum(place.of for place in places)


def read_work(session: Session, library: Library, who: Identity, quizzes: Sequence[Quiz], read: ReadAnswer) -> Work:
    """Returns the newest answer and the result at every question of some quizzes."""
    access = read_access(session, library, who)
    named = {quiz.id for quiz in quizzes}
    rows = [row for row in submissions.find_newest(session, who.course, who.id) if row.quiz in named]
    given = read_answers(session, access, rows, read)
    newest = {(row.quiz, row.question): tell_earlier_regrades(session, row, each)
              for row, each in zip(rows, given, strict=True)}  # fmt: skip
    own_results = results.find_everywhere(session, who.course, who.id)
    places = {}
    for quiz in quizzes:
        for question in quiz.questions:
            at = (quiz.id, question.id)
            places[at] = describe_place(access, quiz, question, newest.get(at), own_results.get(at))
    for comment in line_comments.list_of_learner(session, who.course, who.id):
        at = (comment.quiz, comment.question)
        latest = newest.get(at)
        if at in places and latest is not None and latest.withheld is None and latest.id != comment.submission:
            places[at] = replace(places[at], commented=(*places[at].commented, comment))
    return Work(access, places, read)


def tell_earlier_regrades(session: Session, row: Submission, given: GivenAnswer) -> GivenAnswer:
    """Adds to what is said of a newest answer that was graded again how the points of earlier ones have changed, which
    may be those that count."""
    if not given.again or row.attempt == 1:
        return given
    wanted = SubmissionFilter(row.course, quiz=row.quiz, question=row.question, learner=row.learner)
    earlier = [other for other in submissions.page(session, wanted, None, ATTEMPTS_MAX) if other.attempt < row.attempt]
    marks = submissions.last_marks(session, earlier)
    changes = [
        f" Attempt {other.attempt}: {describe_change(*marks[other.id])}."
        for other in reversed(earlier)
        if other.id in marks and describe_regrade(*marks[other.id]) and has_other_points(*marks[other.id])
    ]
    return replace(given, again=given.again + "".join(changes))


def describe_place(
    access: LearnerAccess, quiz: Quiz, question: Question, given: GivenAnswer | None, result: Result | None
) -> QuestionPlace:
    """Describes what a learner has reached at one question, by the policy."""
    progress = describe_progress_at(access, quiz, question, result)
    decision = access.decide(quiz.id, question.id)
    counts = progress["result"]
    return QuestionPlace(
        given, None if counts is None else counts["points"], find_maximum(question, counts),
        access.describe_attempts(quiz, question), access.describe_dates(quiz, question), decision.may_answer,
        given is not None and decision.why_no_lab is None, decision.due, progress["attempts_left"],
        counts is None or counts["is_final"],
    )  # fmt: skip


def find_maximum(question: Question, counts: Mapping[str, Any] | None) -> float:
    """Returns what the points that count are out of: until a regrade, what the question had when they were given. An
    answer without a mark gets one out of the question's points now."""
    if counts is not None and (counts["is_final"] or counts["points"]):
        return float(counts["max_points"])
    return question.points


def list_attempts(
    session: Session, work: Work, who: Identity, quiz: str, question: str, *, most: int = ATTEMPTS_MAX,
    also: Sequence[str | None] = (),
) -> list[GivenAnswer]:  # fmt: skip
    """Returns all of a learner's answers to one question, newest first; unreadable ones are left out. The newest `most`
    are whole, and older ones that have comments or whose ids are in `also`."""
    marks = submissions.list_attempt_marks(
        session, SubmissionFilter(who.course, quiz=quiz, question=question, learner=who.id)
    )
    wanted = {comment.submission for comment in work.places[quiz, question].commented} | {*also}
    whole = [mark.id for at, mark in enumerate(marks) if at < most or mark.id in wanted]
    rows = submissions.get_several(session, whole)
    read = {given.id: given for given in read_answers(session, work.access, rows, work.read)}
    return compare_attempts([read.get(mark.id) or read_in_short(work.access, quiz, question, mark) for mark in marks])


def read_in_short(access: LearnerAccess, quiz: str, question: str, mark: AttemptMark) -> GivenAnswer:
    """Returns an attempt of which a list says the state and the points."""
    decision = access.decide(quiz, question)
    verdict: dict[str, Any] = {
        "status": mark.status,
        "points": mark.points,
        "max_points": mark.max_points,
        "timing_ms": {},
    }
    is_settled = mark.state in submissions.AT_REST and mark.status is not None
    shown = redact_json(verdict, decision) if is_settled else None
    return GivenAnswer(mark.id, mark.attempt, mark.at, None, mark.state, shown, decision.withheld,
                       multiplier=find_multiplier(access, quiz, mark.at), is_whole=False)  # fmt: skip


def compare_attempts(attempts: Sequence[GivenAnswer]) -> list[GivenAnswer]:
    """Returns attempts, newest first, each with how it compares with those before; unreadable ones are left out."""
    given = [
        attempt for attempt in attempts if attempt.verdict is None or attempt.verdict["status"] != Status.INVALID_ANSWER
    ]
    compared = [
        ComparedAttempt(attempt.attempt, attempt.verdict, attempt.is_whole)
        for attempt in reversed(given)
        if attempt.verdict
    ]
    by_attempt = {
        comparison.attempt: describe_progress(compared[:index], comparison)
        for index, comparison in enumerate(compared)
        if comparison.is_whole
    }
    return [replace(attempt, progress=by_attempt.get(attempt.attempt, "")) for attempt in given]


def read_answers(
    session: Session, access: LearnerAccess, rows: Sequence[Submission], read: ReadAnswer
) -> list[GivenAnswer]:
    """Stored answers as the learner may see them now."""
    verdicts, marks = submissions.read_verdicts(session, rows), submissions.last_marks(session, rows)
    attempts = [read_answer(access, row, read(row), verdicts.get(row.id), marks.get(row.id)) for row in rows]
    scripts = [attempt.id for attempt in attempts if attempt.is_script and attempt.withheld is None]
    comments = read_comments(session, scripts)
    return [replace(attempt, comments=comments.get(attempt.id, ())) for attempt in attempts]


def read_comments(session: Session, ids: Sequence[str]) -> dict[str, list[Comment]]:
    """Returns what instructors wrote to the lines of scripts, by submission."""
    by_submission = line_comments.on_submissions(session, ids) if ids else {}
    return {at: [Comment(comment.id, comment.line, comment.text, comment.name, comment.created_at) for comment in some]
            for at, some in by_submission.items()}  # fmt: skip


def read_answer(
    access: LearnerAccess, row: Submission, answer: Any, verdict: Any | None,
    marks: tuple[VerdictMark, VerdictMark] | None,
) -> GivenAnswer:  # fmt: skip
    """Returns one answer of `given_of`."""
    decision = access.decide(row.quiz, row.question)
    settled = verdict if row.status in submissions.AT_REST else None
    shown = redact_json(settled, decision)
    again = "" if marks is None or decision.shown < Visibility.FEEDBACK else describe_regrade(*marks)
    return GivenAnswer(row.id, row.attempt, row.created_at, answer, row.status, shown, decision.withheld, again,
                       multiplier=find_multiplier(access, row.quiz, row.created_at))  # fmt: skip


def find_multiplier(access: LearnerAccess, quiz: str, at: datetime) -> float:
    """Returns what the points of a learner's answer are multiplied by for being late; 1 where the course has lost the
    quiz."""
    policy = access.policies.get(quiz)
    return 1.0 if policy is None else late_multiplier(policy, access.extensions.get(quiz, NO_EXTENSION), at)


def describe_regrade(before: VerdictMark, after: VerdictMark) -> str:
    """Says that a verdict replaced another; empty where the first one only left it to a person."""
    if before.status == Status.NEEDS_REVIEW or after.cause not in AGAIN:
        return ""
    opening = AGAIN[after.cause].format(when=format_moment(after.at))
    worth = f"of {write_points(before.max_points)}"
    if after.status == Status.NEEDS_REVIEW:
        return f"{opening}: an instructor will decide; before, it had {write_points(before.points)} {worth}."
    if not has_other_points(before, after):
        return f"{opening}: this attempt keeps {write_points(after.points)} {worth}."
    return f"{opening}: {describe_change(before, after)}."


def has_other_points(before: VerdictMark, after: VerdictMark) -> bool:
    """Whether the second of two verdicts gives other points, or out of other ones."""
    return (before.points, before.max_points) != (after.points, after.max_points)


def describe_change(before: VerdictMark, after: VerdictMark) -> str:
    """Says which points there are now, and which there were."""
    now, earlier = (f"{write_points(mark.points)} of {write_points(mark.max_points)}" for mark in (after, before))
    return f"{now} now, {earlier} before"


def read_in_full(row: Submission, answer: Any, verdict: Any | None) -> GivenAnswer:
    """Returns a stored answer as an instructor sees it, with the verdict as reviewers may see it."""
    settled = verdict if row.status in submissions.AT_REST else None
    return GivenAnswer(row.id, row.attempt, row.created_at, answer, row.status, settled, None)


def describe_counting(policy: Policy) -> str:
    """Says which attempts count, in two words."""
    return {"best": "best attempt", "latest": "latest attempt", "average": "average"}[policy.counts]
