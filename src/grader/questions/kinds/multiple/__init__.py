"""`multiple`: choose all right ones of several options."""

from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

from grader.domain.pages.markup import quoted
from grader.domain.plugins import Remark
from grader.domain.verdict import Finding, Status, Verdict, format_points, verdict_of
from grader.errors import InvalidAnswer
from grader.questions.kind import FIELD, Example, Fields, Option, QuestionKind
from grader.questions.kinds.choice.options import DIGITS_MAX, option_text, read_choice, remark_options
from grader.questions.parts import find_place, follow_texts, json_or_text
from grader.questions.question import OptionIndex, Options, Question, Whys

NOTHING_CHOSEN = "Choose at least one option first."
EVERYTHING = "You chose every option, and not all are right: choose those that you can give a reason for."
NO_OPTION = "nothing"
"""How an answer without a choice is described."""


def _each_once(answer: tuple[int, ...]) -> tuple[int, ...]:
    if len(set(answer)) < len(answer):
        raise PydanticCustomError("repeated", "an option is there twice: name each right one once")
    return answer


class MultipleQuestion(Question):
    """Several right options; `answer` has their 0-based indices. Each option may have a sentence of its own in `whys`.
    Points are the share of the right options that are chosen, less as much for every wrong one, and never below 0."""

    kind: Literal["multiple"]
    options: Options
    answer: Annotated[tuple[OptionIndex, ...], Field(min_length=1), AfterValidator(_each_once)]
    whys: Whys = ()


class Multiple(QuestionKind[MultipleQuestion, tuple[int, ...]]):
    """A choice of several options: an answer is read as their indices, in rising order."""

    question = MultipleQuestion

    def heading(self, question: MultipleQuestion) -> str:
        """Returns what to do."""
        return "Choose all that are right"

    def warnings(self, question: MultipleQuestion) -> Iterator[Remark]:
        """Yields remarks on the options, and on points for choosing them all."""
        yield from remark_options(question.options, question.whys)
        if len(question.answer) < len(question.options) < 2 * len(question.answer):
            share = (2 * len(question.answer) - len(question.options)) / len(question.answer)
            earned = format_points(share * question.points)
            yield Remark("options", f"choosing every option earns {earned}: give as many wrong ones as right ones")

    def sample_answers(self, question: MultipleQuestion) -> Sequence[list[int]]:
        """Returns the right options, those that are wrong, one alone, and all of them."""
        every = list(range(len(question.options)))
        wrong = [index for index in every if index not in question.answer]
        return [sorted(question.answer), *([wrong] if wrong else []), [min(question.answer)], every]

    def view(self, question: MultipleQuestion) -> dict[str, Any]:
        """Returns the options."""
        return {"options": list(question.options)}

    def from_form(self, question: MultipleQuestion, fields: Fields) -> list[int | str]:
        """Returns the indices of the checked boxes. Raises InvalidAnswer where none is checked."""
        checked = fields.get(FIELD, ())
        if not checked:
            raise InvalidAnswer(NOTHING_CHOSEN)
        return [int(box) if box.isascii() and box.isdigit() and len(box) <= DIGITS_MAX else box for box in checked]

    def to_form(self, question: MultipleQuestion, answer: Any) -> Fields:
        """Returns the values of the checked boxes."""
        try:
            return {FIELD: [str(index) for index in self.read(question, answer)]}
        except InvalidAnswer:
            return {}

    def from_text(self, question: MultipleQuestion, text: str) -> Any:
        """Returns a JSON list."""
        return json_or_text(text)

    def show(self, question: MultipleQuestion, answer: Any) -> str:
        """Returns the words of the options."""
        try:
            return self.describe(question, self.read(question, answer))
        except InvalidAnswer:
            return super().show(question, answer)

    def read(self, question: MultipleQuestion, answer: Any) -> tuple[int, ...]:
        """Reads a list of indices, of their digits, or of whole texts of options."""
        if not isinstance(answer, list):
            last = len(question.options) - 1
            raise InvalidAnswer(f"The answer must be a list of options, such as [0, 1]: name each from 0 to {last}.")
        twice = "An option is chosen twice: name each option once."
        if len(answer) > len(question.options):
            raise InvalidAnswer(twice)
        chosen = {read_choice(question.options, choice) for choice in answer}
        if len(chosen) < len(answer):
            raise InvalidAnswer(twice)
        return tuple(sorted(chosen))

    def carry_over(self, earlier: MultipleQuestion, question: MultipleQuestion, answer: Any) -> list[int]:
        """Returns the indices of the options with the same words."""
        moved = follow_texts(earlier.options, question.options)
        return [find_place(moved, index) for index in self.read(earlier, answer)]

    def describe(self, question: MultipleQuestion, answer: tuple[int, ...]) -> str:
        """Returns the words of the options."""
        return "; ".join(option_text(question.options[index]) for index in answer) or NO_OPTION

    def grade(self, question: MultipleQuestion, answer: tuple[int, ...]) -> Verdict:
        """Gives a share for each right option, and takes it away again for each wrong one."""
        is_everything = len(answer) == len(question.options) > len(question.answer)
        return verdict_of(
            tuple(_findings(question, answer)),
            diagnosis=EVERYTHING if is_everything else None,
            evidence={"option": list(answer)},
        )

    def options(self, question: MultipleQuestion) -> Sequence[Option]:
        """Returns the options."""
        return [Option(option_text(text), index in question.answer) for index, text in enumerate(question.options)]

    def example(self) -> Example:
        """Returns a question about integrators."""
        return Example(
            {
                "kind": "multiple",
                "q": "Which integrators of MuJoCo take the damping of a servo, its kv, implicitly?",
                "options": ["Euler", "RK4", "implicit", "implicitfast"],
                "answer": [2, 3],
                "whys": ["It takes the damping of joints alone.", "It evaluates every stage explicitly.",
                         "It takes all derivatives of velocity.", "It leaves out those of Coriolis forces alone."],
                "explain": "Euler takes the damping of joints implicitly, unless <code>eulerdamp</code> is disabled.",
                "points": 2,
            },
            [([2, 3], Status.CORRECT), ([3], Status.PARTIAL), ([0, 2, 3], Status.PARTIAL),
             ([1], Status.INCORRECT), ([0, 1, 2, 3], Status.INCORRECT), ([0, 0], Status.INVALID_ANSWER),
             ([4], Status.INVALID_ANSWER), ([True], Status.INVALID_ANSWER), (2, Status.INVALID_ANSWER)],
        )  # fmt: skip


def _findings(question: MultipleQuestion, answer: tuple[int, ...]) -> Iterator[Finding]:
    """Yields a finding for each chosen option, and one for all right options that are not chosen. Wrong options take
    away at most the points of the right ones."""
    share = question.points / len(question.answer)
    right = [index for index in answer if index in question.answer]
    wrong = len(answer) - len(right)
    deduction = -share * min(len(right), wrong) / wrong if right and wrong else 0.0
    for index in answer:
        passed = index in question.answer
        words = option_text(question.options[index])
        why = option_text(question.whys[index]) if question.whys else ""
        message = f"{quoted(words)} is {'right' if passed else 'not right'}. {why}".strip()
        yield Finding(
            id=f"option-{index}", title=f"Option {index + 1}", passed=passed, points=share if passed else deduction,
            max_points=share if passed else 0.0, message=message, direction=message, measured=words
        )  # fmt: skip
    if missing := [index for index in question.answer if index not in answer]:
        message = "At least one right option is not chosen."
        yield Finding(
            id="missing", title="Not chosen", passed=False, points=0.0, max_points=share * len(missing),
            message=message, direction=message,
            expected="; ".join(option_text(question.options[index]) for index in missing)
        )  # fmt: skip
