"""What reviewers are kept from knowing: whose answer they mark, and how another reviewer has marked it."""

import base64
import hmac
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy.orm import Session

from grader.identity import Identity
from grader.library import Library
from grader.store import reviews
from grader.store.reviews import WAITING
from grader.store.submissions import NEEDS_REVIEW
from grader.store.tables import Review, Submission

NAME_BYTES = 5
"""40 bits: among 10,000 learners two have the same pseudonym with a chance below 1 in 20,000."""


@dataclass(frozen=True)
class Blinding:
    """Pseudonyms, and the draw of answers to mark a second time; `secret` is the installation's."""

    secret: bytes = field(repr=False)

    def name(self, submission: Submission) -> str:
        """The learner's pseudonym in this quiz: the same for all answers, and another one in the next quiz."""
        digest = self._keyed("name", submission.course, submission.quiz, submission.learner)
        return f"learner-{base64.b32encode(digest[:NAME_BYTES]).decode().lower()}"

    def is_drawn(self, submission: Submission, share: float) -> bool:
        """Whether the submission is in the `share` that is marked a second time. The first reviewer cannot know."""
        return int.from_bytes(self._keyed("second", submission.id)[:8], "big") < share * 2**64

    def _keyed(self, *parts: str) -> bytes:
        return hmac.digest(self.secret, "\n".join(parts).encode(), "sha256")


@dataclass(frozen=True)
class Blinded:
    """Verdicts by submission, without what this reviewer may not see, and the pseudonyms that stand for names."""

    verdicts: Mapping[str, Any]
    names: Mapping[str, str]


def is_anonymous(library: Library, quiz: str) -> bool:
    """Whether reviewers of a quiz see pseudonyms; also where the content has lost the quiz."""
    found = library.quizzes.get(quiz)
    return found is None or found.anonymous


def blinded(
    session: Session,
    library: Library,
    blinding: Blinding,
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
        one.id: blinding.name(one)
        for one in submissions
        if (always or waits(one, open_reviews)) and one.learner != who.id and is_anonymous(library, one.quiz)
    }
    return Blinded({**verdicts, **earlier}, names)


def waits(submission: Submission, open_reviews: Mapping[str, Review]) -> bool:
    """Whether a person's decision is still to come."""
    return submission.status == NEEDS_REVIEW or submission.id in open_reviews
