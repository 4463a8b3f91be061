"""`numeric`: type a number, with or without a unit."""

from collections.abc import Iterator, Sequence
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from grader.domain.lab import LabConfig
from grader.domain.numbers import NotNegative, Real
from grader.domain.plugins import Remark
from grader.domain.verdict import Status, Verdict, verdict_of
from grader.questions.answer_keys import NumberKey
from grader.questions.drawing import Drawable
from grader.questions.kind import CountedNumber, Example, QuestionKind
from grader.questions.kinds.number.quantities import Quantity, read_quantity
from grader.questions.kinds.number.slips import grade_number
from grader.questions.kinds.number.units import known_unit, suggest_unit
from grader.questions.question import Question, Reveal


class Target(BaseModel):
    """A number in `unit`, correct within `tol` (absolute, in that unit; default 2 % of |answer|)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    answer: Real = Field(strict=True)
    tol: NotNegative | None = Field(default=None, strict=True)
    unit: str | None = None

    @property
    def tolerance(self) -> float:
        """Absolute, in the question's unit. Source: the course's own quiz widget."""
        return self.tol if self.tol is not None else 0.02 * abs(self.answer)


class NumberQuestion(Target, Drawable, Question):
    """A question for one number; `sim` is a simulation that the learner sees after the answer."""

    kind: Literal["numeric"]
    reveal: Reveal | None = None
    sim: LabConfig | None = None

    @property
    def key(self) -> NumberKey:
        """The number that is right, and within what."""
        return NumberKey(
            kind=self.kind, text=self.q, explain=self.explain or "", verify=self.verify, lab=self.sim,
            answer=self.answer, tolerance=self.tolerance, unit=self.unit
        )  # fmt: skip


WIDE = 0.4
"""The share of an answer from which on a tolerance is remarked: half of the answer is nearly right then."""


def target_warnings(target: Target) -> Iterator[Remark]:
    """Yields remarks on a unit and a tolerance that accept fewer answers than their author may expect, or more."""
    if target.unit and known_unit(target.unit) is None:
        cure = f"correct it{suggest_unit(target.unit)}, or keep it where it counts things"
        yield Remark("unit", f"{target.unit!r} is not a known unit, so that nothing is converted: {cure}")
    if target.tolerance == 0 and target.tol is None:
        yield Remark("tol", "2 % of 0 is 0: give tol, or only an exact 0 is right")
    if why := explain_wide(target.answer, target.tolerance):
        yield Remark("tol", why)


def explain_wide(answer: float, tolerance: float) -> str | None:
    """Returns why a tolerance accepts too much about an answer; None where it does not, or the answer is 0."""
    if answer and tolerance >= abs(answer):
        return "it is as large as the answer, so that 0 is right too: give a smaller one"
    if answer and tolerance > abs(answer) * WIDE:
        low, high = answer - tolerance, answer + tolerance
        return f"it is wide: everything from {low:.4g} to {high:.4g} is right; give a smaller one"
    return None


def list_typed_numbers(target: Target) -> list[str]:
    """Returns what people might type: the right number, twice and a tenth of it, its negative, and other spellings."""
    unit = f" {target.unit}" if target.unit else ""
    right = f"{target.answer:.10g}"
    wrong = target.answer * 2 if target.answer else 1 + target.tolerance
    edge = target.answer + 0.99 * target.tolerance
    comma = right.replace(".", ",")
    numbers = (right, f"{wrong:.6g}", f"x = {right}", comma, f"about {right}", f"{edge:.10g}", f"{-target.answer:.10g}")
    return list(dict.fromkeys([*(f"{number}{unit}" for number in numbers), right]))


class Number(QuestionKind[NumberQuestion, Quantity]):
    """A typed number."""

    question = NumberQuestion

    def warnings(self, question: NumberQuestion) -> Iterator[Remark]:
        """Yields units and tolerances that accept fewer answers than their author may expect, or more."""
        return target_warnings(question)

    def sample_answers(self, question: NumberQuestion) -> Sequence[str]:
        """Returns what people might type."""
        return list_typed_numbers(question)

    def answer_keys(self, question: NumberQuestion) -> Sequence[NumberKey]:
        """Returns the number."""
        return [question.key]

    def reveal(self, question: NumberQuestion) -> Reveal | None:
        """Returns what the author allows."""
        return question.reveal

    def heading(self, question: NumberQuestion) -> str:
        """Returns what to do."""
        return "Give a number"

    def view(self, question: NumberQuestion) -> dict[str, Any]:
        """Returns the unit; `has_lab` announces the lab, which is shown after the answer."""
        return {"unit": question.unit, "has_lab": question.sim is not None}

    def lab(self, question: NumberQuestion) -> LabConfig | None:
        """Returns the simulation."""
        return question.sim

    def read(self, question: NumberQuestion, answer: Any) -> Quantity:
        """Reads a JSON number or a text, in the unit of the question."""
        return read_quantity(answer, question.unit, question.q)

    def describe(self, question: NumberQuestion, answer: Quantity) -> str:
        """Returns the number in the unit of the question, and what was left out of a typed text."""
        return answer.echo

    def grade(self, question: NumberQuestion, answer: Quantity) -> Verdict:
        """Gives all points for a number within the tolerance; names the slip behind a wrong one."""
        finding, slip = grade_number(question.key, answer, question.points)
        return verdict_of((finding,), diagnosis=slip, evidence={"value": answer.value, "unit": question.unit})

    def numbers(self, question: NumberQuestion) -> Sequence[CountedNumber]:
        """Returns the one number; none where every learner has another key."""
        return [] if question.draw else [CountedNumber(question.unit or "", question.tolerance)]

    def example(self) -> Example:
        """Returns a question about a pendulum."""
        return Example(
            {
                "kind": "numeric",
                "q": "A pendulum of 1.234 m swings with a small amplitude. How long is its period?",
                "answer": 2.22845,
                "tol": 0.0123,
                "unit": "s",
                "explain": "$T = 2\\pi\\sqrt{l/g}$",
                "verify": {"by": "expression", "expr": "2 * Math.PI * Math.sqrt(1.234 / 9.81)"},
            },
            [(2.23, Status.CORRECT), ("2230 ms", Status.CORRECT), ("1.1", Status.INCORRECT),
             ("3 kg", Status.INVALID_ANSWER), (None, Status.INVALID_ANSWER)],
        )  # fmt: skip
