"""The answer to a platform's request to choose content: signed links to quizzes and questions. Source: LTI Deep Linking
2.0, sections 3 and 4."""

import secrets
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import datetime
from typing import Any
from urllib.parse import urlencode

from grader.domain.pages.markup import plain_text
from grader.domain.platform import Platform
from grader.domain.policy import Policy
from grader.platforms.launching import claims as words
from grader.platforms.launching.launch import ContentSelection
from grader.questions import Question, Quiz
from grader.store.platforms import make_resource_id

LIFETIME_S = 300
CHOICES_MAX = 50


@dataclass(frozen=True)
class Choice:
    """What an instructor chose: a quiz, or one question of it. `policy` is the one in force."""

    quiz: Quiz
    policy: Policy
    question: Question | None = None

    @property
    def points(self) -> float:
        """The points of all that the link leads to."""
        questions = self.quiz.questions if self.question is None else (self.question,)
        return sum(question.points for question in questions)

    @property
    def title(self) -> str:
        """The title without markup: of the quiz, with that of the question or its id."""
        title = plain_text(self.quiz.title)
        if self.question is None:
            return title
        return f"{title}: {plain_text(self.question.title or self.question.id)}"

    @property
    def names(self) -> dict[str, str]:
        """The ids of quiz and question, as a link carries them."""
        return {"quiz": self.quiz.id, **({} if self.question is None else {"question": self.question.id})}


def sign_response(
    sign: Callable[[dict[str, Any]], str], platform: Platform, deployment_id: str, selection: ContentSelection, *,
    choices: Iterable[Choice], launch_url: str,
) -> str:  # fmt: skip
    """Returns the signed response, a JWT, that the instructor's browser posts to `selection.return_url`."""
    now = int(time.time())
    items = [content_item(choice, launch_url, with_line_item=selection.takes_line_items) for choice in choices]
    claims: dict[str, Any] = {
        "iss": platform.client_id,
        "aud": [platform.issuer],
        "iat": now,
        "exp": now + LIFETIME_S,
        "nonce": secrets.token_urlsafe(32),
        f"{words.CLAIM}deployment_id": deployment_id,
        f"{words.CLAIM}message_type": words.DEEP_LINKING_RESPONSE,
        f"{words.CLAIM}version": words.VERSION,
        f"{words.DEEP_LINKING_CLAIM}content_items": items,
    }
    if selection.data is not None:
        claims[f"{words.DEEP_LINKING_CLAIM}data"] = selection.data
    return sign(claims)


def content_item(choice: Choice, launch_url: str, *, with_line_item: bool) -> dict[str, Any]:
    """Returns a link, with its column of the gradebook and its dates."""
    item: dict[str, Any] = {
        "type": "ltiResourceLink",
        "title": choice.title,
        "url": f"{launch_url}?{urlencode(choice.names)}",
        "custom": choice.names,
    }
    if with_line_item and choice.points > 0:
        resource = make_resource_id(choice.quiz.id, None if choice.question is None else choice.question.id)
        item["lineItem"] = {"scoreMaximum": choice.points, "label": choice.title, "resourceId": resource}
    policy = choice.policy
    closes = policy.late.until if policy.late else policy.due
    if available := describe_span(policy.opens, closes):
        item["available"] = available
    if submission := describe_span(policy.opens, policy.due):
        item["submission"] = submission
    return item


def describe_span(start: datetime | None, end: datetime | None) -> dict[str, str]:
    """Returns the dates that are given, as ISO 8601."""
    dates = {"startDateTime": start, "endDateTime": end}
    return {name: moment.isoformat() for name, moment in dates.items() if moment is not None}
