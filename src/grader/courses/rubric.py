"""Reviews by rubric: ticked items give the points, and give them again when the rubric changes. Pure."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from grader.domain.quiz import CodeQuestion, OpenQuestion
from grader.domain.rubric import RubricItem
from grader.domain.verdict import POINT_DIGITS, Finding, Verdict, reviewed

REVIEW = "review"
"""The id of the finding in which `reviewed` keeps a person's decision."""


def rubric_points(items: Iterable[RubricItem], max_points: float) -> float:
    """The sum of the items' points, held between 0 and those of the question."""
    total = round(math.fsum(item.points for item in items), POINT_DIGITS)
    return min(max(total, 0.0), max_points)


def reviewed_by_rubric(
    verdict: Verdict, question: OpenQuestion | CodeQuestion, ticked: Iterable[str], comment: str
) -> Verdict:
    """The verdict after a review that ticks the items with these ids; repeated ids count once.

    Only the ticked items are named in the review, so that the others do not tell what was missing.
    Raises ValueError for an id that the question's rubric does not have.
    """
    wanted = set(ticked)
    if unknown := wanted - {item.id for item in question.rubric}:
        raise ValueError(f"the rubric of {question.id} has no item {sorted(unknown)[0]!r}")
    return _decided(verdict, question, [item for item in question.rubric if item.id in wanted], comment)


def recomputed(verdict: Verdict, question: OpenQuestion | CodeQuestion) -> Verdict:
    """The verdict with the points that its ticked items have in the question's rubric as it is now.

    The comment stays. An item that the rubric no longer has gives no points and is dropped. Returns the verdict
    itself where nothing changes: after no review, after one with points given by hand, and the second time.
    """
    review = next((finding for finding in verdict.findings if finding.id == REVIEW), None)
    ids = None if review is None else ticked_ids(review)
    if review is None or ids is None:
        return verdict
    items = [item for item in question.rubric if item.id in ids]
    again = _decided(verdict, question, items, review.message)
    return verdict if again == verdict else again


def ticked_ids(review: Finding) -> set[str] | None:
    """The ids of the items that a review ticked; None where its points were given by hand."""
    if not isinstance(review.measured, Mapping) or "rubric" not in review.measured:
        return None
    return {item["id"] for item in review.measured["rubric"]}


def _decided(
    verdict: Verdict, question: OpenQuestion | CodeQuestion, items: Sequence[RubricItem], comment: str
) -> Verdict:
    rescaled = verdict.model_copy(update={"max_points": question.points})
    decided = reviewed(rescaled, rubric_points(items, question.points), comment)
    measured: dict[str, Any] = {"rubric": [item.model_dump() for item in items]}
    review, *rest = decided.findings
    return decided.model_copy(update={"findings": (review.model_copy(update={"measured": measured}), *rest)})
