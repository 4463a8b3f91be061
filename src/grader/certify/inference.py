"""Infers how to derive a key that has no `verify`: from a select of the lab, or from numbers in the text."""

import re

from grader.answers import known_unit
from grader.certify.predict_keys import matching_select
from grader.certify.stage_keys import stage_of
from grader.domain.markup import plain_text
from grader.domain.quiz import ChoiceQuestion, NumericQuestion, PredictQuestion, Question
from grader.domain.verify import ByOptions, ByStage, ByThreshold, ServoJoint, Verify

FILLED = {"collision detection": "contact", "contacts are found": "contact"}
"""Words of a question about mj_step, and the field of mjData that the stage fills."""

NUMBER = r"([0-9]+(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?)"
INERTIA = re.compile(rf"inertia (?:of )?{NUMBER} ?kg ?m(?:²|\^?2)")
KV, KP = re.compile(rf"\bkv ?= ?{NUMBER}"), re.compile(rf"\bkp ?= ?{NUMBER}")
ASKED = re.compile(r"largest (?:stable )?timestep")
TIMES = frozenset(("seconds", "milliseconds", "microseconds"))
EXPLICIT = re.compile(r"\bexplicit|\bEuler\b")


def infer(question: Question) -> Verify | None:
    """Return a `verify` for the question, or None if its text suggests none."""
    if isinstance(question, PredictQuestion) and question.sim is not None:
        return ByOptions(by="options") if matching_select(question.options, question.sim) else None
    if isinstance(question, ChoiceQuestion):
        return _stage(question)
    return _servo_limit(question) if isinstance(question, NumericQuestion) else None


def _stage(question: ChoiceQuestion) -> ByStage | None:
    """For a question such as `In which stage of mj_step is collision detection performed?`, with stages as options."""
    text = plain_text(question.q)
    filled = next((field for words, field in FILLED.items() if words in text), None)
    stages = [stage_of(option) for option in question.options]
    if filled is None or "stage" not in text or "mj_step" not in text or None in stages:
        return None
    return ByStage(by="stage", fills=filled) if len(set(stages)) == len(stages) else None


def _servo_limit(question: NumericQuestion) -> ByThreshold | None:
    """For the largest stable timestep of a servo of given inertia and damping under explicit integration."""
    text = plain_text(question.q)
    inertia, kv, kp = INERTIA.search(text), KV.search(text), KP.search(text)
    unit = known_unit(question.unit or "")
    if inertia is None or kv is None or unit is None or unit.words.split(" ")[0] not in TIMES:
        return None
    if not ASKED.search(text) or not EXPLICIT.search(text):
        return None
    servo = ServoJoint(inertia=float(inertia[1]), kv=float(kv[1]), kp=float(kp[1]) if kp else 0.0)
    return ByThreshold(by="threshold", servo=servo)
