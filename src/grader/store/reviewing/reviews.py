"""Every query on submissions that wait for a reviewer, on claims and reviews, and on saved comments."""

import json
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, NamedTuple

from sqlalchemy import ColumnElement, Select, and_, exists, func, or_, select
from sqlalchemy.orm import Session, aliased

from grader.domain.verdict import NO_COMMENT, REVIEW
from grader.store.submissions import GRADED, NEEDS_REVIEW, NEWEST, UNSETTLED, SubmissionFilter
from grader.store.tables import Member, Review, ReviewClaim, SavedComment, Submission, VerdictRow

NONE, WAITING, AGREED, DIFFERS, DECIDED = "none", "waiting", "agreed", "differs", "decided"
"""Where the second marking of a submission stands."""

Waiting = tuple[Submission, ReviewClaim | None]


class WaitingQuestion(NamedTuple):
    """How many answers to a question wait for a person, and since when the oldest does."""

    quiz: str
    question: str
    answers: int
    since: datetime


@dataclass(frozen=True)
class Queue:
    """The submissions that wait for a first mark, or with `second_for` for a second one by this reviewer. A submission
    does not wait for a first mark while a newer attempt at its question replaces it, but in the quizzes `averaged`,
    where all attempts count. None waits whose learner is removed from the course. `quizzes` are the only ones to look
    into, if not None."""

    wanted: SubmissionFilter
    averaged: Collection[str]
    second_for: str | None = None
    quizzes: Collection[str] | None = None

    def conditions(self) -> list[ColumnElement[bool]]:
        """The queue as SQL conditions on submissions."""
        course = self.wanted.course
        removed = select(Member.id).where(Member.course == course, Member.removed_at.is_not(None))
        conditions = [*self.wanted.conditions(), Submission.learner.not_in(removed)]
        if self.second_for is None:
            conditions += [UNSETTLED, Submission.status == NEEDS_REVIEW, _counts(self.averaged)]
        else:
            # The course stands here too, so that the index of reviews finds the few that wait.
            waiting = _first_marks(course, self.second_for)
            conditions += [Submission.status == GRADED, Submission.id.in_(waiting)]
        if self.quizzes is not None:
            conditions.append(Submission.quiz.in_(self.quizzes))
        return conditions


def read_remarks(session: Session, submissions: Collection[str]) -> dict[str, str]:
    """What reviewers wrote to the learner, by submission; those whose newest verdict is not a person's are left
    out."""
    decided = (
        select(VerdictRow.submission_id, VerdictRow.body)
        .join(Submission, NEWEST)
        .where(Submission.id.in_(submissions), VerdictRow.reviewer.is_not(None))
    )
    findings = {id_: json.loads(body)["findings"] for id_, body in session.execute(decided)}
    written = {id_: finding["message"] for id_, all_ in findings.items() for finding in all_ if finding["id"] == REVIEW}
    return {id_: text for id_, text in written.items() if text != NO_COMMENT}


def page(session: Session, queue: Queue, after: str | None, limit: int, clock: datetime) -> Sequence[Waiting]:
    """At most `limit` submissions of the queue with the claims on them, oldest first, after the id `after`."""
    oldest_first = _queued(queue, clock).add_columns(ReviewClaim).limit(limit)
    if after is not None:
        oldest_first = oldest_first.where(Submission.id > after)
    return [(row[0], row[1]) for row in session.execute(oldest_first)]


def find_oldest(
    session: Session, queue: Queue, reviewer: str, clock: datetime, *, own_first: bool = False
) -> Submission | None:
    """The oldest submission without a claim, else the oldest that this reviewer has claimed; with `own_first` the other
    way round."""
    longest = _queued(queue, clock).limit(1)
    free = longest.where(ReviewClaim.submission_id.is_(None))
    own = longest.where(ReviewClaim.reviewer == reviewer)
    first, second = (own, free) if own_first else (free, own)
    found: Submission | None = session.scalar(first)
    return found or session.scalar(second)


def find_claim(session: Session, submission_id: str, clock: datetime) -> ReviewClaim | None:
    """The claim on the submission, if one still holds."""
    claim = session.get(ReviewClaim, submission_id)
    return claim if claim is not None and claim.expires_at > clock else None


def put_claim(session: Session, submission_id: str, reviewer: str, name: str, expires_at: datetime) -> ReviewClaim:
    """Gives the submission to a reviewer until `expires_at`; replaces any earlier claim."""
    claim = ReviewClaim(submission_id=submission_id, reviewer=reviewer, name=name, expires_at=expires_at)
    return session.merge(claim)


def drop_claim(session: Session, submission_id: str) -> None:
    """Deletes the claim on the submission, if there is one."""
    if claim := session.get(ReviewClaim, submission_id):
        session.delete(claim)


def find_review(session: Session, submission_id: str) -> Review | None:
    """What is known of the review of a submission; None before the first."""
    return session.get(Review, submission_id)


def drop_review(session: Session, submission_id: str) -> None:
    """Deletes what is known of the review of the submission: its next mark is a first one."""
    if review := session.get(Review, submission_id):
        session.delete(review)


def is_decided(session: Session, submission: Submission) -> bool:
    """Whether the submission's newest verdict is a reviewer's."""
    newest = select(VerdictRow.reviewer).join(Submission, NEWEST).where(Submission.id == submission.id)
    return session.scalar(newest) is not None


def find_of_submissions(session: Session, submissions: Iterable[str]) -> dict[str, Review]:
    """What is known of the reviews of submissions, by id; without those that have none."""
    rows = select(Review).where(Review.submission_id.in_(list(submissions)))
    return {row.submission_id: row for row in session.scalars(rows)}


def find_undecided(
    session: Session, course: str, averaged: Collection[str], learners: Collection[str]
) -> set[tuple[str, str]]:
    """The quizzes of some learners, as (quiz, learner), in which a decision of a person is still to come."""
    unsettled = select(Review.submission_id).where(Review.course == course, Review.second.in_((WAITING, DIFFERS)))
    first = and_(UNSETTLED, Submission.status == NEEDS_REVIEW, _counts(averaged))
    theirs = (Submission.course == course, Submission.learner.in_(learners))
    rows = select(Submission.quiz, Submission.learner).where(*theirs, or_(first, Submission.id.in_(unsettled)))
    # Not `distinct`: SQLite would take the index that begins as these columns do, and walk the whole course.
    return {(row.quiz, row.learner) for row in session.execute(rows)}


def list_unseen(session: Session, course: str, reviewer: str) -> Sequence[Any]:
    """Id, course, learner, quiz, question of submissions with only a first mark yet, which another reviewer gave."""
    columns = (Submission.id, Submission.course, *_PLACE)
    return session.execute(select(*columns).where(Submission.id.in_(_first_marks(course, reviewer)))).all()


def select_unseen_places(course: str, reviewer: str) -> Select[str, str, str]:
    """Selects learner, quiz and question of those submissions."""
    return select(*_PLACE).where(Submission.id.in_(_first_marks(course, reviewer)))


_PLACE = (Submission.learner, Submission.quiz, Submission.question)


def _first_marks(course: str, reviewer: str) -> Select[str]:
    waits = (Review.course == course, Review.second == WAITING, Review.reviewer != reviewer)
    return select(Review.submission_id).where(*waits)


def list_disagreements(
    session: Session, wanted: SubmissionFilter, after: str | None, limit: int, third_for: str | None = None
) -> list[tuple[Submission, Review]]:
    """At most `limit` submissions whose two marks differ, oldest first, beginning after the id `after`; with
    `third_for` those between which this reviewer may decide."""
    rows = select(Submission, Review).join(Review, Review.submission_id == Submission.id).where(*wanted.conditions())
    differ = rows.where(Review.course == wanted.course, Review.second == DIFFERS)
    if third_for is not None:
        differ = differ.where(_settled_by(third_for))
    if after is not None:
        differ = differ.where(Review.submission_id > after)
    return [(row[0], row[1]) for row in session.execute(differ.order_by(Review.submission_id).limit(limit))]


def may_settle(session: Session, review: Review, reviewer: str) -> bool:
    """Whether this reviewer may decide between the two marks of a review."""
    mine = select(Review.submission_id).where(Review.submission_id == review.submission_id, _settled_by(reviewer))
    return session.scalar(mine) is not None


def _settled_by(reviewer: str) -> ColumnElement[bool]:
    """Whether a reviewer may decide between two marks: who gave neither, or anybody where no other instructor is."""
    pair = (Review.reviewer, Review.second_reviewer)
    here = (Member.course == Review.course, Member.role == "instructor", Member.removed_at.is_(None))
    third = exists().where(*here, *(Member.id != one for one in pair))
    return or_(and_(*(one != reviewer for one in pair)), ~third)


def count_waiting(session: Session, queue: Queue, limit: int) -> list[WaitingQuestion]:
    """What waits in a queue, by question; of the oldest `limit` submissions. The question that waits longest first."""
    return _by_question(session, select(*_WAITS).where(*queue.conditions()), limit)


def count_differing(session: Session, course: str, limit: int, third_for: str) -> list[WaitingQuestion]:
    """As `count_waiting`: the submissions whose two marks differ, between which this reviewer may decide."""
    differ = select(*_WAITS).join(Review, Review.submission_id == Submission.id)
    here = (Review.course == course, Review.second == DIFFERS, _settled_by(third_for))
    return _by_question(session, differ.where(*here), limit)


_WAITS = (Submission.quiz, Submission.question, Submission.created_at)


def _by_question(session: Session, waiting: Select[str, str, datetime], limit: int) -> list[WaitingQuestion]:
    oldest = waiting.order_by(Submission.id).limit(limit).subquery()
    since = func.min(oldest.c.created_at)
    rows = select(oldest.c.quiz, oldest.c.question, func.count(), since).group_by(oldest.c.quiz, oldest.c.question)
    return [WaitingQuestion(*row) for row in session.execute(rows.order_by(since))]


def graders_verdicts(session: Session, submissions: Iterable[str]) -> dict[str, Any]:
    """The newest verdict of each submission that is no person's, as plain JSON, by id."""
    own = (VerdictRow.submission_id.in_(list(submissions)), VerdictRow.reviewer.is_(None))
    rows = select(VerdictRow.submission_id, VerdictRow.body).where(*own).order_by(VerdictRow.revision)
    return {submission: json.loads(body) for submission, body in session.execute(rows)}


def list_with_rubric(session: Session) -> list[tuple[str, str, str]]:
    """Every course, quiz and question with reviews whose points follow a rubric."""
    rows = select(Review.course, Review.quiz, Review.question).where(Review.rubric.is_not(None)).distinct()
    return [(row.course, row.quiz, row.question) for row in session.execute(rows)]


def list_of_other_rubric(session: Session, quiz: str, question: str, fingerprint: str, course: str) -> list[str]:
    """The ids of submissions of a course whose marks were computed with another rubric of the question."""
    here = (Review.course == course, Review.quiz == quiz, Review.question == question, Review.rubric != fingerprint)
    return list(session.scalars(select(Review.submission_id).where(*here).order_by(Review.submission_id)))


def count_of_other_rubric(session: Session, quiz: str, question: str, fingerprint: str, course: str) -> int:
    """How many learners have such submissions."""
    ids = list_of_other_rubric(session, quiz, question, fingerprint, course)
    learners = select(func.count(Submission.learner.distinct())).where(Submission.id.in_(ids))
    return session.scalar(learners) or 0


def _queued(queue: Queue, clock: datetime) -> Select[Any]:
    """The queue, oldest first, joined to the claims that hold."""
    holds = (ReviewClaim.submission_id == Submission.id) & (ReviewClaim.expires_at > clock)
    return select(Submission).outerjoin(ReviewClaim, holds).where(*queue.conditions()).order_by(Submission.id)


def _counts(averaged: Collection[str]) -> ColumnElement[bool]:
    """Whether no newer attempt replaces the submission, or all attempts count."""
    newer = aliased(Submission)
    same = (getattr(newer, name) == getattr(Submission, name) for name in ("course", "learner", "quiz", "question"))
    # A single value is looked up for each row that waits; for NOT EXISTS PostgreSQL would read all submissions.
    newest = select(func.coalesce(func.max(newer.id), "")).where(*same, newer.uses_attempt).scalar_subquery()
    is_newest = Submission.id >= newest
    return or_(Submission.quiz.in_(averaged), is_newest) if averaged else is_newest


def find_comments(session: Session, course: str, quiz: str, question: str) -> Sequence[SavedComment]:
    """The comments saved for a question, oldest first."""
    here = (SavedComment.course == course, SavedComment.quiz == quiz, SavedComment.question == question)
    return session.scalars(select(SavedComment).where(*here).order_by(SavedComment.id)).all()


def count_comments(session: Session, course: str, quiz: str, question: str) -> int:
    """How many comments are saved for a question."""
    here = (SavedComment.course == course, SavedComment.quiz == quiz, SavedComment.question == question)
    return session.scalar(select(func.count()).select_from(SavedComment).where(*here)) or 0


def find_comment(session: Session, comment_id: str, course: str) -> SavedComment | None:
    """The comment with this id, if the course has it."""
    comment = session.get(SavedComment, comment_id)
    return comment if comment is not None and comment.course == course else None
