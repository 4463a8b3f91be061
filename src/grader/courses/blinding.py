"""What reviewers are kept from knowing: whose answer they mark, and how another reviewer has marked it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy.orm import Session

from grader.courses.desk import Desk
from grader.identity import Identity
from grader.store import reviews
from grader.store.reviews import WAITING
from grader.store.submissions import NEEDS_REVIEW
from grader.store.tables import Review, Submission


@dataclass(frozen=True)
class Blinded:
    """Verdicts by submission, without what this reviewer may not see, and pseudonyms in place of names."""

    verdicts: Mapping[str, Any]
    names: Mapping[str, str]


def blinded(
    desk: Desk,
    session: Session,
    who: Identity,
    submissions: Sequence[Submission],
    verdicts: Mapping[str, Any],
    *,
    always: bool = False,
) -> Blinded:
    """What an instructor may see of submissions whose newest verdicts are given; learners see their own as they are.

    In an anonymous quiz, answers that wait for a mark or for a third decision bear a pseudonym; with `always` every
    answer does. Until the second mark is there, only the first reviewer sees the first.
    """
    if not who.is_instructor:
        return Blinded(verdicts, {})
    open_reviews = reviews.unsettled(session, [submission.id for submission in submissions])
    hidden = [one for one, review in open_reviews.items() if review.second == WAITING and review.reviewer != who.id]
    earlier = reviews.graders_verdicts(session, hidden) if hidden else {}
    names = {
        one.id: desk.blinding.name(one)
        for one in submissions
        if (always or waits(one, open_reviews)) and one.learner != who.id and desk.is_anonymous(one.quiz)
    }
    return Blinded({**verdicts, **earlier}, names)


def waits(submission: Submission, open_reviews: Mapping[str, Review]) -> bool:
    """Whether a person's decision is still to come."""
    return submission.status == NEEDS_REVIEW or submission.id in open_reviews
