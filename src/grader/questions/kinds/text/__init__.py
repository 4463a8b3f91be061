"""`open`: write a text, which an instructor reads and grades."""

from collections.abc import Sequence
from typing import Any, Literal

from grader.domain.rubric import Rubric
from grader.domain.verdict import Finding, Status, Verdict
from grader.errors import InvalidAnswer
from grader.questions.kind import Example, QuestionKind
from grader.questions.question import Question

CHARACTERS_MAX = 20_000
"""The longest answer."""

WAITS = "An instructor will read this answer and grade it."


class TextQuestion(Question):
    """A text that an instructor reviews; `reference` is a model answer."""

    kind: Literal["open"]
    reference: str | None = None
    rubric: Rubric = ()


class Text(QuestionKind[TextQuestion, str]):
    """A text in the learner's own words."""

    question = TextQuestion
    is_prose = True

    def rubric(self, question: TextQuestion) -> Rubric:
        """Returns that of the question."""
        return question.rubric

    def reference(self, question: TextQuestion) -> str | None:
        """Returns that of the question."""
        return question.reference

    def heading(self, question: TextQuestion) -> str:
        """Returns what to do."""
        return "In your own words"

    def sample_answers(self, question: TextQuestion) -> Sequence[str]:
        """Returns a text, which a person grades."""
        return ["An answer in a sentence."]

    def read(self, question: TextQuestion, answer: Any) -> str:
        """Reads a text that is neither empty nor too long."""
        if not isinstance(answer, str):
            raise InvalidAnswer("The answer must be a text: write a few sentences.")
        text = answer.strip()
        if not text:
            raise InvalidAnswer("The answer is empty: write a few sentences.")
        if len(text) > CHARACTERS_MAX:
            raise InvalidAnswer(f"The answer has {len(text)} characters: shorten it to at most {CHARACTERS_MAX}.")
        if "\0" in text or any("\ud800" <= c <= "\udfff" for c in text):
            raise InvalidAnswer("The answer contains characters that are not text: remove them and send it again.")
        return text

    def describe(self, question: TextQuestion, answer: str) -> str:
        """Returns how many words there are."""
        words = len(answer.split())
        return f"a text of {words} {'word' if words == 1 else 'words'}"

    def grade(self, question: TextQuestion, answer: str) -> Verdict:
        """Leaves the answer to a person."""
        finding = Finding(
            id="text", title="Your text", passed=None, points=0.0, max_points=question.points, message=WAITS,
            direction=WAITS
        )  # fmt: skip
        return Verdict(status=Status.NEEDS_REVIEW, points=0.0, max_points=question.points, findings=(finding,))

    def example(self) -> Example:
        """Returns a question about energy."""
        return Example(
            {
                "kind": "open",
                "q": "Why does the energy of an undamped pendulum grow under explicit Euler?",
                "points": 2,
                "reference": "Each step leaves the circle of constant energy along its tangent.",
                "rubric": [
                    {"id": "tangent", "title": "Says that a step follows the tangent", "points": 1},
                    {"id": "grows", "title": "Concludes that each step gains energy", "points": 1},
                ],
            },
            [("A step along the tangent ends farther out.", Status.NEEDS_REVIEW),
             ("  ", Status.INVALID_ANSWER), (7, Status.INVALID_ANSWER)],
        )  # fmt: skip
