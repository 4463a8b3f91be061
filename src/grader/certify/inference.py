"""Infers how to derive a key that has no `verify`: from a select of the lab, or from numbers in the text."""

import re

from grader.certify.predict_keys import find_matching_select
from grader.certify.stage_keys import find_stage
from grader.domain.lab import LabConfig
from grader.domain.pages.markup import plain_text
from grader.domain.verify import ByOptions, ByStage, ByThreshold, ServoJoint, Verify
from grader.questions import AnswerKey, NumberKey, OptionKey
from grader.questions.kinds.number.units import known_unit

DETECTS = re.compile(
    r"\b(?:which|what) stage of mj_step (?:(?:performs|does|runs) (?:the )?collision detection|"
    r"(?:finds|detects) (?:the )?(?:contacts|collisions)|"
    r"(?:is|are|does) (?:the )?(?:collision detection|contacts|collisions) "
    r"(?:performed|done|run|carried out|found|detected|computed|happen|take place)) ?\?", re.IGNORECASE,
)  # fmt: skip
"""A question for the stage of mj_step that finds the contacts, and for nothing else."""

NUMBER = r"([0-9]+(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?)"
INERTIA = re.compile(rf"inertia (?:of )?{NUMBER} ?kg ?m(?:²|\^?2)")
KV, KP = re.compile(rf"\bkv ?= ?{NUMBER}"), re.compile(rf"\bkp ?= ?{NUMBER}")
DIGIT = re.compile(r"[0-9]")
ASKED = re.compile(r"largest (?:stable )?timestep")
TIMES = frozenset(("seconds", "milliseconds", "microseconds"))
EXPLICIT = re.compile(r"\bexplicit|\bEuler\b")
OTHERS = re.compile(r"\bimplicit|\bRK4\b|\bRunge|\bdiscrete\b")
TWISTED = re.compile(
    r"\b(?:if|how|half|halv\w+|twice|doubl\w+|tripl\w+|quarter|third|fifth|tenth|times|percent|share|part|fraction|ratio|"
    r"factor|margin|instead|chang\w+|increas\w+|reduc\w+|decreas\w+|replac\w+|other|another|second|more|less|longer|"
    r"shorter|higher|lower|without|add\w*|both|gear\w*|armature|gravit\w+|pendulum|spring|stiffness|friction\w*|"
    r"overshoot\w*|oscillat\w+|monoton\w+|accura\w+|error|delay\w*|sampl\w+|Adams|Bashforth|Heun|midpoint|leapfrog|"
    r"Verlet|backward|trapez\w+)\b|%", re.IGNORECASE,
)  # fmt: skip
"""Words by which a question may ask for something else than the limit of the servo that it describes, or describe one
whose limit other numbers change, too."""
STABLE = re.compile(r"(?<!not )(?<!never )(?<!longer )\bstab", re.IGNORECASE)
"""Words of a question that asks what is stable; `unstable` and `instability` do not match."""


def infer_verify(key: AnswerKey) -> Verify | None:
    """Return a `verify` for the key of a question, or None if its text suggests none."""
    match key:
        case OptionKey(lab=LabConfig() as lab):
            return ByOptions(by="options") if find_matching_select(key.options, lab) else None
        case OptionKey():
            return _infer_stage(key)
        case NumberKey():
            return _infer_servo_limit(key)


def _infer_stage(key: OptionKey) -> ByStage | None:
    """For a question such as `In which stage of mj_step is collision detection performed?`, with stages as options."""
    stages = [find_stage(option) for option in key.options]
    if not DETECTS.search(plain_text(key.text)) or None in stages or len(set(stages)) < len(stages):
        return None
    return ByStage(by="stage", fills="contact")


def _infer_servo_limit(key: NumberKey) -> ByThreshold | None:
    """For the largest stable timestep of a servo of given inertia and damping under explicit integration."""
    text = plain_text(key.text)
    inertia, kv, kp = INERTIA.search(text), KV.search(text), KP.search(text)
    unit = known_unit(key.unit or "")
    if inertia is None or kv is None or unit is None or unit.words.split(" ")[0] not in TIMES:
        return None
    if not ASKED.search(text) or not EXPLICIT.search(text) or OTHERS.search(text) or TWISTED.search(text):
        return None
    if DIGIT.search(KP.sub("", KV.sub("", INERTIA.sub("", text)))):  # such as another damping
        return None
    servo = ServoJoint(inertia=float(inertia[1]), kv=float(kv[1]), kp=float(kp[1]) if kp else 0.0)
    return ByThreshold(by="threshold", servo=servo)


def asks_for_stability(key: AnswerKey) -> bool:
    """Whether the text of a question asks which option is stable."""
    return STABLE.search(plain_text(key.text)) is not None
