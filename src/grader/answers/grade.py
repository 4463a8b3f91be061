"""Read and grade the answers that need no jail: a choice, a number, a text."""

from typing import Any, assert_never

from grader.answers.choices import option_text, read_choice
from grader.answers.quantities import Quantity, read_quantity
from grader.answers.slips import find_slip, is_right, size_of
from grader.domain.quiz import (
    ChoiceQuestion,
    CodeQuestion,
    NumericQuestion,
    OpenQuestion,
    PredictQuestion,
    Question,
)
from grader.domain.verdict import Finding, Status, Verdict, verdict_of
from grader.errors import InvalidAnswer

TEXT_CHARACTERS_MAX = 20_000
"""The longest answer to an open question."""

WAITS = "An instructor will read this answer and grade it."


def read_answer(question: Question, answer: Any) -> str:
    """Return the answer as it is understood, for the learner to confirm.

    Raises InvalidAnswer with one sentence: why the answer cannot be read, and what would be readable.
    """
    match question:
        case ChoiceQuestion() | PredictQuestion():
            return option_text(question.options[read_choice(question, answer)])
        case NumericQuestion():
            return str(read_quantity(answer, question.unit))
        case OpenQuestion():
            words = len(read_text(answer).split())
            return f"a text of {words} {'word' if words == 1 else 'words'}"
        case CodeQuestion():
            raise InvalidAnswer("A script is graded by running it, not as a typed answer.")
        case _:
            assert_never(question)


def grade_answer(question: Question, answer: Any) -> Verdict:
    """Grade any JSON value; one that cannot be read gets `invalid_answer` and the reason.

    Of a wrong answer only `explain`, and `expected` of a number, may contain the right one.
    """
    try:
        read_as = read_answer(question, answer)
    except InvalidAnswer as error:
        return Verdict(status=Status.INVALID_ANSWER, points=0.0, max_points=question.points, diagnosis=str(error))
    match question:
        case ChoiceQuestion() | PredictQuestion():
            verdict = _grade_choice(question, read_choice(question, answer), read_as)
        case NumericQuestion():
            verdict = _grade_number(question, read_quantity(answer, question.unit))
        case _:
            verdict = _for_review(question)
    return verdict.model_copy(update={"read_as": read_as, "explain": question.explain})


def read_text(answer: Any) -> str:
    """Read the text of an answer to an open question. Raises InvalidAnswer."""
    if not isinstance(answer, str):
        raise InvalidAnswer("The answer must be a text: write a few sentences.")
    text = answer.strip()
    if not text:
        raise InvalidAnswer("The answer is empty: write a few sentences.")
    if len(text) > TEXT_CHARACTERS_MAX:
        raise InvalidAnswer(f"The answer has {len(text)} characters: shorten it to at most {TEXT_CHARACTERS_MAX}.")
    if "\0" in text or any("\ud800" <= c <= "\udfff" for c in text):
        raise InvalidAnswer("The answer contains characters that are not text: remove them and send it again.")
    return text


def _grade_choice(question: ChoiceQuestion | PredictQuestion, index: int, read_as: str) -> Verdict:
    passed = index == question.answer
    why = option_text(question.whys[index]) if question.whys else ""
    message = why or ("This option is right." if passed else "This option is not right.")
    finding = _finding(question, "choice", "Your choice", passed=passed, message=message, measured=read_as)
    return verdict_of((finding,), evidence={"option": index})


def _grade_number(question: NumericQuestion, given: Quantity) -> Verdict:
    evidence = {"value": given.value, "unit": question.unit}
    if is_right(given.value, question):
        finding = _finding(
            question, "number", "Your number", passed=True, message=f"{given} is right.", measured=given.value
        )
        return verdict_of((finding,), evidence=evidence)
    direction, size = f"{given} is too {'high' if given.value > question.answer else 'low'}", size_of(given, question)
    message = f"{direction}{', ' if size else ''}{size}."
    finding = _finding(question, "number", "Your number", passed=False, message=message, measured=given.value)
    finding = finding.model_copy(update={"direction": f"{direction}.", "expected": question.answer})
    return verdict_of((finding,), diagnosis=find_slip(given, question), evidence=evidence)


def _for_review(question: Question) -> Verdict:
    finding = Finding(
        id="text",
        title="Your text",
        passed=None,
        points=0.0,
        max_points=question.points,
        message=WAITS,
        direction=WAITS,
    )
    return Verdict(status=Status.NEEDS_REVIEW, points=0.0, max_points=question.points, findings=(finding,))


def _finding(question: Question, name: str, title: str, *, passed: bool, message: str, measured: Any) -> Finding:
    """Make the one finding that carries all points; `expected` is filled in only where the answer is right."""
    expected = None
    if passed:
        expected = question.answer if isinstance(question, NumericQuestion) else measured
    return Finding(
        id=name,
        title=title,
        passed=passed,
        points=question.points if passed else 0.0,
        max_points=question.points,
        message=message,
        direction=message,
        measured=measured,
        expected=expected,
    )
