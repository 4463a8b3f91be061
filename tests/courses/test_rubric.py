"""Reviews by rubric: points, comments, and points that follow the rubric."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from grader.courses.rules.rubric import Mark, mark_verdict, recompute_points, reviewed_by_rubric, rubric_points
from grader.domain.rubric import RubricItem
from grader.domain.verdict import Finding, Status, Verdict, apply_review
from grader.questions.kinds.script import ScriptQuestion
from grader.questions.kinds.text import TextQuestion

WAITING = Verdict(
    status=Status.NEEDS_REVIEW,
    points=0.0,
    max_points=4.0,
    findings=(Finding(id="text", title="Your text", passed=None, points=0, max_points=4, message="It waits."),),
    read_as="a text of 9 words",
)
ITEMS = [
    {"id": "damping", "title": "Names implicit damping", "points": 3},
    {"id": "bound", "title": "Compares with the bound", "points": 1},
    {"id": "units", "title": "Units are missing", "points": -0.5},
]


def question(items: list[dict[str, Any]] = ITEMS, points: float = 4.0) -> TextQuestion:
    rubric = tuple(RubricItem.model_validate(item) for item in items)
    return TextQuestion(kind="open", id="why", q="Why?", points=points, rubric=rubric)


def test_ticked_items_give_the_points_and_only_they_are_named() -> None:
    verdict = reviewed_by_rubric(WAITING, question(), ["units", "damping", "damping"], "Well put.")
    assert (verdict.status, verdict.points, verdict.max_points) == (Status.PARTIAL, 2.5, 4)
    (review,) = verdict.findings
    assert review.message == "Well put."
    assert review.measured == {"rubric": [ITEMS[0], ITEMS[2]]}
    assert "bound" not in verdict.model_dump_json()
    assert verdict.read_as == WAITING.read_as


@pytest.mark.parametrize(
    ("ticked", "status", "points"),
    [
        ([], Status.INCORRECT, 0),
        (["units"], Status.INCORRECT, 0),
        (["damping", "bound"], Status.CORRECT, 4),
        (["damping", "bound", "units"], Status.PARTIAL, 3.5),
    ],
)
def test_the_status_follows_the_points(ticked: list[str], status: Status, points: float) -> None:
    verdict = reviewed_by_rubric(WAITING, question(), ticked, "")
    assert (verdict.status, verdict.points) == (status, points)


def test_an_item_that_is_not_there_is_refused() -> None:
    with pytest.raises(ValueError, match="the rubric of why has no item 'unit'"):
        reviewed_by_rubric(WAITING, question(), ["unit"], "")


def test_changed_points_are_recomputed_and_the_comment_stays() -> None:
    verdict = reviewed_by_rubric(WAITING, question(), ["damping", "units"], "Well put.")
    changed = question([{**ITEMS[0], "points": 2}, {**ITEMS[1], "points": 2}, ITEMS[2]])
    again = recompute_points(verdict, changed)
    assert again.points == 1.5
    assert again.findings[0].message == "Well put."
    assert recompute_points(again, changed) is again


def test_an_item_that_was_removed_gives_no_points() -> None:
    verdict = reviewed_by_rubric(WAITING, question(), ["damping", "units"], "")
    again = recompute_points(verdict, question([{**ITEMS[0], "points": 4}, ITEMS[1]]))
    assert again.points == 4
    assert again.findings[0].measured == {"rubric": [{**ITEMS[0], "points": 4}]}


def test_the_points_of_the_question_are_followed_too() -> None:
    verdict = reviewed_by_rubric(WAITING, question(), ["damping", "bound"], "")
    again = recompute_points(verdict, question(points=3))
    assert (again.points, again.max_points, again.status) == (3, 3, Status.CORRECT)


@pytest.mark.parametrize("ticked", [None, ("damping",)])
def test_a_review_gives_the_points_that_the_question_has_now(ticked: tuple[str, ...] | None) -> None:
    raised = question([*ITEMS, {"id": "more", "title": "Says more", "points": 4}], 8)
    verdict = mark_verdict(WAITING, raised, Mark(ticked, 6))
    assert (verdict.points, verdict.max_points, verdict.status) == (6, 8, Status.PARTIAL)
    with pytest.raises(ValueError, match="between 0 and 8"):
        mark_verdict(WAITING, raised, Mark(ticked, 9))
    with pytest.raises(ValueError, match="between 0 and 4"):
        mark_verdict(WAITING, None, Mark(None, 6))  # the content has lost the question


def test_verdicts_without_ticked_items_are_left_alone() -> None:
    by_hand = apply_review(WAITING, 1.25, "Half of it.")
    assert recompute_points(by_hand, question()) is by_hand
    assert recompute_points(WAITING, question()) is WAITING


def test_a_review_survives_its_json() -> None:
    verdict = reviewed_by_rubric(WAITING, question(), ["damping"], "")
    stored = Verdict.model_validate_json(verdict.model_dump_json())
    assert recompute_points(stored, question([{**ITEMS[0], "points": 1}, {**ITEMS[1], "points": 3}])).points == 1


rubrics = st.lists(st.integers(-4, 8), min_size=1, max_size=5).map(
    lambda halves: [{"id": f"i{n}", "title": "t", "points": half / 2} for n, half in enumerate(halves)]
)


@given(rubrics, rubrics, st.sets(st.integers(0, 4)))
def test_recomputing_is_reviewing_again_with_the_new_rubric(
    old: list[dict[str, Any]], new: list[dict[str, Any]], ticked: set[int]
) -> None:
    top = [{"id": "top", "title": "t", "points": 99}]  # makes full marks reachable
    before, after = question([*old, *top]), question([*new, *top])
    ids = {f"i{n}" for n in ticked} & {item.id for item in before.rubric}
    verdict = reviewed_by_rubric(WAITING, before, ids, "x")
    again = recompute_points(verdict, after)
    assert again == reviewed_by_rubric(verdict, after, ids & {item.id for item in after.rubric}, "x")
    assert 0 <= again.points <= 4
    assert recompute_points(again, after) is again


def test_thirds_that_add_up_are_full_marks() -> None:
    thirds = [RubricItem(id=f"i{n}", title="t", points=1 / 3) for n in range(3)]
    assert rubric_points(thirds, 1.0) == 1


@pytest.mark.parametrize("kind", ["open", "code"])
def test_a_rubric_that_cannot_work_is_refused(kind: str) -> None:
    part: dict[str, Any] = {"kind": kind, "id": "why", "q": "Why?", "points": 5}
    if kind == "code":
        part |= {"entry": "f", "check": {"kind": "rk4"}}
    model = ScriptQuestion if kind == "code" else TextQuestion
    with pytest.raises(ValidationError, match="the items add up to 4 of 5 points: add items or points"):
        model.model_validate({**part, "rubric": ITEMS})
    with pytest.raises(ValidationError, match="two items have the id bound: give each its own"):
        model.model_validate({**part, "points": 1, "rubric": [*ITEMS, ITEMS[1]]})
    assert len(model.model_validate({**part, "points": 4, "rubric": ITEMS}).rubric) == 3
