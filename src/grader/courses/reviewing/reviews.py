"""Reviewing: claims with heartbeats, first and second marks, and points that follow a changed rubric."""

import json
from datetime import timedelta

from sqlalchemy.orm import Session

from grader.courses.answering import results
from grader.courses.people.audit import Action, record
from grader.courses.people.identity import Identity
from grader.courses.reviewing.desk import Desk
from grader.courses.rules.policy import format_moment
from grader.courses.rules.rubric import (
    Mark,
    compute_fingerprint,
    get_items,
    get_rubric,
    mark_verdict,
    recompute_points,
    rubric_points,
)
from grader.domain.verdict import Verdict
from grader.errors import Conflict, NotFound, Unprocessable
from grader.questions import Question
from grader.store import submissions
from grader.store.reviewing import reviews
from grader.store.reviewing.reviews import AGREED, DECIDED, DIFFERS, NONE, WAITING, Queue
from grader.store.submissions import AT_REST, GRADED, REVIEW, WITHDRAWN, SubmissionFilter
from grader.store.tables import Review, ReviewClaim, Submission, now

CLAIM = timedelta(minutes=15)
"""How long a claim holds after it was made or prolonged."""

SECOND = "This submission has a first mark, and waits for a second one: give yours as the second."
NO_MARK = "No reviewer's mark counts for this submission."

FOLLOWING = "a change of the rubric"
"""The audit log's author of points that were recomputed without a request."""


def list_queue(desk: Desk, session: Session, wanted: SubmissionFilter, second_for: str | None = None) -> Queue:
    """Returns the submissions that wait. A search for a learner finds nothing in anonymous quizzes."""
    averaged = desk.list_averaged(session, wanted.course)
    if wanted.user is None and wanted.learner is None:
        return Queue(wanted, averaged, second_for)
    quizzes = {name for name in desk.library.quizzes if not desk.is_anonymous(name)}
    return Queue(wanted, averaged, second_for, quizzes)


def claim(session: Session, who: Identity, submission: Submission, *, second: bool = False) -> ReviewClaim:
    """Claims a submission, or prolongs the reviewer's own claim on it. Raises Conflict. The caller holds the lock."""
    clock = now()
    require_free(session, submission, who)
    if second:
        require_second(session, submission, who)
    else:
        require_third(session, submission, who)
    if reviews.find_claim(session, submission.id, clock) is None:
        record(session, who, who.course, Action.CLAIMED, submission.id)
    return reviews.put_claim(session, submission.id, who.id, who.user, clock + CLAIM)


def next_to_claim(session: Session, queue: Queue, who: Identity, *, own_first: bool = False) -> Submission:
    """Returns the submission that has waited longest for a claim; with `own_first` one that the reviewer holds, if
    there is one. Raises NotFound."""
    submission = reviews.find_oldest(session, queue, who.id, now(), own_first=own_first)
    if submission is None:
        raise NotFound("No submission needs a review here.")
    return submission


def prolong(session: Session, who: Identity, submission: Submission) -> ReviewClaim:
    """Makes the reviewer's claim hold for `CLAIM` from now on. Raises Conflict if it has ended."""
    held = reviews.find_claim(session, submission.id, now())
    if held is None or held.reviewer != who.id:
        raise Conflict("You hold no claim on this submission any more: claim it again.")
    held.expires_at = now() + CLAIM
    return held


def release(session: Session, who: Identity, submission: Submission) -> None:
    """Ends the reviewer's claim on a submission, if there is one."""
    held = reviews.find_claim(session, submission.id, now())
    if held is not None and held.reviewer == who.id:
        reviews.drop_claim(session, submission.id)
        record(session, who, who.course, Action.RELEASED, submission.id)


def require_free(session: Session, submission: Submission, who: Identity) -> None:
    """Raises Conflict unless this reviewer may mark the submission now."""
    if submission.status not in AT_REST:
        raise Conflict("This submission is still being graded.")
    held = reviews.find_claim(session, submission.id, now())
    if held is not None and held.reviewer != who.id:
        raise Conflict(f"{held.name} is reviewing this submission until {format_moment(held.expires_at)}.")


def require_second(session: Session, submission: Submission, who: Identity) -> Review:
    """Returns the review that waits for a second mark by this reviewer. Raises Conflict."""
    review = reviews.find_review(session, submission.id)
    if review is None or review.second != WAITING or submission.status != GRADED:
        raise Conflict("This submission does not wait for a second mark.")
    if review.reviewer == who.id:
        raise Conflict("The first mark is yours: another reviewer gives the second.")
    return review


def require_third(session: Session, submission: Submission, who: Identity) -> None:
    """Raises Conflict if two marks differ of which one is this reviewer's, and another could decide."""
    review = reviews.find_review(session, submission.id)
    if review is not None and review.second == DIFFERS and not reviews.may_settle(session, review, who.id):
        raise Conflict("One of the two marks that differ is yours: a third reviewer decides.")


def waits_for_second(session: Session, submission: Submission, who: Identity) -> bool:
    """Whether the submission has a first mark that this reviewer may not see before giving the second."""
    review = reviews.find_review(session, submission.id)
    return review is not None and review.second == WAITING and review.reviewer != who.id


def decide(desk: Desk, session: Session, who: Identity, submission: Submission, mark: Mark) -> Verdict:
    """Appends the reviewer's verdict, whose points count. Raises Conflict, Unprocessable. On an answer with two marks
    it is the third decision. The caller holds the submission."""
    require_free(session, submission, who)
    require_third(session, submission, who)
    if waits_for_second(session, submission, who):
        raise Conflict(SECOND)
    earlier = read_newest(session, submission)
    verdict = apply_mark(earlier, desk.question(submission), mark)
    results.append_verdict(desk.database, desk.library, session, submission, verdict, cause=REVIEW, reviewer=who.user)
    review = record_decision(desk, session, submission)
    review.reviewer, review.name, review.points = who.id, who.user, verdict.points
    review.rubric = find_fingerprint(desk.question(submission), mark)
    record(session, who, who.course, Action.REVIEWED, submission.id, before=earlier.points, after=verdict.points)
    reviews.drop_claim(session, submission.id)
    return verdict


def withdraw(desk: Desk, session: Session, who: Identity, submission: Submission) -> Verdict:
    """Takes the marks of an answer back: the newest verdict that is no person's counts again, and an answer that only a
    person can grade waits again. Raises Conflict where no person's counts, or one that the caller may not see yet. The
    caller holds the submission."""
    require_free(session, submission, who)
    require_third(session, submission, who)
    if waits_for_second(session, submission, who):
        raise Conflict(SECOND)
    if not reviews.is_decided(session, submission):
        raise Conflict(NO_MARK)
    earlier = read_newest(session, submission)
    verdict = Verdict.model_validate(reviews.graders_verdicts(session, [submission.id])[submission.id])
    results.append_verdict(desk.database, desk.library, session, submission, verdict, cause=WITHDRAWN)
    reviews.drop_review(session, submission.id)
    reviews.drop_claim(session, submission.id)
    record(session, who, who.course, Action.REVIEW_WITHDRAWN, submission.id, before=earlier.points,
           after=verdict.points)  # fmt: skip
    return verdict


def record_decision(desk: Desk, session: Session, submission: Submission) -> Review:
    """Returns the review of a submission after one more decision: the first draws whether there is a second mark."""
    review = reviews.find_review(session, submission.id)
    if review is None:
        drawn = desk.blinding.is_drawn(submission, desk.second_marking(submission).share)
        at = {name: getattr(submission, name) for name in ("course", "quiz", "question")}
        review = Review(submission_id=submission.id, **at, second=WAITING if drawn else NONE)
        session.add(review)
    elif review.second in (AGREED, DIFFERS):
        review.second = DECIDED
    return review


def mark_second(desk: Desk, session: Session, who: Identity, submission: Submission, mark: Mark) -> Review:
    """Keeps a second mark beside the first, which goes on counting. Raises Conflict, Unprocessable. The caller holds
    the submission."""
    require_free(session, submission, who)
    review = require_second(session, submission, who)
    own = reviews.graders_verdicts(session, [submission.id])[submission.id]
    question = desk.question(submission)
    review.second_points = apply_mark(Verdict.model_validate(own), question, mark).points
    review.second_reviewer, review.second_name, review.second_comment = who.id, who.user, mark.comment
    if mark.follows_rubric:
        review.second_ticked = json.dumps(mark.ticked)
        review.rubric = review.rubric or find_fingerprint(question, mark)
    review.second = compare_marks(desk, submission, review)
    record(session, who, who.course, Action.MARKED_SECOND, submission.id, points=review.second_points)
    reviews.drop_claim(session, submission.id)
    return review


def follow_rubric(desk: Desk, session: Session, submission_id: str, who: Identity | None) -> bool:
    """Computes the marks of a submission again from the rubric as it is now. Returns whether its verdict changed. `who`
    asked for it; None is for the service itself. Does nothing the second time."""
    submission = session.get_one(Submission, submission_id)
    desk.hold(session, submission)
    review, question = session.get_one(Review, submission_id), desk.question(submission)
    if question is None or not get_rubric(question) or review.rubric in (None, compute_fingerprint(question)):
        return False
    earlier = read_newest(session, submission)
    verdict = recompute_points(earlier, question)
    if verdict is not earlier:
        results.append_verdict(
            desk.database, desk.library, session, submission, verdict, cause="rubric", reviewer=review.name
        )
        review.points = verdict.points
        changed = {"before": earlier.points, "after": verdict.points}
        record(session, who, submission.course, Action.RECOMPUTED, submission.id, unsigned=FOLLOWING, **changed)
    if review.second_ticked is not None:
        ids = {item.id for item in get_rubric(question)}.intersection(json.loads(review.second_ticked))
        review.second_points = rubric_points(get_items(question, ids), question.points)
    if review.second in (AGREED, DIFFERS):
        review.second = compare_marks(desk, submission, review)
    review.rubric = compute_fingerprint(question)
    return verdict is not earlier


def read_newest(session: Session, submission: Submission) -> Verdict:
    """Returns the newest verdict on a submission that is at rest."""
    return Verdict.model_validate(submissions.read_verdicts(session, [submission])[submission.id])


def apply_mark(verdict: Verdict, question: Question | None, mark: Mark) -> Verdict:
    """Returns the verdict after a mark. Raises Unprocessable."""
    try:
        return mark_verdict(verdict, question, mark)
    except ValueError as error:
        raise Unprocessable(f"{error}.") from error


def find_fingerprint(question: Question | None, mark: Mark) -> str | None:
    """Returns the fingerprint of the rubric that a mark's points follow, if they do."""
    return None if question is None or not mark.follows_rubric else compute_fingerprint(question)


def compare_marks(desk: Desk, submission: Submission, review: Review) -> str:
    """Says whether the two marks agree."""
    assert review.second_points is not None
    agree = desk.second_marking(submission).agree(review.points, review.second_points)
    return AGREED if agree else DIFFERS
