"""The `bounds` kind: both ends of an interval, each in a field of its own and worth half of the points."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field

from grader.questions import (
    FIELD,
    AnswerKey,
    Example,
    Fields,
    Finding,
    InvalidAnswer,
    NumberKey,
    Question,
    QuestionKind,
    Reveal,
    Status,
    Verdict,
    Verify,
    json_or_text,
    verdict_of,
)

ENDS = ("low", "high")


class End(BaseModel):
    """One end: a number, right within the absolute `tol`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    answer: float
    tol: float = Field(gt=0)
    verify: Verify | None = None


class BoundsQuestion(Question):
    """An interval."""

    kind: Literal["bounds"]
    low: End
    high: End
    reveal: Reveal | None = None


class Interval(NamedTuple):
    """An answer that was read."""

    low: float
    high: float


class Bounds(QuestionKind[BoundsQuestion, Interval]):
    """Two numbers, compared one by one."""

    question = BoundsQuestion

    def heading(self, question: BoundsQuestion) -> str:
        """Returns what to do."""
        return "Give an interval"

    def reveal(self, question: BoundsQuestion) -> Reveal | None:
        """Returns what the author allows."""
        return question.reveal

    def answer_keys(self, question: BoundsQuestion) -> Sequence[AnswerKey]:
        """Returns both ends."""
        return [
            NumberKey(
                kind=question.kind, text=question.q, verify=end.verify, place=name, answer=end.answer, tolerance=end.tol
            )
            for name, end in (("low", question.low), ("high", question.high))
        ]

    def from_form(self, question: BoundsQuestion, fields: Fields) -> dict[str, str]:
        """Returns both fields."""
        typed = {name: next(iter(fields.get(f"{FIELD}.{name}", ())), "").strip() for name in ENDS}
        if missing := [name for name, text in typed.items() if not text]:
            raise InvalidAnswer(f"Fill in the {missing[0]} end first.")
        return typed

    def to_form(self, question: BoundsQuestion, answer: Any) -> Fields:
        """Returns both fields."""
        return {
            f"{FIELD}.{name}": [str(answer[name])] for name in ENDS if isinstance(answer, Mapping) and name in answer
        }

    def from_text(self, question: BoundsQuestion, text: str) -> Any:
        """Reads JSON."""
        return json_or_text(text)

    def show(self, question: BoundsQuestion, answer: Any) -> str:
        """Returns `1 to 2`."""
        whole = isinstance(answer, Mapping) and answer.keys() >= {*ENDS}
        return " to ".join(str(answer[name]) for name in ENDS) if whole else super().show(question, answer)

    def read(self, question: BoundsQuestion, answer: Any) -> Interval:
        """Reads an object of two numbers."""
        if not isinstance(answer, Mapping) or answer.keys() != {*ENDS}:
            raise InvalidAnswer('Give both ends, as in {"low": 1, "high": 2}.')
        try:
            return Interval(float(answer["low"]), float(answer["high"]))
        except (TypeError, ValueError) as error:
            raise InvalidAnswer("Give both ends as numbers.") from error

    def describe(self, question: BoundsQuestion, answer: Interval) -> str:
        """Returns the interval."""
        return f"{answer.low:g} to {answer.high:g}"

    def grade(self, question: BoundsQuestion, answer: Interval) -> Verdict:
        """Compares each end."""
        ends = (("low", answer.low, question.low), ("high", answer.high, question.high))
        return verdict_of(tuple(graded(name, value, end, question.points / 2) for name, value, end in ends))

    def example(self) -> Example:
        """Returns a question about a servo."""
        return Example(
            {
                "kind": "bounds",
                "q": "Between which timesteps, in ms, does the servo become unstable?",
                "points": 2,
                "low": {"answer": 20.0123, "tol": 0.0321},
                "high": {"answer": 25.0987, "tol": 0.0321},
                "explain": "The damper shifts both limits.",
            },
            [
                ({"low": 20.01, "high": 25.1}, Status.CORRECT),
                ({"low": "20.01", "high": "24"}, Status.PARTIAL),
                ({"low": 1, "high": 2}, Status.INCORRECT),
                ({"low": 1}, Status.INVALID_ANSWER),
                ("20 to 25", Status.INVALID_ANSWER),
            ],
        )


def graded(name: str, value: float, end: End, points: float) -> Finding:
    """Compares one end."""
    passed = abs(value - end.answer) <= end.tol
    message = f"The {name} end is {'right' if passed else 'not right'}."
    return Finding(
        id=name,
        title=f"The {name} end",
        passed=passed,
        points=points if passed else 0.0,
        max_points=points,
        message=message,
        direction=message,
        measured=value,
        expected=end.answer,
    )
