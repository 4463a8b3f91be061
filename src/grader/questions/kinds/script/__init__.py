"""`code`: write a script, which `grader.exercises` runs in the jail and judges by simulating again."""

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from grader.domain.rubric import Rubric
from grader.domain.run import SOURCE_BYTES_MAX, Limits
from grader.domain.verdict import Status, Verdict
from grader.errors import InvalidAnswer, TooLarge, Unprocessable
from grader.questions.kind import Example, Fields, QuestionKind, typed_in
from grader.questions.question import Question, Reveal

NO_SCRIPT = "Load or paste your script first."


class CheckSpec(BaseModel):
    """The kind of an exercise, and its parameters, tolerances and cases."""

    model_config = ConfigDict(frozen=True, extra="allow")

    kind: str

    @property
    def parameters(self) -> Mapping[str, Any]:
        """All keys but `kind`; the kind validates them."""
        return self.model_extra or {}


class ScriptQuestion(Question):
    """An exercise: a script whose function `entry` is called in the jail and judged by an independent simulation."""

    kind: Literal["code"]
    starter: str | None = None
    entry: str = Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")
    check: CheckSpec
    limits: Limits = Limits()
    rubric: Rubric = ()
    reveal: Reveal | None = None


class Script(QuestionKind[ScriptQuestion, str]):
    """A script. Its faults, its trials and its verdict are those of its exercise."""

    question = ScriptQuestion
    is_script = True

    def reveal(self, question: ScriptQuestion) -> Reveal | None:
        """Returns what the author allows."""
        return question.reveal

    def rubric(self, question: ScriptQuestion) -> Rubric:
        """Returns that of the question."""
        return question.rubric

    def heading(self, question: ScriptQuestion) -> str:
        """Returns what it is."""
        return "Exercise"

    def view(self, question: ScriptQuestion) -> dict[str, Any]:
        """Returns the function to write, what a script may use, and whether there is a file to begin with."""
        limits = question.limits.model_dump()
        return {"entry": question.entry, "limits": limits, "has_starter": question.starter is not None}

    def starter(self, question: ScriptQuestion) -> str | None:
        """Returns that of the question."""
        return question.starter

    def from_form(self, question: ScriptQuestion, fields: Fields) -> dict[str, str]:
        """Returns the text of the editor. Raises InvalidAnswer where that is empty."""
        return {"source": typed_in(fields, NO_SCRIPT)}

    def from_text(self, question: ScriptQuestion, text: str) -> dict[str, str]:
        """Returns the text as a script."""
        return {"source": text}

    def show(self, question: ScriptQuestion, answer: Any) -> str:
        """Returns the text of the script."""
        return str(answer.get("source", "")) if isinstance(answer, dict) else super().show(question, answer)

    def read(self, question: ScriptQuestion, answer: Any) -> str:
        """Reads the script of a `{"source": ...}` answer. Also raises TooLarge, and Unprocessable for another shape."""
        if not isinstance(answer, dict) or not isinstance(answer.get("source"), str) or set(answer) - {"source"}:
            raise Unprocessable('The answer to an exercise is {"source": "the text of your script"}.')
        source: str = answer["source"].removeprefix("\ufeff")  # editors put it there, and Python skips it in a file
        size = len(source.encode())
        if size > SOURCE_BYTES_MAX:
            raise TooLarge(f"The script is {size // 1024} KB long; at most {SOURCE_BYTES_MAX // 1024} KB are taken.")
        if not source.strip():
            raise InvalidAnswer("The script is empty.")
        return source

    def describe(self, question: ScriptQuestion, answer: str) -> str:
        """Returns how long the script is."""
        return f"a script of {len(answer.splitlines())} lines"

    def grade(self, question: ScriptQuestion, answer: str) -> Verdict:
        """Raises AssertionError: `grader.exercises` judges scripts."""
        raise AssertionError("a script is judged by its exercise")

    def example(self) -> Example:
        """Returns an exercise about a velocity."""
        return Example(
            {
                "kind": "code",
                "q": "Write <code>speed(height)</code>: how fast is a body after falling <code>height</code> metres?",
                "entry": "speed",
                "starter": "starters/speed.py",
                "explain": "Energy is conserved.",
                "check": {
                    "kind": "values",
                    "program": "programs/speed.py",
                    "functions": [{"results": [{"name": "speed", "unit": "m/s", "rtol": 1e-9}]}],
                    "cases": [
                        {"id": "given", "title": "from 2 m", "arguments": [2]},
                        {"id": "hidden", "hidden": True, "calls": 3, "arguments": [[1, 9]]},
                    ],
                },
            },
            [({"source": SPEED}, Status.CORRECT), ({"source": STARTER}, Status.INCORRECT),
             ({"source": " "}, Status.INVALID_ANSWER)],
            {"programs/speed.py": SPEED, "starters/speed.py": STARTER},
        )  # fmt: skip


SPEED = "def speed(height):\n    return (2 * 9.81 * height) ** 0.5\n"
STARTER = "def speed(height):\n    return 0.0\n"
