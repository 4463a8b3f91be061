"""`code`: write a script, a model or a file, which `grader.exercises` runs in the jail and judges by simulating."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from grader.domain.plugins import Remark
from grader.domain.rubric import Rubric
from grader.domain.run import Limits
from grader.domain.verdict import Status, Verdict
from grader.questions.forms import ENTRY, FORMS, Form, Takes, describe_file, read_text
from grader.questions.kind import Example, Fields, QuestionKind, typed_in
from grader.questions.kinds.number.units import known_unit, suggest_unit
from grader.questions.question import Question, Reveal

NO_ENTRY = "is required: the name of the function that a script must define"


class CheckSpec(BaseModel):
    """The kind of an exercise, and its parameters, tolerances and cases."""

    model_config = ConfigDict(frozen=True, extra="allow")

    kind: str

    @property
    def parameters(self) -> Mapping[str, Any]:
        """All keys but `kind`; the kind validates them."""
        return self.model_extra or {}


class ScriptQuestion(Question):
    """An exercise: a script whose function `entry` is called in the jail and judged by an independent simulation. Where
    it `takes` MJCF or a file, the grader writes the script: its function returns the text, or the bytes."""

    kind: Literal["code"]
    starter: str | None = None
    takes: Takes = "python"
    entry: str = Field(default=ENTRY, pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")
    check: CheckSpec
    limits: Limits = Limits()
    rubric: Rubric = ()
    reveal: Reveal | None = None

    @property
    def form(self) -> Form:
        """What an answer is called, and the file that holds it."""
        return FORMS[self.takes]


def list_texts(part: Any, name: str, key: str) -> Iterator[tuple[str, str]]:
    """Yields every text of this name in an exercise's parameters, with its key."""
    if isinstance(part, Mapping):
        if isinstance(text := part.get(name), str):
            yield f"{key}.{name}", text
        for inner, value in part.items():
            yield from list_texts(value, name, f"{key}.{inner}")
    elif isinstance(part, Sequence) and not isinstance(part, str):
        for index, value in enumerate(part):
            yield from list_texts(value, name, f"{key}.{index}")


class Script(QuestionKind[ScriptQuestion, str]):
    """A script, a model or a file. Its faults, its trials and its verdict are those of its exercise."""

    question = ScriptQuestion
    is_script = True

    def faults(self, question: ScriptQuestion) -> Iterator[Remark]:
        """Yields that a script has no function to call."""
        if question.takes == "python" and "entry" not in question.model_fields_set:
            yield Remark("entry", NO_ENTRY)

    def warnings(self, question: ScriptQuestion) -> Iterator[Remark]:
        """Yields units of the exercise that are not known, and TeX in the sentences of mistakes: learners would read
        both as they stand."""
        for key, sentence in list_texts(question.check.parameters, "sentence", "check"):
            if "$" in sentence:
                yield Remark(key, "is shown as plain text: write its formulas without $, such as v²/(2μg)")
        for key, unit in list_texts(question.check.parameters, "unit", "check"):
            if unit and known_unit(unit) is None:
                cure = f"correct it{suggest_unit(unit)}, or keep it where it counts things"
                yield Remark(key, f"{unit!r} is not a known unit: {cure}")

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
        """Returns what to hand in, what a script may use, and whether there is a file to begin with."""
        limits = question.limits.model_dump()
        view = {"takes": question.takes, "entry": question.entry}
        return {**view, "limits": limits, "has_starter": question.starter is not None}

    def starter(self, question: ScriptQuestion) -> str | None:
        """Returns that of the question."""
        return question.starter

    def from_form(self, question: ScriptQuestion, fields: Fields) -> dict[str, str]:
        """Returns the text of the editor, or the file. Raises InvalidAnswer where there is none."""
        noun = question.form.noun
        first = f"Choose your {noun} first." if question.form.is_file else f"Load or paste your {noun} first."
        return self.from_text(question, typed_in(fields, first))

    def from_text(self, question: ScriptQuestion, text: str) -> dict[str, str]:
        """Returns the text of a script or a model, or the base64 of a file, as an answer."""
        return {question.form.key: text}

    def show(self, question: ScriptQuestion, answer: Any) -> str:
        """Returns the text of the script or the model, or the size of the file."""
        if not isinstance(answer, dict):
            return super().show(question, answer)
        return describe_file(str(answer["file"])) if "file" in answer else str(answer.get("source", ""))

    def read(self, question: ScriptQuestion, answer: Any) -> str:
        """Returns the text of the script or the model, or the base64 of the file. Also raises TooLarge, and
        Unprocessable for another shape."""
        return read_text(question.form, answer)

    def describe(self, question: ScriptQuestion, answer: str) -> str:
        """Returns how long the script is."""
        form = question.form
        return describe_file(answer) if form.is_file else f"a {form.noun} of {len(answer.splitlines())} lines"

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
