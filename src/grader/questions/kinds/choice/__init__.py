"""`mcq` and `debug`: choose one of several options."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

from grader.domain.verdict import Status
from grader.questions.answer_keys import OptionKey
from grader.questions.kind import Example
from grader.questions.kinds.choice.options import OneOption, OptionsQuestion, option_key

HEADINGS = {"mcq": "Choose one", "debug": "Find the fault"}
NOTHING_ASKED = "this debug block has no options to choose from: it stays in the lesson alone"


class ChoiceQuestion(OptionsQuestion):
    """One right option; a `debug` question asks for the fault in a piece of code."""

    kind: Literal["mcq", "debug"]


class Choice(OneOption[ChoiceQuestion]):
    """A choice of one option."""

    question = ChoiceQuestion
    fences = ("debug",)

    def heading(self, question: ChoiceQuestion) -> str:
        """Returns what to do."""
        return HEADINGS[question.kind]

    def import_block(self, raw: Mapping[str, Any]) -> Mapping[str, Any] | str:
        """Returns the question of a `debug` block. A case to read, which asks nothing, is left in the lesson."""
        return {"kind": "debug", **raw} if "options" in raw else NOTHING_ASKED

    def answer_keys(self, question: ChoiceQuestion) -> Sequence[OptionKey]:
        """Returns the index of the right option."""
        return [option_key(question)]

    def example(self) -> Example:
        """Returns a question about stages of a step."""
        return Example(
            {
                "kind": "mcq",
                "q": "Which stage of <code>mj_step</code> computes <code>data.xpos</code>?",
                "options": ["Forward kinematics", "Forward dynamics", "Integration"],
                "answer": 0,
                "whys": ["Positions come first.", "Accelerations come later.", "It reads accelerations."],
                "explain": "<code>mj_kinematics</code> maps joint positions to body poses.",
            },
            [(0, Status.CORRECT), (2, Status.INCORRECT), ("Forward dynamics", Status.INCORRECT),
             (3, Status.INVALID_ANSWER), ([0], Status.INVALID_ANSWER)],
        )  # fmt: skip
