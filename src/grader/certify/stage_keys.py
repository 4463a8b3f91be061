"""Certifies keys of questions about mj_step: calls its stages one by one to find which fills a field of mjData."""

from collections.abc import Sequence

import mujoco

from grader.certify.certificate import Certificate, certify_choice, refuse
from grader.domain.pages.markup import plain_text
from grader.domain.verify import ByStage
from grader.experiments.runs import DATA_FIELDS, VerifyError, read_xml
from grader.questions import ModelXml, OptionKey

CALLS = (
    "mj_checkPos",
    "mj_checkVel",
    "mj_fwdPosition",
    "mj_fwdVelocity",
    "mj_fwdActuation",
    "mj_fwdAcceleration",
    "mj_fwdConstraint",
    "mj_checkAcc",
    "mj_Euler",
)
"""The calls of mj_step in their order, for a model with the Euler integrator. Source: engine_forward.c of 3.14.0."""

WORDS = {
    "position": "mj_fwdPosition",
    "velocity": "mj_fwdVelocity",
    "actuation": "mj_fwdActuation",
    "acceleration": "mj_fwdAcceleration",
    "constraint": "mj_fwdConstraint",
    "integrat": "mj_Euler",
    "euler": "mj_Euler",
}

IN_CONTACT = """
<mujoco><worldbody>
  <geom type="plane" size="1 1 .1"/>
  <body pos="0 0 .09"><freejoint/><geom size=".1"/></body>
</worldbody></mujoco>
"""


def find_stage(option: str) -> str | None:
    """Returns the call that the words of an option name, or None."""
    words = plain_text(option).lower()
    return next((call for word, call in WORDS.items() if word in words), None)


def certify_stage(key: OptionKey, verify: ByStage, model_xml: ModelXml) -> Certificate:
    """Find the option that names the call which first fills the field."""
    stages = verify.stages or tuple(map(find_stage, key.options))
    if len(stages) != len(key.options) or not set(stages) <= {None, *CALLS}:
        return refuse("stage", key.answer, f"verify.stages needs one of {', '.join(CALLS)} for each option")
    words = tuple(map(find_stage, key.options))
    if None not in words and words != stages and len({*words}) == len(words) and {*words} == {*stages}:
        why = f"verify.stages are exchanged: the words of the options name {', '.join(filter(None, words))}"
        return refuse("stage", key.answer, why, key="verify.stages")
    named = verify.model or verify.xml
    xml = read_xml(verify.model, verify.xml, model_xml) if named else IN_CONTACT
    observed = _observe(xml, verify.fills)
    filled = next((call for call, before, after in observed if after != before), None)
    measured = {
        "field": f"data.{verify.fills}",
        "filled by": filled,
        "calls": {call: after if after == before else f"{before}, then {after}" for call, before, after in observed},
    }
    right = [i for i, stage in enumerate(stages) if stage is not None and stage == filled]
    return certify_choice("stage", right, key.answer, key.options, measured)


def _observe(xml: str, field: str) -> Sequence[tuple[str, str, str]]:
    """Summarise the field before and after each call of mj_step. Raises VerifyError for an unknown field."""
    if field != "contact" and field not in DATA_FIELDS:
        raise VerifyError("verify", f"verify.fills must be contact or an array of the data, not {field!r}")
    model = mujoco.MjModel.from_xml_string(xml)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    data = mujoco.MjData(model)
    mujoco.mj_resetData(model, data)
    observed = []
    for name in CALLS:
        before = _shorten(data, field)
        getattr(mujoco, name)(model, data)
        observed.append((name, before, _shorten(data, field)))
    return observed


def _shorten(data: mujoco.MjData, field: str) -> str:
    """Return the number of contacts, or the sum of magnitudes of an array with all digits."""
    if field == "contact":
        return f"{data.ncon} contacts"
    return repr(float(abs(getattr(data, field)).sum()))
