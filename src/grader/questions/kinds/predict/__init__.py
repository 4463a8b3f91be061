"""`predict`: choose one of several options before a simulation shows which is right."""

from collections.abc import Sequence
from typing import Any, Literal

from grader.domain.lab import LabConfig
from grader.domain.verdict import Status
from grader.questions.answer_keys import OptionKey
from grader.questions.drawing import Drawable
from grader.questions.kind import Example
from grader.questions.kinds.choice.options import OneOption, OptionsQuestion, option_key


class PredictQuestion(Drawable, OptionsQuestion):
    """A choice that the learner makes before running the simulation in `sim`."""

    kind: Literal["predict"]
    sim: LabConfig | None = None


class Predict(OneOption[PredictQuestion]):
    """A prediction of one option, and the lab that opens after it."""

    question = PredictQuestion

    def heading(self, question: PredictQuestion) -> str:
        """Returns what to do."""
        return "Predict, then see"

    def view(self, question: PredictQuestion) -> dict[str, Any]:
        """Returns the options; `has_lab` announces the lab, which is shown after the answer."""
        return {**super().view(question), "has_lab": question.sim is not None}

    def lab(self, question: PredictQuestion) -> LabConfig | None:
        """Returns the simulation."""
        return question.sim

    def answer_keys(self, question: PredictQuestion) -> Sequence[OptionKey]:
        """Returns the index of the right option; nothing derives it where there is neither a lab nor a `verify`."""
        return [option_key(question, question.sim)] if question.sim or question.verify else []

    def example(self) -> Example:
        """Returns a question about two pendulums."""
        return Example(
            {
                "kind": "predict",
                "q": "Two pendulums differ in the mass of the bob alone. Which swings faster?",
                "options": ["The heavy one", "The light one", "Neither"],
                "answer": 2,
                "whys": [
                    "It has more weight, and as much more inertia.",
                    "It has less inertia, and as much less weight.",
                    "Weight and inertia grow alike.",
                ],
                "explain": "The mass cancels in $ml^2\\ddot\\theta = -mgl\\sin\\theta$.",
                "sim": {"title": "Two masses, one period", "model": "bob", "setup": "data.qpos[0] = 0.5"},
            },
            [(2, Status.CORRECT), (0, Status.INCORRECT), ("Both", Status.INVALID_ANSWER)],
            {"models/bob.xml": BOB},
        )


BOB = """<mujoco>
  <worldbody>
    <body pos="0 0 1">
      <joint name="hinge" type="hinge" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 -.5" size=".02"/>
    </body>
  </worldbody>
</mujoco>
"""
