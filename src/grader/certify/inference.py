"""How a key can be re-derived where its author does not say: from the lab's select, or from the numbers in the text."""

import re

from grader.certify.choices import matching_select, plain
from grader.certify.stages import stage_of
from grader.domain.quiz import ChoiceQuestion, NumericQuestion, PredictQuestion, Question
from grader.domain.verify import ByOptions, ByStage, ByThreshold, Servo, Verify
from grader.grading.units import known_unit

FILLED = {"collision detection": "contact", "contacts are found": "contact"}
"""What a question about mj_step may ask for, and the field that shows it."""

NUMBER = r"([0-9]+(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?)"
INERTIA = re.compile(rf"inertia (?:of )?{NUMBER} ?kg ?m(?:²|\^?2)")
KV, KP = re.compile(rf"\bkv ?= ?{NUMBER}"), re.compile(rf"\bkp ?= ?{NUMBER}")
ASKED = re.compile(r"largest (?:stable )?timestep")
EXPLICIT = re.compile(r"\bexplicit|\bEuler\b")


def infer(question: Question) -> Verify | None:
    """A way to re-derive the key, or None where nothing in the question says one."""
    if isinstance(question, PredictQuestion) and question.sim is not None:
        return ByOptions(by="options") if matching_select(question.options, question.sim) else None
    if isinstance(question, ChoiceQuestion):
        return _stage(question)
    return _servo_limit(question) if isinstance(question, NumericQuestion) else None


def _stage(question: ChoiceQuestion) -> ByStage | None:
    """`In which stage of mj_step is collision detection performed?`, with stages as options."""
    text = plain(question.q)
    filled = next((field for words, field in FILLED.items() if words in text), None)
    stages = [stage_of(option) for option in question.options]
    if filled is None or "stage" not in text or "mj_step" not in text or None in stages:
        return None
    return ByStage(by="stage", fills=filled) if len(set(stages)) == len(stages) else None


def _servo_limit(question: NumericQuestion) -> ByThreshold | None:
    """The largest timestep at which a servo of a given inertia and damping is stable under explicit integration."""
    text = plain(question.q)
    inertia, kv, kp = INERTIA.search(text), KV.search(text), KP.search(text)
    unit = known_unit(question.unit or "")
    if inertia is None or kv is None or unit is None or unit.words.split(" ")[0] not in TIMES:
        return None
    if not ASKED.search(text) or not EXPLICIT.search(text):
        return None
    servo = Servo(inertia=float(inertia[1]), kv=float(kv[1]), kp=float(kp[1]) if kp else 0.0)
    return ByThreshold(by="threshold", servo=servo)


TIMES = frozenset(("seconds", "milliseconds", "microseconds"))
