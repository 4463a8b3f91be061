"""Pseudonyms of learners, and the draw of answers that are marked a second time; both are keyed."""

import base64
import hmac
from dataclasses import dataclass, field

from grader.store.tables import Submission

NAME_BYTES = 5
"""40 bits: among 10,000 learners two have the same pseudonym with a chance below 1 in 20,000."""


@dataclass(frozen=True)
class Blinding:
    """Pseudonyms, and the draw of answers to mark a second time; `secret` is the installation's."""

    secret: bytes = field(repr=False)

    def name(self, submission: Submission) -> str:
        """Returns the learner's pseudonym in this quiz: the same for all answers, and another one in the next quiz."""
        digest = self._keyed("name", submission.course, submission.quiz, submission.learner)
        return f"learner-{base64.b32encode(digest[:NAME_BYTES]).decode().lower()}"

    def is_drawn(self, submission: Submission, share: float) -> bool:
        """Whether the submission is in the `share` that is marked a second time. The first reviewer cannot know."""
        return int.from_bytes(self._keyed("second", submission.id)[:8], "big") < share * 2**64

    def _keyed(self, *parts: str) -> bytes:
        return hmac.digest(self.secret, "\n".join(parts).encode(), "sha256")
