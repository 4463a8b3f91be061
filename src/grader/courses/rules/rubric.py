"""Reviews by rubric: ticked items give the points, and give them again when the rubric changes. Pure."""

import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from grader.domain.rubric import Rubric, RubricItem
from grader.domain.verdict import POINT_DIGITS, Finding, Verdict, apply_review
from grader.questions import Question, kind_of

REVIEW = "review"
"""The id of the finding in which `apply_review` keeps a person's decision."""


@dataclass(frozen=True)
class Mark:
    """What a reviewer gives an answer: `ticked` ids of rubric items, `points`, or both. Points win over items."""

    ticked: tuple[str, ...] | None
    points: float | None
    comment: str = ""

    @property
    def follows_rubric(self) -> bool:
        """Whether the points are those of the items, and change with them."""
        return self.points is None


def mark_verdict(verdict: Verdict, question: Question | None, mark: Mark) -> Verdict:
    """The verdict after a review, of the points that the question has now. `question` is None if the content has lost
    it: then only points can be given. Raises ValueError for points outside of the question's, and for items that its
    rubric does not have."""
    if question is not None:
        verdict = verdict.model_copy(update={"max_points": question.points})
    if mark.ticked is None:
        assert mark.points is not None
        return apply_review(verdict, mark.points, mark.comment)
    if question is None or not get_rubric(question):
        raise ValueError("the question has no rubric: give points")
    if mark.points is None:
        return reviewed_by_rubric(verdict, question, mark.ticked, mark.comment)
    return _naming(apply_review(verdict, mark.points, mark.comment), get_items(question, mark.ticked), by_hand=True)


def get_rubric(question: Question) -> Rubric:
    """The items that a reviewer of answers to a question may tick."""
    return kind_of(question).rubric(question)


def rubric_points(items: Iterable[RubricItem], max_points: float) -> float:
    """The sum of the items' points, held between 0 and those of the question."""
    total = round(math.fsum(item.points for item in items), POINT_DIGITS)
    return min(max(total, 0.0), max_points)


def reviewed_by_rubric(verdict: Verdict, question: Question, ticked: Iterable[str], comment: str) -> Verdict:
    """The verdict after a review that ticks the items with these ids; repeated ids count once. Only the ticked items
    are named in the review, so that the others do not tell what was missing. Raises ValueError for an id that the
    question's rubric does not have."""
    return _decided(verdict, question, get_items(question, ticked), comment)


def get_items(question: Question, ticked: Iterable[str]) -> list[RubricItem]:
    """The items with these ids, in the rubric's order. Raises ValueError for an id that the rubric does not have."""
    wanted = set(ticked)
    rubric = get_rubric(question)
    if unknown := wanted - {item.id for item in rubric}:
        raise ValueError(f"the rubric of {question.id} has no item {sorted(unknown)[0]!r}")
    return [item for item in rubric if item.id in wanted]


def recompute_points(verdict: Verdict, question: Question) -> Verdict:
    """The verdict with the points that its ticked items have in the question's rubric as it is now. The comment stays.
    An item that the rubric no longer has gives no points and is dropped. Returns the verdict itself where nothing
    changes: after no review, after one with points given by hand, and the second time."""
    review = next((finding for finding in verdict.findings if finding.id == REVIEW), None)
    ids = None if review is None else ticked_ids(review)
    if review is None or ids is None:
        return verdict
    items = [item for item in get_rubric(question) if item.id in ids]
    again = _decided(verdict, question, items, review.message)
    return verdict if again == verdict else again


def ticked_ids(review: Finding) -> set[str] | None:
    """The ids of the items that a review ticked; None where its points were given by hand."""
    if not isinstance(review.measured, Mapping) or "rubric" not in review.measured or review.measured.get("by_hand"):
        return None
    return {item["id"] for item in review.measured["rubric"]}


def compute_fingerprint(question: Question) -> str:
    """32 hexadecimal digits that change with the items and the points of a question."""
    items = [item.model_dump() for item in get_rubric(question)]
    return hashlib.sha256(json.dumps([question.points, items]).encode()).hexdigest()[:32]


def _decided(verdict: Verdict, question: Question, items: Sequence[RubricItem], comment: str) -> Verdict:
    rescaled = verdict.model_copy(update={"max_points": question.points})
    return _naming(apply_review(rescaled, rubric_points(items, question.points), comment), items)


def _naming(decided: Verdict, items: Sequence[RubricItem], *, by_hand: bool = False) -> Verdict:
    """The reviewed verdict with the ticked items in its review."""
    measured: dict[str, Any] = {"rubric": [item.model_dump(exclude_none=True) for item in items]}
    if by_hand:
        measured["by_hand"] = True
    review, *rest = decided.findings
    return decided.model_copy(update={"findings": (review.model_copy(update={"measured": measured}), *rest)})
