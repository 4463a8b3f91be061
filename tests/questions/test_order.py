"""An order of texts: points by neighbours, known mistakes, and a shown order that tells nothing."""

from itertools import pairwise, permutations
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from grader.domain.verdict import Status
from grader.errors import InvalidAnswer
from grader.questions import grade_answer, parse_question, question_view
from grader.questions.kinds.order import REVERSED, ROTATED, Order, OrderQuestion

KIND = Order()
ITEMS = ["position stage", "velocity stage", "actuation", "acceleration", "integration"]


def asked(items: list[str], **more: Any) -> OrderQuestion:
    question = parse_question({"id": "o", "kind": "order", "q": "In which order?", "items": items, **more})
    assert isinstance(question, OrderQuestion)
    return question


def ids_of(question: OrderQuestion, texts: list[str]) -> list[str]:
    ids = {item["text"]: item["id"] for item in question_view(question)["items"]}
    return [ids[text] for text in texts]


texts = st.lists(st.integers(0, 999).map(lambda n: f"stage {n}"), min_size=2, max_size=8, unique=True)


@st.composite
def questions_and_answers(draw: st.DrawFn) -> tuple[OrderQuestion, list[str], list[str]]:
    """A question, the right order and another one as texts."""
    key = draw(texts)
    return asked(key, points=draw(st.floats(0.1, 1000))), key, draw(st.permutations(key))


@given(questions_and_answers())
def test_points_are_the_share_of_right_neighbours(case: tuple[OrderQuestion, list[str], list[str]]) -> None:
    question, key, order = case
    verdict = grade_answer(question, ids_of(question, order))
    share = len({*pairwise(order)} & {*pairwise(key)}) / (len(key) - 1)
    assert verdict.points == pytest.approx(question.points * share, abs=1e-8)
    assert 0 <= verdict.points <= verdict.max_points == pytest.approx(question.points, abs=1e-8)
    assert (verdict.status is Status.CORRECT) == (order == key)


@given(texts, st.data())
def test_what_is_shown_depends_on_the_set_of_texts_alone(key: list[str], data: st.DataObject) -> None:
    other = data.draw(st.permutations(key))
    shown = question_view(asked(key))["items"]
    assert question_view(asked(other, q="Or so?", id="another"))["items"] == shown
    assert [item["id"] for item in shown] == [*"abcdefgh"][: len(key)]


def test_a_finding_tells_items_apart_that_begin_alike() -> None:
    begin = "the solver computes the forces of contacts "
    question = asked(["first", f"{begin}from their distances", f"{begin}from their velocities"])
    findings = grade_answer(question, ids_of(question, list(question.items))).findings
    assert [finding.message for finding in findings] == [
        f'"{begin}from their distances" comes directly after "first".',
        f'"{begin}from their velocities" comes directly after "{begin}from their distances".',
    ]


@given(texts, st.data())
def test_evidence_options_and_ids_of_an_answer_do_not_depend_on_the_key(key: list[str], data: st.DataObject) -> None:
    one, other = asked(key), asked(data.draw(st.permutations(key)))
    answer = ids_of(one, data.draw(st.permutations(key)))
    assert grade_answer(one, answer).evidence == grade_answer(other, answer).evidence
    assert [option.text for option in KIND.options(one)] == [option.text for option in KIND.options(other)]


@given(questions_and_answers())
def test_a_form_reads_back_as_the_same_order(case: tuple[OrderQuestion, list[str], list[str]]) -> None:
    question, _, order = case
    answer = ids_of(question, order)
    assert KIND.from_form(question, KIND.to_form(question, answer)) == answer


@given(questions_and_answers())
def test_the_options_that_are_counted_are_the_neighbours(case: tuple[OrderQuestion, list[str], list[str]]) -> None:
    question, key, order = case
    options = KIND.options(question)
    counted = [options[index] for index in grade_answer(question, ids_of(question, order)).evidence["option"]]
    assert [option.text for option in counted] == [f"{one}, then {two}" for one, two in pairwise(order)]
    assert [option.is_right for option in counted] == [pair in {*pairwise(key)} for pair in pairwise(order)]


def test_a_right_order_that_is_shown_is_remarked() -> None:
    items = ["position", "velocity", "acceleration", "integration"]
    shown = [item["text"] for item in KIND.view(asked(items))["items"]]
    remarked = [order for order in permutations(items) if [*KIND.warnings(asked(list(order)))]]
    assert remarked == [tuple(shown)]


def test_known_mistakes_are_named() -> None:
    question = asked(ITEMS)
    for order, mistake in (
        (ITEMS, None),
        (ITEMS[::-1], REVERSED),
        (ITEMS[2:] + ITEMS[:2], ROTATED),
        ([ITEMS[1], ITEMS[0], *ITEMS[2:]], None),
    ):
        assert grade_answer(question, ids_of(question, order)).diagnosis == mistake


def test_only_expected_tells_what_follows() -> None:
    question = asked(ITEMS)
    verdict = grade_answer(question, ids_of(question, [ITEMS[0], ITEMS[2], ITEMS[4], ITEMS[1], ITEMS[3]]))
    assert verdict.points == 0
    assert [finding.expected for finding in verdict.findings] == [
        ITEMS[1],
        ITEMS[3],
        f'"{ITEMS[4]}" comes last',
        ITEMS[2],
    ]
    assert verdict.findings[0].message == verdict.findings[0].direction
    assert verdict.findings[0].message == '"actuation" does not come directly after "position stage".'


@pytest.mark.parametrize("answer", [
    [], ["a"], ["a", "b", "c", "d", "d"], ["a", "b", "c", "d", "z"], ["a", "b", "c", "d", "e", "a"], "abcde", None,
    {"a": 1}, [0, 1, 2, 3, 4], [True, "b", "c", "d", "e"], ["A", "b", "c", "d", "e"], [["a"], "b", "c", "d", "e"],
])  # fmt: skip
def test_what_is_no_order_of_all_items_cannot_be_read(answer: Any) -> None:
    with pytest.raises(InvalidAnswer, match="each once"):
        KIND.read(asked(ITEMS), answer)


@pytest.mark.parametrize(("positions", "why"), [
    ({}, "first"), ({"answer.a": ["1"]}, "no position"),
    ({"answer.a": ["1"], "answer.b": ["1"]}, "taken twice"),
    ({"answer.a": ["6"]}, "no position"), ({"answer.a": ["1²"]}, "no position"),
])  # fmt: skip
def test_positions_that_make_no_order_are_refused(positions: dict[str, list[str]], why: str) -> None:
    with pytest.raises(InvalidAnswer, match=why):
        KIND.from_form(asked(ITEMS), positions)


@pytest.mark.parametrize(
    "items", [["a"], ["a", "a"], ["a", " a "], ["a b", "a  b"], ["a", ""], list(map(str, range(101)))]
)
def test_items_that_cannot_be_told_apart_or_counted_are_refused(items: list[str]) -> None:
    with pytest.raises(ValidationError):
        asked(items)


def test_more_items_than_letters_have_ids_of_two() -> None:
    shown = question_view(asked([f"{n}" for n in range(30)]))["items"]
    assert [item["id"] for item in shown][24:28] == ["y", "z", "aa", "ab"]
    assert len({item["id"] for item in shown}) == 30
