"""The score that a learner's results come to, as Assignment and Grade Services says it. Pure."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Self

from grader.store.tables import Result

FULLY_GRADED, PENDING_MANUAL = "FullyGraded", "PendingManual"

DIGITS = 6
"""Decimals of points: sums of floats do not show their round-off."""

SAME = 0.01
"""Points by which a platform's copy may differ: gradebooks round to hundredths."""

NO_COMMENTS: Mapping[str, str] = {}

CANVAS = "https://canvas.instructure.com/lti/submission"


@dataclass(frozen=True)
class Score:
    """A score in real points, with what reviewers wrote to the learner. `given` is None while nothing of it is
    decided."""

    given: float | None
    maximum: float
    activity: str
    grading: str
    comment: str = ""

    @property
    def is_final(self) -> bool:
        """Whether grading is over."""
        return self.grading == FULLY_GRADED

    def body(self, user: str, timestamp: datetime, *, clears_comment: bool = False) -> bytes:
        """Returns the JSON document of the score service. To Canvas it is no new submission. With `clears_comment` an
        empty comment is sent as well."""
        points = {} if self.given is None else {"scoreGiven": self.given, "scoreMaximum": self.maximum}
        document = {
            "userId": user,
            "timestamp": timestamp.strftime("%Y-%m-%dT%H:%M:%S.000Z"),
            "activityProgress": self.activity,
            "gradingProgress": self.grading,
            **points,
            **({"comment": self.comment} if self.comment or clears_comment else {}),
            CANVAS: {"new_submission": False},
        }
        return json.dumps(document).encode()

    def is_at(self, result: "PlatformResult") -> bool:
        """Says whether a platform shows this score; it may have scaled it to another maximum."""
        if self.given is None or result.score is None:
            return self.given is None and result.score is None
        shown = result.score if result.maximum is None else result.score / result.maximum * self.maximum
        return abs(shown - self.given) <= SAME

    def to_json(self) -> str:
        """As it is stored."""
        return json.dumps([self.given, self.maximum, self.activity, self.grading, self.comment])

    @classmethod
    def from_json(cls, stored: str) -> Self:
        """Says what `to_json` has made, earlier versions without a comment too."""
        return cls(*json.loads(stored))


@dataclass(frozen=True)
class PlatformResult:
    """What a platform shows for a learner; a maximum of None is that of the line item."""

    score: float | None = None
    maximum: float | None = None

    @classmethod
    def parse(cls, listed: Any, user: str) -> Self:
        """Returns the result of a user in the answer of the result service; without a score if there is none."""
        for item in listed if isinstance(listed, list) else ():
            if isinstance(item, dict) and str(item.get("userId")) == user:
                score, maximum = item.get("resultScore"), item.get("resultMaximum")
                return cls(read_number(score), read_number(maximum) or None)
        return cls()


def read_number(value: Any) -> float | None:
    """Returns a JSON number; None for anything else."""
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def compute_score(
    results: Mapping[str, Result], worth: Mapping[str, float], question: str, comments: Mapping[str, str] = NO_COMMENTS
) -> Score | None:
    """Returns the score of one question, or with an empty `question` of the whole quiz. `results` are the learner's, by
    question, `worth` the points of the quiz's questions, and `comments` the reviewers' by submission. None if there is
    nothing to score."""
    if question:
        counted = {question: results[question]} if question in results else {}
        asked = {question: worth.get(question) or (counted[question].max_points if counted else 0.0)}
    else:
        counted = {name: result for name, result in results.items() if name in worth}
        asked = dict(worth)
    # Points that a question had when it was graded, until a regrade: 5 of 5, where 5 of 3 would be above its maximum.
    asked |= {name: result.max_points for name, result in counted.items() if result.is_final and result.max_points}
    maximum = round(sum(asked.values()), DIGITS)
    if not counted or maximum <= 0:
        return None
    decided = [result.points for result in counted.values() if result.is_final]
    is_final = len(decided) == len(counted)
    given = round(sum(result.points for result in counted.values()), DIGITS) if decided else None
    if len(counted) < len(asked):
        activity = "InProgress"
    else:
        activity = "Completed" if is_final else "Submitted"
    grading = FULLY_GRADED if is_final else PENDING_MANUAL
    return Score(given, maximum, activity, grading, join_comments(counted, comments, of_quiz=not question))


def join_comments(results: Mapping[str, Result], comments: Mapping[str, str], *, of_quiz: bool) -> str:
    """Returns what reviewers wrote on the answers that count; in the score of a quiz each after its question's id."""
    written = {
        name: comments[result.submission_id] for name, result in results.items() if result.submission_id in comments
    }
    lines = [f"{name}: {text}" if of_quiz else text for name, text in sorted(written.items())]
    return "\n\n".join(lines)
