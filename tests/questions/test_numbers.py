"""Several numbers: each is read, graded and diagnosed as the number of a `numeric` question."""

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.certify.keys import certify_quizzes
from grader.courses.rules.policy import limit_feedback
from grader.domain.verdict import Status
from grader.errors import ContentError, InvalidAnswer
from grader.library import load
from grader.questions import grade_answer, kind_of, parse_question, question_view, read_answer
from grader.questions.kinds.number import NumberQuestion
from grader.questions.kinds.numbers import Numbers, NumbersQuestion
from support.content import PASSED

KIND = Numbers()
CONTENT = Path(__file__).parent / "content"
PERIOD = {"id": "T", "label": "Period <em>T</em>", "answer": 5, "tol": 0.05, "unit": "ms"}
MASS = {"id": "m", "label": "Mass", "answer": 2, "unit": "kg", "points": 2}


def asked(*fields: dict[str, Any], **more: Any) -> NumbersQuestion:
    raw = {"id": "n", "kind": "numbers", "q": "How much?", "fields": list(fields or (PERIOD, MASS)), **more}
    question = parse_question(raw)
    assert isinstance(question, NumbersQuestion)
    return question


def as_numeric(field: dict[str, Any]) -> Any:
    own = {name: value for name, value in field.items() if name not in ("id", "label")}
    return parse_question({"id": field["id"], "kind": "numeric", "q": field["label"], **own})


typed = st.one_of(
    st.floats(-1e6, 1e6), st.sampled_from(["5 ms", "0.005 s", "5", "-5", "2 kg", "2000 g", "10", "0.5", "h", "", "2,5"])
)


@given(st.tuples(typed, typed))
def test_each_field_is_graded_as_a_numeric_question(values: tuple[Any, Any]) -> None:
    question, singles = asked(), [as_numeric(PERIOD), as_numeric(MASS)]
    alone = [grade_answer(single, value) for single, value in zip(singles, values, strict=True)]
    verdict = grade_answer(question, {"T": values[0], "m": values[1]})
    if any(one.status is Status.INVALID_ANSWER for one in alone):
        assert verdict.status is Status.INVALID_ANSWER
        assert (verdict.diagnosis or "").startswith(("Period T: ", "Mass: "))
        return
    assert [finding.passed for finding in verdict.findings] == [one.findings[0].passed for one in alone]
    assert [finding.points for finding in verdict.findings] == [one.points for one in alone]
    assert [finding.direction for finding in verdict.findings] == [one.findings[0].direction for one in alone]
    assert verdict.read_as == f"Period T: {alone[0].read_as}; Mass: {alone[1].read_as}"
    for one, single in zip(verdict.findings, alone, strict=True):
        slip = (single.diagnosis or "").removeprefix("Your number")
        assert slip in f"{one.message} {verdict.diagnosis}"
    assert verdict.evidence["value"] == [None if finding.passed else finding.measured for finding in verdict.findings]


def test_the_points_of_the_question_are_those_of_its_fields() -> None:
    assert asked().points == 3
    assert asked(points=3).points == 3
    assert grade_answer(asked(), {"T": 5, "m": 9}).points == 1
    assert [why for _, why in KIND.faults(asked(points=3))] == []
    assert [(key, "add up to 3" in why) for key, why in KIND.faults(asked(points=4))] == [("points", True)]


def test_a_slip_that_explains_every_wrong_number_is_the_diagnosis() -> None:
    both = grade_answer(asked(), {"T": -5, "m": -2})
    assert both.diagnosis == (
        "Period T and Mass: each number has the wrong sign: check whether it can be negative at all, and "
        "which direction counts as positive."
    )
    one = grade_answer(asked(), {"T": 5, "m": "2 g"})
    assert (one.diagnosis or "").startswith("Mass: your number would be right in kilograms")
    two = grade_answer(asked(), {"T": -5, "m": 4})
    assert two.diagnosis is None
    assert "wrong sign" in two.findings[0].message
    assert "factor of two" in two.findings[1].message


def test_numbers_that_stand_in_each_others_fields_are_told_so() -> None:
    said = "Period T and Mass are exchanged: each number is right for the other."
    assert grade_answer(asked(), {"T": 2, "m": 5}).diagnosis == said
    assert grade_answer(asked(), {"T": "2 ms", "m": 5}).diagnosis != said, "2 ms are no 2 kg"
    assert grade_answer(asked(), {"T": 2, "m": 6}).diagnosis != said


def test_the_direction_alone_tells_no_slip_and_no_size() -> None:
    told = [
        limit_feedback(grade_answer(asked(reveal="direction"), {"T": value, "m": -2}), "direction")
        for value in (50, 51.7)
    ]
    assert [one.findings[0].message for one in told] == ["50 ms is too high.", "51.7 ms is too high."]
    assert all(one.diagnosis is None and one.findings[0].expected is None for one in told)
    assert kind_of(asked(reveal="value")).reveal(asked(reveal="value")) == "value"


@pytest.mark.parametrize(("answer", "why"), [
    ({"T": "5 kg", "m": ""}, 'Period T: "kg"'), ({"T": "5"}, "Mass: type a number here as well"),
    ({"T": "5", "m": None}, "Mass: type"), ({"T": "5", "m": " "}, "Mass: type"), ({"T": True, "m": 1}, "Period T: "),
    ({"T": 5, "m": 2, "x": 1}, '"x", which is not asked: give T, m'), ([5, 2], "must be an object"),
    ("5 ms", "must be an object"), (5, "must"),
])  # fmt: skip
def test_what_cannot_be_read_names_the_field(answer: Any, why: str) -> None:
    with pytest.raises(InvalidAnswer, match=why):
        read_answer(asked(), answer)


@given(st.fixed_dictionaries({"T": st.floats(-1e9, 1e9) | st.just("5 ms"), "m": st.integers(-9, 9) | st.just("2 kg")}))
def test_a_form_reads_back_as_the_same_numbers(answer: dict[str, Any]) -> None:
    question = asked()
    again = KIND.from_form(question, KIND.to_form(question, answer))
    assert KIND.describe(question, KIND.read(question, again)) == KIND.describe(question, KIND.read(question, answer))


def test_what_was_typed_stays_in_every_field_and_an_empty_form_is_asked_for_something() -> None:
    question = asked()
    assert KIND.to_form(question, {"T": "5 kg", "m": "", "gone": 1}) == {"answer.T": ["5 kg"], "answer.m": [""]}
    assert KIND.from_form(question, {"answer.T": ["5 kg"]}) == {"T": "5 kg", "m": ""}
    with pytest.raises(InvalidAnswer, match="Write an answer first"):
        KIND.from_form(question, {"answer.T": [" "]})
    assert KIND.show(question, {"T": "5 ms", "m": 2}) == "Period T: 5 ms; Mass: 2"


def test_a_learner_sees_no_number_and_no_tolerance() -> None:
    assert question_view(asked())["fields"] == [
        {"id": "T", "label": "Period <em>T</em>", "unit": "ms", "points": 1},
        {"id": "m", "label": "Mass", "unit": "kg", "points": 2},
    ]


def quiz_of(folder: Path, question: dict[str, Any]) -> Path:
    (folder / "quizzes").mkdir()
    (folder / "quizzes/q.json").write_text(json.dumps({"id": "q", "title": "Q", "questions": [question]}))
    return folder


@pytest.mark.parametrize(("fields", "more", "key"), [
    ([PERIOD, PERIOD], {}, "q1.fields"),
    ([PERIOD, {**MASS, "tol": -1}], {}, "q1.fields.1.tol"),
    ([{**PERIOD, "labl": "x"}], {}, "q1.fields.0.labl"),
    ([PERIOD, MASS], {"points": 1}, "q1.points"),
    ([PERIOD, MASS], {"verify": {"by": "expression", "expr": "5"}}, "q1.verify"),
    ([{**PERIOD, "verify": {"by": "expression", "expr": "6"}}], {}, None),
    ([], {}, "q1.fields"),
])  # fmt: skip
def test_faults_of_authors_name_the_field(tmp_path: Path, fields: Any, more: dict[str, Any], key: str | None) -> None:
    folder = quiz_of(tmp_path, {"kind": "numbers", "q": "How much?", "fields": fields, **more})
    if key is None:
        (certified,) = certify_quizzes(load(folder), ["q"])
        assert certified.certificate is not None
        assert (certified.certificate.ok, certified.certificate.key) == (False, "fields.0.answer")
        return
    with pytest.raises(ContentError) as raised:
        load(folder)
    assert {fault.key for fault in raised.value.faults} == {key}


def test_remarks_name_the_field(tmp_path: Path) -> None:
    fields = [{**PERIOD, "unit": "steps"}, {"id": "z", "label": "Zero of $x", "answer": 0}]
    library = load(quiz_of(tmp_path, {"kind": "numbers", "q": "How much?", "fields": fields}))
    assert {warning.key for warning in library.warnings} == {"q1.fields.0.unit", "q1.fields.1.tol", "q1.fields.1.label"}


@pytest.mark.slow
def test_every_field_has_a_key_of_its_own_that_simulation_confirms() -> None:
    library = load(CONTENT, passed=PASSED)
    certified = list(certify_quizzes(library, library.quizzes))
    assert [(one.key.place, one.certificate is not None and one.certificate.ok) for one in certified] == [
        ("fields.0", True), ("fields.1", True),
    ]  # fmt: skip


HALF = [
    {"id": name, "label": name, "answer": value, "tol": 0.01} for name, value in (("w", 0.6), ("x", 0), ("z", -0.8))
]


@pytest.mark.parametrize(
    ("given", "status", "points"),
    [
        ((0.6, 0, -0.8), Status.CORRECT, 3),
        ((-0.6, 0, 0.8), Status.CORRECT, 3),
        ((-0.6, 0, -0.8), Status.PARTIAL, 2),  # one sign alone is another rotation
        ((0.8, 0, 0.6), Status.PARTIAL, 1),
    ],
)
def test_all_numbers_together_may_have_either_sign(given: tuple[float, ...], status: Status, points: float) -> None:
    answer = dict(zip("wxz", given, strict=True))
    verdict = grade_answer(asked(*HALF, either_sign=True), answer)
    assert (verdict.status, verdict.points) == (status, points)
    turned = tuple(-value for value in given)
    assert grade_answer(asked(*HALF, either_sign=True), dict(zip("wxz", turned, strict=True))).points == points
    assert grade_answer(asked(*HALF), {"w": -0.6, "x": 0, "z": 0.8}).status is Status.PARTIAL


def quaternion(*values: float, **more: Any) -> NumbersQuestion:
    fields = [
        {"id": name, "label": name, "answer": value, "tol": 0.01} for name, value in zip("wxyz", values, strict=True)
    ]
    return asked(*fields, **more)


@pytest.mark.parametrize("either_sign", [False, True])
def test_numbers_that_all_stand_one_field_further_are_told_so(either_sign: bool) -> None:
    """A quaternion with w last, as SciPy has it, and with w after z where it is asked last."""
    turn = quaternion(0.924, 0, 0, 0.383, either_sign=either_sign)
    last = grade_answer(turn, {"w": 0, "x": 0, "y": 0.383, "z": 0.924})
    assert last.diagnosis == "Each number is that of the next field, and the last one that of w, which is asked first."
    first = grade_answer(quaternion(0, 0, 0.383, 0.924), {"w": 0.924, "x": 0, "y": 0, "z": 0.383})
    assert first.diagnosis == (
        "Each number is that of the field before, and the first one that of z, which is asked last."
    )
    assert grade_answer(turn, {"w": 0.924, "x": 0, "y": 0, "z": 0.383}).diagnosis is None
    negative = grade_answer(turn, {"w": 0, "x": 0, "y": -0.383, "z": -0.924})
    assert (negative.diagnosis == last.diagnosis) is either_sign


def test_a_tolerance_that_takes_almost_anything_is_a_remark() -> None:
    for tolerance, told in ((0.4, None), (1.0, "everything from 0.2 to 2.2 is right"), (1.2, "0 is right too")):
        question = NumberQuestion(id="q", kind="numeric", q="How far?", answer=1.2, tol=tolerance)
        remarks = [remark.why for remark in kind_of(question).warnings(question) if remark.key == "tol"]
        assert (told is None and not remarks) or (told is not None and told in remarks[0])
    zero = NumberQuestion(id="q", kind="numeric", q="How far?", answer=0, tol=0.1)
    assert list(kind_of(zero).warnings(zero)) == []
