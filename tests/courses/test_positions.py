"""Where answers lie on the axes of a question: numbers, drawn numbers, and limits that one verdict alone knows."""

import json
from typing import Any

import pytest

from grader.courses.rules.positions import choose_placing, merge_axes, read_positions
from grader.domain.axes import ClassAxis, Position
from grader.questions import Question
from grader.questions.drawing import fill_in_middle
from grader.questions.kinds.choice import ChoiceQuestion
from grader.questions.kinds.number import NumberQuestion
from grader.questions.kinds.numbers import NumbersQuestion


def read_question(kind: type[Question], raw: dict[str, Any]) -> Question:
    return kind.model_validate_json(json.dumps(fill_in_middle({"id": "q", "q": "?", **raw})))


def place(question: Question, verdict: dict[str, Any]) -> list[tuple[ClassAxis, Position | None]]:
    return list(choose_placing(question)(verdict))


def test_the_axis_of_a_number_has_its_tolerance() -> None:
    asked = read_question(NumberQuestion, {"kind": "numeric", "answer": 5, "tol": 0.5, "unit": "ms"})
    [(axis, position)] = place(asked, {"evidence": {"value": 10}})
    assert (axis.right, axis.limit, axis.unit, axis.is_limit) == ((4.5, 5.5), 5, "ms", False)
    assert position == Position(10, 10) and not axis.accepts(position)
    assert [one for _, one in place(asked, {"evidence": {"value": "5"}})] == [None]


def test_a_right_number_of_several_stands_on_its_line() -> None:
    fields = [{"id": name, "label": f"<em>{name}</em>", "answer": 2, "tol": 0.1} for name in ("a", "b")]
    asked = read_question(NumbersQuestion, {"kind": "numbers", "fields": fields, "points": 2})
    placed = place(asked, {"evidence": {"value": [None, 3]}})
    assert [(axis.title, position) for axis, position in placed] == [("a", Position(2, 2)), ("b", Position(3, 3))]
    assert [position for _, position in place(asked, {"evidence": {}})] == [None, None]


def test_drawn_numbers_lie_beside_everybodys_own_right_one() -> None:
    raw = {"kind": "numeric", "q": "{k} N/m?", "draw": {"k": [2, 4]}, "answer": 6, "tol": 0.3}
    asked = read_question(NumberQuestion, raw)
    findings = [{"id": "number", "passed": False, "measured": 9.0, "expected": 4.5}]
    [(axis, position)] = place(asked, {"findings": findings})
    assert axis.right == pytest.approx((0.95, 1.05)) and axis.limit == 1
    assert position == Position(2, 2, False) and not axis.accepts(position)
    own = [{"id": "number", "passed": True, "measured": 4.6, "expected": 4.5}]  # right for this learner alone
    [(axis, position)] = place(asked, {"findings": own})
    assert position is not None and axis.accepts(position)
    assert place(asked, {}) == place(asked, {"findings": [{"id": "number", "measured": "9"}]}) == []


def test_options_have_no_axis() -> None:
    asked = read_question(ChoiceQuestion, {"kind": "mcq", "options": ["a", "b"], "answer": 1})
    assert place(asked, {"evidence": {"option": 1}}) == []


def test_a_limit_that_one_verdict_knows_is_known() -> None:
    unknown, known = ClassAxis("a", "", "ms"), ClassAxis("a", "", "ms", (1, 2))
    assert merge_axes([[unknown], [known], [unknown]]) == [known]
    assert read_positions([(known, None), (ClassAxis("b", ""), Position(1, 1))]) == {"b": Position(1, 1)}
